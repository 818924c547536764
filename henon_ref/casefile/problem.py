"""A model's tree to an initial-value problem in exact numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import sympy as sp

from henon_ref.casefile.grammar import NOT_STATES
from henon_ref.casefile.source import Names, Source
from henon_ref.casefile.written_system import build_overrides, build_resets, build_system
from henon_ref.errors import ModelError
from henon_ref.modes.algebra import MAX_SIZE
from henon_ref.modes.bounds import exact_sign, put
from henon_ref.modes.preparation import with_held_loops, with_rational_exponents
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.size import size
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    from henon_ref.casefile.assembly import Scene

NO_VALUE = (sp.nan, sp.zoo, sp.oo, -sp.oo)
PARTIAL = (sp.tan, sp.log, sp.asin, sp.acos)
"""Functions that have no value at some numbers."""


def build_problem(source: Source) -> tuple[Problem, Names]:
    """The problem that one reading of a case states.

    Raises
    ------
    CaseError
        At the place of the first thing that does not fit.
    """
    keys = ("system", "scene", "sliding", "resets")
    system, names = source.once("system", keys, lambda: build_model(source))
    start = source.number(("initial", "t"), names.values) if "t" in source.keys(("initial",)) else sp.Integer(0)
    until = source.number(("until",), names.values)
    if exact_sign(until - start) <= 0 or float(until - start) == 0.0:
        raise source.error(("until",), f"'until' must be later than the start, t = {start}")
    problem = with_open_kinks(Problem(system, start, _initial(source, names), until))
    _check_start(source, problem)
    if source.has_scene:
        _check_stops(source, problem)
    return replace(problem, initial_mode=_initial_mode(source, problem)), names


def build_model(source: Source) -> tuple[FilippovSystem, Names]:
    """The system that one reading of a case is about, and what its names stand for."""
    system, names = written_model(source)
    return with_rational_exponents(system), names


def written_model(source: Source) -> tuple[FilippovSystem, Names]:
    """The same with exponents as they are written."""
    if source.has_scene:
        scene, names = read_scene(source)
        system = scene.system()
    else:
        system, names = build_system(source)
    overrides = build_overrides(source, names)
    for i in overrides.keys() & system.resets.keys():
        message = f"'{system.sign_names[i]}' is a hard stop, on which a body rests in its own way"
        raise source.error(("sliding", system.sign_names[i]), message, key=True)
    if overrides:
        system = replace(system, overrides={**system.overrides, **overrides})
    resets = build_resets(source, names, system)
    if resets:
        from henon_ref.modes.resets import with_resting

        system = with_resting(replace(system, resets={**system.resets, **resets}))
    if len(system.surfaces) > 1:
        system = with_held_loops(system)
    return system, names


def read_scene(source: Source) -> tuple[Scene, Names]:
    """The scene of a case that has one, read once for all readings that share it."""
    from henon_ref.casefile.scene import build_scene  # few systems are scenes, and the kinds of connections are many

    return source.once("scene", ("scene",), lambda: build_scene(source))


def _initial(source: Source, names: Names) -> tuple[sp.Expr, ...]:
    given = [name for name in source.keys(("initial",)) if name not in NOT_STATES]
    for name in given:
        if name not in names.states:
            message = f"'{name}' is no state{did_you_mean(name, names.states)}; states: {listed(names.states)}"
            raise source.error(("initial", name), message, key=True)
    missing = [name for name in names.states if name not in given]
    if missing:
        message = f"'initial' lacks the state {listed(missing)}; give every state its value"
        raise source.error(("initial",), message, key=True)
    return tuple(source.number(("initial", name), names.values) for name in names.states)


def _check_start(source: Source, problem: Problem) -> None:
    """Refuse a start at which a surface, or an expression of ``valid``, has no value or would be a giant number."""
    delicate = source.once("exponents", ("system", "scene", "sliding", "resets"), lambda: _delicate(problem.system))
    for what, expression in delicate:
        source.charge(("initial",), size(expression, MAX_SIZE))
        try:
            value = put(problem.system.numeric(expression), _start(problem))
        except ModelError as error:
            raise source.error(("initial",), f"{what} has no value at the start: {error}", key=True) from error
        if (value.has(*NO_VALUE) or value.is_real is False) and not _unused_at_start(problem, expression):
            raise source.error(("initial",), f"{what} has no finite real value at the start", key=True)


def _unused_at_start(problem: Problem, surface: sp.Expr) -> bool:
    """Whether an expression is a kink of a branch that is not in use at the start, where it has no value."""
    system = problem.system
    return surface in system.surfaces and system.surfaces.index(surface) in system.unused_kinks(_sides(problem))


def with_open_kinks(problem: Problem) -> Problem:
    """The problem with kinks open that have no value at the start, in a branch that is not in use there."""
    system = problem.system
    if not system.kinks:
        return problem
    mode = _sides(problem)
    without = (i for i in system.kinks if _without_value(problem, system.surfaces[i]))
    found = {i for i in without if i not in system.unused_kinks(mode) and system.hides(i, mode)}
    return replace(problem, system=replace(system, open_kinks=frozenset(found))) if found else problem


def _sides(problem: Problem) -> tuple[int, ...]:
    """Sides of the surfaces at the start, +1 of a kink that has no value there."""
    surfaces, kinks = problem.system.surfaces, problem.system.kinks
    beside = (i in kinks and _without_value(problem, h) for i, h in enumerate(surfaces))
    return tuple(1 if none else _side_at_start(problem, h) for none, h in zip(beside, surfaces, strict=True))


def _without_value(problem: Problem, expression: sp.Expr) -> bool:
    """Whether an expression has no real value at the start, or one that is the end of its range."""
    powers = [p for p in expression.atoms(sp.Pow) if _may_fail(p)]
    if not powers and not expression.has(*PARTIAL):
        return False
    at, numeric = _start(problem), problem.system.numeric
    value = put(numeric(expression), at)
    ends = (put(numeric(p.base), at) == 0 for p in powers if not p.exp.is_Integer and p.base.free_symbols)
    return value.has(*NO_VALUE) or value.is_real is False or any(ends)


def _check_stops(source: Source, problem: Problem) -> None:
    """Refuse a start beyond a hard stop of a scene, or on one and moving into it."""
    from henon_ref.modes.resets import impact_of, into_surface

    system = problem.system
    for i in sorted(system.resets):
        name, impact = system.sign_names[i], impact_of(system, i)
        side = _side_at_start(problem, system.surfaces[i])
        if side < 0:
            message = f"the start is beyond the stop {name}: x_p - x_q is below its gap"
            raise source.error(("initial",), message, key=True)
        if side == 0 and impact is not None and _side_at_start(problem, impact.speed) < 0:
            reason = into_surface(name, str(problem.start))
            raise source.error(("initial",), f"the start is invalid: {reason}", key=True)


def _delicate(system: FilippovSystem) -> list[tuple[str, sp.Expr]]:
    """Surfaces, and expressions of ``valid``, that may have no value at a point."""
    named = [(f"the surface of '{s}'", h) for s, h in zip(system.sign_names, system.surfaces, strict=True)]
    named += [("an expression of 'valid'", v) for v in system.valid]
    return [(what, e) for what, e in named if e.has(*PARTIAL) or any(_may_fail(p) for p in e.atoms(sp.Pow))]


def _may_fail(power: sp.Pow) -> bool:
    return not (power.exp.is_Integer and power.exp.is_positive)


def _start(problem: Problem) -> dict[sp.Symbol, sp.Expr]:
    return {TIME: problem.start, **dict(zip(problem.system.states, problem.initial, strict=True))}


def _initial_mode(source: Source, problem: Problem) -> dict[int, int]:
    order = list(problem.system.sign_names)
    modes = {}
    for name in source.keys(("initial", "mode")):
        path = ("initial", "mode", name)
        entry = int(source.text(path))
        if name not in order:
            message = f"'{name}' is no surface{did_you_mean(name, order)}; surfaces: {listed(order)}"
            raise source.error(path, message, key=True)
        index = order.index(name)
        side = _side_at_start(problem, problem.system.surfaces[index])
        if side not in (0, entry):
            raise source.error(path, f"the start is not on the surface of '{name}', whose sign is {side:+d} there")
        modes[index] = entry
    sliding = frozenset(index for index, entry in modes.items() if entry == 0)
    try:
        problem.system.shared_equations(sliding)
    except ModelError as error:
        raise source.error(("initial", "mode"), f"no mode slides like that: {error}") from error
    return modes


def _side_at_start(problem: Problem, expression: sp.Expr) -> int:
    value = put(problem.system.numeric(expression), _start(problem))
    return 0 if value.has(*NO_VALUE) else exact_sign(value)
