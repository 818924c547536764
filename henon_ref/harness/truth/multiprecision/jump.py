"""Jumps of the state in ball arithmetic."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp
from flint import arb

from henon_ref.filippov.after_jump import AfterJump, after_jump
from henon_ref.filippov.decision import Decision
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode
from henon_ref.harness.truth.multiprecision import series
from henon_ref.harness.truth.multiprecision.mode_selection import ModeSelection, Point


class Jumps:
    """What follows jumps of one system's state at one precision.

    Parameters
    ----------
    selection : ModeSelection
    """

    rounding = 0.0
    """A point carries the radii to which it is known."""

    def __init__(self, selection: ModeSelection) -> None:
        self._selection = selection

    def after(
        self, point: Point, mode: Mode, surfaces: tuple[int, ...], hits: Sequence[Guard], most: float
    ) -> AfterJump:
        """What follows where surfaces reset the state (:func:`henon_ref.filippov.after_jump.after_jump`)."""
        return after_jump(self._selection.system, self, mode, surfaces, hits, point.time, point.state, arb(most))

    def values(self, expressions: tuple[sp.Expr, ...], t: arb, x: Sequence[arb]) -> list[arb]:
        """Expressions in time and states at a point; ValueError where one has none that is finite."""
        found = self._selection.values_of(expressions, Point(t, tuple(x)))
        if not all(value.is_finite() for value in found):
            raise ValueError("a value is not finite")
        return found

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        return self._selection.guard_series(Point(t, tuple(x)), mode)

    def sign(self, value: arb) -> int:
        """0 where it cannot be told from zero."""
        return series.sign(value)

    def decide(self, t: arb, x: Sequence[arb], surfaces: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point where surfaces and ``valid`` expressions have these signs."""
        return self._selection.mode_by_signs(Point(t, tuple(x)), surfaces, valid)

    def text(self, t: arb) -> str:
        """A time as messages have it."""
        return str(t.str(17, radius=False))
