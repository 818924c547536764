"""Folder of compiled code, its replacement if it cannot be used, and its files.

The machine code in the folder is executed. Therefore the folder, and the subfolder in use, must belong to the user and
must not be writable by group or others. No folder above may be writable by everybody, except with the sticky bit
(``/tmp``). A symbolic link in place of the folder must belong to the user or root; its target is used under the same
rules. A file has a leading checksum, is written atomically, and is read only if it is intact and no other user could
have written it; symbolic links are neither followed nor overwritten.

If the folder is refused or cannot be written, a private temporary folder replaces it, for this process and the
processes that it starts, until it ends. A cache never decides whether a run succeeds. The refusal is logged as a
warning, which commands print on standard error.
"""

from __future__ import annotations

import logging
import os
import shutil
import stat
import sys
import tempfile
from contextlib import suppress
from functools import cache
from hashlib import sha256
from multiprocessing.util import Finalize
from pathlib import Path

from platformdirs import user_cache_path

VARIABLE = "HENON_REF_CACHE_DIR"
"""Environment variable with the folder; by default ``henon_ref`` in the user's cache (``XDG_CACHE_HOME``)."""
OBJECTS = "objects"
"""Subfolder of the modules' machine code."""
_NOWHERE = Path(os.devnull, "henon_ref")
"""Path that cannot exist: no file is found or kept in it."""
_LOG = logging.getLogger(__name__)


def cache_root() -> Path:
    """Folder of compiled code: ``HENON_REF_CACHE_DIR``, or the user's cache; if refused, a temporary folder.

    The environment variable then names the temporary folder, so that processes started later use it as well.
    """
    return _usable(Path(os.environ.get(VARIABLE) or user_cache_path("henon_ref")))


@cache
def _usable(wanted: Path) -> Path:
    folder = Path(os.path.realpath(wanted))
    reason = _refused(wanted, folder)
    if reason is None:
        return folder
    instead = _temporary_folder()
    os.environ[VARIABLE] = str(instead)
    where = "is not kept" if instead == _NOWHERE else "is in a temporary folder until the end"
    _LOG.warning(
        "cache folder %s is not used: %s; compiled code %s (correct this, or name another by %s or XDG_CACHE_HOME)",
        *(_named(wanted), reason, where, VARIABLE),
    )
    return instead


def _refused(wanted: Path, folder: Path) -> str | None:
    """Make a folder if it is missing; return the reason if it cannot be used, else None.

    ``folder``: ``wanted`` with links resolved.
    """
    try:
        if sys.platform != "win32" and wanted.is_symlink() and wanted.lstat().st_uid not in (0, os.geteuid()):
            return "it is a link of another user"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        reason = _open_to_others(wanted, folder)
        if reason is None:
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(bytes(4096))
    except FileExistsError:
        return "it is not a folder"
    except OSError as error:
        return f"it cannot be written ({error.strerror or error})"
    return reason


def _open_to_others(wanted: Path, folder: Path) -> str | None:
    """Return how another user could put files into a folder; None if impossible."""
    if sys.platform == "win32":
        return None
    for above in (*wanted.absolute().parents, *folder.parents):
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"others can write to {_named(above)}"
    if found := foreign(folder.lstat()):
        return found
    with suppress(FileNotFoundError):  # not yet made
        status = (folder / OBJECTS).lstat()
        found = foreign(status) if stat.S_ISDIR(status.st_mode) else "it is not a folder"
        if found:
            return f"{found}: {OBJECTS!r}"
    return None


def foreign(status: os.stat_result) -> str | None:
    """Return why a file or folder with this status may hold data of another user; None if it cannot."""
    if sys.platform == "win32":
        return None
    if status.st_uid != os.geteuid():
        return "it belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others can write to it (mode {stat.S_IMODE(status.st_mode):04o})"
    return None


def _temporary_folder() -> Path:
    """Make a private folder that is removed when this process ends."""
    try:
        made = Path(tempfile.mkdtemp(prefix="henon_ref-"))
    except OSError:
        return _NOWHERE
    if _refused(made, made) is not None:
        shutil.rmtree(made, ignore_errors=True)
        return _NOWHERE
    # Unlike atexit, Finalize also runs at the end of multiprocessing's processes, and not in a fork.
    Finalize(None, shutil.rmtree, (made,), {"ignore_errors": True}, exitpriority=0)
    return made


def _named(path: Path) -> str:
    """Return a path as printable text; the middle of a long path is left out."""
    text = repr(str(path))
    return text if len(text) <= 500 else f"{text[:250]}...{text[-250:]}"


def read(file: Path) -> bytes | None:
    """Return the content of a file; None, with a log entry, if the file cannot be trusted; None if there is none."""
    try:
        with open(file, "rb", opener=_own_file) as stream:
            status = os.fstat(stream.fileno())
            why = foreign(status) if stat.S_ISREG(status.st_mode) else "it is not a file"
            found = b"" if why else stream.read()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        why, found = error.strerror or str(error), b""
    content = memoryview(found)[32:]  # after the checksum, SHA-256 of name and content
    if why or found[:32] != _checksum(file, content):
        _LOG.info("%s is not used and made anew: %s", file, why or "its checksum is wrong")
        return None
    return bytes(content)


def write(file: Path, content: bytes) -> None:
    """Write a file of the cache; a missing folder is made. OSError if it cannot be; an earlier version then remains."""
    file.parent.mkdir(mode=0o700, exist_ok=True)
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
