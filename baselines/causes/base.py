"""What a cause is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial


class ClaimError(AssertionError):
    """A library does not behave as a cause claims."""


@dataclass(frozen=True)
class Cause:
    """One behaviour of one library."""

    name: str
    package: str
    """The distribution whose behaviour it is."""
    title: str
    claim: str
    """In a sentence or two: what the library does, and what follows from it."""
    check: Callable[[], str]
    """Runs the library; what was seen, in one sentence. Raises :class:`ClaimError` where it is not as claimed."""
    links: tuple[str, ...] = ()
    """Reports and documentation."""


def holds(condition: object, words: str) -> None:
    """Raise unless a condition holds.

    Raises
    ------
    ClaimError
    """
    if not condition:
        raise ClaimError(words)


def elsewhere(check: Callable[[], str]) -> Callable[[], str]:
    """The check in a process of its own: for a library whose threads a process that forks must not have, or that may
    end the process.

    Parameters
    ----------
    check : callable
        A function of a module, without arguments.
    """
    return partial(_elsewhere, check)


def _elsewhere(check: Callable[[], str]) -> str:
    from loky import ProcessPoolExecutor

    with ProcessPoolExecutor(1) as pool:
        return str(pool.submit(check).result())
