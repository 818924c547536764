"""The machine: its processor, memory and software for the record of a run; memory and time of processes on it.

Both are read from Linux's ``/proc``. Other systems have none: there only the process itself is known, but not its
memory or time. psutil reads the same files, but gives no processor name, finds descendants by checking every process of
the machine, and has no call for ``prctl``; py-cpuinfo takes 1.2 s per call.
"""

from __future__ import annotations

import ctypes
import os
import platform
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

LIBRARIES = ("henon-ref", "numpy", "sympy", "llvmlite", "python-flint", "pandas", "pydantic", "ruamel.yaml")
"""Packages whose versions affect runs of the reference and sweeps."""
KNOWN = sys.platform == "linux" and Path("/proc/self/stat").exists()
"""Whether the system tells memory and time of processes."""


def machine() -> dict[str, object]:
    """Return the processor, cores, memory, operating system, Python and linear algebra of this machine."""
    return {
        "processor": _processor(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "memory_bytes": _memory(),
        "system": f"{platform.system()} {platform.release()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "linear_algebra": _linear_algebra(),
    }


@cache
def library_versions(names: tuple[str, ...] = LIBRARIES) -> dict[str, str]:
    """Return the versions of packages, empty for a package that is not installed; cached, as it reads many files."""
    found = {}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = ""
    return found


def commit() -> str:
    """Return the commit of the checkout that contains this package, with ``+`` if files differ; else empty."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return ""
    head = _git(root, "rev-parse", "HEAD")
    changed = _git(root, "status", "--porcelain", "--untracked-files=no", "--", "henon_ref", "baselines", "cases")
    return head + ("+" if head and changed else "")


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor()


def _linear_algebra() -> str:
    """Return the linear algebra libraries with their kernels (chosen by processor or setting) and their packages.

    The last digits of implicit methods depend on them, and may decide whether an event occurs before the horizon. The
    builds in different wheels may choose different kernels. Builds of packages that are not imported yet are loaded
    without the package, in a hundredth of the time.
    """
    from threadpoolctl import threadpool_info

    for package in ("numpy", "scipy", "scikit_sundae"):  # their wheels contain such libraries
        for library in Path(np.__file__).parents[1].glob(f"{package}.libs/*openblas*"):
            with suppress(OSError):
                ctypes.CDLL(str(library))
    owners: dict[str, list[str]] = {}
    for entry in threadpool_info():
        if entry["user_api"] == "blas":
            kernels = f"{entry['internal_api']} {entry.get('architecture') or ''}".strip()
            folder = Path(entry["filepath"]).parent.name
            owners.setdefault(kernels, []).append(folder.removesuffix(".libs"))
    return ", ".join(f"{kernels} ({', '.join(sorted(own))})" for kernels, own in sorted(owners.items()))


def _memory() -> int | None:
    if not hasattr(os, "sysconf") or "SC_PHYS_PAGES" not in os.sysconf_names:
        return None
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


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
