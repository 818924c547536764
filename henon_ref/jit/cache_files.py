"""Files of the cache: with a checksum in front, written whole or not at all, and read only where nothing is wrong.

A link is neither followed nor written through, and what another user could have written is not read.
"""

from __future__ import annotations

import os
import stat
import tempfile
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from henon_ref.jit import cache_folder

_CHECK = 32
"""Bytes of the checksum: SHA-256 of the file's name and of what follows."""


class DamagedError(Exception):
    """A file of the cache is not what was written there, or cannot be read."""

    def __init__(self, file: Path, why: str) -> None:
        super().__init__(f"{file.name}: {why}")
        self.file = file


def read(file: Path) -> bytes | None:
    """What was written into a file; None where there is none.

    Raises
    ------
    DamagedError
        Where it is not that, cannot be read, or another user could have written it.
    """
    try:
        with open(file, "rb", opener=_own_file) as stream:
            status = os.fstat(stream.fileno())
            why = cache_folder.foreign(status) if stat.S_ISREG(status.st_mode) else "it is not a file"
            found = b"" if why else stream.read()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise DamagedError(file, error.strerror or str(error)) from None
    content = memoryview(found)[_CHECK:]
    if why or found[:_CHECK] != _checksum(file, content):
        raise DamagedError(file, why or "its checksum is wrong")
    return bytes(content)


def write(file: Path, content: bytes) -> None:
    """Keep something in a file of the cache, whose folder is made where it is missing.

    Raises
    ------
    OSError
        Where it cannot be written; what was there before stays.
    """
    make_folder(file.parent)
    handle, name = tempfile.mkstemp(dir=file.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(_checksum(file, content))
            stream.write(content)
        os.replace(name, file)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def make_folder(folder: Path) -> None:
    """Make a folder in the cache's folder, which must be there."""
    folder.mkdir(mode=cache_folder.PRIVATE, exist_ok=True)


def set_aside(folder: Path, error: Exception) -> None:
    """Set a folder aside in which something is wrong, unless another process has done it meanwhile."""
    if isinstance(error, DamagedError):
        with suppress(DamagedError):
            read(error.file)
            return
    cache_folder.set_aside(folder, error)


def _own_file(name: str, flags: int) -> int:
    """Open what is no link, without waiting for what is no file."""
    return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o600)


def _checksum(file: Path, content: bytes | memoryview) -> bytes:
    made = sha256(file.name.encode() + b"\n")
    made.update(content)
    return made.digest()
