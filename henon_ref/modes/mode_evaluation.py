"""Numerical evaluation of a system's modes at points, in one arithmetic: derivatives of guards, velocities, values.

Each mode's tape is built once and cached, for all threads; results at a point are cached with the point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from typing import TYPE_CHECKING, Any

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import leaves_out
from henon_ref.method_cache import cached_method
from henon_ref.modes.arithmetic import DOUBLES, LAST_ORDER, ORDER, Arithmetic, Leading, size_of_ends, time_unit
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.equations import Guard, ModeTape
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

if TYPE_CHECKING:
    from henon_ref.modes.decoupled_contacts import SwitchedEquations

GuardsAndTape = tuple[tuple[Guard, ...], Tape]
SharedTape = tuple["SwitchedEquations", ModeTape]


def guards_and_tape(system: FilippovSystem, mode: Mode) -> GuardsAndTape | None:
    """Return the guards of a mode, and its field and guards as a tape; None if the mode has no equations."""
    try:
        equations = system.equations(mode)
    except ModelError:
        return None
    return equations.guards, build_tape(system.states, equations.field, [g.expression for g in equations.guards])


def shared_tape(system: FilippovSystem) -> SharedTape | None:
    """Return the equations and the tape that all modes of a system share; None if it has none."""
    made = system.switched
    if made is None:
        return None
    return made, ModeTape(build_tape(system.states, made.field, made.outputs, made.definitions), made.entries)


def in_doubles(system: FilippovSystem) -> ModeEvaluation:
    """Return the evaluation of a system's modes in double precision."""
    return ModeEvaluation(system, DOUBLES)


@lru_cache(maxsize=1024)
def normal_in(system: FilippovSystem, index: int, entries: Mode) -> sp.Expr:
    """Return dh/dt of a surface: shared by all modes, unless it contains operations that these entries do not use.

    ``entries``: of the surfaces of :func:`acting_on`, in their order.
    """
    written = system.normal_velocity(index)
    signs = {system.signs[i]: sp.Integer(entry) for i, entry in zip(acting_on(system, index), entries, strict=True)}
    own = written.xreplace(signs)
    return own if leaves_out(written, own, signs, {TIME, *system.states}) else written


@lru_cache(maxsize=1024)
def acting_on(system: FilippovSystem, index: int) -> tuple[int, ...]:
    """Return the surfaces whose signs are in a surface's normal velocity."""
    written = system.normal_velocity(index).free_symbols
    return tuple(i for i, sign in enumerate(system.signs) if sign in written)


@lru_cache(maxsize=1024)
def terms_of(system: FilippovSystem, index: int) -> tuple[sp.Expr, ...]:
    """Return the terms of dh/dt of a surface, as written."""
    return sp.Add.make_args(system.normal_velocity(index))


