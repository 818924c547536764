"""Files of the cache: with a leading checksum, written atomically, and read only if intact.

Symbolic links are neither followed nor overwritten. A file that another user could have written is not read.
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
"""Bytes of the checksum: SHA-256 of the file's name and content."""
_LOG = logging.getLogger(__name__)


def read(file: Path) -> bytes | None:
    """Return the content of a file; None, with a log entry, if the file cannot be trusted; None if there is none."""
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
    """Write a file of the cache; a missing folder is made.

    Raises
    ------
    OSError
        If it cannot be written; an earlier version then remains.
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
    """Open without following a link, and without blocking on a pipe."""
    return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o600)


def _checksum(file: Path, content: bytes | memoryview) -> bytes:
    made = sha256(file.name.encode() + b"\n")
    made.update(content)
    return made.digest()
