"""Memory and processor time of processes and their descendants, from Linux's ``/proc``.

Other systems have no ``/proc``: only the process itself is known, but not its memory or time. psutil reads the same
files, finds descendants by checking every process of the machine, and has no call for ``prctl``.
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
"""Whether the system has this information."""


def family(pid: int) -> list[int]:
    """Return a process and its descendants, parents first; orphans only if it has called :func:`adopt_orphans`."""
    found = [pid]
    for parent in found:
        found += children(parent)
    return found


def children(pid: int) -> list[int]:
    """Return the children of a process, and the orphans it has adopted, that have not been reaped."""
    found: list[int] = []
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += map(int, (task / "children").read_text(encoding="ascii").split())
    except (OSError, ValueError):  # the process has just ended
        pass
    return found


def processor_seconds(pids: Iterable[int]) -> float:
    """Return the processor time of processes and their reaped children [s]."""
    ticks = sum(sum(map(int, fields[11:15])) for pid in pids if (fields := _stat(pid)))
    return ticks / os.sysconf("SC_CLK_TCK") if KNOWN else 0.0


def resident_bytes(pids: Iterable[int]) -> int:
    """Return the resident memory of processes [bytes]; shared memory counts for each of them."""
    pages = sum(int(fields[21]) for pid in pids if (fields := _stat(pid)))
    return pages * os.sysconf("SC_PAGE_SIZE") if KNOWN else 0


def data_bytes() -> int:
    """Return the data size of this process [bytes], reserved memory included, as counted by the system's limit."""
    if not KNOWN:
        return 0
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    return pages * os.sysconf("SC_PAGE_SIZE")


def own_bytes(pids: Iterable[int]) -> int:
    """Return the memory of processes [bytes], shared memory counted once (slower than :func:`resident_bytes`)."""
    total = 0
    for pid in pids:
        with suppress(OSError, ValueError, StopIteration):  # the process has just ended
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
            total += 1024 * int(next(line for line in lines if line.startswith("Pss:")).split()[1])
    return total


def _stat(pid: int) -> list[str]:
    """Return the fields of a process after its name; empty if there is no such process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except OSError:
        return []


def kill_family(pid: int) -> None:
    """Kill a process and its descendants; outside Linux, its process group."""
    for each in family(pid):
        with suppress(ProcessLookupError, PermissionError):
            os.kill(each, signal.SIGKILL)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def adopt_orphans() -> None:
    """Make this process the parent of its descendants that lose theirs."""
    _prctl(36, 1)  # PR_SET_CHILD_SUBREAPER


def signal_with_parent(number: int) -> None:
    """Request a signal for the time when this process's parent ends, for whatever reason."""
    _prctl(1, number)  # PR_SET_PDEATHSIG


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(option, value, 0, 0, 0)
