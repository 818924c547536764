"""The motion of a mode, and what follows an event, in multiprecision: Taylor series in balls of python-flint."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import sympy as sp
from flint import arb, arb_poly

from henon_ref.integrator.pairs import Pair
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import EPS
from henon_ref.modes.arithmetic import RING
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import ModeEvaluation
from henon_ref.modes.selection import mode_by_signs
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import INFINITE, Tape

MOST_ORDER = 320
"""Highest order of an expansion; it ends before where its terms count for nothing, or the motion is a polynomial."""
NEGLIGIBLE = 1e-50
"""What counts for nothing, relative to the sum of all terms on the step."""
LEAST_ORDER = 48
"""Order before which it does not end: terms may be missing at first."""
ENDING_ORDERS = 4
"""So many orders in a row that count for nothing end an expansion."""

MOST_STEPS = 1000
"""Steps after which no more are taken: some seconds."""
SHORTEST_PART = 2.0**-20
"""Part of the length asked for that a step may be shortened to."""
SAME = 1e-2
"""Part of its size by which a double may be off the motion, for errors to have grown by no more than they seem to."""
START_ROUNDING = 2.0**-52
"""What two doubles lose of a number, to what one does; and so of what comes of it."""


def split(number: arb) -> Pair:
    """A number as two doubles."""
    high = float(number.mid())
    return high, float(number.mid() - high)


class PreciseModes:
    """Modes of one system in multiprecision, made when they are first needed, and its values at points.

    It is what :func:`henon_ref.modes.after_jump.after_jump` takes for numbers.
    """

    rounding = 64 * EPS
    """Steps before a jump know a state to the rounding of a double."""

    def __init__(self, in_doubles: ModeEvaluation, make_in_balls: Callable[[], ModeEvaluation]) -> None:
        self.system, self.in_doubles, self._make_in_balls = in_doubles.system, in_doubles, make_in_balls
        self._functions: dict[tuple[sp.Expr, ...], Callable[..., list[Any]]] = {}

    @cached_property
    def in_balls(self) -> ModeEvaluation:
        """The modes in balls."""
        with compiling():
            return self._make_in_balls()

    def _at(self, expressions: tuple[sp.Expr, ...], t: arb, x: Sequence[arb]) -> list[arb]:
        if expressions not in self._functions:
            self._functions[expressions] = self.in_balls.function(self.system.states, expressions)
        return self._functions[expressions](t, *x)

    def values(self, expressions: tuple[sp.Expr, ...], t: arb, x: Sequence[arb]) -> list[arb]:
        """Expressions in time and states at a point; ValueError where one has none that is finite."""
        found = self._at(expressions, t, x)
        if not all(value.is_finite() for value in found):
            raise ValueError("a value is not finite")
        return found

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        return self.in_balls.guard_series(mode, t, x)

    def sign(self, value: arb) -> int:
        """0 where it cannot be told from zero."""
        return 0 if value.contains(0) else 1 if value > 0 else -1

    def decide(self, t: arb, x: Sequence[arb], surfaces: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point behind a jump, in double precision."""
        at = self.in_doubles.at(float(t), [float(value) for value in x])
        return mode_by_signs(at, surfaces, valid, where="after the reset")

    def text(self, t: arb) -> str:
        """A time as messages have it."""
        return f"{float(t):.17g}"

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Guards of a mode, in the order of :meth:`FilippovSystem.equations`."""
        found = self.in_balls.equations(mode)
        assert found is not None
        return found[0].guards

    def expand(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb
    ) -> tuple[list[arb_poly], list[list[arb]], bool]:
        """Taylor coefficients of the states and of the mode's guards, in units of ``unit`` of time; if these are all.

        So far, one unit, they hold.
        """
        tape, numbers = self._tape(mode)
        degree = _degree(tape)

        def enough(x: Sequence[Sequence[arb]], y: Sequence[Sequence[arb]]) -> bool:
            """Looked at now and then."""
            return len(x[0]) > LEAST_ORDER and len(x[0]) % ENDING_ORDERS == 1 and _negligible_tail([*x, *y])

        order, end = (degree, None) if degree else (MOST_ORDER, enough)
        states, outputs = expand(tape, numbers, time, state, order, RING, unit, end)
        return [arb_poly(series) for series in states], outputs, degree > 0

    def motion(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb, order: int
    ) -> tuple[list[list[arb]], list[list[arb]]]:
        """Taylor coefficients of the states and guards, in units of ``unit`` of time, up to an order."""
        return expand(*self._tape(mode), time, state, order, RING, unit)

    def guard_values(self, mode: Mode, time: arb, state: Sequence[arb]) -> list[arb]:
        """Guards of a mode at a point; no numbers where they are not known there."""
        return [series[0] for series in expand(*self._tape(mode), time, state, 0, RING)[1]]

    def off_surfaces(self, surfaces: Sequence[int], time: arb, state: Sequence[arb]) -> float:
        """How far a state is from surfaces that it slides on: what rounding has left of zero there."""
        farthest = 0.0
        for h in (self.system.surfaces[i] for i in surfaces):
            slopes = tuple(sp.diff(h, x) for x in self.system.states)
            value, *steep = (abs(float(v)) for v in self._at((h, *slopes), time.mid(), [v.mid() for v in state]))
            farthest = max(farthest, value / max(steep) if max(steep) > 0 else 0.0)
        return farthest

    def _tape(self, mode: Mode) -> tuple[Tape, list[arb]]:
        with compiling():
            return self.in_balls.tape(mode)


def _degree(tape: Tape) -> int:
    """Of a motion and its guards, where all of it is a polynomial in time; else 0."""
    nodes = tape.nodes
    degrees = [nodes[row].degree + 1 for row in tape.field] + [nodes[row].degree for row in tape.outputs]
    return max(degrees) if max(degrees) <= MOST_ORDER < INFINITE else 0


def _negligible_tail(rows: Sequence[Sequence[arb]]) -> bool:
    """True if the last terms of some series count for nothing where their variable is 1."""
    sizes = (list(map(abs, map(float, row))) for row in rows)
    return all(max(terms[-ENDING_ORDERS:]) <= NEGLIGIBLE * sum(terms) < math.inf for terms in sizes)


class PreciseMotion:
    """The motion of one mode from a point on, which is known to two doubles; exactly, where the second ones are 0."""

    def __init__(self, modes: PreciseModes, mode: Mode, time: Pair, state: Sequence[Pair]) -> None:
        self._modes, self._mode, self._steps = modes, mode, 0
        self._exact = all(low == 0.0 for _, low in (time, *state))
        with working_precision(BITS):
            self._time, self._state = arb(time[0]) + arb(time[1]), [arb(high) + arb(low) for high, low in state]

    def at(self, time: Pair, near: Sequence[float], length: float) -> tuple[list[arb], list[float]] | None:
        """The state at a later time, and what each entry may be off; None where it is not to be had.

        ``near``: the state there in doubles; ``length``: of a step to begin with [s].
        """
        with working_precision(BITS):
            if not self._advance(arb(time[0]) + arb(time[1]), length):
                return None
            off = [abs(float(own - x)) for own, x in zip(self._state, near, strict=True)]
        sizes = [abs(x) for x in near]
        if not all(error <= SAME * max(size, SAME * max(sizes)) for error, size in zip(off, sizes, strict=True)):
            return None
        if self._exact:
            return list(self._state), [0.0] * len(off)
        return list(self._state), [START_ROUNDING * error for error in off]

    def _advance(self, time: arb, length: float) -> bool:
        """Go on to a time; False where that takes too many steps."""
        part = 1.0
        while self._time < time:
            if self._steps >= MOST_STEPS or part < SHORTEST_PART:
                return False
            self._steps += 1
            left = time - self._time
            unit = left if left <= part * length else arb(part * length)
            states, outputs, whole = self._modes.expand(self._mode, self._time, self._state, unit)
            if not whole and len(outputs[0]) > MOST_ORDER:  # not converged
                part /= 2
                continue
            self._state = [series(arb(1)).mid() for series in states]
            self._time = time if unit is left else (self._time + unit).mid()
        return True
