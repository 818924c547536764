"""What a kind of connection is: keys with units, and the terms it adds to the bodies it acts on.

Each kind is one file in :mod:`henon_ref.casefile.connections`, found by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Literal

import sympy as sp

from henon_ref.casefile.bodies import Body
from henon_ref.casefile.kinks import Kinks
from henon_ref.casefile.source import Path, Source
from henon_ref.errors import CaseError

Range = Literal["any", "nonnegative", "positive", "fraction"]
"""``fraction``: from 0 to 1."""


@dataclass(frozen=True)
class Key:
    """One key of a connection."""

    name: str
    unit: str
    """Between masses."""
    angular: str
    """Unit between rotors."""
    meaning: str
    optional: bool = False
    """Whether it may be left out, and is then not in the equations."""
    range: Range = "any"
    of: Literal["parameters", "time", "states"] = "parameters"
    """What it is an expression in: parameters; t besides; t and states besides."""
    words: tuple[str, ...] = ()
    """It is one of these words, not an expression."""


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
    """A contact that holds more than it slides with."""

    sign: sp.Symbol
    limit: sp.Expr
    """Largest force [N] or torque [N m] that it can hold."""


@dataclass(frozen=True)
class Impact:
    """A surface at which the two bodies throw each other back."""

    sign: sp.Symbol
    restitution: sp.Expr
    """Speed after over speed before [1]."""


@dataclass
class Link:
    """One connection under construction: what its kind reads, and what it adds.

    Attributes
    ----------
    kind : str
    ends : tuple of Body
        The bodies of ``between``, in its order, or that of ``on``.
    values, words : dict
        Keys that are given: expressions, and words.
    """

    kind: str
    ends: tuple[Body, ...]
    values: dict[str, sp.Expr]
    words: dict[str, str]
    source: Source
    path: Path
    """To its keys in the file."""
    name: str | None
    """The name that the file gives it."""
    kinks: Kinks
    """Of the whole scene so far."""
    kinked_values: dict[str, list[sp.Expr]] = field(default_factory=dict)
    """Keys read in states -> what their values have kinks for, which have no symbols yet."""
    pushes: list[tuple[str, sp.Expr]] = field(default_factory=list)
    """Body and force [N] or torque [N m] on it, by this connection alone."""
    surfaces: list[Surface] = field(default_factory=list)
    shared: list[Surface] = field(default_factory=list)
    """Other connections' surfaces whose signs stand in this one's terms, for a kink that is one of them."""
    holds: list[Hold] = field(default_factory=list)
    impacts: list[Impact] = field(default_factory=list)

    def error(self, message: str, *, at: str | None = None) -> CaseError:
        """An error at one of its keys, or at its kind where a key is missing."""
        return self.source.error(self.path if at is None else (*self.path, at), message, key=True)

    def later(self, names: Collection[str]) -> str:
        """Of some of its keys the one that stands last in the file."""
        return [key for key in self.source.keys(self.path) if key in names][-1]

    @property
    def velocity(self) -> sp.Expr:
        """v_p - v_q [m/s], or omega_p - omega_q [rad/s]."""
        p, q = self.ends
        return p.velocity - q.velocity

    @property
    def distance(self) -> sp.Expr:
        """x_p - x_q [m], or phi_p - phi_q [rad].

        Raises
        ------
        CaseError
            Where a body has a velocity alone.
        """
        for i, body in enumerate(self.ends):
            if body.position is None:
                message = (
                    f"{self.kind} needs the position of '{body.name}', of which the velocity alone is given; "
                    "give its 'position' in place of its 'velocity'"
                )
                raise self.source.error((*self.path, "between", i), message)
        p, q = self.ends
        assert p.position is not None
        assert q.position is not None
        return p.position - q.position

    def push(self, force: sp.Expr) -> None:
        """Add a force [N] or torque [N m] on the first body, and its opposite on the second."""
        for body, own in zip(self.ends, (force, -force), strict=False):
            if body.inertia is not None:
                self.pushes.append((body.name, own))

    def sign(self, letter: str, surface: sp.Expr) -> sp.Symbol:
        """The sign of an expression, which becomes a surface: the connection's name, or ``letter_p_q``."""
        name = self.name or "_".join((letter, *(body.name for body in self.ends)))
        symbol = sp.Symbol(name, real=True)
        self.surfaces.append(Surface(symbol, surface))
        self.kinks.declare(symbol, surface)
        return symbol

    def positive_part(self, key: str) -> sp.Expr:
        """max(0, value) of a key that is read in states, its kinks surfaces."""
        return self.kinked(self.kinks.positive_part(self.values[key], self.kinked_values[key]))

    def limited(self, expression: sp.Expr, bound: sp.Expr) -> sp.Expr:
        """An expression kept between -bound and bound, its kinks surfaces."""
        return self.kinked(self.kinks.limited(expression, bound))

    def kinked(self, expression: sp.Expr) -> sp.Expr:
        """An expression of which the kinks become surfaces of this connection, too."""
        self.surfaces += [Surface(sign, surface, kink=True) for sign, surface in self.kinks.used(expression).items()]
        for sign, surface in self.kinks.declared.items():
            if expression.has(sign) and Surface(sign, surface) not in self.surfaces:
                self.shared.append(Surface(sign, surface))
        return expression

    def hold(self, sign: sp.Symbol, limit: sp.Expr) -> None:
        """Hold the two bodies together while the load is at most ``limit`` [N or N m]."""
        self.holds.append(Hold(sign, limit))

    def throw_back(self, sign: sp.Symbol, restitution: sp.Expr) -> None:
        """Let the two bodies throw each other back where a surface falls through zero."""
        self.impacts.append(Impact(sign, restitution))


@dataclass(frozen=True)
class Kind:
    """A kind of connection."""

    meaning: str
    keys: tuple[Key, ...]
    add: Callable[[Link], None]
    """Adds its terms to a connection under construction."""
    on: Literal["", "mass", "rotor"] = ""
    """The kind of body that it acts on alone, named by ``on``; empty: it acts between two, named by ``between``."""
    between_given: bool = False
    """Whether it may stand between two bodies whose motion is given, where it acts on nothing but has a mode."""
