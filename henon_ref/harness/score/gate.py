"""The gate: bounds of a case, solvers that must be right, regressions of earlier rows, results for a test runner."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Literal, get_args

from henon_ref.casefile.case import Case
from henon_ref.harness.rows import NOT_RUN, UNDECIDED, Key, Row, RunRow
from henon_ref.harness.score.ranking import at_fault, tightest
from henon_ref.harness.score.reference import HALF_ULP
from henon_ref.text import did_you_mean, listed, shortened
from henon_ref.trajectory import Status


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
    """Return the bounds of all readings, by default for the smallest tolerance of the reading."""
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

    total: int
    checked: int
    """Number of bounds on runs that were made."""
    left_out: tuple[tuple[str, float | None], ...] = ()
    """Solver and tolerance of the bounds that were not checked (tolerance None: the solver did not run)."""
    unmet: tuple[tuple[RunRow, str], ...] = ()
    """Run and sentence of each unmet bound."""

    @property
    def missing(self) -> bool:
        """Whether bounds exist but none was checked."""
        return self.total > 0 and not self.checked


def gate(bounds: Iterable[Bounds], rows: Sequence[RunRow]) -> Gate:
    """Check runs against bounds; bounds on missing runs are recorded in ``left_out``."""
    total = checked = 0
    left_out: dict[tuple[str, float | None], None] = {}
    unmet: list[tuple[RunRow, str]] = []
    for own in bounds:
        total += own.count
        ran = [row for row in rows if (*row.problem, row.solver) == (own.case, own.reading, own.solver)]
        row = min((row for row in ran if row.rtol in (None, own.rtol)), key=lambda row: row.size, default=None)
        if row is None:
            left_out[own.solver, own.rtol if ran else None] = None
        else:
            checked += own.count
            unmet += [(row, f"{own.reading}: {row.label}: {words}") for words in own.unmet(row)]
    return Gate(total, checked, tuple(left_out), tuple(unmet))


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

    def unmet(self, solver: str) -> tuple[str, ...]:
        """Return the failures of a solver, or one sentence if no reading could be judged."""
        judged = self.judged or self.known
        return self.failures or (() if judged else (f"there is no reading in which {solver} can be judged",))


def demand(solver: str, rows: Iterable[RunRow], known: Callable[[RunRow], bool] = lambda row: False) -> Demand:
    """Check whether a solver is right in every reading, at its tightest setting.

    Readings that the solver does not support, and results that are ill-conditioned, not unique or not judged, do not
    count; nor does a failure for which ``known`` is true (see :class:`KnownFailure`).
    """
    rows = tightest(row for row in rows if row.solver == solver)
    failing = [row for row in rows if at_fault(row) or row.status == "unavailable"]
    unexpected = [row for row in failing if not known(row)]
    right = sum(row.verdict == "right" and not row.repeated for row in rows)
    return Demand(
        right,
        right + sum(row.status != "unavailable" for row in unexpected),
        tuple(f"{row.name}: {row.status_text}" for row in unexpected),
        len(failing) - len(unexpected),
    )


def held_against(rows: Iterable[RunRow], earlier: Iterable[RunRow]) -> tuple[dict[Key, str], list[RunRow]]:
    """Compare rows with earlier rows of the same case, reading, solver, tolerance and step.

    Only the key, ``status`` and ``max_time_error_s`` of the earlier rows are used. Return how each compared row got
    worse by its key (empty if it did not), and the earlier rows without a present one.
    """
    before, now = {row.key: row for row in earlier}, {row.key: row for row in rows}
    changes = {key: _change(before[key], row) for key, row in now.items() if key in before}
    return changes, [row for key, row in before.items() if key not in now]


def _change(before: RunRow, now: RunRow) -> str:
    """Describe how a row got worse; empty if it did not."""
    rank, new_rank = _rank(before), _rank(now)
    if new_rank > rank:
        right = " and right" if rank == 0 and before.status != "ok" else ""
        return f"was {before.status_text}{right}, is {now.status_text}"
    was, now_is = before.max_time_error_s, now.max_time_error_s
    if new_rank or rank or was is None or now_is is None:  # the errors of a wrong run depend on rounding
        return ""
    least = max(_floor(before), _floor(now))
    fewer = math.log10(max(now_is, least) / max(was, least))
    allowed = 0.5
    if fewer <= allowed:
        return ""
    return f"worst time error was {was:.2g} s, is {now_is:.2g} s: {fewer:.2f} digits fewer, {allowed:g} are allowed"


def _rank(row: RunRow) -> int:
    """Rank a row: right, another result, no result, not run."""
    if row.verdict == "right" or (row.verdict is None and row.status == "ok"):
        return 0
    return 3 if row.status in NOT_RUN else 2 if row.status in ("timeout", "failed") else 1


def _floor(row: RunRow) -> float:
    """Smallest measurable error [s]: the truth's radius, or half a unit in the last place of a time."""
    latest = max(abs(row.end_time_s or 0.0), row.time_unit_s or 1.0)
    return max(row.reference_radius_s or 0.0, HALF_ULP * latest)


