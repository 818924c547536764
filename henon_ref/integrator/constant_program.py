"""Programs that evaluate the constants of equations from parameter values, at thousands of points without SymPy.

Compiled code runs every program in double-double (``henon_ref/kernel/double_double.c``); functions other than roots are
evaluated by python-flint, once for each distinct argument. A program also runs over other rings, such as rational
numbers or balls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from itertools import groupby
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from flint import arb, fmpq
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import double_double
from henon_ref.expressions.grammar import ELEMENTARY
from henon_ref.expressions.traversal import Rule, Rules, Walk, fold
from henon_ref.kernel.library import LEVELS, doubles, ffi, integers, kernel
from henon_ref.precision import working_precision

ADD, MULTIPLY, POWER, SQRT = kernel.ADD, kernel.MULTIPLY, kernel.POWER, kernel.SQRT
"""Operations of compiled code; the second operand of POWER is an integer, not a register."""
ROUNDING: float = LEVELS.operation_error
"""Bound of the relative error of one operation."""
FUNCTION = 4
"""Operation evaluated by python-flint; its second operand is the number of the function."""
POWER_OF = 5
"""Power with an exponent in a register, evaluated by python-flint."""
NAMES = (*ELEMENTARY, "Abs")
"""Functions of one argument, by number."""
BITS = 256
"""Precision of python-flint's balls for functions and signs [bits]."""


class CompiledProgram(NamedTuple):
    """Program prepared for compiled code, for one point at a time."""

    program: Any
    """A ``struct program``."""
    pack: Callable[..., bytes]
    """Packs the pairs of all inputs, one after the other."""
    room: int
    """Number of doubles of working memory."""
    memory: Any
    """Objects that the program points to."""


