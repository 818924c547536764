"""Every row of a run that is not judged has a reason, from the solver or from the harness."""

from __future__ import annotations

import pytest
from fakes import case, expected, found, trajectory

from henon_ref.errors import UnsupportedError
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import NO_TRUTH, UNSAID, Outcome, record, scored
from henon_ref.harness.rows import RunRow
from henon_ref.workers.worker import Failure, failure_of


def row(truth=None, **known: object) -> RunRow:
    outcome = Outcome("made_up", case().readings[0], "fake", Setting(1e-6, 1e-6), **known)
    return record(scored(outcome, truth), truth).run


@pytest.mark.parametrize(
    ("failure", "verdict", "reason"),
    [
        (Failure("timeout", "took more than 2 s"), "not judged", "took more than 2 s"),
        (Failure("timeout", ""), "not judged", UNSAID),
        (failure_of(UnsupportedError("")), "not run", UNSAID),
        (failure_of(UnsupportedError("no masses")), "not run", "no masses"),
    ],
)
def test_a_run_without_an_answer(failure: Failure, verdict: str, reason: str) -> None:
    made = row(expected(), failure=failure)
    assert (made.verdict, made.status_reason) == (verdict, reason)


def test_a_run_that_stopped_for_the_time_without_a_word() -> None:
    made = row(expected(), trajectory=trajectory(found()[:1], status="timeout", end_time=found()[0].time))
    assert made.verdict == "not judged"
    assert str(made.status_reason).endswith("where the time limit stopped it")


def test_a_run_that_decides_nothing_of_a_later_transition() -> None:
    last = found()[-1]
    made = row(expected(), trajectory=trajectory(found()[:-1])._replace(undecided_after=((0, last.time - 1e-3),)))
    assert (made.status, made.verdict) == ("ok", "not judged")
    assert "nothing is decided of the surface" in str(made.status_reason)


def test_a_truth_that_is_unknown_from_its_start_on_or_is_none_at_all() -> None:
    known = row(expected((), end_time=0.0, partial=True), trajectory=trajectory(found()))
    assert (known.verdict, known.status_reason) == ("not judged", "nothing is known of the exact run after its start")
    none = row(trajectory=trajectory(found()), repeat_failure=Failure("failed", "it broke"))
    assert none.verdict is None
    assert str(none.status_reason).startswith(f"{NO_TRUTH}; a repeated run ended otherwise")


def test_a_run_that_is_judged_needs_no_reason() -> None:
    assert row(expected(), trajectory=trajectory(found())).status_reason is None
