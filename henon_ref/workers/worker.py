"""The inside of a worker: a process of its own that does one job after another, a request and a reply each.

What a job leaves in the worker's state the next one finds there. Whatever goes wrong in a job, a library's own
exceptions included, becomes its reply; only a signal ends the worker without one.

On Linux the process that the caller begins is a guard, and the worker a fork of it: whatever the worker has started, in
sessions of its own, too, loses its parent to the worker, and when that ends, to the guard, which kills it. The guard
ends as its worker has ended, or when the caller does. Daemons of multiprocessing give nothing of this: a daemon must
not start processes, and what it starts by other means outlives it.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import pickle
import select
import signal
import socket
import sys
import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn

from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.jit.processor_time import compile_listener
from henon_ref.text import short_line
from henon_ref.workers.channel import NO_TOKEN, framed, read_message
from henon_ref.workers.procfs import adopt_orphans, children, data_bytes, kill_family, signal_with_parent

if TYPE_CHECKING:
    from henon_ref.trajectory import Status

REPLY, COMPILING = "reply", "compiling"
"""Kinds of messages: a job's result; and that its run's clock stands still (None) or goes on (seconds it stood)."""
SELDOM = 200_000
"""Objects made between two looks for garbage."""
LAST_SECONDS = 5.0
"""Time for what has been killed to be gone [s]."""


@dataclass
class WorkerState:
    """What a worker keeps from job to job."""

    tell: Callable[[str, Any], None]
    """Sends a message on the present job to the caller."""
    kept: dict[str, Any] = field(default_factory=dict)
    """What jobs leave for those that follow, by name."""

    def off_the_clock(self) -> AbstractContextManager[None]:
        """Where what is compiled does not count for the deadline of the job."""
        return compile_listener(lambda seconds: self.tell(COMPILING, seconds))


class Job(ABC):
    """A piece of work for a worker; goes into a pickle."""

    rests: ClassVar[bool] = False
    """Whether it rests on what jobs before it have left in the worker."""

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


def work(
    theirs: socket.socket,
    log: socket.socket | None,
    memory: int | None,
    guarded: bool,
    environment: Mapping[str, str] | None,
) -> NoReturn:
    """What the process does that a caller begins.

    Parameters
    ----------
    theirs : socket
        The worker's end of a :class:`~henon_ref.workers.channel.Channel`.
    log : socket, optional
        Takes the place of standard output and standard error.
    memory : int, optional
        Bytes of data that the worker may allocate.
    guarded : bool
        Whether the worker is a fork of this process.
    environment : mapping, optional
        The caller's, where this process has not got it: it is a fork of one that was begun earlier.
    """
    if environment is not None:
        os.environ.clear()
        os.environ.update(environment)
    faulthandler.disable()  # a crash is told by its signal; the parent's handler would write to its terminal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if os.name == "posix":
        import resource

        os.setsid()  # a terminal's interrupts and stops are the caller's own
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if guarded:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        adopt_orphans()
        guard = os.getpid()
        worker = os.fork()
        if worker:
            _guard(worker, theirs, log)
        adopt_orphans()
        os.setsid()
        signal_with_parent(signal.SIGKILL)
        if os.getppid() != guard:  # it ended before the request was in force
            os._exit(1)
    try:
        _bound(log, memory)
        with suppress(BrokenPipeError, ConnectionResetError):  # the caller wants no more of it
            _serve(theirs)
        os._exit(0)  # what a library leaves to be done at the end of a process must not hang
    except BaseException:  # noqa: BLE001 - nothing comes back from here into a copy of the caller
        traceback.print_exc()
    finally:
        os._exit(1)


def _guard(worker: int, theirs: socket.socket, log: socket.socket | None) -> NoReturn:
    """Wait for the worker's end, or the caller's, and let nothing of what has been started outlive it."""
    if log is not None:
        log.close()
    signal_with_parent(signal.SIGCONT)  # a guard that has been stopped wakes up to see that the caller is gone

    def end_with_channel() -> None:
        channel = select.poll()
        channel.register(theirs, 0)  # nothing but that the caller's end is closed
        channel.poll()
        kill_family(worker)

    threading.Thread(target=end_with_channel, daemon=True).start()
    _, status = os.waitpid(worker, 0)
    ends = time.monotonic() + LAST_SECONDS
    with suppress(ChildProcessError):
        while time.monotonic() < ends:
            for pid in children(os.getpid()):
                kill_family(pid)
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
            time.sleep(0.001)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        with suppress(OSError, ValueError):  # SIGKILL has no handler to reset
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)


def _bound(log: socket.socket | None, memory: int | None) -> None:
    """Quiet, and within its memory; elsewhere than on POSIX quiet alone."""
    if log is not None:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:  # as where the shell has closed it
                stream.flush()
        nothing = os.open(os.devnull, os.O_RDWR)
        said = log.fileno() if os.name == "posix" else nothing
        for descriptor, target in ((nothing, 0), (said, 1), (said, 2)):
            os.dup2(descriptor, target)
        os.close(nothing)
        log.close()
    if memory is None or os.name != "posix":
        return
    import resource

    # Not RLIMIT_AS: LLVM and thread stacks reserve far more address space than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory + data_bytes()  # what a fork has brought along is not its own
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _serve(theirs: socket.socket) -> None:
    """Do jobs until the caller closes the channel."""
    collect_seldom()
    gc.freeze()  # nor need what a fork has brought along be looked through again and again
    me, state = os.getpid(), WorkerState(lambda kind, value: None)
    theirs.sendall(framed(NO_TOKEN, b""))
    while (request := read_message(theirs)) is not None:
        token, pickled = request

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
        except ConnectionError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever the solver's own classes do on the way into a pickle
            tell(REPLY, failure_of(error))


def collect_seldom() -> None:
    """What is imported and compiled stays: looking through it again and again would be for nothing."""
    gc.set_threshold(SELDOM)


def failure_of(error: BaseException) -> Failure:
    """Status and reason of an exception that a job raised."""
    try:
        text = short_line(str(error))
    except Exception:  # noqa: BLE001 - it cannot even say its own words
        text = ""
    if isinstance(error, UnsupportedError):
        return Failure("unsupported", text)
    if isinstance(error, UnavailableError):
        return Failure("unavailable", text)
    if isinstance(error, MemoryError):
        return Failure("failed", "memory: the run needs more than the limit")
    if isinstance(error, ContractError):
        return Failure("failed", text)
    return Failure("failed", short_line(f"{type(error).__name__}: {text}" if text else type(error).__name__))