@dataclass(frozen=True, eq=False)
class ConstantProgram:
    """Expressions in given symbols as one list of operations.

    The registers are the inputs, then exact numbers and results in order of first use.
    """

    inputs: int
    numbers: tuple[tuple[int, sp.Expr], ...]
    """(register, number) for the exact numbers in the expressions."""
    operations: tuple[tuple[int, int, int, int], ...]
    """(operation, register of the result, registers of the operands)."""
    outputs: tuple[int, ...]
    """Register of each expression."""

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """``outputs`` as an array."""
        return np.array(self.outputs, dtype=np.int64)

    @cached_property
    def _registers(self) -> NDArray[np.float64]:
        """Initial values of all registers, shape (registers, 3)."""
        found = np.zeros((self.inputs + len(self.numbers) + len(self.operations), 3))
        for place, number in self.numbers:
            high, low = double_double(number)
            found[place] = high, low, ROUNDING * abs(high) if low else 0.0
        return found

    @cached_property
    def _stages(self) -> list[tuple[bool, NDArray[np.int64]]]:
        """Consecutive operations grouped by whether compiled code supports them (False) or not (True)."""
        grouped = groupby(self.operations, key=lambda operation: operation[0] >= FUNCTION)
        return [(other, np.array(list(group), dtype=np.int64)) for other, group in grouped]

    def compiled(self, sources: Sequence[int] | NDArray[np.int64] = ()) -> CompiledProgram | None:
        """Prepare the program for compiled code; None if it contains functions.

        ``sources``: result to store at each place. See ``point_tables`` and ``start_run`` of ``kernel.h``.
        """
        if any(other for other, _ in self._stages):
            return None
        operations = self._stages[0][1] if self._stages else np.zeros((0, 4), dtype=np.int64)
        arrays = operations, self._registers, self.places, np.array(sources, dtype=np.int64)
        made = ffi.new("struct program *")
        made.operations, made.registers = integers(operations), doubles(self._registers)
        made.outputs, made.sources = integers(self.places), integers(arrays[-1])
        made.count, made.width, made.inputs = len(operations), len(self._registers), self.inputs
        made.results, made.places = len(self.outputs), len(sources)
        room = self._registers.size + 1 + 2 * len(self.outputs) + len(sources)
        return CompiledProgram(made, Struct(f"{2 * self.inputs}d").pack, room, arrays)

    @cached_property
    def alone(self) -> CompiledProgram | None:
        """:meth:`compiled` without places."""
        return self.compiled()

    def signs_at(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the signs of the expressions at points, shape (points, inputs, 2).

        0 if exactly zero, UNCLEAR_SIGN if not decided.
        """
        registers, signs = self.registers(points), np.empty((len(points), len(self.outputs)), dtype=np.int64)
        width, count = registers.shape[1], len(self.outputs)
        kernel.signs_of(doubles(registers), width, len(points), integers(self.places), count, integers(signs))
        return signs

    def registers(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Run the program at points, exact doubles (points, inputs) or pairs of doubles (points, inputs, 2).

        Returns each number as a pair of doubles (:mod:`henon_ref.integrator.pairs`) and a bound of its error, infinite
        or NaN if not finite, shape (points, registers, 3).
        """
        found = np.empty((len(values), *self._registers.shape))
        found[:] = self._registers
        if values.ndim == 2:
            found[:, : self.inputs, 0] = values
        else:
            found[:, : self.inputs, :2] = values
            found[:, : self.inputs, 2] = np.where(values[..., 1] != 0.0, ROUNDING * np.abs(values[..., 0]), 0.0)
        for other, operations in self._stages:
            if other:
                for operation in operations.tolist():
                    _evaluate(operation, found)
            else:
                kernel.run_operations(integers(operations), len(operations), doubles(found), found.shape[1], len(found))
        return found

    @property
    def places_a_point(self) -> int:
        """Number of doubles that :meth:`pairs` allocates per point."""
        return self._registers.size + 5 * len(self.outputs)

    def pairs(self, values: NDArray[np.float64], exact: Callable[[int], Sequence[sp.Expr]]) -> NDArray[np.float64]:
        """Evaluate the expressions at points as pairs of doubles, shape (points, 2 k).

        ``exact`` returns the exact inputs of a point, by index. Expressions that lose digits by cancellation are
        evaluated again with them in balls.
        """
        own = self.registers(values)[:, self.places]
        size = np.abs(own[:, :, 0])
        lost = np.isfinite(size) & (own[:, :, 2] > LEVELS.accurate * size)
        for point in np.flatnonzero(lost.any(axis=1)).tolist():
            with working_precision(BITS):
                balls = [_three(ball) for ball in self.balls(exact(point))]
            own[point, lost[point]] = np.array(balls)[lost[point]]
        return own[:, :, :2].reshape(len(values), -1)

    def over_ring(self, values: Sequence[Any], number: Callable[[sp.Expr], Any], functions: Any) -> list[Any]:
        """Evaluate the expressions over a ring; ``number`` converts an exact number, ``functions`` is ``arb`` or
        ``math``."""
        registers = dict(enumerate(values)) | {place: number(each) for place, each in self.numbers}
        for what, to, i, j in self.operations:
            a = registers[i]
            if what == ADD:
                registers[to] = a + registers[j]
            elif what == MULTIPLY:
                registers[to] = a * registers[j]
            elif what == POWER:
                registers[to] = a**j
            elif what == SQRT:
                registers[to] = functions.sqrt(a)
            else:
                registers[to] = a ** registers[j] if what == POWER_OF else _function(j, a, functions)
        return [registers[output] for output in self.outputs]

    def balls(self, values: Sequence[sp.Expr]) -> list[arb]:
        """Evaluate the expressions at a point of exact numbers, in balls of python-flint's working precision."""
        return self.over_ring([_ball(v) for v in values], _ball, arb)

    def in_doubles(self, values: Sequence[float]) -> list[float]:
        """Evaluate the expressions in double precision; an exception of ``math`` if one has no value."""
        return self.over_ring(values, _double, math)

    def signs(self, values: Sequence[Any]) -> list[int | None]:
        """Return the signs at a point of exact numbers (int, Fraction or SymPy); 0 if zero to BITS bits.

        None if an expression has no finite real value.
        """
        return [int(v > 0) - int(v < 0) if v.is_finite() else None for v in self.exact_values(values)]

    def exact_values(self, values: Sequence[Any]) -> list[Any]:
        """Evaluate the expressions at a point of exact numbers: balls, exact if all is rational; NaN at a pole."""
        with working_precision(BITS):
            if self.is_rational and all(getattr(v, "is_Rational", True) for v in values):
                exact = [fmpq(int(v.numerator), int(v.denominator)) for v in values]
                try:
                    return list(map(arb, self.over_ring(exact, lambda n: fmpq(int(n.p), int(n.q)), arb)))
                except ZeroDivisionError:  # other expressions may have values at a pole of one
                    pass
            return self.balls(list(map(sp.sympify, values)))

    @cached_property
    def is_rational(self) -> bool:
        """Whether rational inputs yield rational outputs."""
        simple = all(what in (ADD, MULTIPLY, POWER) for what, *_ in self.operations)
        return simple and all(number.is_Rational for _, number in self.numbers)


def _function(number: int, argument: Any, functions: Any = arb) -> Any:
    """Evaluate a function of NAMES, in balls or with ``math``."""
    return abs(argument) if NAMES[number] == "Abs" else getattr(functions, NAMES[number])(argument)


_double = lru_cache(maxsize=1024)(float)
"""Double of an exact number."""


def _ball(number: sp.Expr) -> arb:
    """Return an exact number as a ball; irrational numbers to 90 digits."""
    if number.is_Rational:
        return arb(fmpq(int(number.p), int(number.q)))
    digits, error = _digits(number)
    return arb(digits) + arb(0, error)


@lru_cache(maxsize=1024)
def _digits(number: sp.Expr) -> tuple[str, float]:
    """Return 90 digits of an irrational number, and a bound of their error."""
    return str(sp.N(number, 90)), 10.0**-90 * abs(float(number))


def _evaluate(operation: Sequence[int], registers: NDArray[np.float64]) -> None:
    """Evaluate a function operation at all points, once for each distinct argument."""
    what, to, i, j = operation
    operands = [registers[:, i]] if what == FUNCTION else [registers[:, i], registers[:, j]]
    arguments, places = np.unique(np.concatenate(operands, axis=1), axis=0, return_inverse=True)
    found = []
    with working_precision(BITS):
        for argument in arguments.reshape(len(arguments), -1, 3).tolist():
            balls = [arb(high, error) + arb(low) for high, low, error in argument]
            found.append(_three(balls[0] ** balls[1] if what == POWER_OF else _function(j, balls[0])))
    registers[:, to] = np.array(found)[places.ravel()]


def _three(value: arb) -> tuple[float, float, float]:
    """Return a ball as a pair of doubles and a bound of its error."""
    if not value.is_finite():
        return math.nan, math.nan, math.inf
    high = float(value.mid())
    low = float(value.mid() - high)
    return high, low, 1.0001 * float(value.rad()) + ROUNDING * abs(high)


def constant_program(symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> ConstantProgram:
    """Return expressions in given symbols as a program.

    ModelError if one contains a function not in :data:`NAMES`, another symbol, or a number that is not finite.
    """
    return ProgramWriter(symbols).program(expressions)


class ProgramWriter:
    """Writer of programs in given symbols; each program extends the operations of the previous ones.

    Equal operations are shared, so that a program costs only the operations that the previous ones lack.
    """

    def __init__(self, symbols: Sequence[sp.Symbol]) -> None:
        self._inputs = self._registers = len(symbols)
        self._numbers: list[tuple[int, sp.Expr]] = []
        self._operations: list[tuple[int, int, int, int]] = []
        self._known: dict[sp.Expr, int] = {symbol: i for i, symbol in enumerate(symbols)}
        self._made: dict[tuple[int, int, int], int] = {}
        self._rules = Rules(self._number, self._chain(ADD), self._chain(MULTIPLY), self._power, self._function)

    def program(self, expressions: Sequence[sp.Expr]) -> ConstantProgram:
        """Return a program, as :func:`constant_program`."""
        outputs = tuple([fold(e, self._rules, self._known) for e in expressions])
        return ConstantProgram(self._inputs, tuple(self._numbers), tuple(self._operations), outputs)

    def _register(self) -> int:
        self._registers += 1
        return self._registers - 1

    def _number(self, e: sp.Expr) -> int:
        self._numbers.append((self._register(), e))
        return self._numbers[-1][0]

    def _chain(self, what: int) -> Rule[int]:
        return lambda e, walk: reduce(lambda a, b: self._operation(what, a, b), list(map(walk, e.args)))

    def _power(self, e: sp.Expr, walk: Walk[int]) -> int:
        base = walk(e.base)
        if e.exp.is_Integer:
            return self._operation(POWER, base, int(e.exp))
        if e.exp == sp.Rational(1, 2):
            return self._operation(SQRT, base, base)
        return self._operation(POWER_OF, base, walk(e.exp))

    def _function(self, e: sp.Expr, walk: Walk[int]) -> int:
        name = type(e).__name__
        if name not in NAMES or len(e.args) != 1:
            raise ModelError(f"no program for {e}")
        return self._operation(FUNCTION, walk(e.args[0]), NAMES.index(name))

    def _operation(self, what: int, i: int, j: int) -> int:
        key = what, i, j
        if key not in self._made:
            self._made[key] = self._register()
            self._operations.append((what, self._made[key], i, j))
        return self._made[key]
