"""Bodies of a scene: masses and rotors, which have states, and bodies whose motion is prescribed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeVar

import sympy as sp

from henon_ref.expressions.bounds import exact_sign
from henon_ref.expressions.grammar import NAME, name_problem
from henon_ref.system.source import WITH_VALUES, Path, Source
from henon_ref.system.tree import MappingNode, ScalarNode, SequenceNode, child
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

T = TypeVar("T")
BodyKind = Literal["mass", "rotor", "prescribed", "fixed"]
Range = Literal["any", "nonnegative", "positive", "fraction"]
"""Range of a value; ``fraction``: from 0 to 1."""

KEYS: Mapping[str, tuple[BodyKind, str]] = {
    "mass": ("mass", "kg"),
    "inertia": ("rotor", "kg m^2"),
    "position": ("prescribed", "m, or rad"),
    "velocity": ("prescribed", "m/s, or rad/s"),
    "fixed": ("fixed", "m, or rad"),
}
"""Key that defines a body -> kind of the body, unit of the key's value."""
STATE_NAMES: Mapping[BodyKind, tuple[str, str]] = {"mass": ("x", "v"), "rotor": ("phi", "omega")}
"""Prefixes of state names: position [m] and velocity [m/s], angle [rad] and angular velocity [rad/s]."""


@dataclass(frozen=True)
class Body:
    """Body of a scene."""

    name: str
    kind: BodyKind
    position: sp.Expr | None
    """Position [m] or angle [rad]: a state, or an expression in t and parameters. None if only velocity is given."""
    velocity: sp.Expr
    """Velocity [m/s] or angular velocity [rad/s]."""
    inertia: sp.Expr | None = None
    """Mass [kg] or moment of inertia [kg m^2]. None if the motion is prescribed."""

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """States, position first; empty if the motion is prescribed."""
        return () if self.inertia is None or self.position is None else (self.position, self.velocity)

    @property
    def acceleration(self) -> sp.Expr:
        """Acceleration of a body whose motion is prescribed [m/s^2 or rad/s^2]."""
        return sp.diff(self.velocity, TIME)


class Quantities:
    """Reader of the quantities of a scene; collects the conditions on its parameters."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.values = source.parameters(("scene", "parameters"))
        """Parameter -> exact value."""
        self.symbols = {name: sp.Symbol(name, real=True) for name in self.values}
        self.wanted: list[sp.Expr] = []
        """Expressions in the parameters; the scene is valid for other parameter values if all are larger than 0."""

    def want(self, expression: sp.Expr, value: sp.Expr, path: Path, message: str, *, above: bool = False) -> None:
        """Require that an expression is 0 or larger (``above``: larger than 0); ``value`` is its present value."""
        if exact_sign(value) < above:
            raise self.source.error(path, message)
        self.wanted.append(expression)

    def constant(self, path: Path, what: str, allowed: Range) -> sp.Expr:
        """Read an expression in the parameters and check the range of its value."""
        expression = self.source.expression(path, self.symbols)
        value = self.source.number(path, self.values)
        if allowed == "positive":
            self.want(expression, value, path, f"{what} must be larger than 0", above=True)
        elif allowed in ("nonnegative", "fraction"):
            self.want(expression, value, path, f"{what} must be 0 or larger")
        if allowed == "fraction":
            self.want(1 - expression, 1 - value, path, f"{what} must be at most 1")
        return expression

    def moving(self, read: Callable[..., T], path: Path, states: Mapping[str, sp.Expr] = MappingProxyType({})) -> T:
        """Read an expression in time, parameters and states; check it with the parameters' values, too."""
        found = read(path, {**self.symbols, "t": TIME, **states})
        read(path, {**self.values, "t": TIME, **states}, WITH_VALUES)
        return found


def read_bodies(quantities: Quantities) -> dict[str, Body]:
    """Read the bodies of a scene, by name."""
    source = quantities.source
    bodies: dict[str, Body] = {}
    owners: dict[str, str] = dict.fromkeys(quantities.values, "a parameter")
    for name in source.keys(("scene", "bodies")):
        path = ("scene", "bodies", name)
        if not NAME.fullmatch(name):
            message = f"'{name}' cannot name a body: a name is a letter, then letters, digits and underscores"
            raise source.error(path, message, key=True)
        body = _read(quantities, path)
        for i, state in enumerate(body.states):
            problem = name_problem(state.name, state=True)
            if not problem and state.name in owners:
                problem = f"'{state.name}' is already {owners[state.name]}; give other names by 'states'"
            if problem:
                raise source.error((*path, "states", i), problem, key=True)
            owners[state.name] = f"a state of '{name}'"
        bodies[name] = body
    return bodies


def _read(quantities: Quantities, path: Path) -> Body:
    name, source = str(path[-1]), quantities.source
    node = child(source.tree, path)
    if isinstance(node, ScalarNode) and node.value == "fixed":
        return Body(name, "fixed", sp.Integer(0), sp.Integer(0))
    known = ", ".join(f"'{key}' [{unit}]" for key, (_, unit) in KEYS.items())
    allowed = f"a body is 'fixed' or has one of the keys {known}"
    if not isinstance(node, MappingNode):
        raise source.error(path, f"'{name}': {allowed}")
    for key in node.entries:
        if key not in KEYS and key != "states":
            meant = did_you_mean(key, [*KEYS, "states"])
            raise source.error((*path, key), f"unknown key '{key}' of a body{meant}; {allowed}", key=True)
    given = [key for key in node.entries if key in KEYS]
    if not given:
        raise source.error(path, f"'{name}' has no key that defines the body: {allowed}", key=True)
    if len(given) > 1:
        message = f"'{name}' has '{given[0]}' and '{given[1]}'; {allowed}, not two of them"
        raise source.error((*path, given[1]), message, key=True)
    (key,) = given
    kind = KEYS[key][0]
    if kind not in STATE_NAMES:
        if "states" in node.entries:
            raise source.error((*path, "states"), f"'{name}' has no states: its motion is given", key=True)
        return _moved(quantities, path, key)
    inertia = quantities.constant((*path, key), f"'{key}' [{KEYS[key][1]}] of '{name}'", "positive")
    position, velocity = (sp.Symbol(x, real=True) for x in _state_names(source, path, kind))
    return Body(name, kind, position, velocity, inertia)


def _moved(quantities: Quantities, path: Path, key: str) -> Body:
    """Read a body whose motion is prescribed."""
    name, kind, source = str(path[-1]), KEYS[key][0], quantities.source
    if kind == "fixed":
        source.number((*path, key), quantities.values)
        return Body(name, kind, source.expression((*path, key), quantities.symbols), sp.Integer(0))
    given = quantities.moving(source.expression, (*path, key))
    return Body(name, kind, None, given) if key == "velocity" else Body(name, kind, given, sp.diff(given, TIME))


def _state_names(source: Source, path: Path, kind: BodyKind) -> tuple[str, str]:
    """Return the state names that a body gives, or the default ones made of its own name."""
    node = child(source.tree, (*path, "states"))
    if node is None:
        position, velocity = STATE_NAMES[kind]
        return f"{position}_{path[-1]}", f"{velocity}_{path[-1]}"
    names = [x.text for x in node.items if isinstance(x, ScalarNode)] if isinstance(node, SequenceNode) else []
    if len(names) != 2 or not isinstance(node, SequenceNode) or len(node.items) != 2:
        message = "'states' must be two names, as in [x1, x2]: " + listed(
            ["angle and angular velocity"] if kind == "rotor" else ["position and velocity"]
        )
        raise source.error((*path, "states"), message)
    return names[0], names[1]
