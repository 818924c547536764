"""What a mode does at a point: derivatives of its guards, normal velocities, loads, in double precision.

Tapes are made once a mode and kept; a subclass may compute with other numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import chain, islice
from math import isfinite
from typing import Any

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.branches import leaves_out
from henon_ref.filippov.derivatives import leading, rate_of, scaled
from henon_ref.filippov.equations import Guard, ModeEquations
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.mode_tape import ModeTape
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

ORDER = 8
"""Derivatives looked at before a contact counts as one that never separates."""
ZERO = 1e-13
"""Relative size below which a derivative counts as zero (a tangency within it cannot be told in double)."""
KEPT = 1024
"""Surfaces, each in a mode of a system, of which it is kept whether their normal velocities are apart."""
CLEAR = 1e-9
"""Part of its terms from which on a value is clearly no zero."""


class _Point:
    """What has been worked out at one point, by mode."""

    def __init__(self, place: tuple[float, ...]) -> None:
        self.place = place
        self.series: dict[Mode, tuple[list[list[float]], float]] = {}
        self.first: dict[Mode, list[list[float]]] = {}
        self.normals: dict[tuple[int, Mode], float] = {}


_NOWHERE = _Point(())
"""Before a run has asked for anything."""


ModeWithTape = tuple[ModeEquations, Tape]


def mode_with_tape(system: FilippovSystem, mode: Mode) -> ModeWithTape | None:
    """Equations of a mode, and its field and guards as a tape; None where it has none."""
    try:
        equations = system.equations(mode)
    except ModelError:
        return None
    return equations, build_tape(system.states, equations.field, [g.expression for g in equations.guards])


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
    """The modes of one system at points, from any thread.

    What belongs to the numbers is a method of its own: ``_number`` to ``_negative``.

    Parameters
    ----------
    system : FilippovSystem
    values : FilippovSystem, optional
        The same with values of its parameters, where ``system`` has none.
    """

    def __init__(self, system: FilippovSystem, values: FilippovSystem | None = None) -> None:
        self.system = system
        self._numeric = (values or system).numeric
        self._tapes: dict[Mode, tuple[ModeEquations, Tape, list[Any]] | None] = {}
        self._numbers: dict[tuple[int, tuple[int, ...]], Any] = {}
        self._functions: dict[tuple[sp.Expr, ...], Callable[..., list[Any]]] = {}
        self.forget()
        self._normals: dict[tuple[int, Mode], Callable[..., list[Any]]] = {}
        self._terms: dict[sp.Expr, tuple[sp.Expr, ...]] = {}

    def _number(self, expression: sp.Expr) -> Any:
        """A constant of the equations."""
        return float(expression)

    def _function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """(t, *names) -> values of expressions."""
        values, names = [self._numeric(e) for e in expressions], [TIME, *names]
        # The time that lambdify takes grows with the names that it is given.
        used = set().union(*(value.free_symbols for value in values))
        places = [k for k, name in enumerate(names) if name in used]
        found: Callable[..., list[Any]] = sp.lambdify([names[k] for k in places], values, "math", cse=True)
        return lambda *at: found(*(at[k] for k in places))

    def _series(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> tuple[list[list[Any]], float]:
        """Taylor coefficients of a tape's outputs from a point, and a rate that makes them comparable.

        ZeroDivisionError, ValueError or OverflowError where they are not finite.
        """
        states, outputs = expand(tape, numbers, t, x, ORDER)
        return outputs, rate_of(states, outputs)

    def _linear(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Values and first derivatives of a tape's outputs at a point."""
        return expand(tape, numbers, t, x, 1)[1]

    def _motion(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Taylor coefficients of a mode's states from a point."""
        return expand(tape, numbers, t, x, ORDER)[0]

    def _equal(self, one: Sequence[Any], other: Sequence[Any]) -> bool:
        """Whether the coefficients of a state are the same, but for rounding."""
        rate = rate_of([one, other])
        pairs = list(zip(scaled(one, rate), scaled(other, rate), strict=True))
        largest = max(abs(c) for pair in pairs for c in pair)
        return all(abs(a - b) <= ZERO * largest for a, b in pairs)

    def _leading(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero, or None."""
        return leading(series, first, rate, size, zero)

    def _sign(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int:
        """Sign of that coefficient; 0 if there is none."""
        k = self._leading(series, first, rate, size, zero)
        return 0 if k is None else (1 if series[k] > 0 else -1)

    def _end_order(self, series: Sequence[Any], ways: Sequence[Sequence[Any]], rate: float, zero: float) -> int | None:
        """Index of the first coefficient that is not zero, of an end of a hold zone; None if there is none.

        A load at one end of the hold zone is small against its distance to the others; then its derivatives decide.
        """
        width = max(abs(value) for c in ways for value in scaled(c, rate))
        return 0 if abs(series[0]) > zero * width else leading(series, 1, rate, 0.0, zero)

    def _attracts_by(self, below: Any, above: Any) -> bool:
        """Whether normal velocities below and above a surface point at it, or along it."""
        zero = ZERO * (abs(below) + abs(above))
        return bool(below >= -zero and above <= zero)

    def _negative(self, value: Any, size: Any) -> bool:
        """Whether a value is clearly below zero, beside the sum of the sizes of its terms."""
        return bool(value < -CLEAR * size)

    def forget(self) -> None:
        """What has been worked out at a point is not kept for the next one who comes there."""
        self._point = _NOWHERE

    def _equations(self, mode: Mode) -> tuple[ModeEquations, Tape, list[Any]] | None:
        if mode not in self._tapes:
            with one_at_a_time():
                made = self._tape(mode) if self._shared is None else None
                if made is not None:
                    self._tapes[mode] = *made, self._constants(made[1])
                else:
                    self._tapes[mode] = self._shared_equations(mode) if self._shared is not None else None
        return self._tapes[mode]

    def _guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Guards of a mode; none where it has no equations."""
        return self.system.guards(mode) if self.system.has_equations(mode) else ()

    def tape(self, mode: Mode) -> tuple[Tape, list[Any]]:
        """Field and guards of a mode that has equations as a tape, and its constants."""
        made = self._equations(mode)
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
                self._numbers[key] = self._constants(alone)[0]
            numbers.append(self._numbers[key])
        return ModeEquations((), made.own_guards(mode), {}), replace(shared.tape, outputs=own), numbers

    def _tape(self, mode: Mode) -> ModeWithTape | None:
        """Equations of a mode and their tape; None where it has none."""
        return mode_with_tape(self.system, mode)

    def _constants(self, tape: Tape) -> list[Any]:
        """Constants of a tape."""
        return [self._number(self._numeric(c)) for c in tape.constants]

    def _expanded(self, mode: Mode, t: float, x: Sequence[float]) -> tuple[list[list[float]], float]:
        """Series of a mode's guards from a point, and their rate; those of the last point are kept."""
        kept = self._at(t, x).series
        if mode not in kept:
            made = self._equations(mode)
            assert made is not None
            kept[mode] = self._series(made[1], made[2], t, x)
        return kept[mode]

    def _first_order(self, mode: Mode, t: float, x: Sequence[float]) -> list[list[float]]:
        """Values and first derivatives of a mode's guards at a point."""
        kept = self._at(t, x).first
        if mode not in kept:
            made = self._equations(mode)
            assert made is not None
            kept[mode] = self._linear(made[1], made[2], t, x)
        return kept[mode]

    def _at(self, t: float, x: Sequence[float]) -> _Point:
        """What is known at a point; that of the last one is kept, for one event asks for it several times."""
        place, point = (t, *x), self._point
        if place != point.place:
            self._point = point = _Point(place)
        return point  # not what the attribute holds by now: another thread may be at another point

    def signs_at(self, start: sp.Expr, initial: Sequence[sp.Expr]) -> tuple[list[int], list[int]]:
        """Signs of the surfaces, and of the ``valid`` expressions, at a point in exact numbers."""
        at = {TIME: start, **dict(zip(self.system.states, initial, strict=True))}
        surfaces, valid = (
            [exact_sign(self._numeric(e).xreplace(at)) for e in expressions]
            for expressions in (self.system.surfaces, self.system.valid)
        )
        return surfaces, valid

    def _sign_at(self, t: float, x: Sequence[float], expression: sp.Expr) -> int:
        """Sign of an expression in time and states at a point."""
        at = dict(zip((TIME, *self.system.states), (t, *x), strict=True))
        return exact_sign(self._numeric(expression).xreplace({s: sp.Float(v) for s, v in at.items()}))

    def guard_series(self, mode: Mode, t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Taylor coefficients in time of a mode's guards from a point.

        ZeroDivisionError, ValueError or OverflowError where they are not finite, or the mode has no equations.
        """
        if self._equations(mode) is None:
            raise ValueError("the mode has no equations")
        return self._expanded(mode, t, x)[0]

    def _values_at(
        self, t: Any, x: Sequence[Any], expressions: tuple[sp.Expr, ...], signs: Mode
    ) -> Sequence[Any] | None:
        """Expressions in time, states and signs at a point; None where they are not finite."""
        try:
            values = self._of_states_and_signs(expressions)(t, *x, *signs)
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        return values if all(isfinite(float(value)) for value in values) else None

    def _of_states_and_signs(self, expressions: tuple[sp.Expr, ...]) -> Callable[..., list[Any]]:
        """(t, *x, *signs) -> values of expressions."""
        if expressions not in self._functions:
            with one_at_a_time():
                names = [*self.system.states, *self.system.signs]
                self._functions[expressions] = self._function(names, expressions)
        return self._functions[expressions]

    def _clear_signs(self, t: Any, x: Sequence[Any], signs: Mode, expressions: Sequence[sp.Expr]) -> list[int]:
        """Signs of expressions in time, states and signs at a point; 0 where the terms of one may cancel."""
        sums = []
        for expression in expressions:
            if expression not in self._terms:
                with one_at_a_time():
                    self._terms[expression] = sp.Add.make_args(sp.expand_mul(expression))
            sums.append(self._terms[expression])
        values = self._values_at(t, x, tuple(chain.from_iterable(sums)), signs)
        if values is None:
            return [0] * len(sums)
        found, rest = [], iter(values)
        for terms in sums:
            own = list(islice(rest, len(terms)))
            value, size = sum(own[1:], own[0]), sum(map(abs, own[1:]), abs(own[0]))
            found.append(-1 if self._negative(value, size) else int(self._negative(-value, size)))
        return found

    def _both_sides(self, t: float, x: Sequence[float], mode: Mode, index: int) -> tuple[float, float]:
        """dh/dt of a surface below and above it (signs of the mode elsewhere)."""
        kept = self._at(t, x).normals
        sides = [(index, replaced(mode, index, side)) for side in (-1, 1)]
        for side in sides:
            if side not in kept:
                kept[side] = self._normal(*side)(t, *x, *side[1])[0]
        return kept[sides[0]], kept[sides[1]]

    def _normal(self, index: int, mode: Mode) -> Callable[..., list[Any]]:
        """(t, *x, *signs) -> dh/dt of a surface, for the signs of a mode."""
        key = index, tuple(mode[i] for i in acting_on(self.system, index))
        if key not in self._normals:
            with one_at_a_time():
                self._normals[key] = self._of_states_and_signs((normal_in(self.system, *key),))
        return self._normals[key]

    def _way(self, t: float, x: Sequence[float], mode: Mode, index: int) -> int:
        """Where a surface is left to by the signs of the mode elsewhere; 0 where it attracts or it cannot be told."""
        try:
            below, above = self._both_sides(t, x, mode, index)
        except (ZeroDivisionError, ValueError, OverflowError):
            return 0
        return 1 if below > 0 and above > 0 else -1 if below < 0 and above < 0 else 0

    def _attracts(self, t: float, x: Sequence[float], mode: Mode, index: int) -> bool:
        return self._attracts_by(*self._both_sides(t, x, mode, index))

    def _size(self, t: float, x: Sequence[float], mode: Mode, index: int) -> float:
        """What dh/dt is small or large against."""
        try:
            below, above = self._both_sides(t, x, mode, index)
        except (ZeroDivisionError, ValueError, OverflowError):
            return 0.0
        return abs(below) + abs(above)
