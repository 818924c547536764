"""A worker's process as seen by its caller: start, communication, memory and processor time, end.

It is started by :mod:`multiprocessing`: on Linux as a fork of the caller if the caller has a single thread, else as a
fork of the standard library's fork server, which has imported what workers need. On other systems, and with
``HENON_REF_START=spawn``, it is a new process. In addition to the standard library there are deadlines in processor
time, a memory limit for the worker and its descendants together, their common end (:mod:`henon_ref.workers.worker`),
and a caller that never waits for half a message (:mod:`henon_ref.workers.channel`). Without ``/proc``, processor time
and memory are unknown. Without a guard, descendants end with the worker only if they are in its process group, and on
Windows not at all.
"""

from __future__ import annotations

import os
import selectors
import signal
import socket
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from multiprocessing import current_process, get_context, resource_tracker
from multiprocessing import forkserver as server
from multiprocessing.spawn import get_preparation_data
from types import ModuleType
from typing import Any, Literal

from henon_ref.errors import CaseError, HenonRefError
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.text import short_line
from henon_ref.workers import ONE_THREAD
from henon_ref.workers.channel import MAX_MESSAGE, Channel
from henon_ref.workers.machine import KNOWN, family, kill_family, own_bytes, processor_seconds, resident_bytes
from henon_ref.workers.worker import LAST_SECONDS, Failure, work

SERVER_START = "henon_ref.workers.server_start"
"""First module that a fork server imports."""
_served = False
"""Whether this process has started a fork server."""
_own_ends: set[socket.socket] = set()
"""Caller's ends of all channels, which a forked worker closes."""


def start_method() -> Literal["fork", "forkserver", "spawn"]:
    """Return how workers start; a process is forked only if no other thread can hold a lock."""
    if sys.platform != "linux" or os.environ.get("HENON_REF_START") == "spawn":
        return "spawn"
    return "fork" if threading.active_count() == 1 and not _served else "forkserver"


