"""The gate: a case's bounds for its solvers, solvers that are required to be right, and regressions of earlier rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import Case
from henon_ref.harness.rows import Key, RunRow
from henon_ref.harness.score.reference import HALF_ULP

LOST = 0.5
"""Digits of time accuracy that a row may lose."""
_RANKS = {
    **dict.fromkeys(("ok", "wrong", "diverged", "nonunique", "invalid"), 1),
    **dict.fromkeys(("timeout", "failed"), 2),
    **dict.fromkeys(("unsupported", "unavailable"), 3),
}
"""Rank of rows that are not right, by status: another result, no result, not run. Right rows have rank 0."""
_RANK_NAMES = ("right", "not right", "without a result", "not run")


@dataclass(frozen=True)
class Bounds:
    """Bounds that the gate of a case sets for one solver on one reading."""

    case: str
    reading: str
    solver: str
    rtol: float
    """Relative tolerance of the run that the bounds apply to; for a fixed-step solver the smallest step counts."""
    status: str
    max_time_error: float | None = None
    """[s]."""
    max_stick_error: float | None = None
    """[s]."""

    @property
    def count(self) -> int:
        """Number of bounds: the status, and every error bound."""
        return 1 + (self.max_time_error is not None) + (self.max_stick_error is not None)

    def unmet(self, row: RunRow) -> list[str]:
        """Return one sentence for each bound that a run does not meet."""
        found: list[str] = []
        if row.undecided_after_s is not None and row.verdict == "not judged":
            found.append(f"decided until t = {row.undecided_after_s} s only: {row.verdict_basis}")
        if row.status != self.status:
            found.append(f"status {row.status_text}, wanted {self.status}")
        for name, value, bound in (
            ("worst time error", row.max_time_error_s, self.max_time_error),
            ("worst stick error", row.max_stick_error_s, self.max_stick_error),
        ):
            if bound is None or (value is not None and value <= bound):
                continue
            if value is not None:
                found.append(f"{name} {value:.3g} s, wanted <= {bound:g} s")
            elif row.reference_transitions == 0:
                found.append(f"{name} <= {bound:g} s bounds nothing: the exact run has no transition")
            else:
                found.append(f"{name} unknown, wanted <= {bound:g} s")
        return found


def bounds_of(case: Case) -> list[Bounds]:
    """Bounds of all readings; without a tolerance of their own they apply to the reading's smallest tolerance."""
    return [
        Bounds(
            case.name,
            reading.name,
            solver,
            min(reading.tolerances) if gate.at is None else gate.at,
            gate.status or "ok",
            gate.max_time_error,
            gate.max_stick_error,
        )
        for reading in case.readings
        for solver, gate in reading.gate.items()
    ]


@dataclass(frozen=True)
class Gate:
    """Result of checking bounds."""

    total: int = 0
    checked: int = 0
    """Number of bounds on runs that were made."""
    left_out: tuple[tuple[str, float | None], ...] = ()
    """Solver and tolerance of the bounds that were not checked (tolerance None: the solver did not run)."""
    unmet: tuple[tuple[RunRow, str], ...] = ()
    """Run and sentence of each unmet bound."""

    @property
    def missing(self) -> bool:
        """Whether bounds exist but none was checked."""
        return self.total > 0 and not self.checked

    def __add__(self, other: Gate) -> Gate:
        return Gate(
            self.total + other.total,
            self.checked + other.checked,
            tuple(dict.fromkeys(self.left_out + other.left_out)),
            self.unmet + other.unmet,
        )


def gate(bounds: Iterable[Bounds], rows: Sequence[RunRow]) -> Gate:
    """Check runs against bounds; bounds on missing runs are recorded in ``left_out``."""
    found = Gate()
    for own in bounds:
        ran = [row for row in rows if (*row.problem, row.solver) == (own.case, own.reading, own.solver)]
        spoken_of = [row for row in ran if row.rtol in (None, own.rtol)]
        if spoken_of:
            row = min(spoken_of, key=lambda row: row.size)
            unmet = tuple((row, f"{own.reading}: {row.label}: {words}") for words in own.unmet(row))
            found += Gate(own.count, own.count, unmet=unmet)
        else:
            found += Gate(own.count, left_out=((own.solver, own.rtol if ran else None),))
    return found


