"""The sentences a report opens with say what the rows say."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest
import sympy as sp
from fakes import TIMES, Reference, case, expected, found, trajectory
from made_reports import compared, made, usual

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.rows import Outcome, record, scored
from henon_ref.campaign.settings import Setting
from henon_ref.casefile.expected import Orbit
from henon_ref.report.text.summary import answer
from henon_ref.trajectory import Transition


@pytest.fixture
def comparison() -> Comparison:
    return usual()


def test_the_answer_names_who_is_right_and_what_it_costs(comparison):
    first, second, third = answer(comparison, comparison.readings[0])
    assert first.startswith(
        "3 of 4 solvers find all 5 transitions in order at one setting at least, 2 of them at every setting. "
        "**`henon` is right to 12 digits**"
    )
    assert "(worst error 9.9e-13 s at 1e-12) in **0.3 ms**" in first
    assert "next comes `heyoka`, right to 12 digits in 0.9 ms, 3 times as long" in first
    assert first.endswith("The cheapest is `henon` for 3, 6, 9 and 12 digits.")
    assert "Wrong at every setting: `scipy-sign` (1 missed, 0 spurious)." in second
    assert "Wrong at looser settings only: `scipy-rk45` (at 1e-6)." in second
    assert "Unavailable here: `ida` (it is not installed)." in second
    assert third.startswith("The exact run's last sticks take 0.75 s where the source prints 0.75 s")


def test_a_setting_out_of_time_is_not_a_wrong_one():
    whole = compared(
        made("henon", 1e-6, 1e-4),
        made("scipy-radau", 1e-6, 1e-4),
        made("scipy-radau", 1e-9, 0.0, what="untried"),
        made("scipy-radau", 1e-12, 0.0, what="untried"),
        made("scipy-bdf", 1e-6, 0.0, what="misses"),
        made("scipy-bdf", 1e-9, 0.0, what="untried"),
        made("scipy-lsoda", 1e-6, 0.0, what="untried"),
    )
    first, second, _ = answer(whole, whole.readings[0])
    assert first.startswith(
        "2 of 4 solvers find all 5 transitions in order at one setting at least, 1 of them at every setting. "
    )
    assert second == (
        "Wrong at every setting that was finished: `scipy-bdf` (1 missed, 0 spurious). "
        "Out of time: `scipy-radau` (at 1e-9; not tried at 1e-12), `scipy-bdf` (at 1e-9) and `scipy-lsoda` (at 1e-6)."
    )


def test_a_run_that_fails_when_it_is_repeated_is_right_without_a_time():
    whole = compared(made("henon", 1e-6, 1e-4), made("heyoka", 1e-12, 0.0, what="fails later"))
    first = answer(whole, whole.readings[0])[0]
    assert "**`heyoka` is right to 12 digits** (worst error 9.9e-13 s at 1e-12), without a time: " in first
    assert "failed: it died." in first
    whole = compared(made("henon", 1e-12, 1e-4), made("heyoka", 1e-12, 0.0, what="fails later"))
    assert "in **0.1 ms**." in answer(whole, whole.readings[0])[0]


def test_every_wrong_setting_is_named_beside_the_tightest():
    whole = compared(
        *(made("scipy-sign", rtol, 1e-4, what=what) for rtol, what in ((1e-3, "right"), (1e-6, "misses"))),
        *(made("scipy-sign", rtol, 1e-4, what="misses") for rtol in (1e-9, 1e-12)),
    )
    first, second, _ = answer(whole, whole.readings[0])
    assert first.startswith("`scipy-sign` finds all 5 transitions in order at one setting at least. ")
    assert second == "Wrong at the tightest setting: `scipy-sign` (1 missed, 0 spurious; also at 1e-6 and 1e-9)."


def test_where_no_solver_ran_none_is_counted():
    whole = compared(made("ida", 1e-6, 0.0, what="unavailable"))
    assert answer(whole, whole.readings[0])[:2] == ["No solver ran.", "Unavailable here: `ida` (it is not installed)."]
    both = [made(solver, 1e-6, 0.0, what="unavailable") for solver in ("ida", "cvode-bdf")]
    whole = compared(*both, expected=None, reason="it has none")
    (told,) = answer(whole, whole.readings[0])
    assert told.endswith("it has none. Unavailable here: `ida` and `cvode-bdf` (it is not installed).")
    nothing = replace(expected(), transitions=())
    whole = compared(made("ida", 1e-6, 0.0, what="unavailable", truth=nothing), expected=nothing)
    assert answer(whole, whole.readings[0])[0] == "The exact run has no transition; no solver ran."


def test_a_run_that_only_touches_is_told_from_one_where_nothing_happens():
    def told(truth, seen):
        records = []
        for solver, transitions in (("henon", seen), ("scipy-rk45", ())):
            outcome = Outcome("made_up", case().readings[0], solver, Setting(rtol=1e-6, atol=1e-6))
            outcome = replace(outcome, trajectory=trajectory(transitions))
            outcome = scored(outcome, truth)
            records.append(record(outcome, truth))
        whole = compared(*records, expected=truth)
        return answer(whole, whole.readings[0])[0]

    touch = Reference("graze", 0, (1,), (1,), 1.0)
    seen = (Transition("graze", 0, (1,), (1,), 1.0, (0.25,)),)
    assert told(replace(expected(), transitions=()), ()).startswith(
        "The exact run has no transition; all 2 solvers agree."
    )
    cut = told(replace(expected(), transitions=(), partial=True, end_time=0.5), ())
    assert cut.startswith("The exact run has no transition up to t = 0.5 s, where the truth ends; all 2 solvers agree.")
    nothing = told(replace(expected(), transitions=(), partial=True, end_time=0.0), ())
    assert nothing == "Nothing is known of the exact run after its start: no run is judged."
    touching = told(replace(expected(), transitions=(touch,)), seen)
    assert touching.startswith("The exact run touches a surface once and has no transition; all 2 solvers agree, ")
    assert "1 of 2 solvers report the touch." in touching


def test_published_durations_that_hold_and_that_do_not():
    whole = compared(made("henon", 1e-6, 1e-4))
    reading = replace(whole.readings[0].reading, published=replace(_published(), stick_durations=_decimals("0.9")))
    text = " ".join(answer(whole, replace(whole.readings[0], reading=reading)))
    assert "they are off by" in text
    exact = replace(
        whole.readings[0].reading, published=replace(_published(), stick_durations=_decimals("0.750", "0.5"))
    )
    assert "the printed digits hold" in " ".join(answer(whole, replace(whole.readings[0], reading=exact)))
    none = replace(exact, measure_after=4.5)
    assert "the exact run has no stick after t = 4.5 s." in " ".join(
        answer(whole, replace(whole.readings[0], reading=none))
    )


def test_an_orbit_that_the_case_names_is_set_beside_the_last_period():
    whole = compared(made("henon", 1e-6, 1e-4))
    orbit = Orbit(sp.Integer(2), _decimals("0.75", "0.4"), _decimals("1.5"))
    reading = replace(whole.readings[0].reading, orbit=orbit)
    text = " ".join(answer(whole, replace(whole.readings[0], reading=reading)))
    assert (
        "a periodic orbit of period 2 s with sticks of 0.75 and 0.4 s and crossings at 1.5 s modulo the period" in text
    )
    assert "The exact run's last sticks are off it by 0 and 1.0e-1 s." in text
    assert "The exact run's last crossing is off it by" in text


@pytest.mark.parametrize("times", [TIMES[:1], TIMES[:4], ()])
def test_a_stick_that_the_horizon_cuts_off_is_not_denied(times):
    truth = expected(times)
    whole = compared(made("henon", 1e-6, 1e-4, truth=truth), expected=truth)
    reading = replace(whole.readings[0].reading, measure_after=3.0)
    text = " ".join(answer(whole, replace(whole.readings[0], reading=reading)))
    assert "the exact run has no stick that ends after t = 3 s." in text
    reading = replace(reading, measure_after=0.0)
    text = " ".join(answer(whole, replace(whole.readings[0], reading=reading)))
    assert ("the exact run has no stick that ends within the run." in text) == (len(times) < 2)


def _published():
    return case().readings[0].published


def _decimals(*texts: str) -> tuple[Decimal, ...]:
    return tuple(Decimal(text) for text in texts)


def test_an_exact_run_that_ends_early_is_told_first():
    truth = expected(TIMES[:3], status="nonunique", end_time=2.7)
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6))
    outcome = replace(outcome, trajectory=trajectory(found(TIMES[:3]), "nonunique", end_time=2.7))
    outcome = scored(outcome, truth)
    whole = compared(record(outcome, truth), expected=truth, reason="both sides repel")
    text = answer(whole, whole.readings[0])[0]
    assert text.startswith("The exact run ends at t = 2.7 s, nonunique: both sides repel. `henon` says so, with all 3")


def test_without_a_truth_the_answer_says_so():
    whole = compared(made("henon", 1e-6, 1e-4), expected=None, reason="the routes disagree")
    assert answer(whole, whole.readings[0]) == [
        "No truth could be had, so that nothing is scored: the routes disagree."
    ]
