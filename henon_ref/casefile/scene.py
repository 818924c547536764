"""Scenes: a mechanical body and the effects that act on it, written out as a Filippov system.

``scene: {body: belt_oscillator, effects: {linear_spring: {stiffness: k}, ...}, parameters: {m: 1, k: 2}}``.
Only what the scene names is in the equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp

from henon_ref.casefile.effects.base import Body, Contact, Effect, EffectParameter, Stage
from henon_ref.casefile.effects.damping import VISCOUS_DAMPING
from henon_ref.casefile.effects.drives import HARMONIC_BASE, MOVING_BELT
from henon_ref.casefile.effects.friction import COULOMB_FRICTION, STATIC_FRICTION, STRIBECK_FRICTION
from henon_ref.casefile.effects.oscillator import Oscillator
from henon_ref.casefile.effects.rig import TWO_DOF_RIG
from henon_ref.casefile.effects.springs import CUBIC_SPRING, LINEAR_SPRING
from henon_ref.casefile.expressions import parse_number
from henon_ref.casefile.schema import SceneForm
from henon_ref.casefile.source import Names, Source
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

BELT_OSCILLATOR: Body[Oscillator] = Body(
    name="belt_oscillator",
    meaning="one block on a belt, on springs to a support (Eqs. 1 and 17)",
    parameters=(EffectParameter("m", "kg", "mass of the block", range="positive"),),
    make=Oscillator,
    effects=(
        LINEAR_SPRING,
        CUBIC_SPRING,
        VISCOUS_DAMPING,
        HARMONIC_BASE,
        MOVING_BELT,
        COULOMB_FRICTION,
        STRIBECK_FRICTION,
        STATIC_FRICTION,
    ),
)

BODIES: dict[str, Body[Any]] = {body.name: body for body in (BELT_OSCILLATOR, TWO_DOF_RIG)}


def build_scene(source: Source, form: SceneForm) -> tuple[FilippovSystem, Names]:
    """The system of a scene.

    Raises
    ------
    CaseError
        At the place of a body, effect or parameter that is not known, of one that is missing, and of a
        value out of its range.
    """
    if form.body not in BODIES:
        message = f"unknown body '{form.body}'{did_you_mean(form.body, BODIES)}; bodies: {listed(BODIES)}"
        raise source.error(("scene", "body"), message)
    body = BODIES[form.body]
    values = source.parameters(("scene", "parameters"))
    effects = _named_effects(source, form, body)
    assembly = body.make(_body_values(source, body, values))
    states = [symbol.name for symbol in assembly.states]
    for name in values:
        if name in states or name == assembly.sign.name:
            message = f"'{name}' is a state or the sign symbol of the body; choose another name"
            raise source.error(("scene", "parameters", name), message, key=True)
    for effect in sorted(effects, key=lambda e: e.stage):
        effect.add(assembly, _effect_values(source, effect, values))
    _check_holding(source, effects, values)
    rubs = any(effect.stage == Stage.FRICTION for effect in effects)
    names = Names.of(states, [assembly.sign.name] if rubs else [], values)
    system = _system(assembly, rubs, names, tuple(effect.name for effect in effects))
    return system, names


def conditions(source: Source, form: SceneForm) -> list[sp.Expr]:
    """What a scene wants of its parameters: expressions in them that must be larger than 0, or at least not smaller.

    Values with which they all are larger have been checked.
    """
    body = BODIES[form.body]
    symbols = {name: sp.Symbol(name, real=True) for name in source.keys(("scene", "parameters"))}
    found = [symbols[p.name] for p in body.parameters if p.range != "any"]
    forces: dict[Stage, sp.Expr] = {}
    for effect in _named_effects(source, form, body):
        given = set(source.keys(("scene", "effects", effect.name)))
        for parameter in effect.parameters:
            if parameter.name in given and not parameter.in_time:
                value = source.expression(("scene", "effects", effect.name, parameter.name), symbols)
                found += [] if parameter.range == "any" else [value]
                if parameter.name == "force":
                    forces[effect.stage] = forces.get(effect.stage, sp.Integer(0)) + value
    return [*found, *([forces[Stage.HOLDING] - forces[Stage.FRICTION]] if Stage.HOLDING in forces else [])]


def _system(body: Contact, rubs: bool, names: Names, effects: tuple[str, ...]) -> FilippovSystem:
    # Without friction nothing changes where the block overtakes the belt: there is no surface then.
    return FilippovSystem(
        states=body.states,
        signs=(body.sign,) if rubs else (),
        surfaces=(body.sliding_velocity,) if rubs else (),
        field=body.field(),
        parameters=names.exact_parameters(),
        valid=tuple(body.valid),
        overrides={0: body.override} if body.override is not None else {},
        effects=effects,
    )


def _named_effects(source: Source, form: SceneForm, body: Body[Any]) -> list[Effect[Any]]:
    """The effects a scene names, in the order of the scene."""
    known = {effect.name: effect for effect in body.effects}
    found = []
    for name in form.effects:
        path = ("scene", "effects", name)
        if name not in known:
            message = f"unknown effect '{name}' of {body.name}{did_you_mean(name, known)}; effects: {listed(known)}"
            raise source.error(path, message, key=True)
        effect = known[name]
        if effect.needs and not set(effect.needs) & set(form.effects):
            raise source.error(path, f"'{name}' needs one of {listed(effect.needs)} besides", key=True)
        found.append(effect)
    return found


def _body_values(source: Source, body: Body[Any], values: Mapping[str, sp.Expr]) -> dict[str, sp.Expr]:
    """The parameters that the body reads itself, as symbols."""
    for parameter in body.parameters:
        if parameter.name not in values:
            message = f"{body.name} needs the parameter {_described(parameter)}"
            raise source.error(("scene", "parameters"), message, key=True)
        _check_range(source, ("scene", "parameters", parameter.name), parameter, values[parameter.name])
    return {parameter.name: sp.Symbol(parameter.name, real=True) for parameter in body.parameters}


def _effect_values(source: Source, effect: Effect[Any], values: Mapping[str, sp.Expr]) -> dict[str, sp.Expr]:
    """What a scene gives an effect, as expressions in parameters (and t where the effect allows it)."""
    path = ("scene", "effects", effect.name)
    given = source.keys(path)
    known = [parameter.name for parameter in effect.parameters]
    for name in given:
        if name not in known:
            allowed = f"it takes {listed(known)}" if known else "it takes none"
            message = f"'{effect.name}' has no parameter '{name}'{did_you_mean(name, known)}; {allowed}"
            raise source.error((*path, name), message, key=True)
    symbols = {name: sp.Symbol(name, real=True) for name in values}
    found = {}
    for parameter in effect.parameters:
        if parameter.name in given:
            where = (*path, parameter.name)
            time = {"t": TIME} if parameter.in_time else {}
            found[parameter.name] = source.expression(where, {**symbols, **time})
            if parameter.in_time:
                source.expression(where, {**values, **time}, " (with the values of the parameters)")
            else:
                _check_range(source, where, parameter, source.number(where, values))
        elif parameter.default is not None:
            found[parameter.name] = parse_number(parameter.default, {})
        else:
            raise source.error(path, f"'{effect.name}' lacks its parameter {_described(parameter)}", key=True)
    return found


def _check_holding(source: Source, effects: Sequence[Effect[Any]], values: Mapping[str, sp.Expr]) -> None:
    """Static friction below kinetic friction would let go and catch the block at the same instant."""
    forces: dict[Stage, sp.Expr] = {}
    for effect in effects:
        if "force" in (parameter.name for parameter in effect.parameters):
            value = source.number(("scene", "effects", effect.name, "force"), values)
            forces[effect.stage] = forces.get(effect.stage, sp.Integer(0)) + value
    if Stage.HOLDING in forces and exact_sign(forces[Stage.HOLDING] - forces[Stage.FRICTION]) < 0:
        message = "static friction must not be smaller than kinetic friction at v = 0"
        raise source.error(("scene", "effects", "static_friction", "force"), message)


def _check_range(source: Source, path: Sequence[str], parameter: EffectParameter, value: sp.Expr) -> None:
    sign = exact_sign(value)
    if (parameter.range == "positive" and sign <= 0) or (parameter.range == "nonnegative" and sign < 0):
        bound = "larger than 0" if parameter.range == "positive" else "0 or larger"
        raise source.error(path, f"{_described(parameter)} must be {bound}")


def _described(parameter: EffectParameter) -> str:
    return f"'{parameter.name}' [{parameter.unit}] ({parameter.meaning})"
