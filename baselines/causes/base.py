"""What a cause is, and what their minimal programs have in common."""

from __future__ import annotations

import inspect
import subprocess
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

PROGRAMS = Path(__file__).parent / "programs"
"""Folder of the programs in other languages."""
SECONDS = 300.0
"""Wall time of one [s]."""
Check = Callable[[], str]


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
    check: Check
    """Runs the library; what was seen, in one sentence. Raises :class:`ClaimError` where it is not as claimed."""
    links: tuple[str, ...] = ()
    """Reports and documentation."""


CAUSES: dict[str, Cause] = {}
"""Causes by name."""


def cause(
    package: str, name: str, title: str, *links: str, docs: str = "", apart: bool = False
) -> Callable[[Check], Check]:
    """Make a cause of a program: the first paragraph of its docstring is the claim, the rest the problem that shows it.

    ``docs``: a page that all causes of a library link to. ``apart``: the program runs in a process of its own, for a
    library whose threads a process that forks must not have.
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
    """Raise unless a condition holds.

    Raises
    ------
    ClaimError
    """
    if not condition:
        raise ClaimError(words)


def said(run: Callable[[], object]) -> str:
    """What the exception of a run says; empty where it ends."""
    try:
        run()
    except (RuntimeError, ValueError) as error:
        return str(error)
    return ""


class Printed(dict[str, list[list[float]]]):
    """What a program printed: name -> the numbers of each of its lines."""

    def __missing__(self, name: str) -> list[list[float]]:
        raise ClaimError(f"the program has printed no '{name}'")


def printed(command: Sequence[str], environment: dict[str, str] | None = None) -> Printed:
    """Run a program whose lines are a name and numbers; the library's own words between them are left out.

    Raises
    ------
    ClaimError
        If it cannot be run.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False, env=environment)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ClaimError(f"{command[0]}: {error}") from error
    found = Printed()
    for name, *numbers in (line.split() for line in done.stdout.splitlines() if line.strip()):
        try:
            found.setdefault(name, []).append([float(number) for number in numbers])
        except ValueError:
            continue
    return found
