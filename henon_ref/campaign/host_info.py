"""What the runs ran on: processor, memory, system, libraries and their kernels, commit.

psutil names no processor, so that it would replace the two numbers of ``_memory`` alone; py-cpuinfo takes 1.2 s a call.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from henon_ref.registry import program_versions

DISTRIBUTIONS = (
    "henon-ref", "numpy", "scipy", "sympy", "numba", "llvmlite", "heyoka", "scikit-sundae", "python-flint",
    "pandas", "matplotlib", "jinja2", "pydantic", "ruamel.yaml",
    "diffrax", "jax", "jaxlib", "optimistix", "nosnoc", "casadi", "pydiffsol",
)  # fmt: skip
"""Packages whose versions a result depends on."""
BUILDS = ("numpy", "scipy", "scikit_sundae")
"""Packages whose wheels bring linear algebra."""


def machine() -> dict[str, object]:
    """Processor, cores, memory, operating system, Python and linear algebra of this machine."""
    return {
        "processor": _processor(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "memory_bytes": _memory(),
        "system": f"{platform.system()} {platform.release()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "linear_algebra": _linear_algebra(),
    }


def package_versions() -> dict[str, str]:
    """Versions of the packages of Python, an empty text for one that is not installed."""
    found = {}
    for name in DISTRIBUTIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = ""
    return found


def library_versions() -> dict[str, str]:
    """The same, with what solvers rest on that is no package of Python."""
    return package_versions() | program_versions()


def commit() -> str:
    """The commit of the checkout that this package lies in, with ``+`` where files differ; else empty."""
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
    """Libraries of linear algebra, the kernels they chose by the processor or were told to take, and whose they are.

    The last digits of implicit methods depend on them, and with these, at a horizon, whether an event is before it.
    Wheels bring builds of their own, which need not choose alike: those of packages that this process has not loaded
    are loaded to be asked (a hundredth of what the packages would take).
    """
    from threadpoolctl import threadpool_info

    for package in BUILDS:
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