@dataclass(frozen=True)
class Demand:
    """Result for a solver that is required to be right wherever double precision decides."""

    right: int = 0
    """Number of readings in which the solver is right."""
    judged: int = 0
    """Number of readings in which it is right, or wrong by its own fault."""
    failures: tuple[str, ...] = ()
    """One sentence for each reading in which it is wrong by its own fault or is not available."""
    known: int = 0
    """Number of readings with an expected failure; they are not judged."""

    def __add__(self, other: Demand) -> Demand:
        return Demand(
            self.right + other.right,
            self.judged + other.judged,
            self.failures + other.failures,
            self.known + other.known,
        )

    def unmet(self, solver: str) -> tuple[str, ...]:
        """Return the failures of a solver, or one sentence if no reading could be judged."""
        judged = self.judged or self.known
        return self.failures or (() if judged else (f"there is no reading in which {solver} can be judged",))


def demand(solver: str, rows: Sequence[RunRow], known: Callable[[RunRow], bool] = lambda row: False) -> Demand:
    """Check whether a solver is right in every reading, at its tightest setting.

    Readings that the solver does not support, and results that are ill-conditioned, not unique or not judged, do not
    count; nor does a failure for which ``known`` is true (see
    :class:`henon_ref.harness.score.row_result.KnownFailure`).
    """
    found = Demand()
    by_reading: dict[tuple[str, str], list[RunRow]] = {}
    for row in rows:
        if row.solver == solver:
            by_reading.setdefault(row.problem, []).append(row)
    for own in by_reading.values():
        row = min(own, key=lambda row: row.size)
        failure = f"{row.name}: {row.status_text}"
        defect = row.repeated or row.verdict == "solver defect"  # repeated: right, then a crash or a missed deadline
        if (defect or row.status == "unavailable") and known(row):
            found += Demand(known=1)
        elif row.status == "unavailable":
            found += Demand(failures=(failure,))
        elif defect:
            found += Demand(judged=1, failures=(failure,))
        elif row.verdict == "right":
            found += Demand(right=1, judged=1)
    return found


@dataclass(frozen=True)
class Regression:
    """Comparison with earlier rows."""

    compared: int
    """Number of rows in both sets."""
    worse: dict[Key, str]
    """Key of each row that got worse, with a description."""
    missing: tuple[RunRow, ...]
    """Earlier rows without a present one."""


def held_against(rows: Iterable[RunRow], earlier: Iterable[RunRow]) -> Regression:
    """Compare rows with earlier rows of the same case, reading, solver, tolerance and step.

    Only the key, ``status`` and ``max_time_error_s`` of the earlier rows are used.
    """
    before = {row.key: row for row in earlier}
    now = {row.key: row for row in rows}
    both = [key for key in now if key in before]
    changes = {key: _change(before[key], now[key]) for key in both}
    return Regression(
        compared=len(both),
        worse={key: words for key, words in changes.items() if words},
        missing=tuple(row for key, row in before.items() if key not in now),
    )


def _change(before: RunRow, now: RunRow) -> str:
    """Describe how a row got worse; empty if it did not."""
    ranks = _rank(before), _rank(now)
    if ranks[1] > ranks[0]:
        return f"was {_state(before, ranks[0])}, is {_state(now, ranks[1])}"
    if ranks != (0, 0):  # the course of a wrong run depends on rounding, so its errors are not compared
        return ""
    was, now_is = before.max_time_error_s, now.max_time_error_s
    if was is None or now_is is None:
        return ""
    least = max(_floor(before), _floor(now))
    fewer = math.log10(max(now_is, least) / max(was, least))
    if fewer <= LOST:
        return ""
    return f"worst time error was {was:.2g} s, is {now_is:.2g} s: {fewer:.2f} digits fewer, {LOST:g} are allowed"


def _rank(row: RunRow) -> int:
    if row.verdict == "right" or (row.verdict is None and row.status == "ok"):
        return 0
    return _RANKS[row.status]


def _state(row: RunRow, rank: int) -> str:
    return row.status_text if rank or row.status == "ok" else f"{row.status_text} and {_RANK_NAMES[0]}"


def _floor(row: RunRow) -> float:
    """Smallest measurable error [s]: the truth's radius, or half a unit in the last place of a time."""
    latest = max(abs(row.end_time_s or 0.0), row.time_unit_s or 1.0)
    return max(row.reference_radius_s or 0.0, HALF_ULP * latest)
