"""Part of a run with heyoka that is spent in heyoka's own calls."""

from __future__ import annotations

from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies import pairs
from henon_ref.harness.studies.paired_times import spread_table
from henon_ref.harness.studies.pairs import Pair, PairedTiming, PairRow, clocked, own_part, own_words
from henon_ref.harness.studies.price.chains import chain_problem
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
    own.spent_s.clear()
    first, second = run(), again()
    assert list(first.transitions) == list(second.transitions)
    assert first.counts == second.counts
    assert sum(own.spent_s) > 0.0
    part = own_part("heyoka", run, lambda solver: solver.prepare(problem, rtol=1e-9), rounds=5)
    assert part is not None
    assert part > 0.0


def test_calls_of_an_integrator_that_modes_share_are_clocked_too() -> None:
    """In a run that has the same equations in all modes, caches keep the integrator of the unclocked run."""
    pytest.importorskip("heyoka")
    problem = chain_problem(4)
    run = registry.solver("heyoka").prepare(problem, rtol=1e-9)
    for _ in range(2):
        part = own_part("heyoka", run, lambda solver: solver.prepare(problem, rtol=1e-9), rounds=1)
        assert part is not None
        assert part > 0.0


def test_other_solvers_are_not_clocked() -> None:
    assert clocked(registry.solver("scipy-rk45")) is None
    assert own_part("henon", lambda: None, lambda solver: None, rounds=3) is None


def test_the_part_is_the_calls_of_one_run_over_a_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The median over rounds behind the first, and what was clocked before a run does not count."""
    wholes = iter([1.0, 8.0, 4.0, 2.0])
    monkeypatch.setattr(pairs, "timed", lambda run: next(wholes))

    def prepare(solver):
        solver.spent_s.append(100.0)

        def clocked_run() -> None:
            solver.spent_s.extend([0.25, 0.75])

        return clocked_run

    assert own_part("heyoka", lambda: None, prepare, rounds=3) == 0.25


def test_a_pair_with_heyoka_is_timed_with_its_own_calls_and_no_other_one_is() -> None:
    pytest.importorskip("heyoka")
    problem = load_case(CASES / "free_coulomb.yaml").readings[0].problem
    fast, own, slow = (
        RunRow("c", "r", name, rtol=1e-9, atol=1e-9, wall_s=1e-3) for name in ("scipy-rk45", "heyoka", "scipy-dop853")
    )
    found = (Pair(6, "heyoka", (fast,), (own,)), Pair(6, "scipy-dop853", (fast,), (slow,)))
    rows = PairedTiming("c", "r", problem, found, 0.01, 20.0, fewest=3).run(WorkerState(lambda *_: None))
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
