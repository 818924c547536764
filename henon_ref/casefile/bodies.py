"""Bodies of a scene: masses and rotors, which have states, and bodies whose motion is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import sympy as sp

from henon_ref.casefile.grammar import NAME, TAKEN, name_problem
from henon_ref.casefile.source import Path, Source
from henon_ref.casefile.tree import MappingNode, ScalarNode, SequenceNode, child
from henon_ref.modes.bounds import exact_sign
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

BodyKind = Literal["mass", "rotor", "prescribed", "fixed"]

KEYS: Mapping[str, tuple[BodyKind, str]] = {
    "mass": ("mass", "kg"),
    "inertia": ("rotor", "kg m^2"),
    "position": ("prescribed", "m, or rad"),
    "velocity": ("prescribed", "m/s, or rad/s"),
    "fixed": ("fixed", "m, or rad"),
}
"""The key that says what a body is -> its kind, and the key's unit."""
STATE_NAMES: Mapping[BodyKind, tuple[str, str]] = {"mass": ("x", "v"), "rotor": ("phi", "omega")}
"""Before the body's name: position [m] and velocity [m/s], angle [rad] and angular velocity [rad/s]."""


@dataclass(frozen=True)
class Body:
    """One body of a scene."""

    name: str
    kind: BodyKind
    position: sp.Expr | None
    """Position [m] or angle [rad]: a state, or an expression in t and parameters; None: the velocity alone is given."""
    velocity: sp.Expr
    """Its rate [m/s or rad/s]."""
    inertia: sp.Expr | None = None
    """Mass [kg] or moment of inertia [kg m^2] of what moves freely; None: its motion is given."""

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """Its states, position first; none where its motion is given."""
        return () if self.inertia is None or self.position is None else (self.position, self.velocity)

    @property
    def acceleration(self) -> sp.Expr:
        """The acceleration of a body whose motion is given [m/s^2 or rad/s^2]."""
        return sp.diff(self.velocity, TIME)


@dataclass
class Requirements:
    """Collects the expressions that must be larger than 0, or not smaller, and checks their values."""

    source: Source
    expressions: list[sp.Expr] = field(default_factory=list)
    """Checked; where new values of the parameters make all of these larger than 0, the scene allows them."""

    def want(self, expression: sp.Expr, value: sp.Expr, path: Path, message: str, *, above: bool = False) -> None:
        """Want an expression to be 0 or larger; with ``above`` larger than 0.

        Raises
        ------
        CaseError
            At ``path``, with the message, where its value is not.
        """
        if exact_sign(value) < above:
            raise self.source.error(path, message)
        self.expressions.append(expression)


def read_bodies(source: Source, values: Mapping[str, sp.Expr], requirements: Requirements) -> dict[str, Body]:
    """The bodies of a scene, by name.

    Parameters
    ----------
    source : Source
    values : mapping
        Parameter -> exact number.
    requirements : Requirements
        Takes down what is wanted of the parameters.

    Raises
    ------
    CaseError
        At the place of a name, key or value that is not allowed.
    """
    bodies: dict[str, Body] = {}
    owners: dict[str, str] = dict.fromkeys(values, "a parameter")
    for name in source.keys(("scene", "bodies")):
        path = ("scene", "bodies", name)
        if not NAME.fullmatch(name):
            message = f"'{name}' is no name of a body: a letter first, then letters, digits and underscores"
            raise source.error(path, message, key=True)
        body = _read(source, path, values, requirements)
        for i, state in enumerate(body.states):
            problem = _state_problem(state.name, owners)
            if problem:
                raise source.error((*path, "states", i), problem, key=True)
            owners[state.name] = f"a state of '{name}'"
        bodies[name] = body
    return bodies


def _state_problem(name: str, owners: Mapping[str, str]) -> str:
    problem = name_problem(name)
    if not problem and name in owners:
        problem = f"'{name}' is already {owners[name]}; give other names by 'states'"
    if not problem and name in TAKEN:
        problem = f"'{name}' is a column of transitions.csv, where states have theirs; give other names by 'states'"
    return problem


def _read(source: Source, path: Path, values: Mapping[str, sp.Expr], requirements: Requirements) -> Body:
    name = str(path[-1])
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
        raise source.error(path, f"'{name}' lacks what it is: {allowed}", key=True)
    if len(given) > 1:
        message = f"'{name}' has '{given[0]}' and '{given[1]}'; {allowed}, not two"
        raise source.error((*path, given[1]), message, key=True)
    (key,) = given
    kind = KEYS[key][0]
    if kind not in STATE_NAMES:
        if "states" in node.entries:
            raise source.error((*path, "states"), f"'{name}' has no states: its motion is given", key=True)
        return _moved(source, path, key, values)
    symbols = {p: sp.Symbol(p, real=True) for p in values}
    inertia = source.expression((*path, key), symbols)
    what = f"'{key}' [{KEYS[key][1]}] of '{name}'"
    message = f"{what} must be larger than 0"
    requirements.want(inertia, source.number((*path, key), values), (*path, key), message, above=True)
    position, velocity = (sp.Symbol(x, real=True) for x in _state_names(source, path, kind))
    return Body(name, kind, position, velocity, inertia)


def _moved(source: Source, path: Path, key: str, values: Mapping[str, sp.Expr]) -> Body:
    """A body whose motion is given."""
    name, kind = str(path[-1]), KEYS[key][0]
    symbols = {p: sp.Symbol(p, real=True) for p in values}
    if kind == "fixed":
        source.number((*path, key), values)
        return Body(name, kind, source.expression((*path, key), symbols), sp.Integer(0))
    given = source.expression((*path, key), {**symbols, "t": TIME})
    source.expression((*path, key), {**values, "t": TIME}, " (with the values of the parameters)")
    if key == "velocity":
        return Body(name, kind, None, given)
    return Body(name, kind, given, sp.diff(given, TIME))


def _state_names(source: Source, path: Path, kind: BodyKind) -> tuple[str, str]:
    """The names a body gives its states, or those made of its own."""
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
