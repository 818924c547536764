"""Contacts that act on each other: one set of equations is each mode's own, as SymPy derives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from often import daily
from problems import read_problem

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.mode_code import switched_mode_code
from henon_ref.integrator.run import Run
from henon_ref.modes.decoupled_contacts import SwitchedEquations
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Decisions


def scene(bodies: str, connections: list[str], initial: str, parameters: str = "{}") -> FilippovSystem:
    lines = "".join(f"    - {each}\n" for each in connections)
    text = f"""
scene:
  parameters: {parameters}
  bodies: {bodies}
  connections:
{lines}initial: {initial}
until: 20
"""
    return read_problem(text).system


def stack(count: int, *, law: str = "law: coulomb") -> FilippovSystem:
    """Blocks on each other, static friction in every other contact, a harmonic force on each."""
    connections = []
    for i in range(count):
        below, static = f"b{i - 1}" if i else "floor", f", static: {2.5 * (count - i)}" if i % 2 == 0 else ""
        own = law if not static or "exp" not in law else "law: coulomb"
        connections.append(f"friction: {{between: [b{i}, {below}], {own}, force: {1.75 * (count - i)}{static}}}")
        connections.append(f"force: {{on: b{i}, value: {i + 2}*sin({i + 1}*t)}}")
    bodies = ", ".join(f"b{i}: {{mass: {1 + i / 4}}}" for i in range(count))
    initial = ", ".join(f"x_b{i}: 0, v_b{i}: {(-1) ** i}" for i in range(count))
    return scene(f"{{{bodies}, floor: fixed}}", connections, f"{{{initial}}}")


def clutches() -> FilippovSystem:
    """Five rotors in a row, of which none is held by anything else."""
    connections = [f"friction: {{between: [r{i}, r{i + 1}], law: coulomb, force: {3 - i / 2}}}" for i in range(4)]
    connections += ["force: {on: r0, value: 9*sin(3*t)}", "force: {on: r4, value: 5*cos(2*t)}"]
    bodies = ", ".join(f"r{i}: {{mass: {2 + i}}}" for i in range(5))
    return scene(f"{{{bodies}}}", connections, "{" + ", ".join(f"x_r{i}: 0, v_r{i}: {i}" for i in range(5)) + "}")


def plate() -> FilippovSystem:
    """Four blocks on a plate that slides on a belt: all contacts act on each other."""
    connections = ["friction: {between: [plate, belt], law: coulomb, force: mu*20, static: 30}"]
    connections += [
        f"friction: {{between: [b{i}, plate], law: stribeck, slope: {i + 1}, force: {i + 2}, viscous: 0.25"
        f"{', static: 7' if i % 2 else ''}}}"
        for i in range(4)
    ]
    connections += [f"spring: {{between: [b{i}, wall], stiffness: {i + 3}}}" for i in range(4)]
    bodies = "plate: {mass: 8}, belt: {velocity: 1 + sin(t)/2}, wall: fixed, " + ", ".join(
        f"b{i}: {{mass: {1 + i}}}" for i in range(4)
    )
    initial = "x_plate: 0, v_plate: 0, " + ", ".join(f"x_b{i}: {i}, v_b{i}: {i}" for i in range(4))
    return scene(f"{{{bodies}}}", connections, f"{{{initial}}}", "{mu: 1.25}")


def values(made: SwitchedEquations, mode: Mode, at: Mapping[sp.Symbol, sp.Expr]) -> tuple[list[float], list[float]]:
    """Field and guards of a mode at a point, by the definitions one after the other."""
    known = {**at, **made.values(mode)}
    for name, expression in made.definitions:
        known[name] = made.system.numeric(expression).xreplace(known)
    return tuple([float(made.system.numeric(e).xreplace(known)) for e in part] for part in (made.field, made.outputs))


SYSTEMS = {
    "stack": stack(4),
    "exp": stack(5, law="law: stribeck_exp, velocity: 0.5"),
    "clutches": clutches(),
    "plate": plate(),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_equations_are_those_of_each_mode(name: str) -> None:
    system = SYSTEMS[name]
    made = system.switched
    assert made is not None
    assert made.coupled
    random = np.random.default_rng(7)
    for _ in range(6):
        mode: Mode = tuple(random.integers(-1, 2, len(system.surfaces)).tolist())
        at = {TIME: sp.Float(random.uniform(0, 3))} | {x: sp.Float(random.uniform(-1, 1)) for x in system.states}
        for i in reversed(range(len(mode))):  # on the surfaces that the mode slides on
            if mode[i] == 0:
                at[system.states[made.contacts[i].row]] = sp.S.Zero
        for _ in mode:
            for contact, h, entry in zip(made.contacts, system.surfaces, mode, strict=True):
                x = system.states[contact.row]
                if entry == 0:
                    at[x] -= h.xreplace(at) / sp.diff(h, x)
        own = system.equations(mode)
        field, outputs = values(made, mode, at)
        expected = [float(system.numeric(f).xreplace(at)) for f in own.field]
        assert field == pytest.approx(expected, rel=1e-12, abs=1e-12), mode
        guards = [outputs[row] for row in made.rows(mode)]
        written = [g for g in own.guards if g.kind != "attracts"]
        assert [(g.kind, g.index, g.to_sign) for g in made.own_guards(mode)] == [
            (g.kind, g.index, g.to_sign) for g in written
        ]
        expected = [float(system.numeric(g.expression).xreplace(at)) for g in written]
        for k, guard in enumerate(written[:-1]):  # the ends of a slide are in one unit, which is not the same for both
            if guard.kind == "release" and guard.to_sign == 1 and guard.index not in system.overrides:
                expected[k : k + 2] = [2 * e / sum(expected[k : k + 2]) for e in expected[k : k + 2]]
        assert guards == pytest.approx(expected, rel=1e-11, abs=1e-11), mode


def told_both_ways(system: FilippovSystem, until: int) -> list[tuple[str, int, Mode, Mode]]:
    """Transitions by one set of equations, at the times that the modes' own equations give; Python decides none."""
    start = tuple(sp.Rational((-1) ** k * k, 4) for k in range(len(system.states)))
    runs = []
    for together in (True, False):
        fresh = replace(system)
        if not together:
            vars(fresh)["switched"] = None
        integrator = Integrator(fresh, 18)
        problem = Problem(fresh, sp.S.Zero, start, sp.Integer(until))
        run = Run(integrator, integrator.start(problem, tolerance=1e-13)).to_horizon()
        assert run.status == "ok", run.reason
        assert not together or run.counts.decisions == Decisions()
        assert derived(fresh) is not together
        runs.append(run)
    told = [[(t.kind, t.surface, t.from_mode, t.to_mode) for t in run.transitions] for run in runs]
    assert told[0] == told[1]
    assert [t.time for t in runs[0].transitions] == pytest.approx([t.time for t in runs[1].transitions], abs=1e-11)
    return told[0]


