"""What an effect is: a name, parameters with units, and the term it adds to a body under construction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, Literal, TypeVar

import sympy as sp

from henon_ref.filippov.system import SlidingOverride
from henon_ref.taylor.tape import TIME


class Stage(IntEnum):
    """When an effect adds its term: what others read comes first."""

    MOTION = 0
    """Drives and belts: how supports move."""
    FORCE = 1
    """Springs, dampers, loads."""
    FRICTION = 2
    """Kinetic friction, which reads the belt's velocity and the normal load."""
    HOLDING = 3
    """Static friction and variants, which read everything else."""


@dataclass(frozen=True)
class EffectParameter:
    """One number an effect needs."""

    name: str
    unit: str
    meaning: str
    default: str | None = None
    """Expression used where the scene gives none; None: the scene must give it."""
    range: Literal["any", "nonnegative", "positive"] = "any"
    in_time: bool = False
    """Whether it may be a function of t."""


class Contact:
    """A body that touches a belt: the part of a scene under construction that friction needs.

    Attributes
    ----------
    velocity : Symbol
        Velocity of the block, a state.
    sign : Symbol
        Sign of the sliding velocity, +1 where the block is faster than the belt.
    belt : Expr
        Velocity of the belt, in t and parameters; 0 unless an effect moves it.
    normal_load : Expr
        Factor of every friction force; 1 unless an effect changes it.
    friction : Expr
        Kinetic friction that opposes the sliding velocity, in t, states and ``sign``.
    """

    def __init__(self, velocity: sp.Symbol) -> None:
        self.velocity = velocity
        self.sign = sp.Symbol("s", real=True)
        self.belt: sp.Expr = sp.Integer(0)
        self.normal_load: sp.Expr = sp.Integer(1)
        self.friction: sp.Expr = sp.Integer(0)
        self.valid: list[sp.Expr] = []
        self.override: SlidingOverride | None = None

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        raise NotImplementedError

    @property
    def sliding_velocity(self) -> sp.Expr:
        """Velocity of the block over the belt."""
        return self.velocity - self.belt

    @property
    def belt_acceleration(self) -> sp.Expr:
        return sp.diff(self.belt, TIME)

    def field(self) -> tuple[sp.Expr, ...]:
        """x' in slip, in t, states, ``sign`` and parameters."""
        raise NotImplementedError

    def stuck_field(self) -> tuple[sp.Expr, ...]:
        """x' while the block moves with the belt."""
        raise NotImplementedError

    def holding_load(self) -> sp.Expr:
        """The force that friction has to balance while the block moves with the belt, in units of friction."""
        raise NotImplementedError


BodyT = TypeVar("BodyT", bound=Contact)
ActsOn = TypeVar("ActsOn", bound=Contact, contravariant=True)
"""An effect on any contact acts on every kind of body."""


@dataclass(frozen=True)
class Effect(Generic[ActsOn]):
    """A named term with its parameters."""

    name: str
    meaning: str
    stage: Stage
    parameters: tuple[EffectParameter, ...]
    term: Callable[[ActsOn, Mapping[str, sp.Expr]], None]
    """Adds the term; given the body and the values by the names of the parameters."""
    needs: tuple[str, ...] = ()
    """Effects of which the scene must name at least one besides."""

    def add(self, body: ActsOn, values: Mapping[str, sp.Expr]) -> None:
        """Add this effect's term to a body under construction."""
        self.term(body, values)


@dataclass(frozen=True)
class Body(Generic[BodyT]):
    """A kind of scene: its states, the parameters it reads itself, and the effects it knows."""

    name: str
    meaning: str
    parameters: tuple[EffectParameter, ...]
    """Read from ``scene.parameters`` by these names."""
    make: Callable[[Mapping[str, sp.Expr]], BodyT]
    effects: tuple[Effect[BodyT], ...]
