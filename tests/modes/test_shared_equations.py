"""Many contacts with static friction that do not act on each other: one set of equations serves all their modes.

Blocks in a row on a floor, each pulled by its own spring from a plate that moves on steadily.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise, product

import pytest
import sympy as sp
from multiprecision import multiprecision, simulate

from henon_ref.casefile.case import parse_case
from henon_ref.enclosure.run import certify
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import Run
from henon_ref.modes import system as systems
from henon_ref.modes.decoupled_contacts import switched_equations
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

HEAD = "schema: 1\nname: chain\ntitle: t\nsource: s\nequations: e\n"
LIBRARIES = [
    ("henon-rk4", {"step": 1e-3}, 1e-9),
    ("heyoka", {"rtol": 1e-15}, 1e-12),
    ("scipy-dop853", {"rtol": 1e-11}, 1e-8),
    ("scipy-radau", {"rtol": 1e-9}, 1e-6),
    ("cvode-bdf", {"rtol": 1e-10}, 1e-5),
    ("ida", {"rtol": 1e-10}, 1e-5),
]


def text(until: str, blocks: int = 4, law: str = "coulomb") -> str:
    names = [f"b{i}" for i in range(blocks)]
    lines = ["scene:", "  parameters: {k: 1, kc: 2, Fs: 1.5, Fk: 1, vp: 0.2}", "  bodies:"]
    lines += [f"    {b}: {{mass: 1}}" for b in names]
    lines += ["    plate: {position: vp*t}", "    floor: fixed", "  connections:"]
    lines += [f"    - spring: {{between: [{b}, plate], stiffness: k}}" for b in names]
    lines += [f"    - spring: {{between: [{a}, {b}], stiffness: kc}}" for a, b in pairwise(names)]
    lines += [f"    - friction: {{between: [{b}, floor], law: {law}, force: Fk, static: Fs}}" for b in names]
    starts = ["0.05", "-0.03", "0.08", "-0.06", "0.01"]
    initial = ", ".join(f"x_{b}: {x}, v_{b}: 0" for b, x in zip(names, starts, strict=False))
    return "\n".join([HEAD + lines[0], *lines[1:], f"initial: {{t: 0, {initial}}}", f"until: {until}", ""])


@cache
def chain(until: str = "11") -> Problem:
    return parse_case(text(until)).readings[0].problem


def test_one_set_of_equations_is_that_of_every_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(systems, "FEW", 8)
    own = parse_case(text("1")).readings[0].problem.system
    shared = switched_equations(own)
    assert own.switched is None
    assert shared is not None
    point = {TIME: sp.Rational(3, 7), **{x: sp.Rational(2 * k + 1, 11) for k, x in enumerate(own.states)}}
    for mode in list(product((-1, 0, 1), repeat=4))[::7]:
        there = point | {sp.Symbol(f"v_b{i}", real=True): sp.Integer(0) for i, s in enumerate(mode) if s == 0}
        expected, found, values = own.equations(mode), shared.equations(mode), shared.values(mode)
        assert [(g.kind, g.index, g.to_sign, g.rising_only) for g in found.guards] == [
            (g.kind, g.index, g.to_sign, g.rising_only) for g in expected.guards
        ]
        pairs = [*zip(expected.field, found.field, strict=True)]
        pairs += [(a.expression, b.expression) for a, b in zip(expected.guards, found.guards, strict=True)]
        pairs += zip(expected.field, shared.field, strict=True)
        pairs += [
            (g.expression, shared.outputs[row]) for g, row in zip(expected.guards, shared.rows(mode), strict=True)
        ]
        for theirs, mine in pairs:
            known = [own.numeric(e.xreplace(values)).xreplace(there) for e in (theirs, mine)]
            assert known[0] == known[1], mode


def test_a_chain_runs_on_one_machine_code_as_on_one_a_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(system: FilippovSystem) -> tuple[Run, Integrator]:
        integrator, problem = Integrator(system, 20), chain()
        at = Problem(system, problem.start, problem.initial, problem.until)
        return Run(integrator, integrator.start(at, tolerance=1e-14, landing=HENON)), integrator

    ours, one = run(chain().system)
    mine = ours.to_horizon()
    assert len(one.mode_table._codes) == 1
    assert len({t.to_mode for t in mine.transitions}) >= 5
    monkeypatch.setattr(systems, "FEW", 8)
    theirs, many = run(parse_case(text("11")).readings[0].problem.system)
    other = theirs.to_horizon()
    assert len(many.mode_table._codes) > 5
    assert (mine.status, other.status) == ("ok", "ok")
    assert [(t.kind, t.to_mode) for t in mine.transitions] == [(t.kind, t.to_mode) for t in other.transitions]
    assert [t.time for t in mine.transitions] == pytest.approx([t.time for t in other.transitions], abs=1e-12, rel=0)


def test_the_truths_and_all_libraries_agree_on_a_chain() -> None:
    problem = chain()
    proof, second = certify(problem), simulate(problem, 224)
    assert proof.status == "certified", proof.reason
    modes = [t.to_mode for t in proof.transitions]
    assert len(modes) == 8
    assert any(mode.count(0) == 2 for mode in modes)
    assert [e.after for e in second.events] == modes
    assert all(abs(float(e.time - t.time)) < 1e-25 for e, t in zip(second.events, proof.transitions, strict=True))
    expected = [float(t.time) for t in proof.transitions]
    for name, options, bound in [("henon", {"rtol": 1e-13}, 1e-12), *LIBRARIES]:
        run = solver(name).prepare(problem, **options)()
        assert (run.status, [t.to_mode for t in run.transitions]) == ("ok", modes), (name, run.reason)
        assert [t.time for t in run.transitions] == pytest.approx(expected, abs=bound, rel=0), name


def test_conditioning_of_a_chain_is_that_of_its_modes_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = chain("9")
    found = multiprecision(problem).transitions
    common = conditioning(problem, found)
    monkeypatch.setattr(systems, "FEW", 8)
    alone = parse_case(text("9")).readings[0].problem
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
def test_contacts_that_act_on_each_other_have_no_common_equations(change: tuple[str, str]) -> None:
    assert parse_case(text("1")).readings[0].problem.system.shared is not None
    assert parse_case(text("1").replace(*change)).readings[0].problem.system.shared is None
