"""The gate: bounds that a case sets its solvers, solvers of which it is demanded that they are right, earlier rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import Case
from henon_ref.harness.rows import Key, RunRow
from henon_ref.harness.score.reference import HALF_ULP

LOST = 0.5
"""Digits that a row may lose."""
_RANKS = {
    **dict.fromkeys(("ok", "wrong", "diverged", "nonunique", "invalid"), 1),
    **dict.fromkeys(("timeout", "failed"), 2),
    **dict.fromkeys(("unsupported", "unavailable"), 3),
}
"""Statuses of rows that are not right, by how little is left: another result, none, no run. A right row has rank 0."""
_RANK_NAMES = ("right", "not right", "without a result", "not run")


@dataclass(frozen=True)
class Bounds:
    """What the gate of a case asks of one solver on one reading."""

    case: str
    reading: str
    solver: str
    rtol: float
    """Tolerance of the run that they speak of; of a solver that is driven by a step it is the one with the smallest."""
    status: str
    max_time_error: float | None = None
    """[s]."""
    max_stick_error: float | None = None
    """[s]."""

    @property
    def count(self) -> int:
        """How many bounds there are: the status, and every largest error."""
        return 1 + (self.max_time_error is not None) + (self.max_stick_error is not None)

    def unmet(self, row: RunRow) -> list[str]:
        """A sentence for each that a run does not meet."""
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
    """The bounds of all readings; those without a tolerance of their own are at the tightest of the reading."""
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
    """What became of bounds."""

    total: int = 0
    checked: int = 0
    """Bounds on a run that was made."""
    left_out: tuple[tuple[str, float | None], ...] = ()
    """What the others are on: a solver, and the tolerance that did not run (None: the solver did not)."""
    unmet: tuple[tuple[RunRow, str], ...] = ()
    """A sentence for each bound that is not met, with its run."""

    @property
    def missing(self) -> bool:
        """There are bounds, and none of them was checked."""
        return self.total > 0 and not self.checked

    def __add__(self, other: Gate) -> Gate:
        return Gate(
            self.total + other.total,
            self.checked + other.checked,
            tuple(dict.fromkeys(self.left_out + other.left_out)),
            self.unmet + other.unmet,
        )


def gate(bounds: Iterable[Bounds], rows: Sequence[RunRow]) -> Gate:
    """Hold runs against bounds; those on what did not run are left out."""
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
    """What became of a solver that has to be right wherever double precision decides."""

    right: int = 0
    """Readings in which it is right."""
    judged: int = 0
    """Those and the ones in which it is wrong by its own fault."""
    failures: tuple[str, ...] = ()
    """A sentence for each in which it is not right by its own fault, or could not be run."""
    known: int = 0
    """Readings in which it fails as expected; they are not judged."""

    def __add__(self, other: Demand) -> Demand:
        return Demand(
            self.right + other.right,
            self.judged + other.judged,
            self.failures + other.failures,
            self.known + other.known,
        )

    def unmet(self, solver: str) -> tuple[str, ...]:
        """The failures of a solver; where it was judged nowhere, that."""
        judged = self.judged or self.known
        return self.failures or (() if judged else (f"there is no reading in which {solver} can be judged",))


def demand(solver: str, rows: Sequence[RunRow], known: Callable[[RunRow], bool] = lambda row: False) -> Demand:
    """Whether a solver is right in every reading, at its tightest setting.

    What it does not support, and what is ill-conditioned, not unique or out of time by its own word, is not judged;
    nor is a failure that is ``known`` (expected, see :class:`henon_ref.harness.score.row_result.KnownFailure`).
    """
    found = Demand()
    by_reading: dict[tuple[str, str], list[RunRow]] = {}
    for row in rows:
        if row.solver == solver:
            by_reading.setdefault(row.problem, []).append(row)
    for own in by_reading.values():
        row = min(own, key=lambda row: row.size)
        failure = f"{row.name}: {row.status_text}"
        defect = row.repeated or row.verdict == "solver defect"  # right once, and then a crash, or a deadline ignored
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
    """What became of earlier rows."""

    compared: int
    """Rows that there are now and were there earlier."""
    worse: dict[Key, str]
    """Rows that got worse, and in what."""
    missing: tuple[RunRow, ...]
    """Earlier rows that are not among those of now."""


def held_against(rows: Iterable[RunRow], earlier: Iterable[RunRow]) -> Regression:
    """Hold rows against earlier ones of the same case, reading, solver, tolerance and step.

    Of these only the key, ``status`` and ``max_time_error_s`` are needed.
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
    """In what a row got worse; empty where it did not."""
    ranks = _rank(before), _rank(now)
    if ranks[1] > ranks[0]:
        return f"was {_state(before, ranks[0])}, is {_state(now, ranks[1])}"
    if ranks != (0, 0):  # once a run has gone wrong, the last bit decides where it goes
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
    """The least error that is told apart from none [s]: the truth's radius, or half a unit in a time's last place."""
    latest = max(abs(row.end_time_s or 0.0), row.time_unit_s or 1.0)
    return max(row.reference_radius_s or 0.0, HALF_ULP * latest)
