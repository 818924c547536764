"""A worker's process, from its caller: how it begins, what it is sent and sends, what it holds and uses, how it ends.

It begins by :mod:`multiprocessing`: on Linux as a copy of the caller where that has a single thread, else as a copy of
the standard library's fork server, which has imported what workers need; elsewhere, and with ``HENON_REF_START=spawn``,
afresh. What the standard library does not give is added here: deadlines in processor time, a limit on what a worker and
all that it has started hold together, their common end (:mod:`henon_ref.workers.worker`), and a caller that never waits
for half a message (:mod:`henon_ref.workers.channel`). Where there is no ``/proc``, neither processor time nor memory is
known; without a guard what a worker has started ends with it only by its process group, and on Windows not at all.
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
from multiprocessing import current_process, get_context
from multiprocessing import forkserver as server
from multiprocessing.spawn import get_preparation_data
from types import ModuleType
from typing import Any

from henon_ref.errors import CaseError, HenonRefError
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.text import short_line
from henon_ref.workers.channel import LARGEST, Channel
from henon_ref.workers.procfs import KNOWN, family, kill_family, own_bytes, processor_seconds, resident_bytes
from henon_ref.workers.worker import LAST_SECONDS, Failure, work

START_VARIABLE = "HENON_REF_START"
"""Environment variable: with ``spawn`` every process begins afresh, as where there is no fork."""
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""A worker is one thread: those of linear algebra would only get in the way of the others."""
FORK, SERVER, SPAWN = "fork", "forkserver", "spawn"
SERVER_START = "henon_ref.workers.server_start"
"""The module that a fork server imports first."""
LOG_TAIL = 4000
"""Bytes of a worker's output that are kept, for its last words."""
_AT_ONCE = 1 << 16
_served = False
"""Whether a fork server has been begun for this process's workers."""
_own_ends: set[socket.socket] = set()
"""The caller's ends of all ways to workers: none of them is a later worker's."""


def start_method() -> str:
    """How processes begin: a copy is made of a process that holds no lock of a thread which the copy does not have."""
    if sys.platform != "linux" or os.environ.get(START_VARIABLE) == SPAWN:
        return SPAWN
    return FORK if threading.active_count() == 1 and not _served else SERVER


def begin_server(*modules: str) -> None:
    """Have workers begin, from here on, as copies of a process that imports some modules while this one goes on.

    Only where there is a second core for it. It is the standard library's, and ends with this process.
    """
    global _served
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2 or start_method() == SPAWN:
        return
    server.set_forkserver_preload([SERVER_START, *modules])
    with suppress(OSError), _fresh(main=False):  # such as where no socket can be made
        server.ensure_running()
        _served = True


@contextmanager
def _fresh(*, main: bool) -> Iterator[None]:
    """What a process that begins afresh is told: to have one thread, and to leave the caller's main module alone.

    So that neither script nor notebook needs a guard, but where jobs hold objects of that module (``main``).
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
    """A worker, from its caller's side.

    Parameters
    ----------
    memory : int, optional
        Bytes that it may allocate; what it prints is kept then. None: it is neither bounded nor quiet.
    main : bool
        Whether jobs hold objects of the caller's main module.
    modules : sequence of str
        What it needs to have imported.

    Attributes
    ----------
    ended : int or None
        Exit status, once it has ended and all that it has sent is here.
    began_with : int or None
        Bytes that it held as it began; None until it has.
    """

    def __init__(self, memory: int | None = None, *, main: bool = False, modules: Sequence[str] = ()) -> None:
        if getattr(current_process(), "_inheriting", False):  # of a worker that imports the main module
            raise HenonRefError('the script compares where it is imported: put that under if __name__ == "__main__"')
        method = start_method()
        ours, theirs = socket.socketpair()
        self.channel = Channel(ours, LARGEST if memory is not None else None)
        self._log: socket.socket | None = None
        log = None
        if memory is not None:
            self._log, log = socket.socketpair()
            self._log.setblocking(False)
        self._listened = [end for end in (ours, self._log) if end is not None]
        _own_ends.update(self._listened)
        self.ended: int | None = None
        self.asked = time.monotonic()
        self.began_with: int | None = None
        self._waited: dict[int, float] = {}
        self._tail = b""
        self._guarded = method != SPAWN
        with warnings.catch_warnings():
            # The threads that linear algebra has of its own survive a fork by handlers of theirs.
            warnings.simplefilter("ignore", DeprecationWarning)
            given = theirs, log, memory, self._guarded, dict(os.environ) if method == SERVER else None
            context: Any = get_context(method)
            self._process = context.Process(target=_work, args=given)
            if method == SERVER and not _served:
                server.set_forkserver_preload([SERVER_START, *modules])
            with nullcontext() if method == FORK else _fresh(main=main):
                self._process.start()
        theirs.close()
        if log is not None:
            log.close()

    @property
    def family(self) -> list[int]:
        """It and all that it has started, as far as that is known."""
        return family(self.channel.sender) if KNOWN and self.channel.sender else []

    @property
    def resident(self) -> int:
        """Bytes that it holds, with all that it has started."""
        return resident_bytes(self.family)

    @property
    def own(self) -> int:
        """The same, what they share counted once (slower to tell)."""
        return own_bytes(self.family)

    @property
    def used(self) -> float:
        """Processor time that it has used, with all that it has started [s]."""
        return processor_seconds(self.family)

    @property
    def clock(self) -> float:
        """Wall time, less what it, all that it has started, and this process have waited for a processor [s]."""
        for pid in (os.getpid(), *self.family):  # one that has ended since, of which nothing is told, has, too
            self._waited[pid] = max(self._waited.get(pid, 0.0), waited_seconds(pid))
        return time.monotonic() - sum(self._waited.values())

    def look(self) -> None:
        """Take note of its end, then take what it has printed, and send what there is room for."""
        self.ended = self._process.exitcode  # first of all: what it has sent before its end is there then
        self.channel.go_on()
        if self._log is None:
            return
        with suppress(BlockingIOError, ConnectionResetError):
            printed = self._log.recv(_AT_ONCE)
            self._tail = (self._tail + printed)[-LOG_TAIL:]
            if not printed and self._log in self._listened:
                self._listened.remove(self._log)

    def crash(self) -> Failure:
        """What it died of."""
        how = f"the worker ended with code {self.ended}"
        if self.ended is not None and self.ended < 0:
            how = f"the library was ended by signal {signal.Signals(-self.ended).name}"
        lines = map(short_line, self._tail.decode(errors="replace").split("\n"))
        words = next((line for line in reversed([*lines]) if line), "")
        return Failure("failed", f"{how}: {words}" if words else how)

    def stop(self) -> None:
        """Kill it and everything it has started; :meth:`join` waits for its end."""
        for end in (self.channel.socket, self._log):  # this its guard sees, which has to be awake for that
            if end is not None:
                _own_ends.discard(end)
                end.close()
        if self._process.exitcode is not None:
            return
        if self._guarded:
            with suppress(ProcessLookupError):  # it has seen it and is gone, which its exit status may say later
                os.kill(self._process.pid, signal.SIGCONT)
        else:
            self._kill()

    def join(self) -> None:
        """Wait until it and all that it has started are gone."""
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
    """Send and take what can be, waiting so long at most for something to come [s]."""
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
