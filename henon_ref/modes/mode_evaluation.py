"""What a system's modes do at points: derivatives of guards, normal velocities, values, in numbers of one arithmetic.

Tapes are made once a mode and kept, from any thread; what is worked out at a point is kept with the point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from math import isfinite
from typing import Any, Protocol

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.arithmetic import NO_VALUE, ORDER, Arithmetic, Leading
from henon_ref.modes.branches import leaves_out
from henon_ref.modes.equations import Guard, ModeEquations, ModeTape
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

KEPT = 1024
"""Surfaces, each in a mode of a system, of which it is kept whether their normal velocities are apart."""

ModeWithTape = tuple[ModeEquations, Tape]


class Tapes(Protocol):
    """Where tapes of a system's modes come from, and their constants in numbers of one arithmetic."""

    def mode(self, mode: Mode) -> ModeWithTape | None:
        """Equations of a mode, and its field and guards as a tape; None where it has none."""

    def constants(self, tape: Tape) -> list[Any]:
        """Constants of a tape."""

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """(t, *names) -> values of expressions; :data:`NO_VALUE` where one has none."""


def mode_with_tape(system: FilippovSystem, mode: Mode) -> ModeWithTape | None:
    """Equations of a mode, and its field and guards as a tape; None where it has none."""
    try:
        equations = system.equations(mode)
    except ModelError:
        return None
    return equations, build_tape(system.states, equations.field, [g.expression for g in equations.guards])


class ExactTapes:
    """Tapes of a system, their constants from its exact numbers; how functions are made is left to others.

    Parameters
    ----------
    system : FilippovSystem
    values : FilippovSystem or None
        The same with values of its parameters, where ``system`` has none.
    number : callable
        Of an exact number, in the arithmetic.
    """

    def __init__(self, system: FilippovSystem, values: FilippovSystem | None, number: Callable[[sp.Expr], Any]) -> None:
        self._system, self.numeric, self._number = system, (values or system).numeric, number

    def mode(self, mode: Mode) -> ModeWithTape | None:
        """See :class:`Tapes`."""
        return mode_with_tape(self._system, mode)

    def constants(self, tape: Tape) -> list[Any]:
        """See :class:`Tapes`."""
        return [self._number(self.numeric(c)) for c in tape.constants]


@lru_cache(maxsize=KEPT)
def normal_in(system: FilippovSystem, index: int, entries: Mode) -> sp.Expr:
    """dh/dt of a surface: that of all modes, unless it holds operations that those with these entries do not.

    ``entries``: of the surfaces of :func:`acting_on`, in their order.
    """
    written = system.normal_velocity(index)
    signs = {system.signs[i]: sp.Integer(entry) for i, entry in zip(acting_on(system, index), entries, strict=True)}
    own = written.xreplace(signs)
    return own if leaves_out(written, own, signs, {TIME, *system.states}) else written


@lru_cache(maxsize=KEPT)
def acting_on(system: FilippovSystem, index: int) -> tuple[int, ...]:
    """Surfaces whose signs are in a surface's normal velocity."""
    written = system.normal_velocity(index).free_symbols
    return tuple(i for i, sign in enumerate(system.signs) if sign in written)


