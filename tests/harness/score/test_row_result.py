"""Classification of a row for a test runner, and expected failures."""

from __future__ import annotations

import pytest

from henon_ref.harness.rows import REPEATED, RunRow
from henon_ref.harness.score.gate import KnownFailure, row_result


def row(status: str, verdict: str | None, **values: object) -> RunRow:
    own = {"case": "c", "reading": "default", "solver": "ida", "rtol": 1e-6, "status": status, "verdict": verdict}
    return RunRow(**{"found_transitions": 3} | own | values)


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        (row("ok", "right"), "passed"),
        (row("nonunique", "right"), "passed"),
        (row("failed", "right"), "passed"),
        (row("wrong", "solver defect"), "failure"),
        (row("diverged", "solver defect"), "failure"),
        (row("failed", "solver defect"), "failure"),
        (row("timeout", "not judged"), "failure"),
        (row("timeout", "solver defect", found_transitions=None), "failure"),
        (row("failed", "solver defect", found_transitions=None), "error"),
        (row("ok", "right", status_reason=f"{REPEATED}failed: signal 11"), "error"),
        (row("wrong", "ill-conditioned"), "skipped"),
        (row("invalid", "not unique"), "skipped"),
        (row("ok", None), "skipped"),
        (row("unsupported", "not run", found_transitions=None), "skipped"),
        (row("unavailable", "not run", found_transitions=None), "skipped"),
    ],
)
def test_every_row_is_one_of_four(given, kind):
    found, reason = row_result(given)
    assert found == kind
    assert bool(reason) == (kind != "passed")
    assert row_result(given, known=True)[0] == ("passed" if kind == "passed" else "known")


def test_a_complaint_makes_a_failure_of_what_is_right():
    assert row_result(row("ok", "right"), ["gate: too late"]) == ("failure", "gate: too late")
    assert row_result(row("ok", "right"), ["gate: too late"], known=True)[0] == "known"
    assert row_result(row("unavailable", "not run"), ["worse"])[0] == "failure"


def test_an_empty_field_stands_for_any():
    wrong = row("wrong", "solver defect")
    for entry in (KnownFailure(case="c"), KnownFailure(solver="ida", rtol=1e-6), KnownFailure(reading="default")):
        assert entry.covers(wrong)
    for change in ({"case": "d"}, {"reading": "x"}, {"solver": "cvode"}, {"rtol": 1e-3}, {"step_s": 0.1}):
        assert not KnownFailure(**{"solver": "ida"} | change).names(wrong)
    assert KnownFailure(case="c", status="wrong").covers(wrong)
    assert not KnownFailure(case="c", status="failed").covers(wrong)
    assert KnownFailure(case="c", status="failed").names(wrong)
