"""Contacts that do not act on each other: one set of equations for all modes; events at almost one instant."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
import sympy as sp
from problems import make_problem

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case, parse_case
from henon_ref.errors import ModelError
from henon_ref.harness import registry
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import Run
from henon_ref.modes import system as systems
from henon_ref.modes.decoupled_contacts import switched_equations
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

CASES = Path(__file__).parents[2] / "cases"
BLOCK = """\
schema: 1
name: block
title: One block of near_ties alone
system:
  state: [x, v]
  parameters: {{F: 1, d: {d}, vp: 0.2}}
  surfaces: {{s: v - vp}}
  field: [v, "-x - F*(1 + d)*s/(1 + 3*s*(v - vp))"]
initial: {{t: 0, x: 0.3793, v: 0}}
until: 20
"""


def chain() -> Problem:
    return load_case(CASES / "classic/block_chain.yaml").readings[0].problem


def system(field: list[str], surfaces: str = "{s: v, u: w}") -> FilippovSystem:
    text = f"""\
schema: 1
name: any
title: any
system: {{state: [x, v, y, w], surfaces: {surfaces}, field: {field}}}
initial: {{t: 0, x: 0, v: 1, y: 0, w: 1}}
until: 1
"""
    return parse_case(text.replace("'", '"')).readings[0].problem.system


def run(problem: Problem) -> tuple[Trajectory, Integrator]:
    integrator = Integrator(problem.system, 18)
    return Run(integrator, integrator.start(problem, tolerance=1e-15, landing=HENON)).to_horizon(), integrator


def told(trajectory: Trajectory) -> list[tuple[str, int]]:
    return [(t.kind, t.surface) for t in trajectory.transitions]


def test_one_set_of_equations_is_that_of_every_mode() -> None:
    problem = load_case(CASES / "classic/three_blocks.yaml").readings[0].problem
    ours = problem.system
    equations = switched_equations(ours)
    assert equations is not None
    point = {TIME: sp.Rational(3, 7), **{x: sp.Rational(2 * k + 1, 11) for k, x in enumerate(ours.states)}}
    for mode in product((-1, 0, 1), repeat=len(ours.surfaces)):
        own = ours.equations(mode)
        put = {
            s: v for switches, e in zip(equations.switches, mode, strict=True) for s, v in switches.values(e).items()
        }
        # On the surfaces it slides on, where alone the mode is.
        there = point | {
            x: sp.solve(h, x)[0]
            for h, e in zip(map(ours.numeric, ours.surfaces), mode, strict=True)
            if e == 0
            for x in ours.states
            if h.has(x)
        }
        for theirs, mine in zip(own.field, equations.field, strict=True):
            gap = ours.numeric(theirs - mine.xreplace(put)).xreplace(there)
            assert abs(sp.N(gap, 30)) < 1e-25, mode
        guards, places = equations.guards(mode), equations.places(mode)
        assert sorted(place for place in places if place >= 0) == list(range(len(own.guards)))
        for guard, place in zip(guards, places, strict=True):
            value = sp.N(ours.numeric(guard.expression.xreplace(put)).xreplace(there), 30)
            if place < 0:
                assert abs(value - 1) < 1e-25
                continue
            named = own.guards[place]
            assert (named.kind, named.index, named.to_sign) == (guard.kind, guard.index, guard.to_sign)
            assert abs(value - sp.N(ours.numeric(named.expression).xreplace(there), 30)) < 1e-25


@pytest.mark.parametrize(
    ("field", "surfaces"),
    [
        (["v", "-x - s - u", "w", "-y - u"], "{s: v, u: w}"),  # a contact that feels the other one's sign
        (["v", "-x - s", "w + s", "-y - u"], "{s: v, u: w}"),  # a sign that acts on two rates
        (["v", "-x - s", "w", "-y - u"], "{s: v, u: w - v}"),  # a surface of two states
        (["v", "-x - s - u", "w", "-y"], "{s: v, u: v - 1}"),  # two surfaces of one state
    ],
)
def test_contacts_that_act_on_each_other_have_none(field: list[str], surfaces: str) -> None:
    assert switched_equations(system(field, surfaces)) is None
    assert switched_equations(system(["v", "-x - s", "w", "-y - u"])) is not None


def test_who_acts_on_whom() -> None:
    alone = system(["v", "-x - s", "w", "-y - u"])
    assert alone.together(0, [0, 1]) == {0}
    one_way = system(["v", "-x - s - u", "w", "-y - u"])
    assert one_way.together(0, [1]) == one_way.together(1, [0]) == {0, 1}
    assert one_way.together(0, []) == {0}


def test_a_chain_runs_on_one_machine_code_as_on_one_a_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its beginning: each mode's own code takes a second to compile; test_suite has the whole run beside its truth."""
    ours, integrator = run(replace(chain(), until=sp.Rational(17, 10)))
    assert len(integrator.mode_table._codes) == 1
    assert len({t.to_mode for t in ours.transitions}) > 5
    monkeypatch.setattr(systems, "FEW", 8)
    theirs, many = run(replace(chain(), until=sp.Rational(17, 10)))
    assert len(many.mode_table._codes) > 5
    assert told(ours) == told(theirs)
    assert len(ours.transitions) == 8
    for a, b in zip(ours.transitions, theirs.transitions, strict=True):
        assert abs(a.time - b.time) <= 1e-13
        assert a.to_mode == b.to_mode


