"""Conversion of a model's tree to a Filippov system, and to an initial-value problem in exact numbers."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import MAX_SIZE
from henon_ref.expressions.bounds import NOT_FINITE, exact_sign, put
from henon_ref.expressions.evaluation import Kinked
from henon_ref.expressions.grammar import NOT_STATES, may_have_kinks, name_problem
from henon_ref.expressions.traversal import size
from henon_ref.modes.problem import Problem, with_held_loops, with_rational_exponents
from henon_ref.modes.switched_field import Release, Reset, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.system.source import Names, Path, Source
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed

if TYPE_CHECKING:
    from henon_ref.system.assembly import Scene

MODEL_KEYS = ("system", "scene", "sliding", "resets")
"""Keys of a case file that determine its system."""
PARTIAL = (sp.tan, sp.log, sp.asin, sp.acos)
"""Functions with a restricted domain or with poles."""


def build_problem(source: Source, part: float = 0.0) -> Problem:
    """Return the problem of one reading of a case.

    ``part``: of :func:`henon_ref.modes.end_of_run.signs_in_mode`; 0: the start is exactly on the surfaces of its mode.
    """
    system = build_system(source)
    values = system.parameter_values
    start = source.number(("initial", "t"), values) if "t" in source.keys(("initial",)) else sp.Integer(0)
    until = source.number(("until",), values)
    if exact_sign(until - start) <= 0 or float(until - start) == 0.0:
        raise source.error(("until",), f"'until' must be later than the start, t = {start}")
    problem = with_open_kinks(Problem(system, start, _initial(source, system), until))
    _check_start(source, problem)
    problem = replace(problem, initial_mode=_initial_mode(source, problem, part))
    if source.has_scene:
        _check_stops(source, problem)
    return problem


def build_system(source: Source) -> FilippovSystem:
    """Return the system of one reading; readings with the same model share it."""
    return source.once("system", MODEL_KEYS, lambda: with_rational_exponents(written_system(source)))


def written_system(source: Source) -> FilippovSystem:
    """Return the system of one reading with exponents as written; readings with the same model share it."""
    return source.once("written", MODEL_KEYS, lambda: _written_system(source))


def _written_system(source: Source) -> FilippovSystem:
    system = read_scene(source).system() if source.has_scene else _system(source)
    names = Names.of(system.state_names, system.sign_names, system.parameter_values)
    overrides = {
        _plain_surface(source, names, ("sliding", sign), "a sliding mode"): _override(source, sign, names)
        for sign in source.keys(("sliding",))
    }
    for i in overrides.keys() & system.resets.keys():
        message = f"'{system.sign_names[i]}' is a hard stop; its sliding mode (a body at rest) cannot be replaced"
        raise source.error(("sliding", system.sign_names[i]), message, key=True)
    if overrides:
        system = replace(system, overrides={**system.overrides, **overrides})
    resets = _resets(source, names, system)
    if resets:
        from henon_ref.modes.resets import with_resting

        system = with_resting(replace(system, resets={**system.resets, **resets}))
    if len(system.surfaces) > 1:
        system = with_held_loops(system)
    return system


def read_scene(source: Source) -> Scene:
    """Return the scene of a case; readings with the same scene share it."""
    from henon_ref.system.scene import build_scene  # imported only for scenes

    return source.once("scene", ("scene",), lambda: build_scene(source))


# -- system: and sliding:, resets: ---------------------------------------------------------------------


def _system(source: Source) -> FilippovSystem:
    """Return the system that a case gives as equations."""
    states = [source.text(("system", "state", i)) for i in range(source.length(("system", "state")))]
    signs, rates_given = source.keys(("system", "surfaces")), source.length(("system", "field"))
    values = source.parameters(("system", "parameters"))
    _check_names(source, states, signs, set(values))
    names = Names.of(states, signs, values)
    if rates_given != len(states):
        raise source.error(("system", "field"), _wrong_length(rates_given, states))
    surfaces = {names.signs[name]: _surface_of(source, names, name) for name in signs}
    rates = [names.written(source, ("system", "field", i), signs=signs) for i in range(rates_given)]
    made = {sign: surface for sign, (surface, _) in surfaces.items()}
    field, kinks = [rate for rate, _ in rates], frozenset[int]()
    sections = conditions = tuple[sp.Expr, ...]()
    if any(arguments for _, arguments in (*surfaces.values(), *rates)):
        from henon_ref.system.kinks import with_kinks  # imported only for models with kinks

        made, field, kinks, sections, conditions = with_kinks(source, names, surfaces, rates)
    valid = [names.smooth(source, ("system", "valid", i)) for i in range(source.length(("system", "valid")))]
    places: dict[sp.Symbol, Path] = {x: ("system", "field", i) for i, x in enumerate(names.states.values())}
    places |= {names.signs[name]: ("system", "surfaces", name) for name in signs}
    return FilippovSystem(
        states=tuple(names.states.values()),
        signs=tuple(made),
        surfaces=tuple(made.values()),
        field=tuple(field),
        parameters=names.exact_parameters(),
        valid=tuple(valid),
        kinks=kinks,
        sections=sections,
        conditions=conditions,
        written={s: text for s, path in places.items() if isinstance(text := source.written(path), str)},
    )


def _surface_of(source: Source, names: Names, name: str) -> Kinked:
    path: Path = ("system", "surfaces", name)
    found = names.written(source, path)
    if not found[0].free_symbols & {TIME, *names.states.values()}:
        raise source.error(path, f"the surface '{name}' is constant: it contains neither a state nor t")
    return found


def _check_names(source: Source, states: list[str], signs: list[str], parameters: set[str]) -> None:
    seen: dict[str, str] = dict.fromkeys(parameters, "parameter")
    for kind, found in (("state", states), ("surface", signs)):
        for i, name in enumerate(found):
            path: Path = ("system", "state", i) if kind == "state" else ("system", "surfaces", name)
            problem = name_problem(name, state=kind == "state")
            if not problem and name in seen:
                problem = f"'{name}' is already the name of a {seen[name]}"
            if problem:
                raise source.error(path, problem, key=True)
            seen[name] = kind


def _plain_surface(source: Source, names: Names, path: tuple[str, str], what: str) -> int:
    """Return the index of the surface that a key names, which must have no kinks."""
    order, sign = list(names.signs), path[1]
    if sign not in order:
        raise source.unknown(path, f"'{sign}' is not a surface", "surfaces", order)
    own = source.keys(("system", "surfaces"))
    if sign in own and f"{sign}_2" in order and f"{sign}_2" not in own:
        raise source.error(path, f"{what} on a surface with kinks ('{sign}') is not supported", key=True)
    return order.index(sign)


def _resets(source: Source, names: Names, system: FilippovSystem) -> dict[int, Reset]:
    resets = {}
    for sign in source.keys(("resets",)):
        path = ("resets", sign)
        index = _plain_surface(source, names, path, "a reset")
        if index in system.resets:
            raise source.error(path, f"'{sign}' is a hard stop of the scene, which already has a reset", key=True)
        if index in system.overrides:
            message = f"'{sign}' has a sliding mode under 'sliding'; a surface may have that or a reset, not both"
            raise source.error(path, message, key=True)
        if index in system.kinks:
            raise source.error(path, f"'{sign}' is a kink of the field; resets are allowed on surfaces only", key=True)
        values = {}
        for name in source.keys((*path, "map")):
            place = (*path, "map", name)
            if name not in names.states:
                raise source.unknown(place, f"'{name}' is not a state", "states", names.states)
            with source.at(place):
                has_kinks = may_have_kinks(source.text(place))
            if has_kinks:
                raise source.error(
                    place,
                    f"in '{name}': a map must have no kinks and no signs: write the branch that applies when the "
                    "surface falls (for a speed v, which is negative there, write -v for abs(v))",
                )
            values[names.states[name]] = names.smooth(source, place)
        if all(x == value for x, value in values.items()):
            raise source.error((*path, "map"), "the map changes no state; leave the reset out", key=True)
        resets[index] = Reset(values, priority=float(source.word((*path, "priority"), "0")))
    return resets


def _override(source: Source, sign: str, names: Names) -> SlidingOverride:
    others = [name for name in names.signs if name != sign]
    path = ("sliding", sign)
    rates = source.length((*path, "field"))
    if rates != len(names.states):
        raise source.error((*path, "field"), _wrong_length(rates, names.states))
    field = [names.smooth(source, (*path, "field", i), signs=others) for i in range(rates)]
    releases = []
    for i in range(source.length((*path, "release"))):
        when = names.smooth(source, (*path, "release", i, "when"), signs=others)
        rising = source.text((*path, "release", i, "direction")) == "rising"
        releases.append(Release(when, "rising" if rising else "falling", int(source.text((*path, "release", i, "to")))))
    inside = source.word((*path, "entry"), "attracting") == "inside"
    return SlidingOverride(tuple(field), tuple(releases), "inside" if inside else "attracting")


def _wrong_length(rates: int, states: Collection[str]) -> str:
    entries = "1 entry" if rates == 1 else f"{rates} entries"
    return f"'field' has {entries}; it must have one for each state ({len(states)}): {listed(states)}"


# -- the start ------------------------------------------------------------------------------------------


def _initial(source: Source, system: FilippovSystem) -> tuple[sp.Expr, ...]:
    states = system.state_names
    given = [name for name in source.keys(("initial",)) if name not in NOT_STATES]
    for name in given:
        if name not in states:
            raise source.unknown(("initial", name), f"'{name}' is not a state", "states", states)
    missing = [name for name in states if name not in given]
    if missing:
        message = f"'initial' lacks the state {listed(missing)}; give every state its value"
        raise source.error(("initial",), message, key=True)
    return tuple(source.number(("initial", name), system.parameter_values) for name in states)


def _check_start(source: Source, problem: Problem) -> None:
    """Raise CaseError if a surface or an expression of ``valid`` has no value, or a giant one, at the start."""
    delicate = source.once("exponents", MODEL_KEYS, lambda: _delicate(problem.system))
    for what, expression in delicate:
        with source.at(("initial",)):
            source.work.charge(size(expression, MAX_SIZE), 0)
        try:
            value = _at_start(problem, expression)
        except ModelError as error:
            raise source.error(("initial",), f"{what} has no value at the start: {error}", key=True) from error
        if not (value.has(*NOT_FINITE) or value.is_real is False):
            continue
        surfaces = problem.system.surfaces
        if expression in surfaces and surfaces.index(expression) in problem.system.unused_kinks(_sides(problem)):
            continue  # a kink of a branch that is not in use at the start
        raise source.error(("initial",), f"{what} has no finite real value at the start", key=True)


def with_open_kinks(problem: Problem) -> Problem:
    """Return the problem with kinks marked open that have no value at the start, in a branch not in use there."""
    system = problem.system
    if not system.kinks:
        return problem
    mode = _sides(problem)
    without = (i for i in system.kinks if _without_value(problem, system.surfaces[i]))
    found = {i for i in without if i not in system.unused_kinks(mode) and system.hides(i, mode)}
    return replace(problem, system=replace(system, open_kinks=frozenset(found))) if found else problem


def _sides(problem: Problem) -> tuple[int, ...]:
    """Return the sides of the surfaces at the start; +1 for a kink that has no value there."""
    surfaces, kinks = problem.system.surfaces, problem.system.kinks
    beside = (i in kinks and _without_value(problem, h) for i, h in enumerate(surfaces))
    return tuple(1 if none else _side_at_start(problem, h) for none, h in zip(beside, surfaces, strict=True))


def _without_value(problem: Problem, expression: sp.Expr) -> bool:
    """Check whether an expression has no real value at the start, or is at the end of its domain there."""
    powers = [p for p in expression.atoms(sp.Pow) if _may_fail(p)]
    if not powers and not expression.has(*PARTIAL):
        return False
    value = _at_start(problem, expression)
    ends = (_at_start(problem, p.base) == 0 for p in powers if not p.exp.is_Integer and p.base.free_symbols)
    return value.has(*NOT_FINITE) or value.is_real is False or any(ends)


def _check_stops(source: Source, problem: Problem) -> None:
    """Raise CaseError if a scene starts beyond a hard stop, or on one and moving into it.

    If the mode is given, the start beyond a stop is an error, and a start that moves into it begins with the impact.
    """
    from henon_ref.modes.resets import impact_of, into_surface

    system, given = problem.system, problem.initial_mode
    for i in sorted(system.resets):
        name, impact, side = system.sign_names[i], impact_of(system, i), _side_at_start(problem, system.surfaces[i])
        if given.get(i, -1) >= 0:
            continue
        if side < 0:
            message = f"the start is beyond the stop {name}: x_p - x_q is less than its gap"
            raise source.error(("initial",), message, key=True)
        if side == 0 and impact is not None and _side_at_start(problem, impact.speed) < 0:
            reason = into_surface(name, str(problem.start))
            raise source.error(("initial",), f"the start is invalid: {reason}", key=True)


def _delicate(system: FilippovSystem) -> list[tuple[str, sp.Expr]]:
    """Return the surfaces, and the expressions of ``valid``, that may have no value at a point."""
    named = [(f"the surface of '{s}'", h) for s, h in zip(system.sign_names, system.surfaces, strict=True)]
    named += [("an expression of 'valid'", v) for v in system.valid]
    return [(what, e) for what, e in named if e.has(*PARTIAL) or any(_may_fail(p) for p in e.atoms(sp.Pow))]


def _may_fail(power: sp.Pow) -> bool:
    return not (power.exp.is_Integer and power.exp.is_positive)


def _at_start(problem: Problem, expression: sp.Expr) -> sp.Expr:
    start = {TIME: problem.start, **dict(zip(problem.system.states, problem.initial, strict=True))}
    return put(problem.system.numeric(expression), start)


def _initial_mode(source: Source, problem: Problem, part: float) -> dict[int, int]:
    order = list(problem.system.sign_names)
    modes = {}
    for name in source.keys(("initial", "mode")):
        path = ("initial", "mode", name)
        entry = int(source.text(path))
        if name not in order:
            raise source.unknown(path, f"'{name}' is not a surface", "surfaces", order)
        modes[order.index(name)] = entry
    signs = {i: _side_at_start(problem, problem.system.surfaces[i]) for i in modes}
    resting = any(entry == 0 and problem.system.rests(i) for i, entry in modes.items())
    if resting or (part and any(signs[i] not in (0, entry) for i, entry in modes.items())):
        from henon_ref.modes.end_of_run import signs_in_mode  # rarely needed
        from henon_ref.modes.mode_evaluation import in_doubles

        found, modes = signs_in_mode(in_doubles(problem.system).at_start(problem), _sides(problem), modes, part)
        signs = dict(enumerate(found))
    for i, entry in modes.items():
        if signs[i] not in (0, entry):
            what = f"the start is not on the surface of '{order[i]}', whose sign is {signs[i]:+d} there"
            raise source.error(("initial", "mode", order[i]), what)
    try:
        problem.system.shared_equations(frozenset(i for i, entry in modes.items() if entry == 0))
    except ModelError as error:
        raise source.error(("initial", "mode"), f"the surfaces with mode 0 cannot slide together: {error}") from error
    return modes


def _side_at_start(problem: Problem, expression: sp.Expr) -> int:
    value = _at_start(problem, expression)
    return 0 if value.has(*NOT_FINITE) else exact_sign(value)
