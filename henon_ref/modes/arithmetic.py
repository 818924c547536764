"""What the selection of modes asks of numbers: which are negative, and which term of a series is the first that counts.

The rule (:mod:`henon_ref.modes.selection`) is written once, over points whose numbers are of some arithmetic:
doubles (:mod:`henon_ref.modes.in_doubles`), balls (:mod:`henon_ref.modes.in_balls`). An
:class:`Arithmetic` judges numbers; a :class:`Point` has those of a system's modes at a time and state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import sympy as sp

from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import Ring

NO_VALUE = (ZeroDivisionError, ValueError, OverflowError)
"""What ``math`` and python-flint raise where an expression has no finite value."""
ZERO = 1e-13
"""Relative size below which a derivative counts as zero (a tangency within it cannot be told in double)."""
CLEAR = 1e-9
"""Part of its terms from which on a value is clearly no zero."""
ORDER = 8
"""Derivatives looked at before a contact counts as one that never separates."""

Leading = tuple[int, int]
"""(index, sign) of the first coefficient of a Taylor series that counts as not zero."""


class Arithmetic(Protocol):
    """How numbers are computed and judged."""

    @property
    def ring(self) -> Ring: ...

    @property
    def levels(self) -> tuple[float, ...]:
        """Relative sizes below which a derivative counts as zero: each is tried where no mode fits with the last."""

    @property
    def carries_errors(self) -> bool:
        """Whether a number says how far it may be off, so that it is small or large against nothing else."""

    def number(self, exact: sp.Expr) -> Any:
        """An exact number."""

    def text(self, t: Any) -> str:
        """A time as messages have it."""

    def rate(self, states: Sequence[Sequence[Any]], outputs: Sequence[Sequence[Any]]) -> float:
        """An inverse time that makes coefficients of two orders comparable; ValueError where some are not finite."""

    def leading(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero beside ``size`` and the others, or None."""

    def end_of_hold(self, series: Sequence[Any], ends: Sequence[Sequence[Any]], rate: float, zero: float) -> int | None:
        """The same of one end of a hold zone, whose load may be small against its distance to the other ``ends``."""

    def negative(self, value: Any, size: Any, part: float = CLEAR) -> bool:
        """Whether a value is below zero by more than a part of the sizes of its terms."""

    def equal(self, one: Sequence[Any], other: Sequence[Any]) -> bool:
        """Whether two series are the same, so far as can be told."""


class Point(Protocol):
    """A time and state, with the modes of a system there. What has been worked out is kept as long as the point is."""

    @property
    def system(self) -> FilippovSystem: ...

    @property
    def arithmetic(self) -> Arithmetic: ...

    @property
    def levels(self) -> tuple[float, ...]:
        """As :attr:`Arithmetic.levels`, unless the point was given others."""

    @property
    def when(self) -> str:
        """Its time, as messages have it."""

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        """Guards of a mode; None where it has no equations, :data:`NO_VALUE` where their derivatives are not finite."""

    def leading(self, mode: Mode, place: int, first: int, zero: float, beside: int | None = None) -> Leading | None:
        """What a guard does first just after the point, from its derivative ``first`` on; None: it stays at zero.

        ``beside``: the surface against whose normal velocities it is small or large.
        """

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        """The same of an end of a hold zone, from its value on."""

    def first_order(self, mode: Mode) -> Sequence[Sequence[Any]]:
        """Values and first derivatives of a mode's guards."""

    def sides(self, mode: Mode, index: int) -> tuple[Any, Any]:
        """dh/dt of a surface below and above it, the signs of the others being those of a mode."""

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> Sequence[Any] | None:
        """Expressions in time, states and signs; None where they are not finite."""

    def same_motion(self, first: Mode, second: Mode) -> bool:
        """Whether two modes that have equations have the same motion, so far as its derivatives tell."""
