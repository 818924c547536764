"""The motion of a mode, and what follows an event, in multiprecision: Taylor series in balls of python-flint."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp
from flint import arb, arb_poly

from henon_ref.filippov.equations import Guard, ModeEquations
from henon_ref.filippov.mode_evaluation import ORDER as DERIVATIVES
from henon_ref.filippov.mode_evaluation import ModeWithTape
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.switching import Switching
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.parameter_programs import ParameterPrograms
from henon_ref.jit.processor_time import compiling
from henon_ref.taylor.fold import FUNCTIONS
from henon_ref.taylor.series import Ring, expand
from henon_ref.taylor.tape import INFINITE, Tape, build_tape

MOST_ORDER = 320
"""Highest order of an expansion; it ends before where its terms count for nothing, or the motion is a polynomial."""
NEGLIGIBLE = 1e-50
"""What counts for nothing, relative to the sum of all terms on the step."""
LEAST_ORDER = 48
"""Order before which it does not end: terms may be missing at first."""
ENDING_ORDERS = 4
"""So many orders in a row that count for nothing end an expansion."""
DIGITS = 75
"""Of the constants: more than the precision holds."""
_RING = Ring({name: getattr(arb, name) for name in (*FUNCTIONS, "sqrt")}, arb.__pow__)


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
    switching : Switching
        What decides modes in double precision.
    precise_switching : callable, optional
        Makes what decides modes in balls, when it is first needed; by default from the system.
    """

    def __init__(
        self, system: FilippovSystem, switching: Switching, precise_switching: Callable[[], BallSwitching] | None = None
    ) -> None:
        self.system, self.switching = system, switching
        self._make_switching = precise_switching or (lambda: BallSwitching(system))
        self._tapes: dict[Mode, _ModeTape] = {}

    @cached_property
    def precise_switching(self) -> BallSwitching:
        """What decides modes in balls."""
        with compiling():
            return self._make_switching()

    @cached_property
    def _surfaces(self) -> Callable[..., list[Any]]:
        """(t, *states) -> the surfaces, and the slopes of each in every state."""
        states, surfaces = self.system.states, self.system.surfaces
        slopes = [sp.diff(h, x) for h in surfaces for x in states]
        return self.precise_switching.function(states, [*surfaces, *slopes])

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
        states, outputs = expand(made.tape, made.numbers, time, state, order, _RING, unit, end)
        return [arb_poly(series) for series in states], outputs, made.degree > 0

    def motion(
        self, mode: Mode, time: arb, state: Sequence[arb], unit: arb, order: int
    ) -> tuple[list[list[arb]], list[list[arb]]]:
        """Taylor coefficients of the states and guards, in units of ``unit`` of time, up to an order."""
        made = self._made(mode)
        return expand(made.tape, made.numbers, time, state, order, _RING, unit)

    def guard_values(self, mode: Mode, time: arb, state: Sequence[arb]) -> list[arb]:
        """Guards of a mode at a point; no numbers where they are not known there."""
        made = self._made(mode)
        return [series[0] for series in expand(made.tape, made.numbers, time, state, 0, _RING)[1]]

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
                equations, tape, numbers = self.precise_switching.equations(mode)
                self._tapes[mode] = _ModeTape(tape, equations.guards, numbers, _degree(tape))
        return self._tapes[mode]


def _degree(tape: Tape) -> int:
    """Of a motion and its guards, where all of it is a polynomial in time; else 0."""
    nodes = tape.nodes
    degrees = [nodes[row].degree + 1 for row in tape.field] + [nodes[row].degree for row in tape.outputs]
    return max(degrees) if max(degrees) <= MOST_ORDER < INFINITE else 0


def _number(constant: sp.Expr) -> arb:
    return arb(str(sp.N(constant, DIGITS))).mid()


def _negligible_tail(rows: Sequence[Sequence[arb]]) -> bool:
    """True if the last terms of some series count for nothing where their variable is 1."""
    sizes = (list(map(abs, map(float, row))) for row in rows)
    return all(max(terms[-ENDING_ORDERS:]) <= NEGLIGIBLE * sum(terms) < math.inf for terms in sizes)


class BallSwitching(Switching):
    """Decides modes at a point that is known to a radius: what cannot be told from zero there is zero."""

    def equations(self, mode: Mode) -> tuple[ModeEquations, Tape, list[Any]]:
        """Equations of a mode that has some, their tape, and its constants."""
        made = self._equations(mode)
        assert made is not None
        return made

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """(t, *names) -> values of expressions."""
        return self._function(names, expressions)

    def _number(self, expression: sp.Expr) -> Any:
        return _number(expression)

    def _tape_of(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Tape:
        """Expressions in time and these names as a tape."""
        return build_tape(names, (), expressions)

    def _function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        tape = self._tape_of(tuple(names), tuple(expressions))
        numbers = self._constants(tape)

        def values(t: arb, *x: arb | int) -> list[arb]:
            outputs = expand(tape, numbers, t, [arb(v) for v in x], 0, _RING)[1]
            return [series[0] for series in outputs]

        return values

    def _series(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> tuple[list[list[Any]], float]:
        outputs = expand(tape, numbers, t, x, DERIVATIVES, _RING)[1]
        if not all(c.is_finite() for series in outputs for c in series):
            raise ValueError("a derivative is not finite")
        return outputs, 1.0

    def _linear(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> list[list[Any]]:
        return expand(tape, numbers, t, x, 1, _RING)[1]

    def _motion(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> list[list[Any]]:
        return expand(tape, numbers, t, x, DERIVATIVES, _RING)[0]

    def _equal(self, one: Sequence[Any], other: Sequence[Any]) -> bool:
        return all(a.overlaps(b) for a, b in zip(one, other, strict=True))

    def _leading(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int | None:
        return next((k for k in range(first, len(series)) if not series[k].contains(0)), None)

    def _end_order(self, series: Sequence[Any], ways: Sequence[Sequence[Any]], rate: float, zero: float) -> int | None:
        return self._leading(series, 0, rate, 0.0, zero)

    def _attracts_by(self, below: Any, above: Any) -> bool:
        return not below < 0 and not above > 0

    def _negative(self, value: Any, size: Any) -> bool:
        return bool(value < 0)

    def _size(self, t: Any, x: Sequence[Any], mode: Mode, index: int) -> float:
        return 0.0


class PreciseSwitching(BallSwitching):
    """The same with constants from programs (see :class:`henon_ref.henon.constants.DoubleSwitching`)."""

    def __init__(self, programs: ParameterPrograms, values: tuple[sp.Expr, ...]) -> None:
        self._programs, self._values = programs, values
        super().__init__(programs.system)

    def _tape(self, mode: Mode) -> ModeWithTape | None:
        return self._programs.mode(mode)

    def _constants(self, tape: Tape) -> list[Any]:
        return [ball.mid() for ball in self._programs.constants(tape).balls(self._values)]

    def _tape_of(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Tape:
        return self._programs.tape(names, expressions)