def begin_server(*modules: str) -> None:
    """Start a fork server that imports some modules in the background, and fork later workers from it.

    Only if a second core is available. It is the server of the standard library, and ends with this process.
    """
    global _served
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2 or start_method() == "spawn":
        return
    server.set_forkserver_preload([SERVER_START, *modules])
    with suppress(OSError), _fresh(main=False):  # for example, no socket can be created
        server.ensure_running()
        _served = True


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Delay interrupts of the caller; a process started meanwhile never gets one, not even during its imports."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # its start unblocks SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _fresh(*, main: bool) -> Iterator[None]:
    """Prepare the start of a new process: a single thread, and no import of the caller's main module.

    Scripts and notebooks then need no guard. If jobs contain objects of the main module (``main``), it is imported.
    """
    if main and not {"init_main_from_name", "init_main_from_path"} & set(get_preparation_data("worker")):
        raise CaseError(
            "a solver is defined in a notebook or at a prompt, where no other process finds it: "
            "write it into a module and import it from there"
        )
    module, given = sys.modules["__main__"], {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    if not main:
        sys.modules["__main__"] = ModuleType("__main__")
    try:
        with _no_interrupt():
            yield
    finally:
        sys.modules["__main__"] = module
        for name, value in given.items():
            del os.environ[name]
            if value is not None:
                os.environ[name] = value


def _work(*arguments: Any) -> None:
    for end in _own_ends:
        end.close()
    work(*arguments)


class WorkerProcess:
    """A worker as seen by its caller; ``main`` and ``modules`` as in :class:`~henon_ref.workers.pool.WorkerPool`.

    ``memory`` is a limit on its data [bytes], and the end of its output is then kept. None: no limit, and its output is
    not captured.
    """

    def __init__(self, memory: int | None = None, *, main: bool = False, modules: Sequence[str] = ()) -> None:
        if getattr(current_process(), "_inheriting", False):  # a worker is importing the main module
            raise HenonRefError(
                'the script starts workers when it is imported: put the call under if __name__ == "__main__"'
            )
        method = start_method()
        ours, theirs = socket.socketpair()
        self.channel = Channel(ours, MAX_MESSAGE if memory is not None else None)
        self._log: socket.socket | None = None
        log = None
        if memory is not None:
            self._log, log = socket.socketpair()
            self._log.setblocking(False)
        self._listened = [end for end in (ours, self._log) if end is not None]
        _own_ends.update(self._listened)
        self.ended: int | None = None
        """Exit status, set when the worker has ended; all data that it has sent can then be read."""
        self.asked = time.monotonic()
        self.began_with: int | None = None
        """Memory of the worker at its start [bytes]; None until it has started."""
        self._waited: dict[int, float] = {}
        self._tail = b""
        self._guarded = method != "spawn"
        with warnings.catch_warnings():
            # Threads of linear algebra libraries survive a fork, by handlers of these libraries.
            warnings.simplefilter("ignore", DeprecationWarning)
            given = theirs, log, memory, self._guarded, dict(os.environ) if method == "forkserver" else None
            context: Any = get_context(method)
            self._process = context.Process(target=_work, args=given)
            if method == "forkserver" and not _served:
                server.set_forkserver_preload([SERVER_START, *modules])
            with nullcontext() if method == "fork" else _fresh(main=main):
                self._process.start()
        theirs.close()
        if log is not None:
            log.close()

    @property
    def family(self) -> list[int]:
        """The worker and its descendants, as far as known."""
        return family(self.channel.sender) if KNOWN and self.channel.sender else []

    @property
    def resident(self) -> int:
        """Resident memory of the worker and its descendants [bytes]."""
        return resident_bytes(self.family)

    @property
    def own(self) -> int:
        """Memory of the worker and its descendants, shared memory counted once (slower) [bytes]."""
        return own_bytes(self.family)

    @property
    def used(self) -> float:
        """Processor time of the worker and its descendants [s]."""
        return processor_seconds(self.family)

    @property
    def clock(self) -> float:
        """Wall time, minus the time that the worker, its descendants and this process waited for a processor [s]."""
        for pid in (os.getpid(), *self.family):  # ended processes keep their last value
            self._waited[pid] = max(self._waited.get(pid, 0.0), waited_seconds(pid))
        return time.monotonic() - sum(self._waited.values())

    def look(self) -> None:
        """Update the exit status, read the worker's output, and send remaining data."""
        self.ended = self._process.exitcode  # must come first: all data sent before the end can then be read
        self.channel.go_on()
        if self._log is None:
            return
        with suppress(BlockingIOError, ConnectionResetError):
            printed = self._log.recv(1 << 16)
            self._tail = (self._tail + printed)[-4000:]
            if not printed and self._log in self._listened:
                self._listened.remove(self._log)

    def crash(self) -> Failure:
        """Return the failure for a worker that died: exit code or signal, and its last line of output."""
        how = f"the worker ended with code {self.ended}"
        if self.ended is not None and self.ended < 0:
            how = f"the library was ended by signal {signal.Signals(-self.ended).name}"
        lines = map(short_line, self._tail.decode(errors="replace").split("\n"))
        words = next((line for line in reversed([*lines]) if line), "")
        return Failure("failed", f"{how}: {words}" if words else how)

    def stop(self) -> None:
        """Kill the worker and its descendants; :meth:`join` waits for their end."""
        for end in (self.channel.socket, self._log):  # the guard, once awake, notices the closed channel
            if end is not None:
                _own_ends.discard(end)
                end.close()
        if self._process.exitcode is not None:
            return
        if self._guarded:
            with suppress(ProcessLookupError):  # the guard has already ended
                os.kill(self._process.pid, signal.SIGCONT)
        else:
            self._kill()

    def join(self) -> None:
        """Wait until the worker and its descendants have ended."""
        self._process.join(LAST_SECONDS + 1.0)
        if self._process.exitcode is None:
            self._kill()
            self._process.join(LAST_SECONDS)

    def _kill(self) -> None:
        if os.name == "posix":
            kill_family(self._process.pid)
        else:
            self._process.kill()


def exchange(workers: Sequence[WorkerProcess], seconds: float) -> None:
    """Exchange data with workers, waiting at most ``seconds`` for new data."""
    with selectors.DefaultSelector() as selector:
        for worker in workers:
            waiting = selectors.EVENT_WRITE if worker.channel.waiting else 0
            for end in worker._listened:
                if end is not worker.channel.socket:
                    selector.register(end, selectors.EVENT_READ)
                elif not worker.channel.closed:
                    selector.register(end, selectors.EVENT_READ | waiting)
        selector.select(seconds)
    for worker in workers:
        worker.look()
