"""The gate: bounds that a case sets its solvers; and solvers of which it is demanded that they are right."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from henon_ref.casefile.case import Gate, Reading
from henon_ref.rows import RunRow


class LeftOut(NamedTuple):
    """What a gate sets bounds to, and no run was made of."""

    solver: str
    rtol: float | None
    """The tolerance that did not run; None: the solver did not."""


@dataclass(frozen=True)
class Tally:
    """How many bounds there are, and how many of them were checked."""

    total: int = 0
    """Bounds of the gate: for each solver the status wanted and every largest error."""
    checked: int = 0
    """Those on a run that was made."""
    left_out: tuple[LeftOut, ...] = ()
    """What the bounds that were not checked are on."""

    @property
    def missing(self) -> bool:
        """There are bounds, and none of them was checked."""
        return self.total > 0 and not self.checked

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            self.total + other.total,
            self.checked + other.checked,
            tuple(dict.fromkeys(self.left_out + other.left_out)),
        )


def gate_tally(readings: Iterable[Reading], rows: Sequence[RunRow]) -> Tally:
    """The bounds of some readings' gates; one is checked where its solver ran that reading at its tolerance."""
    found = Tally()
    for reading in readings:
        own = [row for row in rows if row.reading == reading.name]
        for solver, gate in reading.gate.items():
            bounds = 1 + sum(bound is not None for bound in (gate.max_time_error, gate.max_stick_error))
            row, left_out = _row(solver, gate, reading, own)
            found += Tally(bounds, left_out=(left_out,)) if row is None else Tally(bounds, bounds)
    return found


def gate_failures(reading: Reading, rows: Sequence[RunRow]) -> list[str]:
    """One sentence for every bound of a reading's gate that is not met; what did not run is left out.

    Parameters
    ----------
    reading : Reading
    rows : sequence of RunRow
        The run rows of this reading.
    """
    return [words for _, words in unmet_bounds(reading, rows)]


def unmet_bounds(reading: Reading, rows: Sequence[RunRow]) -> list[tuple[RunRow, str]]:
    """The bounds of :func:`gate_failures`, each with the row that does not meet it."""
    failures: list[tuple[RunRow, str]] = []
    for solver, gate in reading.gate.items():
        row, _ = _row(solver, gate, reading, rows)
        if row is not None:
            where = f"{reading.name}: {row.label}"
            failures += [(row, f"{where}: {failure}") for failure in _broken(gate, row)]
    return failures


def _row(solver: str, gate: Gate, reading: Reading, rows: Sequence[RunRow]) -> tuple[RunRow | None, LeftOut]:
    """The row that a gate speaks of, and what is left out where there is none.

    It is the one at the gate's tolerance, or at the tightest of the case; of a solver that is driven by a step the one
    with the smallest.
    """
    own = [row for row in rows if row.solver == solver]
    if not own:
        return None, LeftOut(solver, None)
    rtol = min(reading.tolerances) if gate.at is None else gate.at
    spoken_of = [row for row in own if row.rtol is None or row.rtol == rtol]
    return min(spoken_of, key=lambda row: row.size, default=None), LeftOut(solver, rtol)


def _broken(gate: Gate, row: RunRow) -> list[str]:
    failures: list[str] = []
    until = row.undecided_after_s
    if until is not None and row.verdict == "not judged":
        failures.append(f"decided until t = {until} s only: {row.verdict_basis}")
    if row.status != gate.status:
        failures.append(f"status {row.status_text}, wanted {gate.status}")
    for name, value, bound in (
        ("worst time error", row.max_time_error_s, gate.max_time_error),
        ("worst stick error", row.max_stick_error_s, gate.max_stick_error),
    ):
        if bound is None:
            continue
        if value is None and row.reference_transitions == 0:
            failures.append(f"{name} <= {bound:g} s bounds nothing: the exact run has no transition")
        elif value is None:
            failures.append(f"{name} unknown, wanted <= {bound:g} s")
        elif value > bound:
            failures.append(f"{name} {value:.3g} s, wanted <= {bound:g} s")
    return failures


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


def demand(solver: str, rows: Sequence[RunRow], known: Callable[[RunRow], bool] = lambda row: False) -> Demand:
    """Whether a solver is right in every reading of a case, at its tightest setting.

    What it does not support, and what is ill-conditioned, not unique or out of time by its own word, is not judged;
    nor is a failure that is ``known`` (expected, see :mod:`henon_ref.score.known`).
    """
    found = Demand()
    by_reading: dict[str, list[RunRow]] = {}
    for row in rows:
        if row.solver == solver:
            by_reading.setdefault(row.reading, []).append(row)
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
