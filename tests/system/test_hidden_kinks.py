"""Kinks that another branch hides are none: no transition of a run, a stream, a sweep or a truth."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from problems import HEAD, read_problem

import henon_ref as hr
from henon_ref.casefile.case import parse_case
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.compute import compute, stored_truth, truth_for
from henon_ref.modes import kinks
from henon_ref.trajectory import Trajectory

SOLVERS = pytest.mark.parametrize("name", ["henon", "scipy-dop853"])
HIDDEN = "piecewise(2*sign(t - 1), x > 2, 0) - piecewise(0, x > 2, sign(t - 3))"
"""While x > 2 the jump at 3 is none, and until then that at 1 is none."""
CASE = f"""\
system: {{{{state: [x, v], field: [v, "{HIDDEN}"]}}}}
initial: {{{{x: {{x}}, v: 1}}}}
until: 4
"""


def run_of(name: str, text: str) -> Trajectory:
    run = solver(name).prepare(read_problem(text), rtol=1e-12, atol=1e-13)()
    assert run.status == "ok"
    return run


@SOLVERS
def test_a_kink_that_another_branch_hides_is_none(name: str) -> None:
    """From 0 with speed 1, x'' = 1: x = t + t^2/2 is 2 at sqrt(5) - 1; x'' is 2 from there, and stays so at 3."""
    run = run_of(name, CASE.format(x=0))
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 0)]
    assert float(run.transitions[0].time) == pytest.approx(math.sqrt(5) - 1, abs=1e-11)


def test_the_run_itself_does_not_wait_for_that(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, check = [], kinks.are_visible
    monkeypatch.setattr("henon_ref.integrator.run_result.are_visible", lambda *given: calls.append(1) or check(*given))
    found = run_of("henon", CASE.format(x=0)).transitions
    assert not calls
    assert (len(found), len(found[:1]), len(found[1:])) == (1, 1, 0)
    assert found[:1][0] == found[0]
    assert len(calls) == 1


def test_a_method_of_fixed_steps_leaves_it_out_too() -> None:
    run = solver("henon-rk4").prepare(read_problem(CASE.format(x=0)), step=1e-2)()
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 0)]


def test_simulate_leaves_it_out_too() -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    run = hr.simulate(system, {"x": 0, "v": 1}, until=4)
    assert run.transitions["surface"].tolist() == ["kink1"]
    assert run.transitions["time_s"].tolist() == pytest.approx([math.sqrt(5) - 1], abs=1e-9)


def test_a_stream_leaves_it_out_too() -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    run = hr.stream(system, {"x": 0, "v": 1}, until=4)
    assert [(row.surface, row.to_mode) for row in run] == [("kink1", "kink1=+1 kink2=+1 kink3=+1")]
    assert run.outcome is not None
    assert run.outcome.success


def test_a_section_by_the_name_of_a_kink_leaves_it_out_and_one_by_its_expression_does_not() -> None:
    """From -10 the run does not come to 2: the jump at t = 3 is one there, that at t = 1 is not."""
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    sections = [hr.observe.section(of, name=name) for of, name in (("kink3", "named"), ("t - 3", "written"))]
    table = hr.sweep(system, {"x": 0, "v": 1}, until=4, grid={"x": [-10, 0]}, observe=sections, jobs=1)
    assert table.frames["named"]["point"].tolist() == [0]
    assert table.frames["written"]["point"].tolist() == [0, 1]
    assert table.frames["written"]["time_s"].tolist() == pytest.approx([3, 3], abs=1e-12)


@SOLVERS
def test_a_kink_is_there_where_its_branch_is(name: str) -> None:
    run = run_of(name, CASE.format(x=-10))
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 2)]
    assert float(run.transitions[0].time) == pytest.approx(3, abs=1e-12)


def test_the_truth_leaves_hidden_kinks_out_too() -> None:
    case = parse_case(HEAD + CASE.format(x=0))
    found = compute(case, case.readings[0])
    assert found.status == "ok"
    assert [(t.kind, t.surface) for t in found.transitions] == [("crossing", 0)]
    assert float(found.transitions[0].time_digits) == pytest.approx(math.sqrt(5) - 1, abs=1e-15)


DAMPED = """\
scene:
  bodies: {a: {mass: 1}, frame: fixed}
  connections:
    - stop: {between: [a, frame], gap: -1/2, stiffness: 10, damping: 3/2}
    - stop: {between: [frame, a], gap: -1/2, stiffness: 10, damping: 3/2}
initial: {x_a: 2, v_a: 0}
until: 2
"""


@SOLVERS
def test_modes_follow_on_each_other_though_hidden_kinks_change_their_signs(name: str) -> None:
    """From the middle of the flight on the damping's limits at the stop that was left change their signs."""
    run = run_of(name, DAMPED)
    assert [t.surface for t in run.transitions] == [4, 3, 0, 2, 1, 0]
    for before, after in pairwise(run.transitions):
        assert before.to_mode == after.from_mode
    assert run.end_mode == run.transitions[-1].to_mode == (1, 1, 1, 1, 1, 1)


def test_a_truth_whose_hidden_kinks_change_their_signs_is_stored_and_read_again(tmp_path: Path) -> None:
    case = parse_case(HEAD + DAMPED)
    found = truth_for(case, case.readings[0], folder=tmp_path)
    assert found.certified
    assert [t.surface for t in found.transitions] == [4, 3, 0, 2, 1, 0]
    stored = stored_truth(case, case.readings[0], tmp_path)
    assert stored is not None
    assert stored.transitions == found.transitions
