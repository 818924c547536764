"""A scene put together: its bodies, its connections with their terms, and the Filippov system they add up to."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Set
from dataclasses import dataclass, replace
from functools import cached_property

import sympy as sp

from henon_ref.casefile.bodies import Body
from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Release, Reset, SlidingOverride
from henon_ref.modes.system import FilippovSystem


@dataclass(frozen=True)
class Surface:
    """A surface that a connection makes."""

    sign: sp.Symbol
    expression: sp.Expr
    """In t, states and parameters."""
    kink: bool = False
    """Whether it stands for a kink of an expression."""


@dataclass(frozen=True)
class Hold:
    """A contact that holds its two bodies together while the load on it is at most a limit."""

    sign: sp.Symbol
    limit: sp.Expr
    """Largest force [N] or torque [N m] that it can hold."""


@dataclass(frozen=True)
class Impact:
    """A surface at which the two bodies throw each other back."""

    sign: sp.Symbol
    restitution: sp.Expr
    """Speed after over speed before [1]."""


@dataclass(frozen=True)
class Connection:
    """A connection with what it adds to the equations."""

    kind: str
    ends: tuple[str, ...]
    """Names of the bodies it acts on, in the order of ``between``."""
    name: str | None
    """The name that the file gives it."""
    pushes: tuple[tuple[str, sp.Expr], ...]
    """Body and force [N] or torque [N m] on it."""
    surfaces: tuple[Surface, ...]
    holds: tuple[Hold, ...]
    impacts: tuple[Impact, ...] = ()

    @property
    def label(self) -> str:
        """Kind and bodies, and its name where it has one: ``friction rub (block, belt)``."""
        return f"{self.kind}{f' {self.name}' if self.name else ''} ({', '.join(self.ends)})"


@dataclass(frozen=True)
class Scene:
    """Bodies and what connects them."""

    bodies: Mapping[str, Body]
    connections: tuple[Connection, ...]
    parameters: Mapping[sp.Symbol, sp.Expr]
    """Parameter -> exact number."""

    def without(self, numbers: Collection[int]) -> Scene:
        """The scene with some connections left out."""
        return replace(self, connections=tuple(c for i, c in enumerate(self.connections) if i not in numbers))

    def system(self) -> FilippovSystem:
        """The Filippov system: states body by body, surfaces connection by connection."""
        surfaces = list(dict.fromkeys(surface for each in self.connections for surface in each.surfaces))
        order = [surface.sign for surface in surfaces]
        system = FilippovSystem(
            states=tuple(x for body in self.bodies.values() for x in body.states),
            signs=tuple(order),
            surfaces=tuple(surface.expression for surface in surfaces),
            field=self._field({}, {}),
            parameters=self.parameters,
            overrides={
                order.index(hold.sign): self._held(number, connection, hold)
                for number, connection in enumerate(self.connections)
                for hold in connection.holds
            },
            kinks=frozenset(number for number, surface in enumerate(surfaces) if surface.kink),
            effects=tuple(connection.label for connection in self.connections),
            resets={
                order.index(impact.sign): Reset(thrown_back(*self._ends(connection), impact.restitution))
                for connection in self.connections
                for impact in connection.impacts
            },
        )
        return with_resting(system)

    def _ends(self, connection: Connection) -> tuple[Body, Body]:
        p, q = (self.bodies[name] for name in connection.ends)
        return p, q

    @cached_property
    def _pushes(self) -> Mapping[str, list[tuple[int, sp.Expr]]]:
        """Body -> the forces [N] or torques [N m] on it, each with the number of its connection."""
        found: dict[str, list[tuple[int, sp.Expr]]] = {name: [] for name in self.bodies}
        for number, connection in enumerate(self.connections):
            for name, push in connection.pushes:
                found[name].append((number, push))
        return found

    def _force(self, body: Body, without: int | None = None) -> sp.Expr:
        """Sum of the forces or torques on a body, those of one connection left out."""
        return sp.Add(*(push for number, push in self._pushes[body.name] if number != without))

    def _field(self, on_surface: Mapping[sp.Symbol, sp.Expr], held: Mapping[str, sp.Expr]) -> tuple[sp.Expr, ...]:
        """x' of all states, on a surface, some bodies' accelerations given."""
        rates: list[sp.Expr] = []
        for name, own in self._rates.items():
            pair = (own[0], held[name]) if name in held else own
            symbols = self._moving[name] if name not in held else on_surface.keys()
            rates += pair if symbols.isdisjoint(on_surface) else (rate.xreplace(on_surface) for rate in pair)
        return tuple(rates)

    @cached_property
    def _rates(self) -> Mapping[str, tuple[sp.Expr, sp.Expr]]:
        """Body that moves -> its velocity and acceleration."""
        bodies = (body for body in self.bodies.values() if body.inertia is not None)
        return {body.name: (body.velocity, self._force(body) / body.inertia) for body in bodies}

    @cached_property
    def _moving(self) -> Mapping[str, Set[sp.Symbol]]:
        """What stands in these."""
        return {name: velocity.free_symbols | rate.free_symbols for name, (velocity, rate) in self._rates.items()}

    def _held(self, number: int, connection: Connection, hold: Hold) -> SlidingOverride:
        """The two bodies of a contact move as one, until the load on it is larger than the limit.

        The load is the force that the contact takes from the first body and gives to the second:
        ``m_p a = f_p - load``, ``m_q a = f_q + load``.
        """
        p, q = self._ends(connection)
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
        else:  # whose motion is given, at one velocity: nothing to carry
            on_surface, load, held, inertia = {}, sp.Integer(0), {}, sp.Integer(0)
        load, limit = load.xreplace(on_surface), hold.limit.xreplace(on_surface)
        ends = {body.velocity: way / body.inertia for body, way in ((p, -1), (q, 1)) if body.inertia is not None}
        return SlidingOverride(
            field=self._field(on_surface, held),
            release=(Release(load - limit, "rising", 1), Release(load + limit, "falling", -1)),
            entry="inside",
            inertia=inertia,
            push=tuple(ends.get(x, sp.S.Zero) for body in self.bodies.values() for x in body.states) if ends else (),
        )


def thrown_back(p: Body, q: Body, restitution: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Velocities after an impact, of those bodies that move freely.

    The relative velocity v_p - v_q turns round and is multiplied by the restitution, the momentum of the two stays
    (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 4); a body whose motion is given is not moved.

    Parameters
    ----------
    p, q : Body
    restitution : Expr
        Speed after over speed before, 0 to 1 [1].
    """
    change = (1 + restitution) * (p.velocity - q.velocity)
    if p.inertia is None:
        return {q.velocity: q.velocity + change}
    if q.inertia is None:
        return {p.velocity: p.velocity - change}
    whole = p.inertia + q.inertia
    return {p.velocity: p.velocity - q.inertia * change / whole, q.velocity: q.velocity + p.inertia * change / whole}
