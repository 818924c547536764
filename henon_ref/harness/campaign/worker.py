"""The inside of a worker: a process of its own that does one job after another, a request and a reply each.

What a job leaves in the worker's state the next one finds there. Whatever goes wrong in a job, a library's own
exceptions included, becomes its reply; only a signal ends the worker without one.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import pickle
import signal
import socket
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, ClassVar

from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.harness.campaign.channel import framed, read_message
from henon_ref.jit.processor_time import compile_listener
from henon_ref.text import short_line
from henon_ref.trajectory import Status
from henon_ref.workers.procfs import KNOWN, adopt_orphans, data_bytes, signal_with_parent

REPLY, COMPILING = "reply", "compiling"
"""Kinds of messages: a job's result; and that its run's clock stands still (None) or goes on (seconds it stood)."""


@dataclass
class WorkerState:
    """What a worker keeps from job to job."""

    tell: Callable[[str, Any], None]
    """Sends a message on the present job to the pool."""
    kept: dict[str, Any] = field(default_factory=dict)
    """What jobs leave for those that follow, by name."""

    def off_the_clock(self) -> AbstractContextManager[None]:
        """Where what is compiled does not count for the deadline of the job."""
        return compile_listener(lambda seconds: self.tell(COMPILING, seconds))


class Job(ABC):
    """A piece of work for a worker; goes into a pickle."""

    prepares: ClassVar[bool] = False
    """Whether it leaves something in the worker that later jobs rest on."""
    rests: ClassVar[bool] = False
    """Whether it rests on what the last job that prepares has left."""

    @property
    @abstractmethod
    def seconds(self) -> float:
        """Its deadline: processor time that the worker, and all that it starts, may use for it [s]."""

    @abstractmethod
    def run(self, state: WorkerState) -> Any:
        """Do the work, in the worker; what it returns is the job's result."""


@dataclass(frozen=True)
class Failure:
    """The result of a job that did not come to its end."""

    status: Status
    reason: str
    ignored: bool = False
    """The deadline was ignored: the job was stopped from outside."""


def serve(theirs: socket.socket, log: int, memory: int, server: int) -> None:
    """Do jobs until the pool closes the channel.

    Parameters
    ----------
    theirs : socket
        The worker's end of a :class:`~henon_ref.harness.campaign.channel.Channel`.
    log : int
        File descriptor that takes the place of standard output and standard error.
    memory : int
        Bytes of data that the worker may allocate.
    server : int
        The process that it was forked from.
    """
    _isolate(memory, log, server)
    gc.freeze()  # what a fork has brought along stays: it need not be looked through again and again
    state = WorkerState(lambda kind, value: None)
    while (request := read_message(theirs)) is not None:
        token, pickled = request
        me = os.getpid()

        def tell(kind: str, value: Any, token: bytes = token, me: int = me) -> None:
            if os.getpid() == me:  # a fork of the worker has nothing to say
                theirs.sendall(framed(token, pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL)))

        state.tell = tell
        try:
            result = pickle.loads(pickled).run(state)
        except BaseException as error:  # noqa: BLE001 - a library's failure is a row, not the end of the others
            result = failure_of(error)
        if os.getpid() != me:  # a fork that came back out of the solver: it is none
            os._exit(1)
        try:
            tell(REPLY, result)
        except (BrokenPipeError, ConnectionResetError):
            return
        except Exception as error:  # noqa: BLE001 - whatever the solver's own classes do on the way into a pickle
            tell(REPLY, failure_of(error))


def failure_of(error: BaseException) -> Failure:
    """Status and reason of an exception that a job raised."""
    text = short_line(_said(error))
    if isinstance(error, UnsupportedError):
        return Failure("unsupported", text)
    if isinstance(error, UnavailableError):
        return Failure("unavailable", text)
    if isinstance(error, MemoryError):
        return Failure("failed", "memory: the run needs more than the limit")
    if isinstance(error, ContractError):
        return Failure("failed", text)
    return Failure("failed", short_line(f"{type(error).__name__}: {text}" if text else type(error).__name__))


def _said(error: BaseException) -> str:
    """The words of an exception; none where it cannot even say them."""
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - a library's own
        return ""


def _isolate(memory: int, log: int, server: int) -> None:
    """A session of its own, quiet, bounded, and never outliving the process that it was forked from."""
    faulthandler.disable()  # a crash is told by its signal; the parent's handler would write to its terminal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    adopt_orphans()
    signal_with_parent(signal.SIGKILL)
    if KNOWN and os.getppid() != server:  # it ended before the request was in force
        os._exit(1)
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # as where the shell has closed it
            stream.flush()
    nothing = os.open(os.devnull, os.O_RDONLY)
    for descriptor, target in ((nothing, 0), (log, 1), (log, 2)):
        os.dup2(descriptor, target)
    os.close(nothing)
    os.close(log)
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Not RLIMIT_AS: LLVM and thread stacks reserve far more address space than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory + data_bytes()  # what a fork has brought along is not its own
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
