"""What of a run with heyoka is heyoka's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.studies.paired_times import own_calls
from henon_ref.harness.studies.paired_times.own_calls import Clock, clocked, own_part
from henon_ref.harness.studies.paired_times.rows import PairRow, own_words, spread_table
from henon_ref.harness.studies.paired_times.timing import Candidate, Pair, PairedTiming
from henon_ref.workers.worker import WorkerState

CASES = Path(__file__).parents[3] / "cases"


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
    assert own_part(run, again, own.clock, rounds=5) > 0.0


def test_other_solvers_are_not_clocked() -> None:
    assert clocked(registry.solver("scipy-rk45")) is None
    assert clocked(registry.solver("henon")) is None


def test_the_part_is_the_calls_of_one_run_over_a_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The median over rounds behind the first, and what was clocked before a run does not count."""
    clock, wholes, owns = Clock(spent_s=100.0), iter([1.0, 8.0, 4.0, 2.0]), iter([1.0, 1.0, 1.0, 1.0])
    monkeypatch.setattr(own_calls, "timed", lambda run: next(wholes))

    def clocked_run() -> None:
        clock.spent_s += next(owns)

    assert own_part(lambda: None, clocked_run, clock, rounds=3) == 0.25


def test_a_pair_with_heyoka_is_timed_with_its_own_calls_and_no_other_one_is() -> None:
    pytest.importorskip("heyoka")
    problem = load_case(CASES / "free_coulomb.yaml").readings[0].problem
    fast, own, slow = (Candidate(name, Setting(1e-9, 1e-9), 1e-3) for name in ("scipy-rk45", "heyoka", "scipy-dop853"))
    pairs = (Pair(6, "heyoka", (fast,), (own,)), Pair(6, "scipy-dop853", (fast,), (slow,)))
    rows = PairedTiming("c", "r", problem, pairs, 0.01, 20.0, fewest=3).run(WorkerState(lambda *_: None))
    assert rows[0].rival_own_s > 0.0
    assert rows[1].rival_own_s is None


def pair(digits: int, *, wall: float = 1e-4, own: float | None = 4e-4) -> PairRow:
    settings = {"rtol": 1e-9, "rival": "heyoka", "rival_rtol": 1e-9, "rival_step_s": None, "rounds": 9}
    times = {"wall_s": wall, "rival_wall_s": 1e-3, "ratio": wall / 1e-3, "ratio_low": 0.1, "ratio_high": 0.1}
    return PairRow("a", "default", digits, "heyoka", **settings, **times, rival_own_s=own)


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
