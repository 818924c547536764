"""The log of what nobody foresaw: traceback, arguments, versions, in a folder of the user's own."""

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
    """The file with an error of a command, for the user alone; None where not even a temporary folder takes it."""
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
    """The user's folder of logs, made if it is not there; an OSError where others can write into it."""
    folder = platformdirs.user_log_path("henon_ref")
    if not folder.is_absolute():
        raise NotADirectoryError(f"{folder}: there is no home")
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    found = os.lstat(folder)
    own = not hasattr(os, "geteuid") or found.st_uid == os.geteuid()
    if not (own and stat.S_ISDIR(found.st_mode)) or (os.name == "posix" and found.st_mode & 0o022):
        raise PermissionError(f"{folder}: others can write into it")
    return folder


def _temporary_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="henon_ref."))


def _text(error: BaseException, name: str, arguments: Sequence[str]) -> str:
    return "\n".join(
        [
            f"python -m henon_ref.{name} {shlex.join(map(str, arguments))}",
            f"in {os.environ.get('PWD', 'a folder that is not known')}",
            f"{platform.python_implementation()} {sys.version}, {platform.platform()}",
            "",
            "".join(traceback.format_exception(error)),
            *_packages(),
            "",
        ]
    )


def _packages() -> list[str]:
    """Everything that is installed, with versions."""
    try:
        return sorted({f"{found.name} {found.version}" for found in metadata.distributions()})
    except Exception as error:  # noqa: BLE001 - whatever is broken there, the traceback is what matters
        return [f"the packages cannot be listed: {type(error).__name__}"]
