"""The inside of a fence: a process of its own that does one job after another and reports each stage.

A job is a generator: what it yields goes to the parent as a message, and the parent's answer comes back as the
value of the ``yield``. Whatever goes wrong in a job, a library's own exceptions included, becomes one last
message; only a signal ends the worker without one.
"""

from __future__ import annotations

import faulthandler
import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Generator
from dataclasses import dataclass
from multiprocessing import reduction
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Protocol

from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.score.plaintext import plain_text
from henon_ref.score.upkeep import die_with_parent
from henon_ref.trajectory import Status

Message = tuple[str, Any]
"""Stage and payload."""
Stages = Generator[Message, Any, None]

FAILURE = "failure"
"""Stage of the message that reports a failure; its payload is a :class:`Failure`."""
DONE = "done"
"""Stage of the message that says that the job is done."""


class Job(Protocol):
    """A piece of work for a worker."""

    @property
    def seconds(self) -> float:
        """Time until its first message [s]."""
        ...

    def stages(self) -> Stages:
        """The work itself, done in the worker."""
        ...


@dataclass(frozen=True)
class Failure:
    """Why a job did not come to its end."""

    status: Status
    reason: str


class Descriptor:
    """A file descriptor on its way to another process, however that is begun."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __reduce__(self) -> tuple[Any, ...]:
        return _arrived, (reduction.DupFd(self.number),)


def _arrived(descriptor: Any) -> Descriptor:
    return Descriptor(descriptor.detach())


def serve(connection: Connection, memory: int, log: Descriptor | None) -> None:
    """Do jobs until the parent closes the connection.

    Parameters
    ----------
    connection : Connection
        Brings jobs and answers, takes messages.
    memory : int
        Bytes of data that the worker may allocate.
    log : Descriptor, optional
        What takes the place of standard output and standard error; None: they are thrown away.
    """
    _isolate(memory, log)
    gc.freeze()  # what a fork has brought along stays: it need not be looked through again and again
    while True:
        try:
            job: Job = connection.recv()
        except EOFError:
            return
        with _Reported(connection):
            _work(job, connection)


def _work(job: Job, connection: Connection) -> None:
    stages = job.stages()
    answer: Any = None
    while True:
        try:
            message = stages.send(answer)
        except StopIteration:
            connection.send((DONE, None))
            return
        connection.send(message)
        answer = connection.recv()


class _Reported:
    """Turns any exception of a job into a message: a library's failure is a row, not the end of the others."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool:
        if error is None or isinstance(error, EOFError | BrokenPipeError):
            return False
        self.connection.send((FAILURE, failure_of(error)))
        return True


def failure_of(error: BaseException) -> Failure:
    """Status and reason of an exception that a job raised."""
    text = plain_text(_said(error))
    if isinstance(error, UnsupportedError):
        return Failure("unsupported", text)
    if isinstance(error, UnavailableError):
        return Failure("unavailable", text)
    if isinstance(error, MemoryError):
        return Failure("failed", "memory: the run needs more than the limit")
    if isinstance(error, ContractError):
        return Failure("failed", text)
    return Failure("failed", plain_text(f"{type(error).__name__}: {text}" if text else type(error).__name__))


def _said(error: BaseException) -> str:
    """The words of an exception; none where it cannot even say them."""
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - a library's own
        return ""


def _isolate(memory: int, log: Descriptor | None) -> None:
    """A session and a process group of its own, quiet, bounded, and never outliving the parent."""
    faulthandler.disable()  # a crash is told by its signal; the parent's handler would write to its terminal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(os, "setsid"):
        os.setsid()
    if sys.platform == "linux":
        _die_with_parent()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # as where the shell has closed it
            stream.flush()
    target = os.open(os.devnull, os.O_WRONLY) if log is None else log.number
    os.dup2(target, 1)
    os.dup2(target, 2)
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # Not RLIMIT_AS: LLVM and thread stacks reserve far more address space than they use.
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        limit = memory if hard == resource.RLIM_INFINITY else min(memory, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _die_with_parent() -> None:
    """Make sure that this process ends when the one that wants its work does, however that ends."""
    die_with_parent()
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():  # it ended before the request was in force
        os._exit(1)
