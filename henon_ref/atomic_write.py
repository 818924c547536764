"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the name of a file to an OSError that has none, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def write_through(path: Path, content: bytes) -> None:
    """Write a new file, not through a link, and wait until it is on the disk."""
    path.unlink(missing_ok=True)
    with naming(path), path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(path: Path, content: bytes) -> None:
    """Put a whole file in the place of another, or leave the other as it is; a device or pipe is written to.

    A link stays a link: the file to which it leads is replaced. OSError if no process reads a pipe.
    """
    if path.exists() and not path.is_file():
        with naming(path), open(str(path), "wb", opener=_opened_at_once) as file:
            file.write(content)
        return
    if path.is_symlink():
        path = path.resolve()
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write_through(part, content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _opened_at_once(path: str, flags: int) -> int:
    """Open a device or pipe without waiting for a reader; OSError if a pipe has none."""
    waits = getattr(os, "O_NONBLOCK", 0)
    try:
        descriptor = os.open(path, flags | waits)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise OSError(errno.ENXIO, "no process reads this pipe", path) from None
    if waits:
        os.set_blocking(descriptor, True)
    return descriptor
