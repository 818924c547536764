"""The fork server: a process that workers are forked from, so that they begin with all that it has imported.

The command begins one of its own at once, which imports what workers need while the command reads its cases. Else it
is a fork of the caller on Linux while that has a single thread: its workers have what the caller has. Where neither
can be (in a notebook, say), it is a fresh process. That imports the caller's main module only where jobs hold objects
of it (a solver that a script defines): such a script needs the usual ``if __name__ == "__main__"`` guard.

It outlives the caller by a moment: whatever workers have started, in sessions of their own, too, loses its parent to
it, and is killed when the worker has ended or the caller has. On other systems than Linux (POSIX alone will do) only
what is in a worker's process group is. A server that is killed takes its workers with it, and cannot tidy up.
"""

from __future__ import annotations

import atexit
import gc
import os
import select
import signal
import socket
import struct
import sys
import threading
import time
import traceback
import warnings
from collections import deque
from contextlib import suppress
from importlib import import_module
from multiprocessing import spawn, util
from typing import Any, NoReturn

from henon_ref.errors import CaseError, HenonRefError
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.workers.procfs import adopt_orphans, children, family, is_at_work, kill_family, signal_with_parent

WORKERS_NEED = (
    "henon_ref.baselines.henon",
    "henon_ref.harness.campaign.run_jobs",
    "henon_ref.harness.campaign.truth_job",
)
"""What the command's server imports as it begins."""
SELDOM = 200_000
"""Objects made between two looks for garbage."""
BEGUN, ENDED = 0, 1
"""What the server tells: a worker has begun (0), or ended (exit status)."""
_FORK, _IMPORT = 0, 1
_REQUEST = struct.Struct("=iq116s")
"""What it is asked: kind, memory of a worker, what to import. Two file descriptors go along with a fork."""
_REPORT = struct.Struct("=iqq")
_LEISURE = 20
"""Milliseconds between two looks while something is left to be killed."""
_LAST_SECONDS = 5.0
"""Time for what has been killed to be gone [s]."""


def collect_seldom() -> None:
    """What is imported and compiled stays: looking through it again and again would be for nothing."""
    gc.set_threshold(SELDOM)


class ForkServer:
    """The caller's handle on a fork server.

    Parameters
    ----------
    pid : int
        Its process.
    control : socket
        The way to it.
    """

    def __init__(self, pid: int, control: socket.socket) -> None:
        self.pid = pid
        self._control = control
        control.setblocking(False)
        self._come = bytearray()
        self._broken = self._closed = False

    @classmethod
    def of_caller(cls, *, main: bool = False) -> ForkServer:
        """One that has what this process has; a fresh one has its main module only where it is needed (``main``)."""
        if sys.platform != "linux" or threading.active_count() > 1:
            return cls.fresh(caller=True) if main else cls.fresh(*WORKERS_NEED)
        ours, theirs = socket.socketpair()
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        pid = _forked()
        if pid == 0:
            try:
                ours.close()
                _serve(theirs, ())
            finally:
                os._exit(1)
        theirs.close()
        return cls(pid, ours)

    @classmethod
    def fresh(cls, *modules: str, caller: bool = False) -> ForkServer:
        """One that imports some modules, and the caller's main module where it wants that.

        Raises
        ------
        OSError
            Where it cannot be begun.
        HenonRefError
            In a server that is importing its caller's main module.
        CaseError
            Where the caller's main module is wanted and there is no file to import it from.
        """
        if _importing:
            raise HenonRefError('the script compares where it is imported: put that under if __name__ == "__main__"')
        known: dict[str, Any] = spawn.get_preparation_data("worker") if caller else {}
        known.pop("authkey", None)
        if caller and not {"init_main_from_name", "init_main_from_path"} & set(known):
            raise CaseError(
                "a solver is defined in a notebook or at a prompt, where no other process finds it: "
                "write it into a module and import it from there"
            )
        ours, theirs = socket.socketpair()
        code = (
            f"import sys; sys.path[:] = {[*map(str, sys.path)]!r}; "
            f"from henon_ref.harness.campaign.fork_server import main; main({theirs.fileno()}, {modules!r}, {known!r})"
        )
        command = [sys.executable, *util._args_from_interpreter_flags(), "-c", code]  # type: ignore[attr-defined]
        pid = util.spawnv_passfds(os.fsencode(sys.executable), command, [theirs.fileno()])
        theirs.close()
        return cls(pid, ours)

    def fileno(self) -> int:
        """For :func:`select.poll`."""
        return self._control.fileno()

    @property
    def is_sound(self) -> bool:
        """Whether it can be relied on: neither dead nor stopped."""
        return not self._broken and is_at_work(self.pid)

    @property
    def clock(self) -> float:
        """Wall time, less what it has waited for a processor [s]."""
        return time.monotonic() - waited_seconds(self.pid)

    def fork(self, theirs: socket.socket, log: int, memory: int) -> None:
        """Ask for a worker (see :func:`henon_ref.harness.campaign.worker.serve`)."""
        self._ask(_REQUEST.pack(_FORK, memory, b""), theirs.fileno(), log)

    def preload(self, what: str) -> None:
        """Have a module imported, or one of its functions called (``module:function``), when there is time for it."""
        self._ask(_REQUEST.pack(_IMPORT, 0, what.encode()))

    def _ask(self, what: bytes, *descriptors: int) -> None:
        try:
            socket.send_fds(self._control, [what], descriptors)
        except OSError:  # it is gone, or has taken nothing for long
            self._broken = True

    def reports(self) -> list[tuple[int, int, int]]:
        """What it has told by now: BEGUN or ENDED, process, exit status; workers begin in the order asked for."""
        with suppress(BlockingIOError):
            try:
                while piece := self._control.recv(4096):
                    self._come += piece
                self._broken = True
            except ConnectionResetError:
                self._broken = True
        whole = len(self._come) - len(self._come) % _REPORT.size
        found = list(_REPORT.iter_unpack(bytes(self._come[:whole])))
        del self._come[:whole]
        return found

    def close(self) -> None:
        """End it, with all workers and whatever they have started."""
        if self._closed:
            return
        self._broken = self._closed = True
        self._control.close()
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGCONT)
        began = time.monotonic()
        with suppress(ChildProcessError):
            while os.waitpid(self.pid, os.WNOHANG) == (0, 0) and (took := time.monotonic() - began) < 2 * _LAST_SECONDS:
                if took > _LAST_SECONDS:
                    kill_family(self.pid)
                time.sleep(0.001)


