"""Errors that this package raises on purpose: each names the problem, its place, and the remedy."""

from __future__ import annotations


class HenonRefError(Exception):
    """Base class of the errors of this package."""


class ExpressionError(HenonRefError):
    """Expression that the whitelist does not allow, with the 0-based character offset of the problem in it."""

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset


class CaseError(HenonRefError):
    """Case file or argument that cannot be used; printed as one line.

    Parameters
    ----------
    message : str
        The problem and what is allowed.
    file : str, optional
        The file with the problem.
    line, column : int, optional
        1-based place in the file.
    """

    def __init__(
        self, message: str, *, file: str | None = None, line: int | None = None, column: int | None = None
    ) -> None:
        self.message = message
        self.file = file
        self.line = line
        self.column = column
        place = ":".join(str(part) for part in (file, line, column) if part is not None)
        super().__init__(f"{place}: {message}" if place else message)


class ArgumentError(HenonRefError, ValueError):
    """Invalid argument of a function; the message names it and the allowed values.

    Parameters
    ----------
    message : str
        Put on one line, since it may show a value such as an array, and cut to ``LONGEST`` characters.
    """

    LONGEST = 390

    def __init__(self, message: str) -> None:
        line = " ".join(message.split())
        super().__init__(line if len(line) <= self.LONGEST else line[: self.LONGEST - 4] + " ...")


class ModelError(HenonRefError):
    """Well-formed system that this package cannot simulate."""


class UnsupportedError(HenonRefError):
    """The problem requires a feature that a solver lacks; the message names the reason (status ``unsupported``)."""


class UnavailableError(HenonRefError):
    """The library of a solver is not installed (status ``unavailable``)."""


class ContractError(HenonRefError):
    """A solver violates the contract; the message names the place (status ``failed``)."""


class DeadlineError(ContractError):
    """A solver ignores its deadline and is stopped from outside (status ``timeout``)."""


class KernelError(HenonRefError):
    """A compiled library is missing or of other sources; the message names the command that builds it."""
