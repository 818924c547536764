"""The folder that compiled code is kept in, and what is done where it cannot be used.

The machine code in it is run. The folder is therefore refused unless it belongs to the user, and neither group nor
others can write to it; so is the folder in it that is used. No folder above it may be open to everybody (one with
the sticky bit, such as ``/tmp``, may). A symbolic link in its place must be the user's or root's; what it leads to is
used, under the same rules. Each file is looked at again when it is read (:mod:`henon_ref.jit.cache_files`).

A folder that is refused, or cannot be written, is replaced by a private temporary one: for this process and those that
it begins, until it ends. A cache never decides whether a run succeeds. What was refused is logged as a warning, which
a command shows on standard error.
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
from multiprocessing.util import Finalize
from pathlib import Path

from platformdirs import user_cache_path

VARIABLE = "HENON_REF_CACHE_DIR"
"""Environment variable of the folder; without it, it is ``henon_ref`` in the user's cache (``XDG_CACHE_HOME``)."""
OBJECTS = "objects"
"""Folder in it of modules' machine code."""
PRIVATE = 0o700
"""Mode of folders that are made here."""
LONGEST_NAME = 500
"""Characters of a path in a message."""
_PROBE = 4096
"""Bytes that must find room in the folder."""
_NOWHERE = Path(os.devnull, "henon_ref")
"""A folder that cannot be: nothing is found in it, nothing is kept."""
_LOG = logging.getLogger(__name__)


def cache_root() -> Path:
    """Folder of what is compiled: ``HENON_REF_CACHE_DIR``, or the user's cache; where refused, a temporary one.

    The variable then leads to that one, so that processes begun from here on use it, too.
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
        "cache folder %s is not used: %s; compiled code %s (mend that, or name another by %s or XDG_CACHE_HOME)",
        *(_named(wanted), reason, where, VARIABLE),
    )
    return instead


def _refused(wanted: Path, folder: Path) -> str | None:
    """Why a folder is not used, in words; it is made where it is missing.

    ``folder`` is where the ``wanted`` one is, links followed.
    """
    try:
        reason = _link_of_another(wanted)
        if reason is None:
            folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
            reason = _open_to_others(wanted, folder)
        if reason is None:
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(bytes(_PROBE))
    except FileExistsError:
        return "it is not a folder"
    except OSError as error:
        return f"it cannot be written ({error.strerror or error})"
    return reason


def _link_of_another(wanted: Path) -> str | None:
    if sys.platform != "win32" and wanted.is_symlink() and wanted.lstat().st_uid not in (0, os.geteuid()):
        return "it is a link of another user"
    return None


def _open_to_others(wanted: Path, folder: Path) -> str | None:
    """How another user could put files into a folder, in words; None where nobody can."""
    if sys.platform == "win32":
        return None
    for above in (*wanted.absolute().parents, *folder.parents):
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"others can write to {_named(above)}"
    if found := foreign(folder.lstat()):
        return found
    with suppress(FileNotFoundError):  # it is not there yet
        status = (folder / OBJECTS).lstat()
        found = foreign(status) if stat.S_ISDIR(status.st_mode) else "it is not a folder"
        if found:
            return f"{found}: {OBJECTS!r}"
    return None


def foreign(status: os.stat_result) -> str | None:
    """Why what has this status may hold what another user has written, in words; None where it cannot."""
    if sys.platform == "win32":
        return None
    if status.st_uid != os.geteuid():
        return "it belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others can write to it (mode {stat.S_IMODE(status.st_mode):04o})"
    return None


def _temporary_folder() -> Path:
    """A private folder that is removed when this process ends."""
    try:
        made = Path(tempfile.mkdtemp(prefix="henon_ref-"))
    except OSError:
        return _NOWHERE
    if _refused(made, made) is not None:
        shutil.rmtree(made, ignore_errors=True)
        return _NOWHERE
    # Unlike atexit's, these calls are made at the end of multiprocessing's processes, too, and not by a fork's.
    Finalize(None, shutil.rmtree, (made,), {"ignore_errors": True}, exitpriority=0)
    return made


def _named(path: Path) -> str:
    """A path as printable text, its middle left out where it is long."""
    text = repr(str(path))
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME // 2]}...{text[-LONGEST_NAME // 2 :]}"
