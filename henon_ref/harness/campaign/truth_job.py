"""What a reading is scored against, fetched (or computed, where nothing is stored) by a worker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from henon_ref.casefile.case import Case, Reading
from henon_ref.harness.score.reference import Expected
from henon_ref.workers.worker import Job, WorkerState

if TYPE_CHECKING:
    from henon_ref.harness.truth import Truth

TRUTH_SECONDS = 300.0
"""Processor time that a truth which is not stored may take [s]."""


@dataclass(frozen=True)
class Statement:
    """The truth of one reading, and what the report says of it."""

    expected: Expected | None
    """None where no truth could be had."""
    methods: tuple[tuple[str, tuple[int, ...], float], ...] = ()
    """(method, bits, seconds taken) of every route, the one that the digits come from first."""
    certified: bool = False
    """Every transition has a proven radius, and it is proven that there is no other."""
    proven: int = 0
    """Transitions whose radius is proven."""
    closed_forms: int = 0
    """Transitions whose time is a closed form of the case."""
    near_grazes: int = 0
    """Instants at which a surface is nearly touched."""
    reason: str = ""
    """Why there is none, or how the exact run ends where that is not at the horizon."""
    uncertified_because: str = ""


@dataclass(frozen=True)
class TruthJob(Job):
    """Fetch the truth of one reading; the result is a :class:`Statement`."""

    case: Case
    reading: Reading
    seconds: float = TRUTH_SECONDS

    def run(self, state: WorkerState) -> Statement:
        return statement_of(self.case, self.reading)


def statement_of(case: Case, reading: Reading) -> Statement:
    """The truth of a reading, computed where it is not stored."""
    from henon_ref.harness.truth import truth_for

    return _statement(reading, truth_for(case, reading))


def stored_statement(case: Case, reading: Reading) -> Statement | None:
    """The truth of a reading, if it is stored."""
    from henon_ref.harness.truth.compute import stored_truth

    stored = stored_truth(case, reading)
    return None if stored is None else _statement(reading, stored)


def _statement(reading: Reading, truth: Truth) -> Statement:
    """A truth as this package's scoring wants it."""
    problem = reading.problem
    # Where the case does not say that the exact run fails, it is the truth that could not go on.
    partial = truth.status == "failed" and (reading.expect is None or reading.expect.status != "failed")
    expected = Expected(
        status="ok" if partial else truth.status,
        transitions=truth.transitions,
        start=float(problem.start),
        until=float(problem.until),
        end_time=truth.end_time,
        near_grazes=truth.near_grazes,
        start_size=max((abs(float(value)) for value in problem.initial), default=0.0),
        partial=partial,
    )
    return Statement(
        expected,
        methods=truth.methods,
        certified=truth.certified,
        proven=truth.proven,
        closed_forms=sum(event.closed_form for event in truth.transitions),
        near_grazes=len(truth.near_grazes),
        reason=truth.reason,
        uncertified_because=truth.uncertified_because,
    )
