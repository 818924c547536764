"""Jumps of the state: maps of resets in multiprecision, so that they lose none of the digits that a landing has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from flint import arb

from henon_ref.filippov.decision import Decision
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.resets import Jump, jump_of, order_matters
from henon_ref.filippov.resting import Resting, rests_on, state_at_rest, time_to_rest
from henon_ref.henon.precise_modes import PreciseModes
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS

Pair = tuple[float, float]
"""A number as its double and what that leaves."""


class AfterJump(NamedTuple):
    """Where a jump leads to."""

    state: Sequence[Pair]
    decision: Decision
    """The mode there."""
    known_zeros: Sequence[int]
    """For each of its guards, zeros there, in the order of the mode's equations."""
    rest: Rest | None = None
    """Where the impacts have come to their limit."""


class Rest(NamedTuple):
    """What impacts that accumulate lead to."""

    time: Pair
    state: Sequence[Pair]
    decision: Decision
    known_zeros: Sequence[int]


class Jumps:
    """Jumps of one system at parameter values, each made a tape when it is first needed.

    Parameters
    ----------
    precise : PreciseModes
    """

    def __init__(self, precise: PreciseModes) -> None:
        self._precise = precise
        self._functions: dict[Jump, Callable[..., list[Any]]] = {}
        self._rests: dict[Resting, Callable[..., list[Any]]] = {}

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
        system, switching = self._precise.system, self._precise.switching
        jump = jump_of(system, surfaces)
        if jump is None:
            return AfterJump(state, Decision("nonunique", None, order_matters(system, surfaces, f"{time[0]:.17g}")), ())
        try:
            after, signs = self._mapped(jump, time, state)
        except (ZeroDivisionError, ValueError):  # python-flint's words for a value that does not exist
            reason = f"the state after the reset at t = {time[0]:.17g} is not finite"
            return AfterJump(state, Decision("none", None, reason), ())
        if (rest := self._rest(surfaces, mode, time, state, after, most)) is not None:
            return AfterJump(after, Decision("unique", mode), (0,) * len(system.equations(mode).guards), rest)
        count, x = len(system.surfaces), [high for high, _ in after]
        sides = jump.sides(mode, {g.index for g in hits if g.kind == "surface"}, signs[:count])
        switching.forget()  # what another run has worked out at the same point is none of this one's work
        decision = switching.mode_by_signs(time[0], x, sides, signs[count:], {})
        if decision.mode is None:
            return AfterJump(after, decision, ())
        on = [i for i, side in enumerate(sides) if side == 0]
        return AfterJump(after, decision, switching.contact_orders(time[0], x, decision.mode, on))

    def _rest(
        self,
        surfaces: tuple[int, ...],
        mode: Mode,
        time: Pair,
        before: Sequence[Pair],
        after: Sequence[Pair],
        most: float,
    ) -> Rest | None:
        """Where a body comes to rest, if its impacts have come to their limit."""
        system, switching = self._precise.system, self._precise.switching
        resting = rests_on(system, surfaces)
        if resting is None:
            return None
        if resting not in self._rests:
            expressions = resting.expressions(system.surfaces[surfaces[0]], system.states)
            names = (*system.states, *system.signs)
            self._rests[resting] = self._precise.precise_switching.function(names, expressions)
        values = self._rests[resting]
        with working_precision(BITS):
            t, *points = (arb(high) + arb(low) for high, low in (time, *before, *after))
            n = len(before)
            first, found = values(t, *points[:n], *mode)[0], values(t, *points[n:], *mode)
            remaining = time_to_rest(first, found[0], found[1], most)
            if remaining is None:
                return None
            end, *state = (_pair(value) for value in (t + remaining, *state_at_rest(points[n:], found, remaining)))
        stuck = replaced(mode, surfaces[0], 0)
        switching.forget()
        x = [high for high, _ in state]
        return Rest(end, state, Decision("unique", stuck), switching.contact_orders(end[0], x, stuck, surfaces))

    def _mapped(self, jump: Jump, time: Pair, state: Sequence[Pair]) -> tuple[list[Pair], list[int]]:
        """The state after a jump, and the signs of all surfaces and ``valid`` expressions there; 0: not told from zero.

        ZeroDivisionError or ValueError where one has no value.
        """
        if jump not in self._functions:
            expressions = [*(jump.states[i] for i in jump.moved), *jump.guards]
            self._functions[jump] = self._precise.precise_switching.function(self._precise.system.states, expressions)
        with working_precision(BITS):
            values = self._functions[jump](*(arb(high) + arb(low) for high, low in (time, *state)))
            if not all(value.is_finite() for value in values):
                raise ValueError("a value after the jump is not finite")
            after = list(state)
            for i, value in zip(jump.moved, values, strict=False):
                after[i] = _pair(value)
            signs = [0 if v.contains(0) else 1 if v > 0 else -1 for v in values[len(jump.moved) :]]
        return after, signs


def _pair(value: arb) -> Pair:
    """A number as two doubles."""
    high = float(value.mid())
    return high, float(value.mid() - high)
