"""What of a run with heyoka is heyoka's own."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from henon_ref import registry
from henon_ref.casefile.case import load_case
from henon_ref.report.text.paired_times import COLUMNS, OWN, own_words, spread_table
from henon_ref.studies.price.own_calls import Clock, clocked, own_part

CASES = Path(__file__).parents[2] / "cases"


def test_a_clocked_run_is_the_same_run_and_its_calls_take_a_part_of_it() -> None:
    pytest.importorskip("heyoka")
    problem = load_case(CASES / "fig8.yaml").readings[0].problem
    solver = registry.solver("heyoka")
    own = clocked(solver)
    assert own is not None
    assert (own.name, own.restart) == ("heyoka", solver.restart)
    run, again = (each.prepare(problem, rtol=1e-9) for each in (solver, own))
    own.clock.spent_s = 0.0
    first, second = run(), again()
    assert list(first.transitions) == list(second.transitions)
    assert first.counts == second.counts
    assert own.clock.spent_s > 0.0
    assert 0.0 < own_part(run, again, own.clock, rounds=5) < 1.0


def test_other_solvers_are_not_clocked() -> None:
    assert clocked(registry.solver("scipy-rk45")) is None
    assert clocked(registry.solver("henon")) is None


def test_the_part_is_the_calls_of_one_run_over_a_whole_one() -> None:
    """Two sleeps in a row: what is clocked is a half of the whole, and what was clocked before does not count."""
    clock = Clock(spent_s=100.0)

    def clocked_run() -> None:
        clock.spent_s += 0.02

    assert own_part(lambda: time.sleep(0.04), clocked_run, clock, rounds=3) == pytest.approx(0.5, abs=0.25)


def pair(digits: int, *, wall: float = 1e-4, own: float | None = 4e-4) -> dict[str, object]:
    settings = {"case": "a", "reading": "default", "digits": digits, "against": "heyoka", "rival": "heyoka"}
    times = {"wall_s": wall, "rival_wall_s": 1e-3, "ratio": wall / 1e-3, OWN: own}
    return dict.fromkeys(COLUMNS) | settings | times


def test_the_own_calls_stand_beside_every_ratio_to_heyoka() -> None:
    rows = [pair(6), pair(9)]
    table = spread_table(rows).rows
    labels = ("`heyoka`", "`heyoka`, its own calls alone")
    assert [line[:2] for line in table] == [(label, digits) for label in labels for digits in ("6", "9")]
    assert table[2][3:] == ("4", "4", "4", "4", "4", "0")
    words = own_words(rows)
    assert "takes 10 times as long" in words
    assert "are 40%" in words
    assert "would take 4 times as long" in words
    assert own_words([pair(6, own=None)]) == ""
