"""Jumps of the state that compiled code (``henon_ref/kernel/jump.c``) leaves open, in multiprecision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import sympy as sp
from flint import arb

from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.precise_modes import PreciseModes
from henon_ref.kernel.shared import EPS
from henon_ref.modes.after_jump import after_jump
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.selection import contact_orders, mode_by_signs
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS


class Rest(NamedTuple):
    """What impacts that accumulate lead to."""

    time: Pair
    state: Sequence[Pair]
    decision: Decision
    known_zeros: Sequence[int]


class AfterJump(NamedTuple):
    """Where a jump leads to."""

    state: Sequence[Pair]
    decision: Decision
    """The mode there."""
    known_zeros: Sequence[int]
    """For each of its guards, zeros there, in the order of the mode's equations."""
    applied: Sequence[tuple[int, Sequence[float]]] = ()
    """Surfaces whose maps were applied, in order, each with the state that its map has left."""
    rest: Rest | None = None
    """Where the impacts have come to their limit."""


class Jumps:
    """Jumps of one system at parameter values, each made a tape when it is first needed.

    Parameters
    ----------
    precise : PreciseModes
    """

    rounding = 64 * EPS
    """Steps before it know a state to the rounding of a double."""

    def __init__(self, precise: PreciseModes) -> None:
        self._precise = precise
        self._functions: dict[tuple[sp.Expr, ...], Callable[..., list[Any]]] = {}

    def after(
        self,
        surfaces: tuple[int, ...],
        hits: Sequence[Guard],
        mode: Mode,
        time: Pair,
        state: Sequence[Pair],
        most: float,
    ) -> AfterJump:
        """What follows where some surfaces reset the state.

        Parameters
        ----------
        surfaces : tuple of int
            Those that do.
        hits : sequence of Guard
            All guards of the mode that are at zero.
        most : float
            How long all later impacts may last together where they have come to their limit [s].
        """
        system, in_doubles = self._precise.system, self._precise.in_doubles
        with working_precision(BITS):
            t, *x = (arb(high) + arb(low) for high, low in (time, *state))
            found = after_jump(system, self, mode, surfaces, hits, t, x, arb(most))
            after = [_pair(value) for value in found.state]
            if found.decision.mode is None:
                return AfterJump(after, found.decision, ())
            applied = [(i, [float(value.mid()) for value in left]) for i, left in found.applied]
            place = [high for high, _ in after]
            zeros = contact_orders(in_doubles.at(time[0], place), found.decision.mode, found.on)
            if found.rest is None:
                return AfterJump(after, found.decision, zeros, applied)
            end, *resting = (_pair(value) for value in (t + found.rest.remaining, *found.rest.state))
        place = [high for high, _ in resting]
        own = contact_orders(in_doubles.at(end[0], place), found.rest.mode, found.on)
        return AfterJump(
            after, found.decision, zeros, applied, Rest(end, resting, Decision("unique", found.rest.mode), own)
        )

    def values(self, expressions: tuple[sp.Expr, ...], t: arb, x: Sequence[arb]) -> list[arb]:
        """Expressions in time and states at a point; ValueError where one has none that is finite."""
        if expressions not in self._functions:
            states = self._precise.system.states
            self._functions[expressions] = self._precise.in_balls.function(states, expressions)
        found = self._functions[expressions](t, *x)
        if not all(value.is_finite() for value in found):
            raise ValueError("a value is not finite")
        return found

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        return self._precise.in_balls.guard_series(mode, t, x)

    def sign(self, value: arb) -> int:
        """0 where it cannot be told from zero."""
        return 0 if value.contains(0) else 1 if value > 0 else -1

    def decide(self, t: arb, x: Sequence[arb], surfaces: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point, in double precision."""
        at = self._precise.in_doubles.at(float(t), [float(value) for value in x])
        return mode_by_signs(at, surfaces, valid, where="after the reset")

    def text(self, t: arb) -> str:
        """A time as messages have it."""
        return f"{float(t):.17g}"


def _pair(value: arb) -> Pair:
    """A number as two doubles."""
    high = float(value.mid())
    return high, float(value.mid() - high)
