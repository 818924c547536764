"""Programs of the constants of a system's modes, and of its start, made once for all values of its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from struct import Struct
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.integrator.compiled_modes import CompiledModes
from henon_ref.integrator.constant_program import ConstantProgram, constant_program
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.pairs import Three
from henon_ref.kernel.shared import doubles, ffi, integers, kernel
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME

if TYPE_CHECKING:
    from henon_ref.integrator.shared_tapes import SharedTapes

KEPT = 64
"""Programs of constants that are kept: those of all modes, and of what later ones have more."""
SHARE = 25
"""Constants of all modes for which one point more is made without a program of all."""
TABLES = ffi.sizeof("struct tables") // 8
"""Length of the tables at the begin of a block, in doubles."""
_BLOCK = ffi.typeof("double[]")
CLEAR = 1e-9
"""Part of the size of its terms that a sum is larger than where its sign is beyond rounding: a thousand terms of a
thousand factors each are off by less."""
MOST_TERMS = 100
"""Terms of one polynomial, and polynomials: more are left to others."""


class LoopData(NamedTuple):
    """What the compiled loop reads of the modes that are compiled, apart from a run's own memory."""

    compiled: CompiledModes
    constants: Any
    """The memory of the modes' constants, and of those of the normal velocities."""
    tables: Any
    """All this as the loop takes it: ``struct tables`` of ``henon_ref/kernel/kernel.h``, which points into it."""

    @property
    def numbers(self) -> NDArray[np.float64]:
        """(M, 2 or 3, K): for each mode the constants of its expansion, of its probe, and of the maps of resets where
        compiled code makes jumps, rounded to double; behind them what the rounding lost of each. A copy."""
        shape = self.tables.count, self.tables.tapes, self.tables.length
        memory = ffi.buffer(self.tables.numbers, 8 * math.prod(shape))
        return np.frombuffer(memory, dtype=np.float64).reshape(shape).copy()


def loop_data(
    mode_table: ModeTable, compiled: CompiledModes, numbers: NDArray[np.float64], normals: NDArray[np.float64]
) -> LoopData:
    """Modes that are compiled with their constants; those of the first point where there are several points'.

    numbers : ndarray, shape (..., M, tapes, K)
        See :attr:`LoopData.numbers`.
    normals : ndarray
        Constants of the normal velocities of all surfaces, likewise; none where the loop selects no mode by them.
    """
    tables = ffi.new("struct tables *")
    tables.modes, tables.count = ffi.from_buffer(compiled.records), len(compiled.records)
    tables.numbers = doubles(numbers)
    tables.tapes, tables.length = numbers.shape[-2:]
    if mode_table.contacts and len(compiled.records):
        owned = mode_table.owned
        tables.contacts, tables.owned_ends, tables.owned = mode_table.contacts, *map(integers, owned)
    velocities, selection = mode_table.normals, tables.selection
    if velocities is not None:
        selection.velocities, selection.constants = ffi.cast("expand_code", velocities.address), doubles(normals)
        selection.surfaces, selection.decoupled = len(mode_table.system.surfaces), mode_table.decoupled
        if velocities.contacts is not None:
            selection.contact, selection.beside = integers(velocities.contacts), integers(velocities.beside)
    return LoopData(compiled, (numbers, normals), tables)


