"""``scene:`` of a case file: bodies and connections, converted to a Filippov system.

Only the connections named in the scene become part of the equations.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from henon_ref.expressions.grammar import MAX_STATES, name_problem
from henon_ref.expressions.kinks import Kinks
from henon_ref.expressions.operations import names_in
from henon_ref.system.assembly import Connection, Scene
from henon_ref.system.bodies import Body, Quantities, read_bodies
from henon_ref.system.connections import KINDS, Key, Kind, Link
from henon_ref.system.kinks import check_kinks, resolved
from henon_ref.system.source import Names, Path, Source
from henon_ref.system.tree import MappingNode, ScalarNode, SequenceNode, child
from henon_ref.text import did_you_mean, listed

CONNECTIONS = ("scene", "connections")
_KINK = "a kink"
"""Owner of the name of a kink, which several connections may share."""


def build_scene(source: Source) -> tuple[Scene, Names]:
    """Build the scene of a case file."""
    return _read(source)[1]


def conditions(source: Source) -> list[sp.Expr]:
    """Return expressions in the parameters of a scene; parameter values that make all of them positive are allowed."""
    reader, _ = _read(source)
    return [*reader.quantities.wanted, *reader.kinks.conditions]


def _read(source: Source) -> tuple[_Reader, tuple[Scene, Names]]:
    """Read a scene; once more with its surfaces known if a kink equals the surface of a later connection."""
    reader = _Reader(source)
    found = reader.scene()
    if reader.kinks.declared_late:
        declared = reader.kinks.declared
        reader = _Reader(source)
        for sign, surface in declared.items():
            reader.kinks.declare(sign, surface)
        found = reader.scene()
    return reader, found


class _Reader:
    def __init__(self, source: Source) -> None:
        self.source = source
        self.quantities = Quantities(source)
        self.values = self.quantities.values
        self.bodies: dict[str, Body] = {}
        self.states: dict[str, sp.Symbol] = {}
        self.kinks = Kinks({self.quantities.symbols[name]: value for name, value in self.values.items()})

    def scene(self) -> tuple[Scene, Names]:
        self.bodies = read_bodies(self.quantities)
        self.states = {x.name: x for body in self.bodies.values() for x in body.states}
        if not self.states:
            message = "no body moves freely: give one a 'mass' or an 'inertia'"
            raise self.source.error(("scene", "bodies"), message, key=True)
        self._check_size("bodies", "states", len(self.states))
        owners = dict.fromkeys(self.states, "a state") | dict.fromkeys(self.values, "a parameter")
        owners |= {name: owners.get(name, "a body") for name in self.bodies}
        found, signs = [], []
        node = child(self.source.tree, CONNECTIONS)
        for number in range(len(node.items) if isinstance(node, SequenceNode) else 0):
            link = self._link(number)
            self._claim(link, owners)
            signs += [surface.sign.name for surface in (*link.surfaces, *link.shared)]
            found.append(
                Connection(
                    link.kind,
                    tuple(body.name for body in link.ends),
                    link.name,
                    tuple(link.pushes),
                    (*link.surfaces, *link.shared),
                    tuple(link.holds),
                    tuple(link.impacts),
                )
            )
        self._check_size("connections", "surfaces", len(set(signs)))
        names = Names.of(list(self.states), list(dict.fromkeys(signs)), self.values)
        return Scene(self.bodies, tuple(found), names.exact_parameters()), names

    def _check_size(self, key: str, what: str, number: int) -> None:
        if number > MAX_STATES:
            message = f"'{key}' results in {number} {what}; at most {MAX_STATES} are allowed"
            raise self.source.error(("scene", key), message, key=True)

    def _claim(self, link: Link, owners: dict[str, str]) -> None:
        """Claim the names of the connection, which must be unique."""
        kinks = {sign.name for sign in self.kinks.surfaces}
        for name in dict.fromkeys([*([link.name] if link.name else []), *(s.sign.name for s in link.surfaces)]):
            if name in kinks and owners.get(name) == _KINK:
                continue
            problem = name_problem(name)
            if not problem and name in owners:
                problem = f"'{name}' is already the name of {owners[name]}; give the {link.kind} another 'name'"
            if problem:
                raise link.error(problem, at="name" if link.name else None)
            owners[name] = _KINK if name in kinks else "a connection"

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
            example = "on: a" if kind.on else "between: [a, wall]"
            raise self.source.error(path, f"'{name}' must be a mapping of its keys, as in {{{example}, ...}}")
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
                message = f"'{path[-1]}' has no key '{key}'{did_you_mean(key, known)}; allowed: {listed(known)}"
                raise self.source.error((*path, key), message, key=True)
        if known[0] not in own.entries:
            example = "on: a" if kind.on else "between: [a, wall]"
            raise self.source.error(path, f"'{path[-1]}' requires '{known[0]}', as in {example}", key=True)

    def _name(self, path: Path, own: MappingNode) -> str | None:
        node = own.entries.get("name")
        if node is None:
            return None
        if not isinstance(node, ScalarNode):
            raise self.source.error((*path, "name"), "'name' must be text, as in name: rub")
        return node.text

    def _body(self, path: Path) -> Body:
        node = child(self.source.tree, path)
        name = node.text if isinstance(node, ScalarNode) else ""
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
        node = child(self.source.tree, path)
        if not isinstance(node, SequenceNode) or len(node.items) != 2:
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
            node = child(self.source.tree, path)
            word = node.text if isinstance(node, ScalarNode) else ""
            if word not in key.words:
                message = f"unknown {key.name} '{word}'{did_you_mean(word, key.words)}{_choice(key.words)}"
                raise self.source.error(path, message)
            link.words[key.name] = word
            return
        if key.of != "states":
            self._check_states(path, key)
        if key.of == "parameters":
            link.values[key.name] = self.quantities.constant(path, what, key.range)
            return
        written = self.quantities.moving(self.source.field, path, self.states if key.of == "states" else {})
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
            self.quantities.want(link.values["static"] - link.values["force"], value, path, message)


def _choice(words: Sequence[str]) -> str:
    return f"; one of {listed(words)}" if words else ""
