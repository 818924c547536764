"""Code of a worker: a process that executes one job after another, with one request and one reply for each.

Jobs can leave objects in the worker's state for later jobs. Any exception in a job becomes its reply; only a signal
ends the worker without a reply.

On Linux, the caller starts a guard process, and the worker is a fork of the guard. The worker, and after its end the
guard, adopts orphaned descendants of the worker, even in other sessions; the guard kills them. The guard ends after its
worker, or with the caller. Daemons of multiprocessing cannot replace this: they must not start processes, and processes
that they start by other means outlive them. A worker without a guard ends itself and its process group with the caller.
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
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from multiprocessing import parent_process
from typing import TYPE_CHECKING, Any, NoReturn

from henon_ref.errors import ContractError, DeadlineError, UnavailableError, UnsupportedError
from henon_ref.jit.processor_time import compile_listener
from henon_ref.text import short_line
from henon_ref.workers.channel import NO_TOKEN, framed, read_message
from henon_ref.workers.machine import adopt_orphans, children, data_bytes, kill_family, signal_with_parent

if TYPE_CHECKING:
    from henon_ref.trajectory import Status

REPLY, COMPILING = "reply", "compiling"
"""Kinds of messages: result of a job; the job's clock stops (None) or continues (seconds of the interruption)."""
LAST_SECONDS = 5.0
"""Time to wait for killed processes to disappear [s]."""


@dataclass
class WorkerState:
    """State that a worker keeps between jobs."""

    tell: Callable[[str, Any], None]
    """Sends a message about the current job to the caller."""
    kept: dict[str, Any] = field(default_factory=dict)
    """Objects that jobs leave for later jobs, by name."""

    def off_the_clock(self) -> AbstractContextManager[None]:
        """Return a context in which compiling does not count for the job's deadline."""
        return compile_listener(lambda seconds: self.tell(COMPILING, seconds))


@dataclass(frozen=True)
class Job:
    """Job of a worker: a call of a function, which is pickled with its arguments."""

    function: Callable[..., Any]
    """Receives the :class:`WorkerState` and the arguments; its value is the result of the job."""
    arguments: tuple[Any, ...]
    seconds: float
    """Deadline: processor time of the worker and its descendants for this job [s]."""
    rests: bool = False
    """Whether the job depends on objects that previous jobs have left in the worker."""


@dataclass(frozen=True)
class Failure:
    """Result of a job that failed."""

    status: Status
    reason: str
    ignored: bool = False
    """Whether the job ignored its deadline and was stopped from outside."""


def work(
    theirs: socket.socket,
    log: socket.socket | None,
    memory: int | None,
    guarded: bool,
    environment: Mapping[str, str] | None,
) -> NoReturn:
    """Run as the process started by a caller: serve jobs, or, with ``guarded``, guard a fork that does.

    ``theirs`` is the worker's end of the channel; ``log`` replaces standard output and standard error; ``memory`` is a
    limit on the data of the worker [bytes]; ``environment`` is that of the caller, if this process is a fork of a
    server that was started earlier.
    """
    if environment is not None:
        os.environ.clear()
        os.environ.update(environment)
    faulthandler.disable()  # a crash is reported by its signal; the parent's handler would write to its terminal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if os.name == "posix":
        import resource

        os.setsid()  # interrupts and stops from the terminal go to the caller only
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
        if os.getppid() != guard:  # the guard ended before the request took effect
            os._exit(1)
    else:
        threading.Thread(target=_end_with_caller, daemon=True).start()
    try:
        _bound(log, memory)
        with suppress(BrokenPipeError, ConnectionResetError):  # the caller has closed the channel
            _serve(theirs)
        os._exit(0)  # skip exit handlers of libraries, which may hang
    except BaseException:  # noqa: BLE001 - never return into the copy of the caller's code
        traceback.print_exc()
    finally:
        os._exit(1)


def _end_with_caller() -> None:
    """Wait for the end of the caller, and end this process and its process group."""
    caller = parent_process()
    assert caller is not None
    caller.join()
    if os.name == "posix":
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def _guard(worker: int, theirs: socket.socket, log: socket.socket | None) -> NoReturn:
    """Wait for the end of the worker or the caller, and kill every descendant that is left."""
    if log is not None:
        log.close()
    signal_with_parent(signal.SIGCONT)  # wakes a stopped guard, which then finds the caller gone

    def end_with_channel() -> None:
        channel = select.poll()
        channel.register(theirs, 0)  # reports only that the caller's end is closed
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
    """Redirect the output to ``log`` and limit the memory (on POSIX only)."""
    if log is not None:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:  # None if the shell has closed it
                stream.flush()
        nothing = os.open(os.devnull, os.O_RDWR)
        output = log.fileno() if os.name == "posix" else nothing
        for descriptor, target in ((nothing, 0), (output, 1), (output, 2)):
            os.dup2(descriptor, target)
        os.close(nothing)
        log.close()
    if memory is None or os.name != "posix":
        return
    import resource

    # Not RLIMIT_AS: LLVM and thread stacks reserve far more address space than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory + data_bytes()  # memory inherited by the fork does not count
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _serve(theirs: socket.socket) -> None:
    """Execute jobs until the caller closes the channel."""
    collect_seldom()
    gc.freeze()  # objects inherited by the fork need no further collections
    me, state = os.getpid(), WorkerState(lambda kind, value: None)
    theirs.sendall(framed(NO_TOKEN, b""))
    requests = theirs.makefile("rb")
    while (request := read_message(requests)) is not None:
        token, pickled = request

        def tell(kind: str, value: Any, token: bytes = token, me: int = me) -> None:
            if os.getpid() == me:  # a fork of the worker must not reply
                theirs.sendall(framed(token, pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL)))

        state.tell = tell
        try:
            job: Job = pickle.loads(pickled)
            result = job.function(state, *job.arguments)
        except BaseException as error:  # noqa: BLE001 - a failure of a library must not end the other jobs
            result = failure_of(error)
        if os.getpid() != me:  # a fork made by the solver has returned from it
            os._exit(1)
        try:
            tell(REPLY, result)
        except ConnectionError:
            raise
        except Exception as error:  # noqa: BLE001 - pickling of the solver's classes may raise anything
            tell(REPLY, failure_of(error))


def collect_seldom() -> None:
    """Make garbage collections rare: imported and compiled objects stay, and scanning them costs time."""
    gc.set_threshold(200_000)


def failure_of(error: BaseException) -> Failure:
    """Return the status and the reason of an exception that a job raised."""
    try:
        text = short_line(str(error))
    except Exception:  # noqa: BLE001 - its own __str__ fails
        text = ""
    if isinstance(error, UnsupportedError):
        return Failure("unsupported", text)
    if isinstance(error, UnavailableError):
        return Failure("unavailable", text)
    if isinstance(error, MemoryError):
        return Failure("failed", "memory: the run needs more than the limit")
    if isinstance(error, DeadlineError):
        return Failure("timeout", text, ignored=True)
    if isinstance(error, ContractError):
        return Failure("failed", text)
    return Failure("failed", short_line(f"{type(error).__name__}: {text}" if text else type(error).__name__))
