"""Contacts that do not act on each other: one set of equations for all modes; events at almost one instant."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import pytest
import sympy as sp
from multiprecision import multiprecision, simulate
from problems import make_problem, read_problem

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case, parse_case
from henon_ref.enclosure.run import certify
from henon_ref.errors import ModelError
from henon_ref.harness import registry
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.integrator import mode_changes
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run
from henon_ref.modes import system as systems
from henon_ref.modes.decoupled_contacts import switched_equations
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

CASES = Path(__file__).parents[2] / "cases"
LIBRARIES = [
    ("henon-rk4", {"step": 1e-3}, 1e-9),
    ("heyoka", {"rtol": 1e-15}, 1e-12),
    ("scipy-dop853", {"rtol": 1e-11}, 1e-8),
    ("scipy-radau", {"rtol": 1e-9}, 1e-6),
    ("cvode-bdf", {"rtol": 1e-10}, 1e-5),
    ("ida", {"rtol": 1e-10}, 1e-5),
]
# One block of near_ties alone.
BLOCK = """\
system:
  state: [x, v]
  parameters: {{F: 1, d: {d}, vp: 0.2}}
  surfaces: {{s: v - vp}}
  field: [v, "-x - F*(1 + d)*s/(1 + 3*s*(v - vp))"]
initial: {{t: 0, x: 0.3793, v: 0}}
until: 20
"""


def chain_text(until: str, blocks: int = 4, law: str = "coulomb") -> str:
    """Blocks in a row on a floor with static friction, each pulled by its spring from a plate that moves."""
    names = [f"b{i}" for i in range(blocks)]
    lines = ["scene:", "  parameters: {k: 1, kc: 2, Fs: 1.5, Fk: 1, vp: 0.2}", "  bodies:"]
    lines += [f"    {b}: {{mass: 1}}" for b in names]
    lines += ["    plate: {position: vp*t}", "    floor: fixed", "  connections:"]
    lines += [f"    - spring: {{between: [{b}, plate], stiffness: k}}" for b in names]
    lines += [f"    - spring: {{between: [{a}, {b}], stiffness: kc}}" for a, b in pairwise(names)]
    lines += [f"    - friction: {{between: [{b}, floor], law: {law}, force: Fk, static: Fs}}" for b in names]
    starts = ["0.05", "-0.03", "0.08", "-0.06", "0.01"]
    initial = ", ".join(f"x_{b}: {x}, v_{b}: 0" for b, x in zip(names, starts, strict=False))
    return "\n".join([*lines, f"initial: {{t: 0, {initial}}}", f"until: {until}", ""])


def static_chain(until: str) -> Problem:
    return read_problem(chain_text(until))


def chain() -> Problem:
    return load_case(CASES / "classic/block_chain.yaml").readings[0].problem


def system(field: list[str], surfaces: str = "{s: v, u: w}") -> FilippovSystem:
    text = f"""\
system: {{state: [x, v, y, w], surfaces: {surfaces}, field: {field}}}
initial: {{t: 0, x: 0, v: 1, y: 0, w: 1}}
until: 1
"""
    return read_problem(text.replace("'", '"')).system


def run(problem: Problem) -> tuple[Trajectory, Integrator]:
    integrator = Integrator(problem.system, 18)
    return Run(integrator, integrator.start(problem, tolerance=1e-15)).to_horizon(), integrator


def told(trajectory: Trajectory) -> list[tuple[str, int]]:
    return [(t.kind, t.surface) for t in trajectory.transitions]


@pytest.mark.parametrize("kind", ["plain", "static"])
def test_one_set_of_equations_is_that_of_every_mode(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(systems, "FEW_SURFACES", 8)
    three_blocks = load_case(CASES / "classic/three_blocks.yaml").readings[0].problem
    ours = three_blocks.system if kind == "plain" else static_chain("1").system
    equations = switched_equations(ours)
    assert ours.switched is None
    assert equations is not None
    point = {TIME: sp.Rational(3, 7), **{x: sp.Rational(2 * k + 1, 11) for k, x in enumerate(ours.states)}}
    for mode in list(product((-1, 0, 1), repeat=len(ours.surfaces)))[:: 1 if kind == "plain" else 7]:
        own, single, put = ours.equations(mode), equations.equations(mode), equations.values(mode)
        # On the surfaces it slides on, where alone the mode is.
        there = point | {
            x: sp.solve(h, x)[0]
            for h, e in zip(map(ours.numeric, ours.surfaces), mode, strict=True)
            if e == 0
            for x in ours.states
            if h.has(x)
        }

        pairs = [*zip(own.field, equations.field, strict=True), *zip(own.field, single.field, strict=True)]
        guards, places = equations.guards(mode), equations.places(mode)
        assert sorted(place for place in places if place >= 0) == list(range(len(own.guards)))
        for guard, place in zip(guards, places, strict=True):
            if place < 0:
                pairs.append((guard.expression, sp.S.One))
                continue
            for same in (guard, single.guards[place]):
                named = own.guards[place]
                assert (named.kind, named.index, named.to_sign) == (same.kind, same.index, same.to_sign)
                pairs.append((named.expression, same.expression))
        for theirs, mine in pairs:
            gap = ours.numeric((theirs - mine).xreplace(put)).xreplace(there)
            assert abs(sp.N(gap, 30)) < 1e-25, mode


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


@pytest.mark.parametrize("kind", ["plain", "static"])
def test_a_chain_runs_on_one_machine_code_as_on_one_a_mode(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its beginning: each mode's own code takes a second to compile; test_suite has the whole run beside its truth."""

    def problem() -> Problem:
        return replace(chain(), until=sp.Rational(17, 10)) if kind == "plain" else static_chain("11")

    ours, integrator = run(problem())
    assert len(integrator.mode_table._codes) == 1
    assert len({t.to_mode for t in ours.transitions}) >= 5
    monkeypatch.setattr(systems, "FEW_SURFACES", 8)
    theirs, many = run(problem())
    assert len(many.mode_table._codes) >= 5
    assert (ours.status, theirs.status, told(ours)) == ("ok", "ok", told(theirs))
    for a, b in zip(ours.transitions, theirs.transitions, strict=True):
        assert abs(a.time - b.time) <= 1e-12
        assert a.to_mode == b.to_mode