@dataclass(frozen=True)
class KnownFailure(Row):
    """Rows that are expected to fail; a field that is None matches any value.

    ValueError if it would match every row, or if its status is not one with which a row fails.
    """

    case: str | None = None
    reading: str | None = None
    solver: str | None = None
    rtol: float | None = None
    step_s: float | None = None
    """Step [s]."""
    status: str | None = None
    reason: str | None = None
    """Why the failure is expected."""

    def __post_init__(self) -> None:
        if not (self.case or self.reading or self.solver):
            raise ValueError("the line would match every row: name a case, a reading or a solver")
        if self.status == "ok":
            raise ValueError("'ok' is no failure: leave the status empty, or give that of the failing rows")
        if self.status:
            check_status(self.status)

    @property
    def name(self) -> str:
        """Description in messages.

        >>> KnownFailure("two_roots", solver="ida", rtol=1e-3).name
        'case two_roots, solver ida, rtol 0.001'
        """
        given = [(own.name, getattr(self, own.name)) for own in fields(self) if own.name != "reason"]
        return ", ".join(f"{what} {value}" for what, value in given if value is not None)

    def names(self, row: RunRow) -> bool:
        """Whether the row matches, regardless of its status."""
        own = (self.case, self.reading, self.solver, self.rtol, self.step_s)
        return all(wanted in (None, value) for wanted, value in zip(own, row.key, strict=True))

    def covers(self, row: RunRow) -> bool:
        """Whether a failure of the row is the expected one."""
        return self.names(row) and self.status in (None, row.status)


def check_status(status: str) -> None:
    """Check that a text is a status of a row; raise ValueError if it is not."""
    statuses: tuple[str, ...] = get_args(Status)
    if status not in statuses:
        hint = did_you_mean(status, statuses)
        raise ValueError(f"{shortened(status)} is no status; there are {listed(statuses)}{hint}")


RowKind = Literal["passed", "failure", "error", "skipped", "known"]
"""Result of a row for a test runner; ``known``: it fails as expected."""


def row_result(row: RunRow, complaints: Collection[str] = (), *, known: bool = False) -> tuple[RowKind, str]:
    """Classify a row for a test runner; return the reason why it has not passed, too.

    Failure: it is wrong by its solver's fault, it ran out of time, or there are complaints. Error: it has no result (a
    crash, an exception, too much memory), or a repeated run ended differently. Skipped: it did not run, or double
    precision does not decide the right result. ``complaints``: further faults, such as unmet bounds or digits lost
    since an earlier run; ``known``: whether a failure of the row is expected.
    """
    kind: RowKind
    verdict = row.verdict
    judged = f"; verdict: {verdict}" if verdict is not None and row.status not in NOT_RUN else ""
    reasons = [*([] if verdict == "right" else [row.status_text + judged]), *complaints]
    if row.repeated:
        kind, reasons = "error", [row.status_text, *complaints]
    elif row.status == "failed" and row.found_transitions is None:
        kind = "error"
    elif complaints:
        kind = "failure"
    elif verdict == "right":
        kind = "passed"
    elif row.status in NOT_RUN or ((verdict in UNDECIDED or not row.judged) and row.status != "timeout"):
        kind = "skipped"
    else:
        kind = "failure"
    if known and kind != "passed":
        return "known", "fails as expected: " + "; ".join(reasons)
    return kind, "; ".join(reasons)
