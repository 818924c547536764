"""numba's ``njit`` with a disk cache that knows when any compiled module of this package has changed.

numba looks at a function's own file only; a function compiled into another one would go stale there. The
cache therefore lives in a folder named after the text of all that is compiled, outside the source tree; which
folder may be used, :mod:`henon_ref.jit.cache_folder` says.
"""

from __future__ import annotations

import gc
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.registry import cpu_target

from henon_ref.jit.cache_folder import FUNCTIONS, cache_root
from henon_ref.jit.numba_cache import CheckedCache
from henon_ref.jit.target import target

COMPILED = ("jit", "roots", "taylor", "henon")
"""Rooms of what is compiled, and of the constants that compiled code takes in."""


@cache
def cache_folder() -> Path:
    """Folder of the compiled functions, by a hash of the text and the path of every module that is compiled.

    And of where that stands: numba does not take over what it has compiled of another copy.
    """
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(f"{numba.__version__} {target()} {package}".encode())
    for path in sorted(path for room in COMPILED for path in (package / room).rglob("*.py")):
        digest.update(f"{path.relative_to(package)}\n".encode() + path.read_bytes())
    folder = cache_root() / f"{FUNCTIONS}{digest.hexdigest()[:16]}"
    with suppress(OSError):  # it is not there yet
        os.utime(folder)
    return folder


def warm_up() -> None:
    """Have numba list what it can compile, as it does anyway before the first function that it compiles or loads."""
    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()


def inner(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """:func:`njit` for functions that only compiled code calls: no wrappers for Python, a third less to compile.

    What every step passes through is asked to be inlined (``forceinline=True``): calls would take some percent of a
    run. Nothing is compiled with ``fastmath``: see :mod:`henon_ref.jit.target`.
    """
    return njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)


def in_python(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """The Python function that a compiled one was made from, for callers that are in Python."""
    function: Callable[..., Any] = compiled.py_func  # type: ignore[attr-defined]
    return function


def njit(*, allocates: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """``numba.njit(error_model="numpy", **options)``, cached in :func:`cache_folder`.

    Without ``allocates`` no array can be made inside, and views of arrays are not counted: atomic counts took a
    quarter of a run's time.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        compiled = numba.njit(error_model="numpy", _nrt=allocates, **options)(function)
        compiled._cache = CheckedCache(function, cache_folder())
        return compiled

    return decorate


@contextmanager
def compiling() -> Iterator[None]:
    """Leave the garbage alone: numba makes millions of objects that stay, and looking through them is a fifth."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
