"""The motion of a mode, and what follows an event, in multiprecision: Taylor series in balls of python-flint."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp
from flint import arb, arb_poly

from henon_ref.integrator.pairs import Pair
from henon_ref.jit.processor_time import compiling
from henon_ref.modes.arithmetic import RING
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import ModeEvaluation, in_balls
from henon_ref.modes.system import FilippovSystem
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


@dataclass(frozen=True)
class _ModeTape:
    """A mode's tape with its constants."""

    tape: Tape
    guards: tuple[Guard, ...]
    numbers: list[arb]
    degree: int
    """Of the motion and its guards, where all of it is a polynomial in time; else 0."""


class PreciseModes:
    """Modes of one system in multiprecision, made when they are first needed.

    Parameters
    ----------
    system : FilippovSystem
    in_doubles : ModeEvaluation
    make_in_balls : callable, optional
        Makes them in balls, when they are first needed; by default from the system.
    """

    def __init__(
        self,
        system: FilippovSystem,
        in_doubles: ModeEvaluation,
        make_in_balls: Callable[[], ModeEvaluation] | None = None,
    ) -> None:
        self.system, self.in_doubles = system, in_doubles
        self._make_in_balls = make_in_balls or (lambda: in_balls(system))
        self._tapes: dict[Mode, _ModeTape] = {}

    @cached_property
    def in_balls(self) -> ModeEvaluation:
        """The modes in balls."""
        with compiling():
            return self._make_in_balls()

    @cached_property
    def _surfaces(self) -> Callable[..., list[Any]]:
        """(t, *states) -> the surfaces, and the slopes of each in every state."""
        states, surfaces = self.system.states, self.system.surfaces
        slopes = [sp.diff(h, x) for h in surfaces for x in states]
        return self.in_balls.function(states, [*surfaces, *slopes])

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Guards of a mode, in the order of :meth:`FilippovSystem.equations`."""
        return self._made(mode).guards

    def expand(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb
    ) -> tuple[list[arb_poly], list[list[arb]], bool]:
        """Taylor coefficients of the states and of the mode's guards, in units of ``unit`` of time; if these are all.

        Parameters
        ----------
        mode : Mode
        time, state
            The start.
        unit : arb
            How far on the series have to hold.
        """
        made = self._made(mode)

        def enough(x: Sequence[Sequence[arb]], y: Sequence[Sequence[arb]]) -> bool:
            """Looked at now and then."""
            return len(x[0]) > LEAST_ORDER and len(x[0]) % ENDING_ORDERS == 1 and _negligible_tail([*x, *y])

        order, end = (made.degree, None) if made.degree else (MOST_ORDER, enough)
        states, outputs = expand(made.tape, made.numbers, time, state, order, RING, unit, end)
        return [arb_poly(series) for series in states], outputs, made.degree > 0

    def motion(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb, order: int
    ) -> tuple[list[list[arb]], list[list[arb]]]:
        """Taylor coefficients of the states and guards, in units of ``unit`` of time, up to an order."""
        made = self._made(mode)
        return expand(made.tape, made.numbers, time, state, order, RING, unit)

    def guard_values(self, mode: Mode, time: arb, state: Sequence[arb]) -> list[arb]:
        """Guards of a mode at a point; no numbers where they are not known there."""
        made = self._made(mode)
        return [series[0] for series in expand(made.tape, made.numbers, time, state, 0, RING)[1]]

    def off_surfaces(self, surfaces: Sequence[int], time: arb, state: Sequence[arb]) -> float:
        """How far a state is from surfaces that it slides on: what rounding has left of zero there."""
        if not surfaces:
            return 0.0
        n, values = len(state), [abs(float(v)) for v in self._surfaces(time.mid(), *(v.mid() for v in state))]
        slopes = values[len(self.system.surfaces) :]
        steepest = [max(slopes[i * n : i * n + n]) for i in surfaces]
        return max(values[i] / slope if slope > 0 else 0.0 for i, slope in zip(surfaces, steepest, strict=True))

    def _made(self, mode: Mode) -> _ModeTape:
        if mode not in self._tapes:
            with compiling():
                made = self.in_balls.equations(mode)
                assert made is not None
                equations, tape, numbers = made
                self._tapes[mode] = _ModeTape(tape, equations.guards, numbers, _degree(tape))
        return self._tapes[mode]


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
    """The motion of one mode from a point on, which is known to two doubles or exactly.

    Parameters
    ----------
    modes : PreciseModes
    mode : Mode
    time : Pair
        [s]
    state : sequence of Pair
        Taken as exact where what the doubles leave is 0 in all of them.
    """

    def __init__(self, modes: PreciseModes, mode: Mode, time: Pair, state: Sequence[Pair]) -> None:
        self._modes, self._mode, self._steps = modes, mode, 0
        self._exact = all(low == 0.0 for _, low in (time, *state))
        with working_precision(BITS):
            self._time, self._state = arb(time[0]) + arb(time[1]), [arb(high) + arb(low) for high, low in state]

    def at(self, time: Pair, near: Sequence[float], length: float) -> tuple[list[arb], list[float]] | None:
        """The state at a later time, and what each entry may be off; None where it is not to be had.

        Parameters
        ----------
        time : Pair
            [s]
        near : sequence of float
            The state there in doubles.
        length : float
            A step to begin with [s].
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