class ModeEvaluation:
    """The modes of one system in numbers of one arithmetic.

    Parameters
    ----------
    system : FilippovSystem
    arithmetic : Arithmetic
    tapes : Tapes
        With constants of that arithmetic.
    """

    def __init__(self, system: FilippovSystem, arithmetic: Arithmetic, tapes: Tapes) -> None:
        self.system, self.arithmetic, self._source = system, arithmetic, tapes
        self._tapes: dict[Mode, tuple[ModeEquations, Tape, list[Any]] | None] = {}
        self._numbers: dict[tuple[int, tuple[int, ...]], Any] = {}
        self._functions: dict[tuple[sp.Expr, ...], Callable[..., list[Any]]] = {}
        self._normals: dict[tuple[int, Mode], Callable[..., list[Any]]] = {}

    def at(self, t: Any, x: Sequence[Any], levels: tuple[float, ...] | None = None) -> TapePoint:
        """A point; ``levels``: see :attr:`Arithmetic.levels`."""
        return TapePoint(self, t, x, self.arithmetic.levels if levels is None else levels)

    def exactly(self, start: sp.Expr, initial: Sequence[sp.Expr]) -> TapePoint:
        """A point of exact numbers."""
        return self.at(self.arithmetic.number(start), [self.arithmetic.number(v) for v in initial])

    def equations(self, mode: Mode) -> tuple[ModeEquations, Tape, list[Any]] | None:
        """Equations of a mode, its field and guards as a tape, and its constants; None where it has none."""
        if mode not in self._tapes:
            with one_at_a_time():
                made = self._source.mode(mode) if self._shared is None else None
                if made is not None:
                    self._tapes[mode] = *made, self._source.constants(made[1])
                else:
                    self._tapes[mode] = self._shared_equations(mode) if self._shared is not None else None
        return self._tapes[mode]

    def tape(self, mode: Mode) -> tuple[Tape, list[Any]]:
        """Field and guards of a mode that has equations as a tape, and its constants."""
        made = self.equations(mode)
        assert made is not None
        return made[1], made[2]

    @cached_property
    def _shared(self) -> ModeTape | None:
        """The tape of a system whose modes have one in common."""
        made = self.system.switched
        if made is None:
            return None
        return ModeTape(build_tape(self.system.states, made.field, made.outputs, made.definitions), made.entries)

    def _shared_equations(self, mode: Mode) -> tuple[ModeEquations, Tape, list[Any]]:
        """A mode's equations, its own part of that tape, and its constants, each worked out once."""
        shared, made = self._shared, self.system.switched
        assert shared is not None
        assert made is not None
        own = tuple(shared.tape.outputs[row] for row in made.rows(mode))
        numbers = []
        for at, surfaces in enumerate(shared.owners):
            key = at, tuple(mode[i] for i in surfaces)
            if key not in self._numbers:
                alone = replace(shared.tape, constants=(shared.constant(at, mode),))
                self._numbers[key] = self._source.constants(alone)[0]
            numbers.append(self._numbers[key])
        return ModeEquations((), made.own_guards(mode), {}), replace(shared.tape, outputs=own), numbers

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """(t, *names) -> values of expressions."""
        return self._source.function(names, expressions)

    def of_states_and_signs(self, expressions: tuple[sp.Expr, ...]) -> Callable[..., list[Any]]:
        """(t, *x, *signs) -> values of expressions."""
        if expressions not in self._functions:
            with one_at_a_time():
                names = [*self.system.states, *self.system.signs]
                self._functions[expressions] = self.function(names, expressions)
        return self._functions[expressions]

    def normal(self, index: int, mode: Mode) -> Callable[..., list[Any]]:
        """(t, *x, *signs) -> dh/dt of a surface, for the signs of a mode."""
        key = index, tuple(mode[i] for i in acting_on(self.system, index))
        if key not in self._normals:
            with one_at_a_time():
                self._normals[key] = self.of_states_and_signs((normal_in(self.system, *key),))
        return self._normals[key]

    def guard_series(self, mode: Mode, t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Taylor coefficients in time of a mode's guards from a point.

        :data:`NO_VALUE` where they are not finite, or the mode has no equations.
        """
        if self.equations(mode) is None:
            raise ValueError("the mode has no equations")
        return self.at(t, x).series(mode)[0]


class TapePoint:
    """A point with what its modes' tapes tell; see :class:`henon_ref.modes.arithmetic.Point`."""

    def __init__(self, modes: ModeEvaluation, t: Any, x: Sequence[Any], levels: tuple[float, ...]) -> None:
        self._modes, self._t, self._x, self.levels = modes, t, x, levels
        self.system, self.arithmetic = modes.system, modes.arithmetic
        self._series: dict[Mode, tuple[list[list[Any]], float]] = {}
        self._first: dict[Mode, list[list[Any]]] = {}
        self._normals: dict[tuple[int, Mode], Any] = {}

    @property
    def when(self) -> str:
        """See :class:`Point`."""
        return self.arithmetic.text(self._t)

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        """See :class:`Point`."""
        made = self._modes.equations(mode)
        if made is None:
            return None
        self.series(mode)
        return made[0].guards

    def series(self, mode: Mode) -> tuple[list[list[Any]], float]:
        """Taylor coefficients of a mode's guards, and a rate that makes them comparable."""
        if mode not in self._series:
            states, outputs = expand(*self._modes.tape(mode), self._t, self._x, ORDER, self.arithmetic.ring)
            self._series[mode] = outputs, self.arithmetic.rate(states, outputs)
        return self._series[mode]

    def leading(self, mode: Mode, place: int, first: int, zero: float, beside: int | None = None) -> Leading | None:
        """See :class:`Point`."""
        outputs, rate = self.series(mode)
        size = 0.0 if beside is None or self.arithmetic.carries_errors else self._size(mode, beside)
        return _term(outputs[place], self.arithmetic.leading(outputs[place], first, rate, size, zero))

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        """See :class:`Point`."""
        (outputs, rate), guards = self.series(mode), self._modes.equations(mode)
        assert guards is not None
        index = guards[0].guards[place].index
        ends = [c for g, c in zip(guards[0].guards, outputs, strict=True) if g.kind == "release" and g.index == index]
        return _term(outputs[place], self.arithmetic.end_of_hold(outputs[place], ends, rate, zero))

    def first_order(self, mode: Mode) -> list[list[Any]]:
        """See :class:`Point`."""
        if mode not in self._first:
            self._first[mode] = expand(*self._modes.tape(mode), self._t, self._x, 1, self.arithmetic.ring)[1]
        return self._first[mode]

    def sides(self, mode: Mode, index: int) -> tuple[Any, Any]:
        """See :class:`Point`."""
        sides = [(index, replaced(mode, index, side)) for side in (-1, 1)]
        for side in sides:
            if side not in self._normals:
                self._normals[side] = self._modes.normal(*side)(self._t, *self._x, *side[1])[0]
        return self._normals[sides[0]], self._normals[sides[1]]

    def _size(self, mode: Mode, index: int) -> float:
        """What dh/dt is small or large against."""
        try:
            below, above = self.sides(mode, index)
        except NO_VALUE:
            return 0.0
        return float(abs(below) + abs(above))

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> Sequence[Any] | None:
        """See :class:`Point`."""
        try:
            values = self._modes.of_states_and_signs(expressions)(self._t, *self._x, *signs)
        except NO_VALUE:
            return None
        return values if all(isfinite(float(value)) for value in values) else None

    def same_motion(self, first: Mode, second: Mode) -> bool:
        """See :class:`Point`."""
        one, other = (
            expand(*self._modes.tape(mode), self._t, self._x, ORDER, self.arithmetic.ring)[0]
            for mode in (first, second)
        )
        return all(self.arithmetic.equal(a, b) for a, b in zip(one, other, strict=True))


def _term(series: Sequence[Any], place: int | None) -> Leading | None:
    """The place of a coefficient that is not zero, with its sign."""
    return None if place is None else (place, 1 if series[place] > 0 else -1)