@pytest.mark.parametrize("apart", ["0", "1e-16", "1e-14", "1e-12", "1e-11", "1e-10", "1e-9", "1e-8", "1e-6"])
def test_two_blocks_move_as_each_would_alone(apart: str) -> None:
    base = load_case(CASES / "hard/near_ties.yaml").readings[0].problem
    text = (CASES / "hard/near_ties.yaml").read_text().replace("kc: 0, d: 0,", f"kc: 0, d: {apart},")
    problem = parse_case(text).readings[0].problem
    assert base.system.surfaces == problem.system.surfaces
    both, _ = run(problem)
    for index, own in enumerate(("0", apart)):
        alone, _ = run(parse_case(BLOCK.format(d=own)).readings[0].problem)
        mine = [t for t in both.transitions if t.surface == index]
        assert [t.kind for t in mine] == [t.kind for t in alone.transitions]
        assert len(mine) == 5
        for a, b in zip(mine, alone.transitions, strict=True):
            assert abs((a.time - b.time) + (a.time_low - b.time_low)) <= 2e-14


def test_a_release_just_after_another_is_decided_in_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_case(CASES / "hard/near_ties.yaml").reading("d_1e_10").problem
    integrator = Integrator(problem.system, 18)
    Run(integrator, integrator.start(problem, tolerance=1e-15, landing=HENON)).to_horizon()

    def never(self: Run, **options: float) -> None:
        raise AssertionError("Python was asked")

    monkeypatch.setattr(Run, "_select_mode", never)
    assert (
        len(Run(integrator, integrator.start(problem, tolerance=1e-15, landing=HENON)).to_horizon().transitions) == 10
    )


def test_a_mode_seen_for_the_first_time_changes_nothing() -> None:
    first = HENON_SOLVER.prepare(chain(), rtol=1e-12)
    once, again = first(), first()
    assert [t.time for t in once.transitions] == [t.time for t in again.transitions]
    assert once.counts == again.counts


@pytest.mark.parametrize("solver", ["henon", "scipy-dop853", "cvode-bdf", "ida", "heyoka"])
@pytest.mark.parametrize(("surface", "share"), [("v", "- u/2"), ("3*v", "- u/2"), ("-v", "+ u/2")])
def test_two_surfaces_of_one_contact_stick_as_one(solver: str, surface: str, share: str) -> None:
    """Neither sign is settled by the balance of forces, but there are only two fields beside the contact."""
    drive = "-x - s {} + 3*sin(2*t)"
    states, start = "x v", [1, 0]
    two = make_problem(states, ["v", drive.format(share)], {"s": "v", "u": surface}, start, 12)
    one = make_problem(states, ["v", drive.format("- s/2")], {"s": "v"}, start, 12)
    both, single = (registry.solver(solver).prepare(p, rtol=1e-10, atol=1e-12)() for p in (two, one))
    assert both.status == "ok"
    for index in (0, 1):
        own = [q for q in both.transitions if q.surface == index]
        assert [q.kind for q in own] == [q.kind for q in single.transitions]
        assert {"stick", "release", "crossing"} == {q.kind for q in own}
        assert [q.time for q in own] == pytest.approx([q.time for q in single.transitions], abs=1e-7)
    assert both.end_state == pytest.approx(single.end_state, abs=1e-7)


@pytest.mark.parametrize(
    ("other", "way"),
    [("v - x/3", 1), ("3*v - x", 1), ("x - 3*v", -1), ("-sqrt(2)*(3*v - x)", -1), ("v - x", 0), ("v - x/3 + 1", 0)],
)
def test_a_surface_is_known_again_up_to_a_number(other: str, way: int) -> None:
    system = make_problem("x v", ["v", "-x - s - u"], {"s": "v - x/3", "u": other}, [1, 0], 1).system
    assert system.multiples == ({1: (0, way)} if way else {})


def test_one_surface_of_a_contact_does_not_stick_without_the_other() -> None:
    system = make_problem("x v", ["v", "-x - s - u"], {"s": "v", "u": "2*v"}, [1, 0], 1).system
    assert system.multiples == {1: (0, 1)}
    with pytest.raises(ModelError, match="together or not at all"):
        system.equations((0, 1))
    assert system.equations((0, 0)).equivalent_signs[0] == -sp.Symbol("x", real=True) / 2
