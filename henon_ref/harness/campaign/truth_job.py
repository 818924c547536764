"""Fetch the truth of a reading, or compute it in a worker if it is not stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from henon_ref.casefile.case import Case, Reading
from henon_ref.harness.score.reference import Expected
from henon_ref.workers.worker import Job, WorkerState

if TYPE_CHECKING:
    from henon_ref.harness.truth import Truth

TRUTH_SECONDS = 300.0
"""Limit on the processor time to compute a truth that is not stored [s]."""


@dataclass(frozen=True)
class Statement:
    """Truth of one reading, and its description for the report."""

    expected: Expected | None
    """None if no truth is available."""
    methods: tuple[tuple[str, tuple[int, ...], float], ...] = ()
    """(method, bits, time taken [s]) of every method; the first one gives the digits."""
    certified: bool = False
    """Whether every transition has a proven radius, and it is proven that no other transition exists."""
    proven: int = 0
    """Number of transitions with a proven radius."""
    closed_forms: int = 0
    """Number of transitions whose time is a closed form in the case."""
    near_grazes: int = 0
    """Number of near-grazes of a surface."""
    reason: str = ""
    """Reason why no truth is available, or why the exact run ends before the horizon."""
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
    """Return the truth of a reading; compute it if it is not stored."""
    from henon_ref.harness.truth import truth_for

    return _statement(reading, truth_for(case, reading))


def stored_statement(case: Case, reading: Reading) -> Statement | None:
    """Return the stored truth of a reading; None if it is not stored."""
    from henon_ref.harness.truth.compute import stored_truth

    stored = stored_truth(case, reading)
    return None if stored is None else _statement(reading, stored)


def _statement(reading: Reading, truth: Truth) -> Statement:
    """Convert a truth to the form that scoring uses."""
    problem = reading.problem
    # If the case does not state that the exact run fails, it was the computation of the truth that failed.
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