def derived(system: FilippovSystem) -> bool:
    """Whether equations of single modes have been made."""
    return any(method.endswith("shared_equations") for method, _ in vars(system).get("_cached_results", ()))


@pytest.mark.parametrize("name", daily(["stack", "clutches"], some=["clutches"]))
def test_runs_need_no_equations_of_single_modes(name: str) -> None:
    assert len(told_both_ways(SYSTEMS[name], 6)) > 5


def beside(system: FilippovSystem, surface: sp.Expr, force: sp.Expr = sp.S.Zero) -> FilippovSystem:
    """The system with one more surface, whose sign p drives the first body by a force."""
    first = next(k for k, x in enumerate(system.states) if x.name.startswith("v_"))
    field = tuple(rate + force * int(k == first) for k, rate in enumerate(system.field))
    return replace(system, signs=(*system.signs, P), surfaces=(*system.surfaces, surface), field=field)


P = sp.Symbol("p", real=True)


@pytest.mark.parametrize(
    "kind", daily(["section", "section of a speed", "kink", "force that jumps"], some=["section", "kink"])
)
def test_what_stands_beside_them_changes_no_more_than_its_side(kind: str) -> None:
    base = clutches() if kind in ("kink", "force that jumps") else stack(3)
    x, v = (next(s for s in base.states if s.name.startswith(letter)) for letter in ("x_", "v_"))
    force = {"kink": 10 * (P - 1) * (x + sp.Rational(1, 50)), "force that jumps": -P / 2}.get(kind, sp.S.Zero)
    surface = {"section": TIME - 1, "section of a speed": v + sp.Rational(1, 10)}.get(kind, x + sp.Rational(1, 50))
    system = beside(base, surface, force)
    told = told_both_ways(system, 3)
    assert kind == "section of a speed" or any(each[1] == len(base.surfaces) for each in told)


def test_friction_that_another_surface_turns_off_is_no_one_set() -> None:
    system = clutches()
    turned = tuple(rate.xreplace({system.signs[0]: system.signs[0] * (1 + P) / 2}) for rate in system.field)
    off = replace(system, signs=(*system.signs, P), surfaces=(*system.surfaces, TIME - 1), field=turned)
    assert off.switched is None


@pytest.mark.parametrize("name", SYSTEMS)
def test_each_constant_is_that_of_one_contact(name: str) -> None:
    """So a mode that is new has no constants that are: three a place, whatever the other contacts do."""
    system = SYSTEMS[name]
    made = system.switched
    assert made is not None
    code = switched_mode_code(system, made, 6)
    assert all(len(own) < 2 for tape in code.tapes for own in tape.owners)
