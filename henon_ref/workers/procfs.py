"""What processes hold and have used, by Linux's ``/proc``; a process counts with all that it has started.

Elsewhere there is no ``/proc``: only a process itself is known then, and neither its memory nor its time. psutil would
read the same files, a family's members by a look at every process of the machine, and has no call for ``prctl``.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

KNOWN = sys.platform == "linux" and Path("/proc/self/stat").exists()
"""Whether the system tells what is asked for here."""
_TIMES, _RESIDENT = slice(11, 15), 21
"""Fields of ``/proc/PID/stat`` behind the name: time of the process, and of children that it has waited for."""
_DEATH_SIGNAL, _SUBREAPER = 1, 36
"""Numbers of requests to the kernel (``prctl``)."""


def family(pid: int) -> list[int]:
    """A process and all that it has started and what those have, whether in its session or not, parents first.

    Whatever has lost its parent is among them where the process has asked for that (:func:`adopt_orphans`).
    """
    found = [pid]
    for parent in found:
        found += children(parent)
    return found


def children(pid: int) -> list[int]:
    """What a process has started, or adopted, that has not been waited for."""
    found: list[int] = []
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += map(int, (task / "children").read_text(encoding="ascii").split())
    except (OSError, ValueError):  # it ends just now
        pass
    return found


def processor_seconds(pids: Iterable[int]) -> float:
    """Processor time that processes have used, with children that they have waited for [s]."""
    ticks = sum(sum(map(int, fields[_TIMES])) for pid in pids if (fields := _stat(pid)))
    return ticks / os.sysconf("SC_CLK_TCK") if KNOWN else 0.0


def resident_bytes(pids: Iterable[int]) -> int:
    """Memory that processes hold; what they share counts for each."""
    pages = sum(int(fields[_RESIDENT]) for pid in pids if (fields := _stat(pid)))
    return pages * os.sysconf("SC_PAGE_SIZE") if KNOWN else 0


def data_bytes() -> int:
    """Data of this process, whether it is in memory or only reserved, as the system's limit on data counts it."""
    if not KNOWN:
        return 0
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    return pages * os.sysconf("SC_PAGE_SIZE")


def own_bytes(pids: Iterable[int]) -> int:
    """Memory that processes hold, what they share counted once (slower to tell)."""
    total = 0
    for pid in pids:
        with suppress(OSError, ValueError, StopIteration):  # it ends just now
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
            total += 1024 * int(next(line for line in lines if line.startswith("Pss:")).split()[1])
    return total


def _stat(pid: int) -> list[str]:
    """Fields of a process behind its name; empty where there is no such process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except OSError:
        return []


def kill_family(pid: int) -> None:
    """Kill a process and all that it has started; elsewhere than on Linux, what is in its process group."""
    for each in family(pid):
        with suppress(ProcessLookupError, PermissionError):
            os.kill(each, signal.SIGKILL)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def adopt_orphans() -> None:
    """Have whatever loses its parent among those that this process has started become its child."""
    _request(_SUBREAPER, 1)


def signal_with_parent(number: int) -> None:
    """Ask for a signal when the process that this one was begun by ends, however it ends."""
    _request(_DEATH_SIGNAL, number)


def _request(what: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(what, value, 0, 0, 0)
