"""Files of the cache: with a checksum in front, written whole or not at all, and read only where nothing is wrong.

A link is neither followed nor written through, and what another user could have written is not read.
"""

from __future__ import annotations

import logging
import os
import stat
import tempfile
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from henon_ref.jit import cache_folder

_CHECK = 32
"""Bytes of the checksum: SHA-256 of the file's name and of what follows."""
_LOG = logging.getLogger(__name__)


def read(file: Path) -> bytes | None:
    """What was written into a file; None where there is none that can be trusted, which is logged."""
    try:
        with open(file, "rb", opener=_own_file) as stream:
            status = os.fstat(stream.fileno())
            why = cache_folder.foreign(status) if stat.S_ISREG(status.st_mode) else "it is not a file"
            found = b"" if why else stream.read()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        why, found = error.strerror or str(error), b""
    content = memoryview(found)[_CHECK:]
    if why or found[:_CHECK] != _checksum(file, content):
        _LOG.info("%s is not used and made anew: %s", file, why or "its checksum is wrong")
        return None
    return bytes(content)


def write(file: Path, content: bytes) -> None:
    """Keep something in a file of the cache, whose folder is made where it is missing.

    Raises
    ------
    OSError
        Where it cannot be written; what was there before stays.
    """
    file.parent.mkdir(mode=cache_folder.PRIVATE, exist_ok=True)
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


def _own_file(name: str, flags: int) -> int:
    """Open what is no link, without waiting for what is no file."""
    return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o600)


def _checksum(file: Path, content: bytes | memoryview) -> bytes:
    made = sha256(file.name.encode() + b"\n")
    made.update(content)
    return made.digest()