@dataclass(frozen=True, eq=False)
class LoopProgram:
    """Constants of all compiled modes, as the compiled loop takes them."""

    compiled: CompiledModes
    constants: ConstantProgram
    normals: ConstantProgram
    """Constants of the normal velocities."""
    table: ModeTable

    @cached_property
    def one_point(self) -> OnePoint | None:
        """What makes the constants of one point at once; None where they hold functions."""
        rows, nothing = self.compiled.sources, np.zeros(1)
        count = 2 * len(self.normals.outputs)
        places = np.concatenate([np.arange(1, count, 2), np.arange(2, count + 1, 2), [0]])
        constants, normals = self.constants.compiled(rows), self.normals.compiled(places)
        if constants is None or normals is None:
            return None
        template = loop_data(self.table, self.compiled, np.zeros(rows.shape), nothing)
        size = 2 + rows.size + len(places) + 2 * len(self.constants.outputs) + count
        return OnePoint(template, constants, normals, TABLES + size, self.constants.inputs)

    @property
    def bytes_a_point(self) -> int:
        """Memory that :meth:`numbers` takes for each point."""
        return 8 * (self.constants.places_a_point + self.normals.places_a_point + self.compiled.sources.size)

    def numbers(
        self, values: NDArray[np.float64], exact: Callable[[int], Sequence[sp.Expr]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """At parameter values, shape (points, parameters, 3); ``exact``: those of a point, by its number.

        Returns
        -------
        numbers : ndarray, shape (points, M, tapes, K)
            See :attr:`LoopData.numbers`.
        normals : ndarray, shape (points, 2 k + 1)
            Constants of the normal velocities.
        """
        nothing = np.zeros((len(values), 1))
        found = np.concatenate([nothing, self.constants.pairs(values, exact)], axis=1)
        normals = self.normals.pairs(values, exact)
        normals = np.concatenate([normals[:, ::2], normals[:, 1::2], nothing], axis=1)
        return np.take(found, self.compiled.sources, axis=1), normals


class OnePoint:
    """Makes the constants of one point at once: see ``point_tables`` of ``kernel.h``.

    Parameters
    ----------
    template : LoopData
        Of the modes, whatever their constants are.
    constants, normals
        See :meth:`ConstantProgram.compiled`.
    size : int
        Of a block, in doubles.
    parameters : int
    """

    def __init__(self, template: LoopData, constants: Any, normals: Any, size: int, parameters: int) -> None:
        self._template, self._constants, self._normals, self._size = template, constants, normals, size
        self._pack = Struct(f"{3 * parameters}d").pack

    def __call__(self, values: Sequence[Three]) -> LoopData | None:
        """At parameter values; None where a constant is not finite, or its terms cancel."""
        block, inputs = ffi.new(_BLOCK, self._size), self._pack(*chain.from_iterable(values))
        compiled, _, template = self._template
        tables = kernel.point_tables(template, self._constants[0], self._normals[0], inputs, block)
        return LoopData(compiled, block, tables) if tables else None


def numbers_behind(data: LoopData) -> NDArray[np.float64]:
    """Constants of one point by their numbers; see :class:`henon_ref.integrator.compiled_modes.DistinctConstants`."""
    numbers = np.frombuffer(ffi.buffer(data.constants), dtype=np.float64)
    return numbers[TABLES : TABLES + 1 + 2 * data.compiled.constants].copy()


class ParameterPrograms:
    """Programs of one system, whose parameters have no values.

    Parameters
    ----------
    mode_table : ModeTable

    Attributes
    ----------
    parameters : tuple of Symbol
        Those that stand in the system's expressions, by name: the order of all values.
    """

    def __init__(self, mode_table: ModeTable) -> None:
        self.table = mode_table
        self.system = mode_table.system
        self.parameters = parameters_in(self.system)
        self.no_zeros = (0,) * mode_table.most_guards
        self._loop: LoopProgram | None = None
        self._asked, self._asked_for = 0, self.table.compiled
        self.program = lru_cache(maxsize=KEPT)(self._program)

    def at_once(self, values: Sequence[Three]) -> LoopData | None:
        """Constants of the modes that are compiled now; None where they are to be made one after the other.

        The program of all is written once points have come without new modes in between, more of them the longer it is.
        """
        made, compiled = self._loop, self.table.compiled
        if made is None or made.compiled is not compiled:
            self._asked = self._asked + 1 if self._asked_for is compiled else 1
            self._asked_for = compiled
            if self._asked * SHARE < compiled.constants:
                return None
            made = self.loop()
        return None if made.one_point is None else made.one_point(values)

    def loop(self) -> LoopProgram:
        """For the modes that are compiled now."""
        made = self._loop
        if made is None or made.compiled is not self.table.compiled:
            with one_at_a_time():
                made = self._loop = self._loop_program(self.table.compiled)
        return made

    @cached_property
    def signs_in_doubles(self) -> Callable[..., tuple[int, ...] | None] | None:
        """See :func:`sign_function`: of surfaces and ``valid`` expressions, from time, state and parameter values."""
        with one_at_a_time():
            inputs = (TIME, *self.system.states, *self.parameters)
            return sign_function(inputs, (*self.system.surfaces, *self.system.valid))

    @cached_property
    def start(self) -> ConstantProgram:
        """Surfaces, then ``valid`` expressions, in time, states and parameters."""
        with one_at_a_time():
            inputs = (TIME, *self.system.states, *self.parameters)
            return constant_program(inputs, (*self.system.surfaces, *self.system.valid))

    def start_signs(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Signs of the surfaces, then of the ``valid`` expressions, at some points; UNCLEAR_SIGN where it is not clear.

        Parameters
        ----------
        points : ndarray, shape (points, 1 + n + parameters, 3)
            Time, state, parameter values (see :func:`henon_ref.integrator.pairs.threes`).
        """
        program = self.start
        signs = np.empty((len(points), len(program.outputs)), dtype=np.int64)
        registers, count = program.registers(points), len(program.outputs)
        kernel.signs_of(
            doubles(registers), registers.shape[1], len(points), integers(program.places), count, integers(signs)
        )
        return signs

    @cached_property
    def shared_tapes(self) -> SharedTapes:
        """What decides modes in Python, for all parameter values."""
        from henon_ref.integrator.shared_tapes import SharedTapes  # most runs have no use for it

        return SharedTapes(self.system, self.parameters)

    def _program(self, expressions: tuple[sp.Expr, ...]) -> ConstantProgram:
        """Expressions in the parameters as a program."""
        with one_at_a_time():
            return constant_program(self.parameters, expressions)

    def _loop_program(self, compiled: CompiledModes) -> LoopProgram:
        constants, normals = self.table.constants.expressions[: compiled.constants], self.table.normals
        velocities = () if normals is None else normals.tape.constants
        return LoopProgram(compiled, self.program(tuple(constants)), self.program(tuple(velocities)), self.table)


def parameters_in(system: FilippovSystem) -> tuple[sp.Symbol, ...]:
    """Symbols of a system's expressions that are no states, no signs and not the time, by name."""
    expressions = [*system.field, *system.surfaces, *system.valid]
    for override in system.overrides.values():
        expressions += [*override.field, *(release.when for release in override.release)]
    for reset in system.resets.values():
        expressions += reset.map.values()
    symbols = set().union(*(e.free_symbols for e in set(expressions))) - {TIME, *system.states, *system.signs}
    return tuple(sorted(symbols, key=lambda symbol: symbol.name))


def sign_function(
    symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]
) -> Callable[..., tuple[int, ...] | None] | None:
    """What gives the signs of some expressions at a point; None where one of them is no short sum of products.

    Parameters
    ----------
    symbols : sequence of Symbol
        What the function takes, as floats that are off by no more than rounding.
    expressions : sequence of Expr

    Returns
    -------
    callable or None
        It returns None where a sign is not beyond rounding.
    """
    if len(expressions) > MOST_TERMS:
        return None
    sums = [sp.Add.make_args(sp.expand(e)) for e in expressions]
    if any(len(terms) > MOST_TERMS or not all(map(_is_product, terms)) for terms in sums):
        return None
    values_at = sp.lambdify(symbols, [_value_and_size(terms) for terms in sums], "math")

    def signs(*point: float) -> tuple[int, ...] | None:
        found = []
        try:
            values = values_at(*point)
        except ArithmeticError:
            return None
        for value, size in values:
            if not abs(value) > CLEAR * size:  # nor where they are not finite
                return None
            found.append(1 if value > 0.0 else -1)
        return tuple(found)

    return signs


def _value_and_size(terms: Sequence[sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
    """A sum, and that of the sizes of its terms, as they are to be evaluated."""
    return sp.Add(*terms, evaluate=False), sp.Add(*(sp.Abs(term, evaluate=False) for term in terms), evaluate=False)


def _is_product(term: sp.Expr) -> bool:
    """Whether a term is a product of rational numbers and whole powers of symbols."""
    factors = (factor.as_base_exp() for factor in sp.Mul.make_args(term))
    return all((base.is_Rational or base.is_Symbol) and exponent.is_Integer for base, exponent in factors)
