"""How every command of this package ends: its exit status, and one message for whatever goes wrong.

0 done; 1 what was asked for is not met (a gate, a required solver, a check); 2 a bad case file, argument or folder;
3 something unforeseen, with the path of a log; 130 interrupted. A standard stream that is closed, or whose reader
has gone, is no failure.
"""

from __future__ import annotations

import errno
import logging
import os
import signal
import sys
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
"""What a disk says on which nothing more can be written."""
USAGE_ERROR: Any = typer.BadParameter.__base__
"""What typer raises for a wrong argument; it exports this one class of them only."""


def exit_status(act: Callable[[], int], *, name: str, arguments: Sequence[str] | None, kept: str = "") -> int:
    """Do what a command does; its exit status.

    Parameters
    ----------
    act : callable
        Returns the exit status where nothing goes wrong.
    name : str
        The command's, for the log's name.
    arguments : sequence of str, optional
        What it was given, for the log; None: those of the process.
    kept : str
        What is said, where it is interrupted or breaks, of what is not lost.
    """
    with _standard_streams(), warnings_shown():
        try:
            signal.signal(signal.SIGTERM, _terminate)
            return act()
        except HenonRefError as error:
            say(f"error: {error}")
            return BAD
        except USAGE_ERROR as error:
            say(f"error: {error.format_message()} (see --help)")
            return BAD
        except (KeyboardInterrupt, typer.Abort):
            say("; ".join(part for part in ("interrupted", kept) if part))
            return INTERRUPTED
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the one place where what nobody foresaw is told
            from henon_ref.commands.crash_log import write_log

            log = write_log(error, name, sys.argv[1:] if arguments is None else arguments)
            what = message("".join(traceback.format_exception_only(error)))
            where = f"the log is {log}" if log else "no log can be written"
            say("; ".join(part for part in (f"error: unforeseen: {what}", kept, where) if part))
            return UNFORESEEN


def parsed(app: Callable[..., Any], arguments: Sequence[str] | None, *, name: str = "", obj: Any = None) -> Any:
    """What a typer application's function returns for these arguments; a status where it was help that was asked for.

    Without arguments they are those of the process; the usage names the subcommand, and the function finds ``obj`` in
    its context. A KeyboardInterrupt, which typer would turn into a status, is passed on.
    """
    result = app(arguments, prog_name=f"henon-ref {name}".strip(), standalone_mode=False, obj=obj)
    if type(result) is int and result == INTERRUPTED:
        raise KeyboardInterrupt
    return DONE if result is None else result


def command_of(app: Callable[..., Any], name: str) -> Callable[..., int]:
    """The subcommand that a typer application reads: a function of its arguments, or the process's; the exit status."""

    def command(arguments: Sequence[str] | None = None) -> int:
        return exit_status(lambda: int(parsed(app, arguments, name=name)), name=name, arguments=arguments)

    return command


@contextmanager
def writing_into(folder: Path, *, kept: str = "") -> Iterator[None]:
    """What goes wrong with the folder that a command was told to write into is a bad argument: a CaseError says so."""
    try:
        yield
    except OSError as error:
        place = error.filename if isinstance(error.filename, str) else None
        inside = place is not None and Path(place).absolute().is_relative_to(folder.absolute())
        if not inside and error.errno not in FULL:
            raise
        told = f"cannot write{f' {place}' if place else ''}: {error.strerror or error}"
        raise CaseError("; ".join(part for part in (told, kept) if part)) from error


def say(words: str) -> None:
    """One line on standard error."""
    status_line.clear()
    print(message(words), file=sys.stderr)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


class _Stream:
    """A standard stream that nobody need read: once it is found closed, what is written is dropped."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:  # a name that this terminal has no characters for
            encoding = self._stream.encoding or "ascii"
            self.write(text.encode(encoding, errors="backslashreplace").decode(encoding))
        except (OSError, ValueError):
            self._drop()
        return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except (OSError, ValueError):
            self._drop()

    def _drop(self) -> None:
        """Lead what is still to come into nothing, what is flushed at the exit of the process included."""
        with suppress(OSError, ValueError), Path(os.devnull).open("w") as nothing:
            os.dup2(nothing.fileno(), self._stream.fileno())


@contextmanager
def _standard_streams() -> Iterator[None]:
    """Standard streams that can always be written to."""
    before = sys.stdout, sys.stderr
    # Where the shell has closed one, the next file that is opened would take its number, and libraries' words.
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdout, sys.stderr = (
        _Stream(stream or Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - as long as the command
        for stream in before
    )
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


class _Shown(logging.Handler):
    """Shows the package's warnings as the command's other messages are."""

    def emit(self, record: logging.LogRecord) -> None:
        say(record.getMessage())


@contextmanager
def warnings_shown() -> Iterator[None]:
    """What is logged as a warning is told on standard error, a line each."""
    handler = _Shown(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)
