"""Compiling what is not on the disk yet: processes that need the same functions share the work.

numba looks on the disk before it compiles a function, one that another function contains, too. Who comes to a function
that another process is compiling goes on to the next one, and takes that one from the disk afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import sha256
from typing import IO, Any

from henon_ref.jit import cache_folder, compiling

try:
    import fcntl
except ImportError:  # elsewhere than on Unix every process compiles for itself
    fcntl = None  # type: ignore[assignment]

Compiled = tuple[Any, tuple[Any, ...]]
"""A function and the types that it is to be compiled for."""


def compile_all(needed: Iterable[Compiled], ahead: Iterable[Compiled] = ()) -> None:
    """Make functions callable; ``ahead`` is compiled, too, where there is nothing to do but to wait for another."""
    with compiling():
        waiting = [each for each in needed if not _compiled(*each, wait=False)]
        if waiting:
            for function, types in ahead:
                function.compile(types)
        for each in waiting:
            _compiled(*each, wait=True)


def _compiled(function: Any, types: tuple[Any, ...], *, wait: bool) -> bool:
    """Compile a function, or read it from the disk; False where another process is compiling it, unless we wait."""
    name = f"{function.__module__}.{function.__name__}"
    turn = cache_folder() / f"{name}-{sha256(str(types).encode()).hexdigest()[:8]}.turn"
    if types in function.overloads or (turn.exists() and turn.stat().st_size):
        function.compile(types)
        return True
    turn.parent.mkdir(parents=True, exist_ok=True)
    with turn.open("a") as file:
        if not _mine(file, wait=wait):
            return False
        function.compile(types)
        file.write("compiled\n")
    return True


def _mine(file: IO[str], *, wait: bool) -> bool:
    """Take the turn to compile, which ends when the file is closed; False where another process has it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