@pytest.mark.parametrize("apart", ["0", "1e-16", "1e-14", "1e-12", "1e-11", "1e-10", "1e-9", "1e-8", "1e-6"])
def test_two_blocks_move_as_each_would_alone(apart: str) -> None:
    base = load_case(CASES / "hard/near_ties.yaml").readings[0].problem
    text = (CASES / "hard/near_ties.yaml").read_text().replace("kc: 0, d: 0,", f"kc: 0, d: {apart},")
    problem = parse_case(text).readings[0].problem
    assert base.system.surfaces == problem.system.surfaces
    both, _ = run(problem)
    for index, own in enumerate(("0", apart)):
        alone, _ = run(read_problem(BLOCK.format(d=own)))
        mine = [t for t in both.transitions if t.surface == index]
        assert [t.kind for t in mine] == [t.kind for t in alone.transitions]
        assert len(mine) == 5
        for a, b in zip(mine, alone.transitions, strict=True):
            assert abs((a.time - b.time) + (a.time_low - b.time_low)) <= 2e-14


def test_a_release_just_after_another_is_decided_in_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_case(CASES / "hard/near_ties.yaml").reading("d_1e_10").problem
    integrator = Integrator(problem.system, 18)
    Run(integrator, integrator.start(problem, tolerance=1e-15)).to_horizon()

    def never(self: Run, **options: float) -> None:
        raise AssertionError("Python was asked")

    monkeypatch.setattr(mode_changes, "select_mode", never)
    assert len(Run(integrator, integrator.start(problem, tolerance=1e-15)).to_horizon().transitions) == 10


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


def test_the_truths_and_all_libraries_agree_on_a_chain() -> None:
    problem = static_chain("11")
    proof, second = certify(problem), simulate(problem, 224)
    assert proof.status == "certified", proof.reason
    modes = [t.to_mode for t in proof.transitions]
    assert len(modes) == 8
    assert any(mode.count(0) == 2 for mode in modes)
    assert [e.after for e in second.events] == modes
    assert all(abs(float(e.time - t.time)) < 1e-25 for e, t in zip(second.events, proof.transitions, strict=True))
    expected = [float(t.time) for t in proof.transitions]
    for name, options, bound in [("henon", {"rtol": 1e-13}, 1e-12), *LIBRARIES]:
        run = registry.solver(name).prepare(problem, **options)()
        assert (run.status, [t.to_mode for t in run.transitions]) == ("ok", modes), (name, run.reason)
        assert [t.time for t in run.transitions] == pytest.approx(expected, abs=bound, rel=0), name


def test_conditioning_of_a_chain_is_that_of_its_modes_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = static_chain("9")
    found = multiprecision(problem).transitions
    common = conditioning(problem, found)
    monkeypatch.setattr(systems, "FEW_SURFACES", 8)
    alone = static_chain("9")
    assert alone.system.switched is None
    assert len(common) >= 4
    assert common == pytest.approx(conditioning(alone, found), rel=1e-6)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(("friction: {between: [b1, floor]", "friction: {between: [b1, b0]"), id="a common body"),
        pytest.param(("static: Fs}", "static: Fs, normal: 2 + x_b0}"), id="a load with a kink"),
    ],
)
def test_static_friction_on_each_other_has_no_common_equations(change: tuple[str, str]) -> None:
    assert static_chain("1").system.shared is not None
    assert read_problem(chain_text("1").replace(*change)).system.shared is None
