"""Comparison of rows with earlier ones: by status and by digits, and differences that are no loss."""

from __future__ import annotations

from dataclasses import replace

import pytest

from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import held_against

EARLIER = RunRow(
    "c", "default", "henon", rtol=1e-6, status="ok", verdict="right", max_time_error_s=1e-9, end_time_s=2.0,
    time_unit_s=1.0, reference_radius_s=1e-30,
)  # fmt: skip


def worse(before: dict[str, object], now: dict[str, object]) -> str:
    changes, _ = held_against([replace(EARLIER, **now)], [replace(EARLIER, **before)])
    return changes[EARLIER.key]


WRONG = {"status": "wrong", "verdict": "solver defect"}
FAILED = {"status": "failed", "verdict": "solver defect"}
GONE = {"status": "unavailable", "verdict": "not run", "max_time_error_s": None}
ENDS = {"status": "nonunique", "verdict": "right"}


@pytest.mark.parametrize("now", [WRONG, FAILED, GONE, {"status": "wrong", "verdict": "ill-conditioned"}])
def test_what_was_right_and_is_not_is_worse(now):
    assert worse({}, now | {"status_reason": "1 missed"}) == f"was ok, is {now['status']} (1 missed)"
    assert worse(ENDS, now).startswith("was nonunique and right, is ")


@pytest.mark.parametrize(("before", "now"), [(WRONG, FAILED), (FAILED, GONE), (WRONG, GONE)])
def test_less_of_a_result_is_worse_and_more_is_not(before, now):
    assert worse(before, now)
    assert not worse(now, before)
    assert not worse(now, {})


def test_of_runs_that_are_wrong_only_the_kind_of_status_is_compared():
    assert not worse(WRONG, {"status": "diverged", "verdict": "solver defect"})
    assert not worse(WRONG | {"max_time_error_s": 1e-12}, WRONG | {"max_time_error_s": 1e-3})


@pytest.mark.parametrize(("factor", "lost"), [(10**0.49, False), (10**0.51, True), (1e-3, False)])
def test_half_a_digit_may_be_lost(factor, lost):
    assert bool(worse({}, {"max_time_error_s": 1e-9 * factor})) == lost


def test_errors_below_what_can_be_resolved_are_no_loss():
    assert not worse({"max_time_error_s": 1e-16}, {"max_time_error_s": 3e-16})
    assert not worse({"max_time_error_s": 0.0}, {"max_time_error_s": 2e-16})
    known = {"reference_radius_s": 1e-12}
    assert not worse({"max_time_error_s": 1e-16} | known, {"max_time_error_s": 2e-12} | known)
    assert worse({"max_time_error_s": 1e-16} | known, {"max_time_error_s": 4e-12} | known)
    late = {"end_time_s": 1e4}
    assert not worse({"max_time_error_s": 1e-16} | late, {"max_time_error_s": 1e-12} | late)
    assert worse({"max_time_error_s": 1e-16} | late, {"max_time_error_s": 1e-11} | late)


def test_the_sentence_names_both_errors():
    words = worse({}, {"max_time_error_s": 1e-8})
    assert words == "worst time error was 1e-09 s, is 1e-08 s: 1.00 digits fewer, 0.5 are allowed"


def test_a_row_without_an_error_has_no_digits_to_lose():
    assert not worse({"max_time_error_s": None}, {})
    assert not worse({}, {"max_time_error_s": None})


@pytest.mark.parametrize("change", [{"case": "d"}, {"reading": "x"}, {"solver": "ida"}, {"rtol": 1e-7}, {"step_s": 1}])
def test_rows_are_held_against_their_own_only(change):
    assert held_against([replace(EARLIER, **change | WRONG)], [EARLIER]) == ({}, [EARLIER])


def test_the_columns_of_the_contract_are_enough():
    plain = RunRow("c", "default", "henon", rtol=1e-6, status="ok", max_time_error_s=1e-9)
    same, _ = held_against([EARLIER], [plain])
    wrong, _ = held_against([replace(EARLIER, **WRONG)], [plain])
    fewer, _ = held_against([EARLIER], [replace(plain, max_time_error_s=1e-12)])
    assert (same[plain.key], bool(wrong[plain.key]), bool(fewer[plain.key])) == ("", True, True)


def test_a_row_with_neither_tolerance_nor_step_has_a_name_too():
    _, missing = held_against([EARLIER], [replace(EARLIER, rtol=None), replace(EARLIER, rtol=None, step_s=0.5)])
    assert [row.name for row in missing] == ["c: default: henon", "c: default: henon (step 0.5 s)"]
