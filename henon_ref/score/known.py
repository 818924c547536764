"""Failures that are expected: which rows they are, and what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from henon_ref.rows import RunRow


@dataclass(frozen=True)
class KnownFailure:
    """Rows that are expected to fail; None stands for any."""

    case: str | None = None
    reading: str | None = None
    solver: str | None = None
    rtol: float | None = None
    """Relative tolerance."""
    step_s: float | None = None
    """Step [s]."""
    status: str | None = None
    """The status with which they fail."""
    reason: str = ""
    """Why that is expected."""
    place: str = ""
    """File and line."""

    def names(self, row: RunRow) -> bool:
        """Whether it speaks of a row, whatever that row's status."""
        own = (self.case, self.reading, self.solver, self.rtol, self.step_s)
        return all(wanted in (None, value) for wanted, value in zip(own, row.key, strict=True))

    def covers(self, row: RunRow) -> bool:
        """Whether a failure of this row is the one that is expected."""
        return self.names(row) and self.status in (None, row.status)


@dataclass(frozen=True)
class Found:
    """What became of one that was expected."""

    entry: KnownFailure
    failing: list[RunRow]
    """Rows that fail as expected."""
    named: bool
    """There are rows of which it speaks."""
    mended: bool
    """There are, and none of them fails in any way."""


def fails(row: RunRow) -> bool:
    """Whether a row is not right, or was right once and failed when it was repeated."""
    return row.verdict != "right" or row.repeated


def found(entries: Iterable[KnownFailure], rows: Iterable[RunRow], failing: Callable[[RunRow], bool]) -> list[Found]:
    """What became of failures that were expected.

    Parameters
    ----------
    entries : iterable of KnownFailure
    rows : iterable of RunRow
        All that were run.
    failing : callable
        Whether something is wrong with a row.
    """
    rows = list(rows)
    states = []
    for entry in entries:
        own = [row for row in rows if entry.names(row)]
        bad = [row for row in own if failing(row)]
        expected = [row for row in bad if entry.covers(row)]
        states.append(Found(entry, expected, bool(own), mended=bool(own) and not bad))
    return states
