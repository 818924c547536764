"""Tapes and functions of a system's modes, built once and evaluated at any parameter values in doubles or balls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from henon_ref.integrator.constant_program import ConstantProgram, constant_program
from henon_ref.modes.arithmetic import BALLS, DOUBLES, Arithmetic
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import GuardsAndTape, ModeEvaluation, ball_function, guards_and_tape
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME, Tape, build_tape


class SharedTapes:
    """Tapes of a system with symbolic parameters, whose values are given in a fixed order."""

    def __init__(self, system: FilippovSystem, parameters: tuple[sp.Symbol, ...]) -> None:
        self.system, self._parameters = system, parameters
        self.mode = lru_cache(maxsize=None)(self._mode)
        self.function = lru_cache(maxsize=None)(self._function)
        self.tape = lru_cache(maxsize=None)(self._tape)
        self._programs: dict[int, tuple[Tape, ConstantProgram]] = {}

    def in_doubles(self, values: tuple[float, ...]) -> ModeEvaluation:
        """Return the modes in double precision at parameter values."""
        return _InDoubles(self, DOUBLES, values)

    def in_balls(self, values: tuple[sp.Expr, ...]) -> ModeEvaluation:
        """Return the modes in ball arithmetic of the working precision at exact parameter values."""
        return _InBalls(self, BALLS, values)

    def constants(self, tape: Tape) -> ConstantProgram:
        """Return the program of the constants of one of these tapes."""
        if id(tape) not in self._programs:
            with one_at_a_time():
                self._programs[id(tape)] = tape, constant_program(self._parameters, tape.constants)
        return self._programs[id(tape)][1]

    def _mode(self, mode: Mode) -> GuardsAndTape | None:
        with one_at_a_time():
            return guards_and_tape(self.system, mode)

    def _function(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> ConstantProgram:
        """Write a program of expressions in time, ``names`` and parameters."""
        with one_at_a_time():
            return constant_program((TIME, *names, *self._parameters), expressions)

    def _tape(self, names: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Tape:
        """Build a tape of expressions in time and ``names``."""
        with one_at_a_time():
            return build_tape(names, (), expressions)


class _AtValues(ModeEvaluation):
    """Evaluation at given parameter values, by shared tapes and programs."""

    def __init__(self, shared: SharedTapes, arithmetic: Arithmetic, values: tuple[Any, ...]) -> None:
        super().__init__(shared.system, arithmetic)
        self._tapes, self._values = shared, values

    def guards_and_tape(self, mode: Mode) -> GuardsAndTape | None:
        return self._tapes.mode(mode)


class _InDoubles(_AtValues):
    def constants(self, tape: Tape) -> list[Any]:
        program = self._tapes.constants(tape)
        registers = program.registers(np.array([self._values]))[0]
        found: list[float] = registers[program.places, 0].tolist()
        return found

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        program, values = self._tapes.function(tuple(names), tuple(expressions)), self._values
        return lambda *point: program.in_doubles((*point, *values))


class _InBalls(_AtValues):
    def constants(self, tape: Tape) -> list[Any]:
        return [ball.mid() for ball in self._tapes.constants(tape).balls(self._values)]

    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        tape = self._tapes.tape(tuple(names), tuple(expressions))
        return ball_function(tape, self.constants(tape))
