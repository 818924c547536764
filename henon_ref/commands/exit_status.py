"""Exit statuses of all commands of this package, and one message for every error.

0: done. 1: a requirement is not met (a gate, a required solver, a check). 2: a bad case file, argument or folder.
3: an unforeseen error, with the path of a log that has the traceback, the arguments and the versions. 130: interrupted.
A closed standard stream, or one whose reader has ended, is not an error; a full disk of the standard output is (2).
"""

from __future__ import annotations

import errno
import logging
import os
import platform
import shlex
import signal
import stat
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

import typer

from henon_ref.commands import status_line
from henon_ref.errors import CaseError, HenonRefError
from henon_ref.text import message

DONE, NOT_MET, BAD, UNFORESEEN, INTERRUPTED = 0, 1, 2, 3, 130
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG)
"""Error numbers of a disk on which nothing can be written."""
USAGE_ERROR: Any = typer.BadParameter.__base__
"""Base class of typer's errors for wrong arguments; typer exports only one subclass."""


def exit_status(act: Callable[[], int], *, name: str, arguments: Sequence[str] | None, kept: str = "") -> int:
    """Run a command and return its exit status: that which ``act`` returns, if there is no error.

    ``name`` and ``arguments`` (None: those of the process) are written to the log. ``kept`` is added to the message of
    an interruption or a crash: results that are kept.
    """
    with _output():
        try:
            signal.signal(signal.SIGTERM, _terminate)
            status = act()
            sys.stdout.flush()
            if (lost := getattr(sys.stdout, "lost", None)) is not None:
                raise CaseError(f"cannot write the standard output: {lost.strerror}")
            return status
        except HenonRefError as error:
            say(f"error: {error}")
            return BAD
        except USAGE_ERROR as error:
            say(f"error: {error.format_message()} (see --help)")
            return BAD
        except (KeyboardInterrupt, typer.Abort):
            say("; ".join(part for part in ("interrupted", kept) if part))
            return INTERRUPTED
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the one place that reports unforeseen errors
            log = write_log(error, name, sys.argv[1:] if arguments is None else arguments)
            what = message("".join(traceback.format_exception_only(error)))
            where = f"the log is {log}" if log else "no log can be written"
            say("; ".join(part for part in (f"error: unforeseen: {what}", kept, where) if part))
            return UNFORESEEN


def write_log(error: BaseException, name: str, arguments: Sequence[str]) -> Path | None:
    """Write an error of a command to a file readable by the user alone; return its path, or None if this fails."""
    import tempfile  # imported late, like the other modules that only a log needs, for a fast start

    text = _text(error, name, arguments).encode(errors="backslashreplace")
    for folder in (_users_folder, lambda: tempfile.mkdtemp(prefix="henon_ref.")):
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
    import platformdirs

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
    from importlib import metadata

    try:
        return sorted({f"{found.name} {found.version}" for found in metadata.distributions()})
    except Exception as error:  # noqa: BLE001 - the traceback matters more than a broken package
        return [f"the packages cannot be listed: {type(error).__name__}"]


def parsed(app: Callable[..., Any], arguments: Sequence[str] | None, *, name: str = "", obj: Any = None) -> Any:
    """Run a typer application and return the value of its function, or a status if help was requested.

    ``arguments`` default to those of the process; the usage shows the subcommand, and the function finds ``obj`` in its
    context. Exceptions that typer would turn into a status propagate: KeyboardInterrupt, EOFError, BrokenPipeError.
    """
    try:
        result = app(arguments, prog_name=f"henon-ref {name}".strip(), standalone_mode=False, obj=obj)
    except (typer.Abort, SystemExit) as error:
        if isinstance(cause := error.__context__, EOFError | BrokenPipeError):
            raise cause from cause.__cause__
        raise
    if type(result) is int and result == INTERRUPTED:
        raise KeyboardInterrupt
    return DONE if result is None else result


def command_of(app: Callable[..., Any], name: str, *, kept: str = "") -> Callable[..., int]:
    """Return the subcommand of a typer application: a function of its arguments that returns the exit status.

    ``kept``: what an interrupt leaves, for its message. The function's ``obj`` is passed to the application's context.
    """

    def command(arguments: Sequence[str] | None = None, *, obj: Any = None) -> int:
        def act() -> int:
            return int(parsed(app, arguments, name=name, obj=obj))

        return exit_status(act, name=name, arguments=arguments, kept=kept)

    return command


@contextmanager
def writing_into(folder: Path, *, kept: str = "") -> Iterator[None]:
    """Convert an OSError in the folder that a command writes to into a CaseError, since the folder is an argument."""
    try:
        yield
    except OSError as error:
        place = error.filename if isinstance(error.filename, str) else None
        inside = place is not None and Path(place).absolute().is_relative_to(folder.absolute())
        if not inside and error.errno not in FULL:
            raise
        reason = f"cannot write{f' {place}' if place else ''}: {error.strerror or error}"
        raise CaseError("; ".join(part for part in (reason, kept) if part)) from error


def say(words: str) -> None:
    """Print one line on standard error."""
    status_line.clear()
    print(message(words), file=sys.stderr)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


class _Stream:
    """Standard stream that may be closed: once it is, further output is dropped."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.lost: OSError | None = None
        """Error of output that is lost because the disk is full."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:  # a character that this terminal does not have
            encoding = self._stream.encoding or "ascii"
            self.write(text.encode(encoding, errors="backslashreplace").decode(encoding))
        except (OSError, ValueError) as error:
            self._drop(error)
        return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except (OSError, ValueError) as error:
            self._drop(error)

    def _drop(self, error: Exception) -> None:
        """Redirect further output, including that flushed at exit, to the null device."""
        if isinstance(error, OSError) and error.errno in FULL:
            self.lost = error
        with suppress(OSError, ValueError), Path(os.devnull).open("w") as nothing:
            os.dup2(nothing.fileno(), self._stream.fileno())


class _Shown(logging.Handler):
    """Shows warnings of the package like other messages of the command."""

    def emit(self, record: logging.LogRecord) -> None:
        say(record.getMessage())


@contextmanager
def _output() -> Iterator[None]:
    """Replace the standard streams by streams that can always be written to, and show logged warnings."""
    before, handler = (sys.stdout, sys.stderr), _Shown(logging.WARNING)
    # If the shell has closed one, the next opened file would get its number, and with it output of libraries.
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout, sys.stderr = (
        _Stream(stream or Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - as long as the command
        for stream in before
    )
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before
