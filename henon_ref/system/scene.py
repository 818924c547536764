"""``scene:`` of a case file: bodies and connections, converted to a Filippov system.

Only the connections named in the scene become part of the equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.expressions.bounds import exact_sign
from henon_ref.expressions.evaluation import FIELD, SMOOTH, Kinked
from henon_ref.expressions.grammar import MAX_STATES, NAME, name_problem
from henon_ref.expressions.kinks import Kinks
from henon_ref.expressions.operations import names_in
from henon_ref.system.assembly import Body, BodyKind, Connection, Scene
from henon_ref.system.connections import KINDS, Key, Kind, Link, Range
from henon_ref.system.kinks import check_kinks, resolved
from henon_ref.system.source import WITH_VALUES, Path, Source
from henon_ref.system.tree import MappingNode, ScalarNode, child
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

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

CONNECTIONS = ("scene", "connections")
_KINK = "a kink"
"""Owner of the name of a kink, which several connections may share."""


def build_scene(source: Source) -> Scene:
    """Read a scene; once more with its surfaces known if a kink equals the surface of a later connection."""
    reader = _Reader(source)
    found = reader.scene()
    if reader.kinks.declared_late:
        declared = reader.kinks.declared
        reader = _Reader(source)
        for sign, surface in declared.items():
            reader.kinks.declare(sign, surface)
        found = reader.scene()
    return found


class _Reader:
    """Reader of a scene; collects the conditions on its parameters."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.values = source.parameters(("scene", "parameters"))
        """Parameter -> exact value."""
        self.symbols = {name: sp.Symbol(name, real=True) for name in self.values}
        self.wanted: list[sp.Expr] = []
        """Expressions in the parameters; the scene is valid for other parameter values if all are larger than 0."""
        self.bodies: dict[str, Body] = {}
        self.states: dict[str, sp.Symbol] = {}
        self.kinks = Kinks({self.symbols[name]: value for name, value in self.values.items()})

    def scene(self) -> Scene:
        self.bodies = self._read_bodies()
        self.states = {x.name: x for body in self.bodies.values() for x in body.states}
        if not self.states:
            message = "no body moves freely: give one a 'mass' or an 'inertia'"
            raise self.source.error(("scene", "bodies"), message, key=True)
        self._check_size("bodies", "states", len(self.states))
        owners = dict.fromkeys(self.states, "a state") | dict.fromkeys(self.values, "a parameter")
        owners |= {name: owners.get(name, "a body") for name in self.bodies}
        found = []
        for number in range(self.source.length(CONNECTIONS)):
            link = self._link(number)
            self._claim(link, owners)
            ends, surfaces = tuple(body.name for body in link.ends), link.surfaces | link.shared
            kinks = self.kinks.surfaces.keys() & surfaces.keys()
            found.append(Connection(link.kind, ends, link.name, link.pushes, surfaces, kinks, link.holds, link.impacts))
        self._check_size("connections", "surfaces", len({sign for each in found for sign in each.surfaces}))
        return Scene(self.bodies, tuple(found), self.kinks.parameters, (*self.wanted, *self.kinks.conditions))

    def _check_size(self, key: str, what: str, number: int) -> None:
        if number > MAX_STATES:
            message = f"'{key}' results in {number} {what}; at most {MAX_STATES} are allowed"
            raise self.source.error(("scene", key), message, key=True)

    def _claim(self, link: Link, owners: dict[str, str]) -> None:
        kinks = {sign.name for sign in self.kinks.surfaces}
        for name in dict.fromkeys([*([link.name] if link.name else []), *(sign.name for sign in link.surfaces)]):
            if name in kinks and owners.get(name) == _KINK:
                continue
            problem = name_problem(name)
            if not problem and name in owners:
                problem = f"'{name}' is already the name of {owners[name]}; give the {link.kind} another 'name'"
            if problem:
                raise link.error(problem, at="name" if link.name else None)
            owners[name] = _KINK if name in kinks else "a connection"

    # -- quantities and bodies --------------------------------------------------------------------------

    def _want(self, expression: sp.Expr, value: sp.Expr, path: Path, message: str, *, above: bool = False) -> None:
        """Require that an expression is 0 or larger (``above``: larger than 0); ``value`` is its present value."""
        if exact_sign(value) < above:
            raise self.source.error(path, message)
        self.wanted.append(expression)

    def _constant(self, path: Path, what: str, allowed: Range) -> sp.Expr:
        """Read an expression in the parameters and check the range of its value."""
        expression, _ = self.source.expression(path, self.symbols, SMOOTH)
        value = self.source.number(path, self.values)
        if allowed == "positive":
            self._want(expression, value, path, f"{what} must be larger than 0", above=True)
        elif allowed in ("nonnegative", "fraction"):
            self._want(expression, value, path, f"{what} must be 0 or larger")
        if allowed == "fraction":
            self._want(1 - expression, 1 - value, path, f"{what} must be at most 1")
        return expression

    def _moving(self, path: Path, functions: Mapping[str, int], states: Mapping[str, sp.Expr]) -> Kinked:
        """Read an expression in time, parameters and states; check it with the parameters' values, too."""
        found = self.source.expression(path, {**self.symbols, "t": TIME, **states}, functions)
        self.source.expression(path, {**self.values, "t": TIME, **states}, functions, WITH_VALUES)
        return found

    def _read_bodies(self) -> dict[str, Body]:
        source, bodies = self.source, dict[str, Body]()
        owners: dict[str, str] = dict.fromkeys(self.values, "a parameter")
        for name in source.keys(("scene", "bodies")):
            path = ("scene", "bodies", name)
            if not NAME.fullmatch(name):
                message = f"'{name}' cannot name a body: a name is a letter, then letters, digits and underscores"
                raise source.error(path, message, key=True)
            body = self._body_of(path)
            for i, state in enumerate(body.states):
                problem = name_problem(state.name, state=True)
                if not problem and state.name in owners:
                    problem = f"'{state.name}' is already {owners[state.name]}; give other names by 'states'"
                if problem:
                    raise source.error((*path, "states", i), problem, key=True)
                owners[state.name] = f"a state of '{name}'"
            bodies[name] = body
        return bodies

    def _body_of(self, path: Path) -> Body:
        name, source = str(path[-1]), self.source
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
            return self._moved(path, key)
        inertia = self._constant((*path, key), f"'{key}' [{KEYS[key][1]}] of '{name}'", "positive")
        position, velocity = (sp.Symbol(x, real=True) for x in self._state_names(path, kind))
        return Body(name, kind, position, velocity, inertia)

    def _moved(self, path: Path, key: str) -> Body:
        """Read a body whose motion is prescribed."""
        name, kind, source = str(path[-1]), KEYS[key][0], self.source
        if kind == "fixed":
            source.number((*path, key), self.values)
            return Body(name, kind, source.expression((*path, key), self.symbols, SMOOTH)[0], sp.Integer(0))
        given, _ = self._moving((*path, key), SMOOTH, {})
        return Body(name, kind, None, given) if key == "velocity" else Body(name, kind, given, sp.diff(given, TIME))

    def _state_names(self, path: Path, kind: BodyKind) -> tuple[str, str]:
        """Return the state names that a body gives, or the default ones made of its own name."""
        path = (*path, "states")
        node = child(self.source.tree, path)
        if node is None:
            position, velocity = STATE_NAMES[kind]
            return f"{position}_{path[-2]}", f"{velocity}_{path[-2]}"
        if self.source.length(path) != 2 or not all(isinstance(child(node, (i,)), ScalarNode) for i in range(2)):
            which = "angle and angular velocity" if kind == "rotor" else "position and velocity"
            raise self.source.error(path, f"'states' must be two names, as in [x1, x2]: {which}")
        return self.source.plain((*path, 0)), self.source.plain((*path, 1))

    # -- one connection ---------------------------------------------------------------------------------

    def _link(self, number: int) -> Link:
        entry = child(self.source.tree, (*CONNECTIONS, number))
        if not isinstance(entry, MappingNode) or len(entry.entries) != 1:
            message = "a connection is a kind with its keys, as in spring: {between: [a, wall], stiffness: 1}"
            raise self.source.error((*CONNECTIONS, number), f"{message}; kinds: {listed(KINDS)}")
        (name,) = entry.entries
        path = (*CONNECTIONS, number, name)
        if name not in KINDS:
            raise self.source.unknown(path, f"unknown connection '{name}'", "kinds", KINDS)
        kind = KINDS[name]
        own = child(self.source.tree, path)
        if not isinstance(own, MappingNode):
            raise self.source.error(path, f"'{name}' must be a mapping of its keys, as in {{{kind.example}, ...}}")
        self._check_keys(path, kind, own)
        ends = self._on(path, name, kind) if kind.on else self._between(path, name)
        link = Link(name, ends, self.source, path, self._name(path, own), self.kinks)
        turns = any(body.kind == "rotor" for body in ends)
        for key in kind.keys:
            self._read(link, key, turns, key.name in own.entries)
        kind.add(link)
        self._check_static(link)
        return link

    def _check_keys(self, path: Path, kind: Kind, own: MappingNode) -> None:
        known = ["on" if kind.on else "between", *(key.name for key in kind.keys), "name"]
        for key in own.entries:
            if key not in known:
                raise self.source.unknown((*path, key), f"'{path[-1]}' has no key '{key}'", "allowed", known)
        if known[0] not in own.entries:
            raise self.source.error(path, f"'{path[-1]}' requires '{known[0]}', as in {kind.example}", key=True)

    def _name(self, path: Path, own: MappingNode) -> str | None:
        node = own.entries.get("name")
        if node is None:
            return None
        if not isinstance(node, ScalarNode):
            raise self.source.error((*path, "name"), "'name' must be text, as in name: rub")
        return node.text

    def _body(self, path: Path) -> Body:
        name = self.source.plain(path)
        if name not in self.bodies:
            message = f"unknown body '{name}'{did_you_mean(name, self.bodies)}; bodies: {listed(self.bodies)}"
            raise self.source.error(path, message)
        return self.bodies[name]

    def _on(self, path: Path, name: str, kind: Kind) -> tuple[Body, ...]:
        body = self._body((*path, "on"))
        if body.kind != kind.on:
            other = next((n for n, k in KINDS.items() if k.on == body.kind), None)
            mend = f"use a {other}" if other else "its motion is given"
            raise self.source.error((*path, "on"), f"a {name} acts on a {kind.on}, not on '{body.name}': {mend}")
        return (body,)

    def _between(self, path: Path, name: str) -> tuple[Body, ...]:
        path = (*path, "between")
        if self.source.length(path) != 2:
            raise self.source.error(path, "'between' must name two bodies, as in [a, wall]")
        p, q = (self._body((*path, i)) for i in range(2))
        if p is q:
            raise self.source.error((*path, 1), f"'{p.name}' cannot be connected to itself; name another body")
        given = KINDS[name].between_given and not p.kind == q.kind == "fixed"
        if p.inertia is None and q.inertia is None and not given:
            which = "both are fixed" if p.kind == q.kind == "fixed" else "the motion of both is given"
            message = f"the {name} between '{p.name}' and '{q.name}' has no effect: {which}; name a mass or a rotor"
            raise self.source.error(path, message)
        if {p.kind, q.kind} == {"mass", "rotor"}:
            message = f"'{p.name}' is a {p.kind} and '{q.name}' a {q.kind}; connect two masses or two rotors"
            raise self.source.error((*path, 1), message)
        return p, q

    def _read(self, link: Link, key: Key, turns: bool, given: bool) -> None:
        """Read and check one key of a connection."""
        unit = key.angular if turns else key.unit
        what = f"'{key.name}'{f' [{unit}]' if unit else ''} ({key.meaning})"
        path = (*link.path, key.name)
        if not given:
            if not key.optional:
                raise link.error(f"{link.kind} requires the key {what}{_choice(key.words)}")
            return
        if key.words:
            word = self.source.plain(path)
            if word not in key.words:
                message = f"unknown {key.name} '{word}'{did_you_mean(word, key.words)}{_choice(key.words)}"
                raise self.source.error(path, message)
            link.words[key.name] = word
            return
        if key.of != "states":
            self._check_states(path, key)
        if key.of == "parameters":
            link.values[key.name] = self._constant(path, what, key.range)
            return
        written = self._moving(path, FIELD, self.states if key.of == "states" else {})
        if key.of == "time":  # kinks and jumps become surfaces
            link.values[key.name] = link.kinked(resolved(self.source, path, self.kinks, written))
        else:
            check_kinks(self.source, path, self.kinks, written[1])
            link.values[key.name], link.kinked_values[key.name] = written

    def _check_states(self, path: Path, key: Key) -> None:
        """Raise CaseError if an expression contains states that are not allowed in it."""
        held = [name for name in names_in(self.source.written(path)) if name in self.states]
        if held:
            allowed = "t and parameters" if key.of == "time" else "parameters"
            raise self.source.error(
                path,
                f"'{held[0]}' is a state, but '{key.name}' is an expression in {allowed}; for forces that depend on "
                "states use a spring, a damper or a friction, or write the equations as 'system' instead of 'scene'",
            )

    def _check_static(self, link: Link) -> None:
        """Check that static friction is not below sliding friction; else a contact would release and stick at once."""
        if "static" in link.values and "force" in link.values:
            path = (*link.path, "static")
            value = self.source.number(path, self.values) - self.source.number((*link.path, "force"), self.values)
            message = "'static' must not be smaller than 'force': static friction is at least sliding friction"
            self._want(link.values["static"] - link.values["force"], value, path, message)


def _choice(words: Sequence[str]) -> str:
    return f"; one of {listed(words)}" if words else ""