class ModeEvaluation:
    """Evaluation of the modes of one system in one arithmetic.

    Constants are the doubles of the system's exact numbers; a subclass may compute the results of
    :meth:`guards_and_tape`, :meth:`constants` and :meth:`function` in another way, or in another arithmetic.
    """

    def __init__(self, system: FilippovSystem, arithmetic: Arithmetic) -> None:
        self.system, self.arithmetic = system, arithmetic
        self._numbers: dict[sp.Expr, Any] = {}

    def guards_and_tape(self, mode: Mode) -> GuardsAndTape | None:
        return guards_and_tape(self.system, mode)

    def constants(self, expressions: tuple[sp.Expr, ...]) -> list[Any]:
        """Return constants of a tape as numbers."""
        return [float(self.system.numeric(c)) for c in expressions]

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """Return (t, *names) -> values of expressions, which raises ``ARITHMETIC`` if one has none."""
        values, names = [self.system.numeric(e) for e in expressions], [TIME, *names]
        # The time of lambdify grows with the number of its arguments.
        used = set().union(*(value.free_symbols for value in values))
        places = [k for k, name in enumerate(names) if name in used]
        found: Callable[..., list[Any]] = sp.lambdify([names[k] for k in places], values, "math", cse=True)
        return lambda *at: found(*(at[k] for k in places))

    def at(self, t: Any, x: Sequence[Any], levels: tuple[float, ...] | None = None, unit: float = 1.0) -> TapePoint:
        """Return a point; ``levels``: see :attr:`Doubles.levels`; ``unit``: :func:`time_unit` of the run."""
        return TapePoint(self, t, x, self.arithmetic.levels if levels is None else levels, unit)

    def at_start(self, problem: Problem) -> TapePoint:
        """Return the start of a problem, in doubles."""
        unit = time_unit(float(problem.until - problem.start))
        return self.at(float(problem.start), [float(v) for v in problem.initial], unit=unit)

    @cached_method
    def _made(self, mode: Mode) -> tuple[tuple[Guard, ...], Tape, list[Any]] | None:
        """Return the guards, tape and constants of a mode; None if it has no equations."""
        with one_at_a_time():
            shared = self.shared()
            if shared is not None:
                return self._of_shared(mode, *shared)
            made = self.guards_and_tape(mode)
            return None if made is None else (*made, self.constants(made[1].constants))

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        """Return the guards of a mode; None if it has no equations."""
        made = self._made(mode)
        return None if made is None else made[0]

    def tape(self, mode: Mode) -> tuple[Tape, list[Any]]:
        """Return the tape and constants of a mode; ValueError if it has no equations."""
        made = self._made(mode)
        if made is None:
            raise ValueError("the mode has no equations")
        return made[1], made[2]

    @cached_method
    def shared(self) -> SharedTape | None:
        return shared_tape(self.system)

    def _of_shared(
        self, mode: Mode, made: SwitchedEquations, shared: ModeTape
    ) -> tuple[tuple[Guard, ...], Tape, list[Any]]:
        """Return a mode's guards, its part of the shared tape, and its constants, each computed once."""
        own = tuple(shared.tape.outputs[row] for row in made.rows(mode))
        constants = [shared.constant(at, mode) for at in range(len(shared.tape.constants))]
        for constant in constants:
            if constant not in self._numbers:
                self._numbers[constant] = self.constants((constant,))[0]
        numbers = [self._numbers[constant] for constant in constants]
        return made.own_guards(mode), replace(shared.tape, outputs=own), numbers

    @cached_method
    def of_states_and_signs(self, expressions: tuple[sp.Expr, ...]) -> Callable[..., list[Any]]:
        """Return (t, *x, *signs) -> values of expressions."""
        with one_at_a_time():
            return self.function([*self.system.states, *self.system.signs], expressions)

    def normal(self, index: int, mode: Mode) -> Callable[..., list[Any]]:
        """Return (t, *x, *signs) -> dh/dt of a surface in a mode."""
        return self._normal(index, tuple(mode[i] for i in acting_on(self.system, index)))

    @cached_method
    def _normal(self, index: int, entries: Mode) -> Callable[..., list[Any]]:
        with one_at_a_time():
            return self.of_states_and_signs((normal_in(self.system, index, entries),))

    def guard_series(self, mode: Mode, t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Return the Taylor coefficients in time of a mode's guards; raises ``ARITHMETIC`` if there are none."""
        return self.at(t, x).series(mode)[0]


class TapePoint:
    """Point evaluated by the tapes of its modes; see :class:`henon_ref.modes.arithmetic.Point`."""

    def __init__(self, modes: ModeEvaluation, t: Any, x: Sequence[Any], levels: tuple[float, ...], unit: float) -> None:
        self._modes, self._t, self._x, self.levels, self._unit = modes, t, x, levels, unit
        self.system, self.arithmetic = modes.system, modes.arithmetic

    @property
    def when(self) -> str:
        return f"{float(self._t):.17g}"

    def _expanded(self, mode: Mode, order: int) -> tuple[list[list[Any]], list[list[Any]]]:
        return expand(*self._modes.tape(mode), self._t, self._x, order, self.arithmetic.ring)

    def at_zero_of(self, mode: Mode, place: int) -> TapePoint:
        """Return the point at which a guard is zero, by one step of Newton's method along a mode's motion.

        The same point if the guard's second derivative matters there.
        """
        states, outputs = self._expanded(mode, 2)
        value, rate, bend = outputs[place]
        if not abs(value * bend) <= 1e-6 * rate * rate or rate == 0:
            return self
        step = -value / rate
        return self._modes.at(self._t + step, [x + step * slope for x, slope, _ in states], self.levels, self._unit)

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        guards = self._modes.guards(mode)
        if guards is not None:
            self.series(mode)
        return guards

    @cached_method
    def series(self, mode: Mode, order: int = ORDER) -> tuple[list[list[Any]], float]:
        """Return the Taylor coefficients of a mode's guards, and a rate that makes them comparable."""
        states, outputs = self._expanded(mode, order)
        return outputs, self.arithmetic.rate(states, outputs, self._unit)

    def leading(self, mode: Mode, place: int, first: int, zero: float, beside: int | None = None) -> Leading | None:
        outputs, rate = self.series(mode)
        size = 0.0 if beside is None or self.arithmetic.carries_errors else self._size(mode, place, beside)
        return _term(outputs[place], self.arithmetic.leading(outputs[place], first, rate, size, zero))

    def late(self, mode: Mode, place: int, zero: float, index: int) -> Leading | None:
        outputs, rate = self.series(mode, LAST_ORDER)
        terms = () if self.arithmetic.carries_errors else self.values(terms_of(self.system, index), mode) or ()
        size = sum(map(abs, terms), 0.0)
        return _term(outputs[place], self.arithmetic.leading(outputs[place], 1, rate, size, zero))

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        (outputs, rate), guards = self.series(mode), self.guards(mode) or ()
        index = guards[place].index
        ends = [c for g, c in zip(guards, outputs, strict=True) if g.kind == "release" and g.index == index]
        return _term(outputs[place], self.arithmetic.end_of_hold(outputs[place], ends, rate, zero))

    @cached_method
    def first_order(self, mode: Mode) -> list[list[Any]]:
        return self._expanded(mode, 1)[1]

    def sides(self, mode: Mode, index: int) -> tuple[Any, Any]:
        below, above = (self._speed(index, replaced(mode, index, side)) for side in (-1, 1))
        return below, above

    @cached_method
    def _speed(self, index: int, mode: Mode) -> Any:
        return self._modes.normal(index, mode)(self._t, *self._x, *mode)[0]

    def _size(self, mode: Mode, place: int, index: int) -> float:
        try:
            if (self.guards(mode) or ())[place].kind == "release" and index not in self.system.overrides:
                return float(size_of_ends(self, mode, index))
            below, above = self.sides(mode, index)
        except ARITHMETIC:
            return 0.0
        return float(abs(below) + abs(above))

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> Sequence[Any] | None:
        try:
            values = self._modes.of_states_and_signs(expressions)(self._t, *self._x, *signs)
        except ARITHMETIC:
            return None
        return values if all(isfinite(float(value)) for value in values) else None

    def same_motion(self, first: Mode, second: Mode) -> bool:
        one, other = (self._expanded(mode, ORDER)[0] for mode in (first, second))
        return all(self.arithmetic.equal(a, b) for a, b in zip(one, other, strict=True))


def _term(series: Sequence[Any], place: int | None) -> Leading | None:
    return None if place is None else (place, 1 if series[place] > 0 else -1)
