"""Worker processes: how they are begun and ended, and what they hold.

A program that has chosen multiprocessing's fork server, as the command has (:mod:`henon_ref.score.nursery`), has its
workers from there. Else they are forked on Linux while the caller has a single thread; elsewhere they are spawned, and
a script that begins one needs the usual ``if __name__ == "__main__"`` guard.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import warnings
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import IO

from henon_ref.score.plaintext import plain_text
from henon_ref.score.worker import Descriptor, serve

LOG_TAIL = 4000
"""Bytes of a dead worker's output that are searched for its last words."""


class Process:
    """A worker's process, and the parent's end of its connection.

    Parameters
    ----------
    memory : int
        Bytes that it may hold.
    here : bool
        Whether to fork it from this process where that can be, so that it has all that this has imported.
    """

    def __init__(self, memory: int, *, here: bool = False) -> None:
        context = _context(here=here)
        self.log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in stop()
        self.connection, theirs = multiprocessing.Pipe()
        log = None if sys.platform == "win32" else Descriptor(self.log.fileno())
        self._process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=serve, args=(theirs, memory, log), daemon=True
        )
        with warnings.catch_warnings():
            # BLAS keeps threads of its own, which survive a fork by its own handlers.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process.start()
        theirs.close()
        self._began_with = self.resident or 0

    @property
    def resident(self) -> int | None:
        """Bytes that it holds; None where the system does not tell."""
        return resident_bytes(self._process.pid)

    @property
    def grown(self) -> int:
        """Bytes that it holds beyond those that it began with (a fork begins with its parent's)."""
        return (self.resident or 0) - self._began_with

    def ended(self) -> int | None:
        """Exit status of a process whose connection has broken; None where it has not ended."""
        self._process.join(timeout=5)
        return self._process.exitcode

    def stop(self) -> None:
        """Kill the process and everything it started."""
        pid = self._process.pid
        try:
            os.killpg(pid, signal.SIGKILL)  # type: ignore[arg-type]
        except (ProcessLookupError, PermissionError):  # it is gone, or has not made its group yet
            self._process.kill()
        self._process.join()
        self._process.close()
        self.connection.close()
        self.log.close()

    def last_words(self) -> str:
        """The last line that the process printed, for the reason of a crash."""
        size = self.log.seek(0, os.SEEK_END)
        self.log.seek(max(0, size - LOG_TAIL))
        lines = map(plain_text, self.log.read().decode(errors="replace").split("\n"))
        return next((line for line in reversed([*lines]) if line), "")


def resident_bytes(pid: int | None) -> int | None:
    """Memory that a process holds; None where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


def _context(*, here: bool) -> BaseContext:
    served = multiprocessing.get_start_method(allow_none=True) == "forkserver"
    forkable = sys.platform == "linux" and threading.active_count() == 1
    if served and not (here and forkable):
        return multiprocessing.get_context("forkserver")
    return multiprocessing.get_context("fork" if forkable else "spawn")
