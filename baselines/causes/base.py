"""Definition of a cause, and functions that the minimal programs share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

Check = Callable[[], str]


class ClaimError(AssertionError):
    """A library does not behave as a cause claims."""


@dataclass(frozen=True)
class Cause:
    """A behaviour of a library that makes runs fail."""

    name: str
    package: str
    """Distribution of the library."""
    title: str
    claim: str
    """One or two sentences on the behaviour and its consequence."""
    check: Check
    """Run the library and return one sentence on the result; raise :class:`ClaimError` if it contradicts the claim."""
    links: tuple[str, ...] = ()
    """Issues and documentation."""


CAUSES: dict[str, Cause] = {}
"""All causes by name."""


def cause(
    package: str, name: str, title: str, *links: str, docs: str = "", apart: bool = False
) -> Callable[[Check], Check]:
    """Return a decorator that registers a check as a cause; the first paragraph of its docstring is the claim.

    ``docs`` is a page to which all causes of a library link. With ``apart`` the check runs in a new process, for a
    library that starts threads, because this process may fork later.
    """

    def made(check: Check) -> Check:
        claim = " ".join((inspect.getdoc(check) or "").partition("\n\n")[0].split())
        every = (docs, *links) if docs else links
        CAUSES[name] = Cause(name, package, title, claim, partial(_in_own_process, check) if apart else check, every)
        return check

    return made


def _in_own_process(check: Check) -> str:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return str(pool.submit(check).result())


def holds(condition: object, words: str) -> None:
    """Raise :class:`ClaimError` with a message if a condition is false."""
    if not condition:
        raise ClaimError(words)


def error_message(run: Callable[[], object]) -> str:
    """Return the message of the exception that a run raises; empty if it raises none."""
    try:
        run()
    except (RuntimeError, ValueError) as error:
        return str(error)
    return ""
