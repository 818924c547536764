"""Description of the machine and software of a run: processor, memory, system, libraries, commit.

psutil gives no processor name, so it would replace only the two calls of ``_memory``; py-cpuinfo takes 1.2 s per call.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

LIBRARIES = ("henon-ref", "numpy", "sympy", "llvmlite", "python-flint", "pandas", "pydantic", "ruamel.yaml")
"""Packages whose versions affect runs of the reference and sweeps."""


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
            with contextlib.suppress(OSError):
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
