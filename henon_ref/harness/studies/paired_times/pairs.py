"""Pairs to be timed on one reading: by rows of runs, the cheapest settings of two solvers for the same digits."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from henon_ref.harness.campaign.settings import Setting
from henon_ref.harness.report.text.paired_times import FIRST
from henon_ref.harness.report.text.ranking import reaching
from henon_ref.harness.rows import RunRow

CANDIDATES = 3
"""Settings of a side that are timed: the cheapest by the rows. The cheapest in turn is among them, or next to it."""


@dataclass(frozen=True)
class Candidate:
    """A solver at a setting."""

    solver: str
    setting: Setting
    wall_s: float
    """Time of a run, by the rows [s]."""


@dataclass(frozen=True)
class Pair:
    """The reference against a rival, for the same digits."""

    digits: int | None
    """Digits that every setting of both reaches; None where there is no transition to time."""
    against: str
    """The other side: a solver's name, or that of a group whose cheapest is taken."""
    own: tuple[Candidate, ...]
    """Candidates for the reference's cheapest setting."""
    rival: tuple[Candidate, ...]
    """Candidates for the other side's."""


def pairs_of(rows: Sequence[RunRow], rivals: Mapping[str, Collection[str]], levels: Sequence[int]) -> Iterator[Pair]:
    """The pairs of one reading.

    Parameters
    ----------
    rows : sequence of RunRow
        The reading's.
    rivals : mapping of collections of str
        What each rival is, and the solvers that it is the cheapest of.
    levels : sequence of int
        Digits to be reached. Where there is no transition to time, right rows are set against each other once.
    """
    for level, able in able_rows(rows, levels):
        own = _cheapest(able, (FIRST,))
        for against, solvers in rivals.items():
            rival = _cheapest(able, solvers)
            if own and rival:
                yield Pair(level, against, own, rival)


def able_rows(rows: Sequence[RunRow], levels: Sequence[int]) -> Iterator[tuple[int | None, list[RunRow]]]:
    """Rows that reach so many digits; once, and with None, those that are right where there is no transition."""
    idle = [row for row in rows if row.verdict == "right" and row.reference_transitions == 0 and row.wall_s]
    if idle:
        yield None, idle
    else:
        yield from ((level, reaching(rows, level)) for level in levels)


def _wall(candidate: Candidate) -> float:
    return candidate.wall_s


def _cheapest(rows: Sequence[RunRow], solvers: Collection[str]) -> tuple[Candidate, ...]:
    timed = [
        Candidate(row.solver, Setting(row.rtol, row.atol, row.step_s), row.wall_s)
        for row in rows
        if row.solver in solvers and row.wall_s
    ]
    return tuple(sorted(timed, key=_wall)[:CANDIDATES])
