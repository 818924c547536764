"""Constants of compiled modes at parameter values that two doubles hold, made in microseconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.filippov.in_balls import BALLS, ball_function
from henon_ref.filippov.in_doubles import DOUBLES
from henon_ref.filippov.mode_evaluation import ModeEvaluation
from henon_ref.henon.mode_constants import LoopData, ModeConstants, Pair
from henon_ref.henon.pairs import Three, three_of
from henon_ref.henon.parameter_programs import ParameterPrograms, numbers_behind
from henon_ref.henon.precise_modes import PreciseModes
from henon_ref.taylor.tape import Tape


class DoubleConstants(ModeConstants):
    """From programs in double-double.

    Parameters
    ----------
    programs : ParameterPrograms
    values : tuple of Three
        Of the programs' parameters, in their order (see :mod:`henon_ref.henon.pairs`).
    exact : callable
        Gives them as exact numbers, for what double-double does not decide.

    Attributes
    ----------
    doubles : tuple of float
        The values, each rounded to double.
    is_finite : bool
        Whether the constants of all modes that were compiled first are.
    """

    def __init__(
        self, programs: ParameterPrograms, values: tuple[Three, ...], exact: Callable[[], Sequence[sp.Expr]]
    ) -> None:
        self._programs, self.values, self._exact = programs, values, exact
        self.doubles = tuple([high for high, _, _ in values])
        self.table = programs.table
        made = programs.at_once(values)
        if made is None:
            super().__init__(programs.table)
            self.is_finite = bool(np.isfinite(self.latest.numbers).all())
        else:
            self.latest, self.is_finite = made, True

    @cached_property
    def _values(self) -> NDArray[np.float64]:
        """See :class:`ModeConstants`; of modes whose constants have been made at once it is theirs."""
        made: LoopData | None = self.__dict__.get("latest")
        return np.zeros(1) if made is None else numbers_behind(made)

    def _pairs(self, expressions: Sequence[sp.Expr]) -> NDArray[np.float64]:
        program = self._programs.program(tuple(expressions))
        return program.pairs(np.array(self.values).reshape(1, -1, 3), lambda _: self._exact())[0]

    def start_signs(self, t: Pair, x: Sequence[Pair]) -> tuple[int, ...]:
        """See :meth:`ParameterPrograms.start_signs`."""
        point = np.array([[*(three_of(pair) for pair in (t, *x)), *self.values]])
        found: list[int] = self._programs.start_signs(point)[0].tolist()
        return tuple(found)

    def exact_signs(self, t: sp.Expr, x: Sequence[sp.Expr]) -> tuple[list[int], list[int]]:
        """Signs of the surfaces, and of the ``valid`` expressions, at a point of exact numbers."""
        signs, count = self._programs.start.signs((t, *x, *self._exact())), len(self._programs.system.surfaces)
        return signs[:count], signs[count:]

    @cached_property
    def in_doubles(self) -> ModeEvaluation:
        """See :class:`ModeConstants`."""
        return ModeEvaluation(self._programs.system, DOUBLES, _DoubleTapes(self._programs, self.doubles))

    @cached_property
    def precise(self) -> PreciseModes:
        """See :class:`ModeConstants`."""
        system, tapes = self._programs.system, _BallTapes(self._programs, tuple(self._exact()))
        return PreciseModes(system, self.in_doubles, lambda: ModeEvaluation(system, BALLS, tapes))


class _DoubleTapes:
    """Tapes that are shared with other parameter values, their constants from programs."""

    def __init__(self, programs: ParameterPrograms, values: tuple[float, ...]) -> None:
        self.mode, self._programs, self._values = programs.mode, programs, values

    def constants(self, tape: Tape) -> list[Any]:
        program = self._programs.constants(tape)
        registers = program.registers(np.array([self._values]))[0]
        found: list[float] = registers[list(program.outputs), 0].tolist()
        return found

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        function, values = self._programs.function(names, expressions), self._values
        return lambda *point: function(*point, *values)


class _BallTapes:
    """The same in balls."""

    def __init__(self, programs: ParameterPrograms, values: tuple[sp.Expr, ...]) -> None:
        self.mode, self._programs, self._values = programs.mode, programs, values

    def constants(self, tape: Tape) -> list[Any]:
        return [ball.mid() for ball in self._programs.constants(tape).balls(self._values)]

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        tape = self._programs.tape(tuple(names), tuple(expressions))
        return ball_function(tape, self.constants(tape))
