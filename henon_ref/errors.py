"""Every error this package raises on purpose: what is wrong, where, and the mend."""

from __future__ import annotations


class HenonRefError(Exception):
    """Base class of the errors of this package."""


class ExpressionError(HenonRefError):
    """An expression that the whitelist does not allow.

    Parameters
    ----------
    message : str
        What is wrong and what is allowed.
    offset : int
        0-based character offset in the expression at which it goes wrong.
    """

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset


class CaseError(HenonRefError):
    """A case file (or an argument) that cannot be used; printed as one line.

    Parameters
    ----------
    message : str
        What is wrong and what is allowed.
    file : str, optional
        The file it stands in.
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
    """An invalid argument of a function; the message names it and says what is allowed.

    Parameters
    ----------
    message : str
        What is longer than ``LONGEST`` characters is cut.
    """

    LONGEST = 390

    def __init__(self, message: str) -> None:
        super().__init__(message if len(message) <= self.LONGEST else message[: self.LONGEST - 4] + " ...")


class ModelError(HenonRefError):
    """A system that is well written but not one this package can simulate."""


class UnsupportedError(HenonRefError):
    """A solver cannot do what the problem asks; the message says why (status ``unsupported``)."""


class UnavailableError(HenonRefError):
    """A solver's library is not installed (status ``unavailable``)."""


class ContractError(HenonRefError):
    """A solver does not keep the contract; the message says where (status ``failed``)."""


class KernelError(HenonRefError):
    """A compiled library is missing, or not one of these sources; the message names the line that builds it anew."""