_begun: list[ForkServer] = []
"""The command's own server, where it has begun one."""
_importing = False


def begin_server() -> None:
    """Have workers forked, from here on, from a process that is begun now: where there is a second core for it."""
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2:
        return
    with suppress(OSError):  # such as where no socket can be made
        _begun.append(ForkServer.fresh(*WORKERS_NEED))
        atexit.register(end_server)


def end_server() -> None:
    """End the command's own server, if there is one."""
    while _begun:
        _begun.pop().close()


def present_server() -> ForkServer | None:
    """The command's own server, where there is one that can be relied on."""
    if _begun and not _begun[0].is_sound:
        end_server()
    return _begun[0] if _begun else None


def main(control: int, modules: tuple[str, ...], known: dict[str, Any]) -> None:
    """What a fresh server does."""
    global _importing
    os.setsid()  # a terminal's interrupts and stops are the command's own
    signal_with_parent(signal.SIGKILL)  # until it can see for itself that the caller is gone
    collect_seldom()
    _importing = True
    try:
        spawn.prepare(known)
    except BaseException as error:  # noqa: BLE001 - the caller's own module, whose threads may be there already
        print(f"workers cannot import the main module: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        os._exit(1)
    _importing = False
    _serve(socket.socket(fileno=control), modules)


def _serve(control: socket.socket, modules: tuple[str, ...]) -> NoReturn:
    """Fork workers until the caller closes the control socket, or ends."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # it ends with the caller, not before: somebody has to tidy up
    adopt_orphans()
    signal_with_parent(signal.SIGCONT)  # one that has been stopped wakes up to see that the caller is gone
    ours, wake = socket.socketpair()
    for end in (ours, wake):
        end.setblocking(False)
    signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    control.setblocking(True)
    poll = select.poll()
    for end in (control, ours):
        poll.register(end, select.POLLIN)
    workers: set[int] = set()
    to_import = deque(modules)
    while True:
        strays = _without_strays(control, workers)
        ready = [number for number, _ in poll.poll(0 if to_import else _LEISURE if strays else None)]
        with suppress(BlockingIOError):
            ours.recv(4096)
        if control.fileno() not in ready:
            if to_import and not ready:
                _import(to_import.popleft())
            continue
        try:
            request, descriptors, _, _ = socket.recv_fds(control, _REQUEST.size, 2)
        except ConnectionResetError:
            request = b""
        if not request:
            _leave()
        kind, memory, name = _REQUEST.unpack(request)
        if kind == _IMPORT:
            to_import.append(name.rstrip(b"\0").decode())
            continue
        pid = _forked()
        if pid == 0:
            _become_worker(control, [ours, wake], descriptors, memory)
        for descriptor in descriptors:
            os.close(descriptor)
        workers.add(pid)
        control.sendall(_REPORT.pack(BEGUN, pid, 0))


def _become_worker(control: socket.socket, others: list[socket.socket], descriptors: list[int], memory: int) -> None:
    from henon_ref.harness.campaign.worker import serve

    server = os.getppid()
    try:
        signal.set_wakeup_fd(-1)
        for end in (control, *others):
            end.close()
        theirs, log = descriptors
        serve(socket.socket(fileno=theirs), log, memory, server)
        os._exit(0)
    except BaseException:  # noqa: BLE001 - nothing comes back from here into a copy of the server
        traceback.print_exc()
    finally:
        os._exit(1)


def _forked() -> int:
    with warnings.catch_warnings():
        # BLAS keeps threads of its own, which survive a fork by its own handlers.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _without_strays(control: socket.socket, workers: set[int]) -> bool:
    """Tell which workers have ended, and kill what they have left behind; whether there was any of it."""
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            pid, status = ended
            if pid in workers:
                workers.remove(pid)
                with suppress(BrokenPipeError, ConnectionResetError):
                    control.sendall(_REPORT.pack(ENDED, pid, os.waitstatus_to_exitcode(status)))
    strays = [pid for pid in children(os.getpid()) if pid not in workers]
    for pid in strays:
        kill_family(pid)
    return bool(strays)


def _import(what: str) -> None:
    module, _, function = what.partition(":")
    with suppress(Exception):  # what cannot be imported is a failure of the job that needs it
        made = import_module(module)
        if function:
            getattr(made, function)()


def _leave() -> NoReturn:
    """Kill all that is left, and end."""
    ends = time.monotonic() + _LAST_SECONDS
    with suppress(ChildProcessError):
        while time.monotonic() < ends:
            for pid in reversed(family(os.getpid())[1:]):
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
            time.sleep(0.001)
    os._exit(0)
