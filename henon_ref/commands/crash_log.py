"""Log of an unforeseen error: traceback, arguments, versions, in a folder of the user."""

from __future__ import annotations

import os
import platform
import shlex
import stat
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import platformdirs


def write_log(error: BaseException, name: str, arguments: Sequence[str]) -> Path | None:
    """Write an error of a command to a file readable by the user alone; return its path, or None if this fails."""
    text = _text(error, name, arguments).encode(errors="backslashreplace")
    for folder in (_users_folder, _temporary_folder):
        try:
            handle, path = tempfile.mkstemp(dir=folder(), prefix=time.strftime(f"{name}-%Y%m%d-%H%M%S-"), suffix=".log")
            with os.fdopen(handle, "wb") as file:
                file.write(text)
        except OSError:
            continue
        return Path(path)
    return None


def _users_folder() -> Path:
    """Return the user's log folder, created if necessary; OSError if other users can write to it."""
    folder = platformdirs.user_log_path("henon_ref")
    if not folder.is_absolute():
        raise NotADirectoryError(f"{folder}: there is no home folder")
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    found = os.lstat(folder)
    own = not hasattr(os, "geteuid") or found.st_uid == os.geteuid()
    if not (own and stat.S_ISDIR(found.st_mode)) or (os.name == "posix" and found.st_mode & 0o022):
        raise PermissionError(f"{folder}: other users can write to it")
    return folder


def _temporary_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="henon_ref."))


def _text(error: BaseException, name: str, arguments: Sequence[str]) -> str:
    return "\n".join(
        [
            f"python -m henon_ref.{name} {shlex.join(map(str, arguments))}",
            f"in {os.environ.get('PWD', 'an unknown folder')}",
            f"{platform.python_implementation()} {sys.version}, {platform.platform()}",
            "",
            "".join(traceback.format_exception(error)),
            *_packages(),
            "",
        ]
    )


def _packages() -> list[str]:
    try:
        return sorted({f"{found.name} {found.version}" for found in metadata.distributions()})
    except Exception as error:  # noqa: BLE001 - the traceback matters more than a broken package
        return [f"the packages cannot be listed: {type(error).__name__}"]
