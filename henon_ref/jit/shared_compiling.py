"""Compiling what is not on the disk yet: processes that need the same functions share the work.

numba looks on the disk before it compiles a function, one that another function contains, too. Who comes to a function
that another process is compiling goes on to the next one, and takes that one from the disk afterwards. A function that
takes long is shared, too: by the parts that it contains.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import IO, Any

from henon_ref.jit.cache_files import open_turn
from henon_ref.jit.njit import cache_folder, compiling

try:
    import fcntl
except ImportError:  # elsewhere than on Unix every process compiles for itself
    fcntl = None  # type: ignore[assignment]

LONGEST_WAIT = 60.0
"""Seconds after which a process that is at a function, and may hang, is not waited for any longer."""
POLL_INTERVAL = 0.02
"""Seconds from one test whether it is done to the next: a function takes tenths of a second and more."""

Compiled = tuple[Any, tuple[Any, ...]]
"""A function and the types that it is to be compiled for."""


def compile_all(needed: Iterable[Compiled], parts: Iterable[Compiled] = ()) -> None:
    """Make functions callable.

    Parameters
    ----------
    needed : iterable of Compiled
    parts : iterable of Compiled
        What those contain: compiled first, so that several processes can share even in one function. Long ones first.
    """
    needed, parts = list(needed), list(parts)
    with compiling():
        if not all(_is_made(*each) for each in needed):
            _share(parts)
            _share(needed)
        for function, types in needed:
            function.compile(types)


def _share(functions: list[Compiled]) -> None:
    """See to it that functions are on the disk: compile what nobody else is compiling, wait for the others."""
    waiting = [each for each in functions if not _made(*each, wait=False)]
    for each in waiting:
        _made(*each, wait=True)


def _made(function: Any, types: tuple[Any, ...], *, wait: bool) -> bool:
    """Compile a function unless it is on the disk; False where another process is at it, and stays at it if we wait."""
    if _is_made(function, types):
        return True
    try:
        file = open_turn(_turn(function, types))
    except OSError:  # no turns can be taken there: everybody compiles for himself
        function.compile(types)
        return True
    with file:
        if not _mine(file, wait=wait):
            return False
        if not _is_made(function, types):
            function.compile(types)
            with suppress(OSError):
                file.write(b"compiled\n")
    return True


def _is_made(function: Any, types: tuple[Any, ...]) -> bool:
    if types in function.overloads:
        return True
    try:
        return _turn(function, types).stat().st_size > 0
    except OSError:
        return False


def _turn(function: Any, types: tuple[Any, ...]) -> Path:
    """File that is locked by whoever compiles a function, and has a word in it afterwards."""
    name = f"{function.__module__}.{function.__name__}"
    return cache_folder() / f"{name}-{sha256(str(types).encode()).hexdigest()[:8]}.turn"


def _mine(file: IO[bytes], *, wait: bool) -> bool:
    """Take the turn to compile, which ends when the file is closed; False where another process has it."""
    if fcntl is None:
        return True
    latest = time.monotonic() + (LONGEST_WAIT if wait else 0)
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= latest:
                return False
            time.sleep(POLL_INTERVAL)
        except OSError:  # a disk without locks
            return True
        else:
            return True
