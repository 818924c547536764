"""numba's ``njit`` with a disk cache that knows when any compiled module of this package has changed.

numba looks at a function's own file only; a function compiled into another one would go stale there. The
cache therefore lives in a folder named after the text of :mod:`henon_ref.henon`, outside the source tree; which
folder may be used, :mod:`henon_ref.cachefolder` says.
"""

from __future__ import annotations

import gc
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.registry import cpu_target

from henon_ref import cachefiles, numbacache
from henon_ref.cachefolder import FUNCTIONS, cache_root
from henon_ref.target import target


@contextmanager
def _hidden(module: str) -> Iterator[None]:
    """Whoever imports a module finds that it is not installed."""
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[module]


# numba tries whether there is a BLAS by importing all of scipy.linalg, a third of the time until compiled code is
# loaded. What it takes from the answer is whether np.correlate may use it; what needs a BLAS looks for it again.
with _hidden("scipy.linalg"):
    import numba.np.arraymath


@cache
def cache_folder() -> Path:
    """Folder of the compiled functions, by a hash of the package that compiles, with the constants it compiles in.

    And of where that stands: numba does not take over what it has compiled of another copy.
    """
    digest = hashlib.sha256(f"{numba.__version__} {target()} {Path(__file__).parent.resolve()}".encode())
    form = [Path(__file__), Path(cachefiles.__file__), Path(numbacache.__file__)]
    for path in [*form, *sorted((Path(__file__).parent / "henon").glob("*.py"))]:
        digest.update(path.read_bytes())
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
    run. So is what the compiler may fuse or reorder (``fastmath``), unless it is a compile unit
    (:mod:`henon_ref.henon.compile_units`): a process that compiles has such a function twice, with other last digits.
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
        compiled._cache = numbacache.CheckedCache(function, cache_folder())
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
