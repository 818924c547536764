"""Modes in Python, in doubles or balls, at any parameter values: mode of a start, motion and guards in multiprecision.

The Taylor series are in the ball arithmetic of python-flint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from flint import arb, arb_poly

from henon_ref.integrator.constant_program import ConstantProgram, constant_program
from henon_ref.integrator.multiprecision_roots import BITS
from henon_ref.integrator.pairs import Pair
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.library import EPS
from henon_ref.method_cache import cached_method
from henon_ref.modes.arithmetic import BALLS, DOUBLES, Arithmetic
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.consistency import stays
from henon_ref.modes.end_of_run import signs_in_mode
from henon_ref.modes.equations import Guard, gradient
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import (
    GuardsAndTape,
    ModeEvaluation,
    SharedTape,
    TapePoint,
    guards_and_tape,
    shared_tape,
)
from henon_ref.modes.selection import contact_orders, mode_at_start
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time, working_precision
from henon_ref.taylor.series import BALL, expand
from henon_ref.taylor.tape import TIME, Tape, build_tape
from henon_ref.trajectory import Status

MOST_ORDER = 320
"""Largest order of an expansion; it ends earlier if its terms are negligible or the motion is a polynomial."""
ENDING_ORDERS = 4
"""Number of consecutive negligible orders that end an expansion."""
SAME = 1e-2
"""Largest relative difference between the doubles and the motion for which its digits are trusted."""


def split(number: arb) -> Pair:
    """Return a number as a pair of doubles; a second one below the rounding error of pairs is replaced by 0."""
    high = float(number)
    low = float(number - high)
    return high, (low if abs(low) > 2.0**-106 * abs(high) else 0.0)


class SharedTapes:
    """Tapes and functions of a system's modes, built once and evaluated at any parameter values in doubles or balls.

    ``parameters``: symbols in the order of the values.
    """

    def __init__(self, system: FilippovSystem, parameters: tuple[sp.Symbol, ...]) -> None:
        self.system, self._parameters = system, parameters

    def in_doubles(self, values: tuple[float, ...]) -> ModeEvaluation:
        """Return the modes in double precision at parameter values."""
        return _InDoubles(self, DOUBLES, values)

    def in_balls(self, values: tuple[sp.Expr, ...]) -> ModeEvaluation:
        """Return the modes in ball arithmetic of the working precision at exact parameter values."""
        return _InBalls(self, BALLS, values)

    @cached_method
    def shared(self) -> SharedTape | None:
        with one_at_a_time():
            return shared_tape(self.system)

    @cached_method
    def constants(self, expressions: tuple[sp.Expr, ...]) -> ConstantProgram:
        """Write a program of constants of these tapes."""
        with one_at_a_time():
            return constant_program(self._parameters, expressions)

    @cached_method
    def mode(self, mode: Mode) -> GuardsAndTape | None:
        with one_at_a_time():
            return guards_and_tape(self.system, mode)

    @cached_method
    def program(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> ConstantProgram:
        """Write a program of expressions in time, ``names`` and parameters."""
        with one_at_a_time():
            return constant_program((TIME, *names, *self._parameters), expressions)

    @cached_method
    def tape(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Tape:
        """Build a tape of expressions in time and ``names``."""
        with one_at_a_time():
            return build_tape(names, (), expressions)


class _InDoubles(ModeEvaluation):
    def __init__(self, shared: SharedTapes, arithmetic: Arithmetic, values: tuple[Any, ...]) -> None:
        super().__init__(shared.system, arithmetic)
        self._tapes, self._values = shared, values

    def guards_and_tape(self, mode: Mode) -> GuardsAndTape | None:
        return self._tapes.mode(mode)

    def shared(self) -> SharedTape | None:
        return self._tapes.shared()

    def constants(self, expressions: tuple[sp.Expr, ...]) -> list[Any]:
        program = self._tapes.constants(expressions)
        registers = program.registers(np.array([self._values]))[0]
        found: list[float] = registers[program.places, 0].tolist()
        return found

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        program, values = self._tapes.program(tuple(names), tuple(expressions)), self._values
        return lambda *point: program.in_doubles((*point, *values))


class _InBalls(_InDoubles):
    def constants(self, expressions: tuple[sp.Expr, ...]) -> list[Any]:
        return [ball.mid() for ball in self._tapes.constants(expressions).balls(self._values)]

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        tape = self._tapes.tape(tuple(names), tuple(expressions))
        numbers = self.constants(tape.constants)

        def values(t: arb, *x: arb | int) -> list[arb]:
            return [series[0] for series in expand(tape, numbers, t, [arb(v) for v in x], 0, BALL)[1]]

        return values


class PreciseModes:
    """Modes of one system in multiprecision, prepared on first use.

    It is the arithmetic that :func:`henon_ref.modes.after_jump.after_jump` works in.
    """

    rounding = 64 * EPS
    """Relative error of a state before a jump: the steps are in double precision."""
    unit = 1.0
    """:func:`henon_ref.modes.arithmetic.time_unit` of the run, for decisions in double precision."""

    def __init__(self, in_doubles: ModeEvaluation, make_in_balls: Callable[[], ModeEvaluation]) -> None:
        self.system, self.in_doubles, self._make_in_balls = in_doubles.system, in_doubles, make_in_balls

    @cached_method
    def in_unit(self, unit: float) -> PreciseModes:
        """Return the modes for a run with this :attr:`unit`."""
        if unit == self.unit:
            return self
        made = PreciseModes(self.in_doubles, lambda: self.in_balls)
        made.unit = unit
        return made

    @cached_property
    def in_balls(self) -> ModeEvaluation:
        """Modes in ball arithmetic."""
        with compiling():
            return self._make_in_balls()

    @cached_method
    def _function(self, expressions: tuple[sp.Expr, ...]) -> Callable[..., list[Any]]:
        return self.in_balls.function(self.system.states, expressions)

    def values(self, expressions: tuple[sp.Expr, ...], t: arb, x: Sequence[arb]) -> list[arb]:
        """Evaluate expressions in time and states at a point; ValueError if a value is not finite."""
        found = self._function(expressions)(t, *x)
        if not all(value.is_finite() for value in found):
            raise ValueError("a value is not finite")
        return found

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb]) -> list[list[arb]]:
        """Return the Taylor coefficients in time of a mode's guards."""
        return self.in_balls.guard_series(mode, t, x)

    def sign(self, value: arb) -> int:
        """Return the sign; 0 if the ball contains zero."""
        return 0 if value.contains(0) else 1 if value > 0 else -1

    def at(self, t: arb, x: Sequence[arb]) -> TapePoint:
        """Return the point, in double precision, at which the mode after a jump is decided."""
        return self.in_doubles.at(float(t), [float(value) for value in x], unit=self.unit)

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Return the guards of a mode in the order of :meth:`FilippovSystem.equations`."""
        guards = self.in_balls.guards(mode)
        assert guards is not None
        return guards

    def expand(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb
    ) -> tuple[list[arb_poly], list[list[arb]], bool]:
        """Return the Taylor coefficients of states and guards in units of ``unit``, and whether they are polynomials.

        The series converge up to one unit.
        """
        tape, numbers = self._tape(mode)
        degree = tape.degree if tape.degree <= MOST_ORDER else 0

        def enough(x: Sequence[Sequence[arb]], y: Sequence[Sequence[arb]]) -> bool:
            """Checked every few orders, from 48 on: low orders may be zero."""
            return len(x[0]) > 48 and len(x[0]) % ENDING_ORDERS == 1 and _negligible_tail([*x, *y])

        order, end = (degree, None) if degree else (MOST_ORDER, enough)
        states, outputs = expand(tape, numbers, time, state, order, BALL, unit, end)
        return [arb_poly(series) for series in states], outputs, degree > 0

    def motion(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb, order: int
    ) -> tuple[list[list[arb]], list[list[arb]]]:
        """Return the Taylor coefficients of states and guards in units of ``unit``, up to an order."""
        return expand(*self._tape(mode), time, state, order, BALL, unit)

    def guard_values(self, mode: Mode, time: arb, state: Sequence[arb]) -> list[arb]:
        """Evaluate the guards of a mode at a point; NaN if a guard has no value."""
        return [series[0] for series in expand(*self._tape(mode), time, state, 0, BALL)[1]]

    def off_surfaces(self, surfaces: Sequence[int], time: arb, state: Sequence[arb]) -> float:
        """Return the distance of a sliding state from its surfaces, which rounding causes."""
        farthest = 0.0
        for h in (self.system.surfaces[i] for i in surfaces):
            slopes = gradient(h, self.system.states)
            value, *steep = (abs(float(v)) for v in self._function((h, *slopes))(time.mid(), *(v.mid() for v in state)))
            farthest = max(farthest, value / max(steep) if max(steep) > 0 else 0.0)
        return farthest

    def _tape(self, mode: Mode) -> tuple[Tape, list[arb]]:
        with compiling():
            return self.in_balls.tape(mode)


def _negligible_tail(rows: Sequence[Sequence[arb]]) -> bool:
    """Whether the last terms of all series are below 1e-50 of the sum of all terms at argument 1."""
    sizes = (list(map(abs, map(float, row))) for row in rows)
    return all(max(terms[-ENDING_ORDERS:]) <= 1e-50 * sum(terms) < math.inf for terms in sizes)


class PreciseMotion:
    """Motion of one mode from a start given by pairs of doubles, which is exact if the second doubles are 0."""

    def __init__(self, modes: PreciseModes, mode: Mode, time: Pair, state: Sequence[Pair]) -> None:
        self._modes, self._mode, self._steps = modes, mode, 0
        self._exact = all(low == 0.0 for _, low in (time, *state))
        with working_precision(BITS):
            self._time, self._state = arb(time[0]) + arb(time[1]), [arb(high) + arb(low) for high, low in state]

    def at(self, time: Pair, near: Sequence[float], length: float) -> tuple[list[arb], list[float]] | None:
        """Return the state at a later time and a bound of the error of each entry; None if it cannot be computed.

        ``near``: the state there in doubles; ``length``: initial length of a step [s].
        """
        with working_precision(BITS):
            if not self._advance(arb(time[0]) + arb(time[1]), length):
                return None
            off = [abs(float(own - x)) for own, x in zip(self._state, near, strict=True)]
        sizes = [abs(x) for x in near]
        if not all(error <= SAME * max(size, SAME * max(sizes)) for error, size in zip(off, sizes, strict=True)):
            return None
        # The rounding error of a pair relative to that of one double; the propagated errors have the same ratio.
        rounding = 0.0 if self._exact else 2.0**-52
        return list(self._state), [rounding * error for error in off]

    def _advance(self, time: arb, length: float) -> bool:
        """Advance to a time; False if that takes too many steps (some seconds)."""
        part = 1.0
        while self._time < time:
            if self._steps >= 1000 or part < 2.0**-20:
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


class StartMode(NamedTuple):
    """Mode of a start."""

    mode: Mode | None
    orders: list[int]
    """Known zeros of each guard; empty if there are none."""
    still: list[int]
    """Surfaces whose function vanishes here with its derivative: rounding may decide how it goes on."""
    status: Status = "failed"
    reason: str = ""
    """Status of the run, and the reason, if there is no mode."""


def start_mode(
    modes: ModeEvaluation,
    t: float,
    x: tuple[float, ...],
    signs: tuple[int | None, ...],
    given: tuple[tuple[int, int], ...],
    part: float,
    unit: float,
) -> StartMode:
    """Return the mode of a start on surfaces that compiled code does not decide, by fields and derivatives.

    ``modes``: in doubles; ``signs``: of the surfaces, then of the ``valid`` expressions, None for one without a value;
    ``given``: surfaces with their entries, where several motions are possible; ``part``: see :func:`signs_in_mode`;
    ``unit``: :func:`henon_ref.modes.arithmetic.time_unit` of the run.
    """
    system, count = modes.system, len(modes.system.surfaces)
    known = [1 if sign is None else sign for sign in signs]
    at = modes.at(t, x, unit=unit)
    known[:count], entries = signs_in_mode(at, known[:count], dict(given), part)
    decision, left = mode_at_start(at, known[:count], known[count:], entries)
    unused = system.unused_kinks(decision.mode) if None in signs and decision.mode else frozenset[int]()
    for i, sign in enumerate(signs):
        if sign is None and i not in unused:  # a kink in a branch that the mode does not use needs no value
            what = f"the surface of '{system.sign_names[i]}'" if i < count else "an expression of 'valid'"
            return StartMode(None, [], [], reason=f"{what} has no finite real value at the start")
    if decision.mode is None:
        return StartMode(None, [], [], decision.ending, decision.reason)
    active, edges = ([i for i, sign in enumerate(some) if sign == 0] for some in (known[:count], known[count:]))
    if not (active or edges):
        return StartMode(decision.mode, [], [])
    try:
        guards = system.guards(decision.mode)
        orders = contact_orders(at, decision.mode, active, edges)
        own = [g.kind == "surface" and g.index in left for g in guards]
        orders = [1 if leaves else order for leaves, order in zip(own, orders, strict=True)]
        still = [
            guard.index
            for guard, order in zip(guards, orders, strict=True)
            if guard.kind == "surface" and guard.index in active
            if order > 1 or stays(at, decision.mode, guard.index)
        ]
    except ARITHMETIC:  # the loop finds no finite step either, and the reason
        return StartMode(decision.mode, [], [])
    return StartMode(decision.mode, orders, still)
