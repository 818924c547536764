"""Scene of bodies and connections, assembled into a Filippov system."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import sympy as sp

from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Release, Reset, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

BodyKind = Literal["mass", "rotor", "prescribed", "fixed"]


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


@dataclass(frozen=True)
class Connection:
    """Connection between bodies, with its terms in the equations."""

    kind: str
    ends: tuple[str, ...]
    """Names of the bodies, in the order of ``between``."""
    name: str | None
    pushes: Sequence[tuple[str, sp.Expr]]
    """Pairs of a body's name and the force [N] or torque [N m] on it."""
    surfaces: Mapping[sp.Symbol, sp.Expr]
    """Each sign in the terms -> its surface, in t, states and parameters."""
    kinks: Set[sp.Symbol]
    """Signs of kinks of expressions."""
    holds: Mapping[sp.Symbol, sp.Expr]
    """Sign of a contact that holds its two bodies together -> largest force [N] or torque [N m] that it can hold."""
    impacts: Mapping[sp.Symbol, sp.Expr]
    """Sign of a surface at which two bodies collide -> relative speed after the impact over that before [1]."""

    @property
    def label(self) -> str:
        """Kind, name (if given) and bodies: ``friction rub (block, belt)``."""
        return f"{self.kind}{f' {self.name}' if self.name else ''} ({', '.join(self.ends)})"


@dataclass(frozen=True)
class Scene:
    """Bodies and the connections between them."""

    bodies: Mapping[str, Body]
    connections: tuple[Connection, ...]
    parameters: Mapping[sp.Symbol, sp.Expr]
    conditions: tuple[sp.Expr, ...]
    """Expressions in the parameters; other values of the parameters are allowed if they make all of these positive."""

    def without(self, numbers: Collection[int]) -> Scene:
        """Return the scene without the connections of the given indices."""
        return replace(self, connections=tuple(c for i, c in enumerate(self.connections) if i not in numbers))

    def system(self) -> FilippovSystem:
        """Return the Filippov system: states in the order of the bodies, surfaces in that of the connections."""
        surfaces = {sign: h for each in self.connections for sign, h in each.surfaces.items()}
        places = {sign: i for i, sign in enumerate(surfaces)}
        system = FilippovSystem(
            states=tuple(x for body in self.bodies.values() for x in body.states),
            signs=tuple(surfaces),
            surfaces=tuple(surfaces.values()),
            field=self._field({}, {}),
            parameters=self.parameters,
            overrides={
                places[sign]: self._held(number, limit)
                for number, connection in enumerate(self.connections)
                for sign, limit in connection.holds.items()
            },
            kinks=frozenset(places[sign] for connection in self.connections for sign in connection.kinks),
            conditions=self.conditions,
            effects=tuple(connection.label for connection in self.connections),
            resets={
                places[sign]: Reset(thrown_back(*self._ends(connection), restitution))
                for connection in self.connections
                for sign, restitution in connection.impacts.items()
            },
        )
        return with_resting(system)

    def _ends(self, connection: Connection) -> tuple[Body, Body]:
        p, q = (self.bodies[name] for name in connection.ends)
        return p, q

    @cached_property
    def _pushes(self) -> Mapping[str, list[tuple[int, sp.Expr]]]:
        """Body -> forces [N] or torques [N m] on it, each with the index of its connection."""
        found: dict[str, list[tuple[int, sp.Expr]]] = {name: [] for name in self.bodies}
        for number, connection in enumerate(self.connections):
            for name, push in connection.pushes:
                found[name].append((number, push))
        return found

    def _force(self, body: Body, without: int | None = None) -> sp.Expr:
        return sp.Add(*(push for number, push in self._pushes[body.name] if number != without))

    def _field(self, on_surface: Mapping[sp.Symbol, sp.Expr], held: Mapping[str, sp.Expr]) -> tuple[sp.Expr, ...]:
        """Return x' of all states on a surface; ``held`` gives the acceleration of some bodies."""
        rates: list[sp.Expr] = []
        for name, own in self._rates.items():
            pair = (own[0], held[name]) if name in held else own
            symbols = self._moving[name] if name not in held else on_surface.keys()
            rates += pair if symbols.isdisjoint(on_surface) else (rate.xreplace(on_surface) for rate in pair)
        return tuple(rates)

    @cached_property
    def _rates(self) -> Mapping[str, tuple[sp.Expr, sp.Expr]]:
        """Free body -> its velocity and acceleration."""
        bodies = (body for body in self.bodies.values() if body.inertia is not None)
        return {body.name: (body.velocity, self._force(body) / body.inertia) for body in bodies}

    @cached_property
    def _moving(self) -> Mapping[str, Set[sp.Symbol]]:
        """Free body -> symbols in its velocity and acceleration."""
        return {name: velocity.free_symbols | rate.free_symbols for name, (velocity, rate) in self._rates.items()}

    def _held(self, number: int, limit: sp.Expr) -> SlidingOverride:
        """Return the mode in which the two bodies of a contact move as one until the load exceeds the limit.

        The load is the force that the contact takes from the first body and gives to the second:
        ``m_p a = f_p - load``, ``m_q a = f_q + load``.
        """
        p, q = self._ends(self.connections[number])
        f_p, f_q = (self._force(body, without=number) for body in (p, q))
        if p.inertia is not None and q.inertia is not None:
            on_surface = {q.velocity: p.velocity}
            load = (q.inertia * f_p - p.inertia * f_q) / (p.inertia + q.inertia)
            together = (f_p + f_q) / (p.inertia + q.inertia)
            held = {p.name: together, q.name: together}
            inertia = p.inertia * q.inertia / (p.inertia + q.inertia)
        elif p.inertia is not None:
            on_surface = {p.velocity: q.velocity}
            load = f_p - p.inertia * q.acceleration
            held, inertia = {p.name: q.acceleration}, p.inertia
        elif q.inertia is not None:
            on_surface = {q.velocity: p.velocity}
            load = q.inertia * p.acceleration - f_q
            held, inertia = {q.name: p.acceleration}, q.inertia
        else:  # both motions are prescribed, with equal velocities: no load
            on_surface, load, held, inertia = {}, sp.Integer(0), {}, sp.Integer(0)
        load, limit = load.xreplace(on_surface), limit.xreplace(on_surface)
        ends = {body.velocity: way / body.inertia for body, way in ((p, -1), (q, 1)) if body.inertia is not None}
        return SlidingOverride(
            field=self._field(on_surface, held),
            release=(Release(load - limit, "rising", 1), Release(load + limit, "falling", -1)),
            entry="inside",
            inertia=inertia,
            push=tuple(ends.get(x, sp.S.Zero) for body in self.bodies.values() for x in body.states) if ends else (),
        )


def thrown_back(p: Body, q: Body, restitution: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Return the velocities after an impact of the bodies that move freely.

    The relative velocity v_p - v_q is reversed and multiplied by the restitution; the total momentum is conserved
    (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 4). A body whose motion is prescribed is unaffected.
    """
    change = (1 + restitution) * (p.velocity - q.velocity)
    if p.inertia is None:
        return {q.velocity: q.velocity + change}
    if q.inertia is None:
        return {p.velocity: p.velocity - change}
    whole = p.inertia + q.inertia
    return {p.velocity: p.velocity - q.inertia * change / whole, q.velocity: q.velocity + p.inertia * change / whole}
