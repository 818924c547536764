"""Constants of compiled modes at given parameter values, and what decides modes with them in Python."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.in_balls import in_balls
from henon_ref.filippov.in_doubles import in_doubles
from henon_ref.filippov.mode_evaluation import ModeEvaluation
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.growing_rows import GrowingRows
from henon_ref.henon.jump import Jumps
from henon_ref.henon.mode_table import CompiledModes, ModeTable
from henon_ref.henon.precise_modes import PreciseModes
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import doubles, ffi, integers
from henon_ref.precision import one_at_a_time

Pair = tuple[float, float]
"""A number as its double and what that leaves."""


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


class ModeConstants(ABC):
    """A system's compiled modes at given parameter values.

    Parameters
    ----------
    mode_table : ModeTable

    Attributes
    ----------
    table : ModeTable
    latest : LoopData
        For the modes that were compiled when it was last asked for; replaced as a whole by :meth:`update`.
    """

    latest: LoopData

    def __init__(self, mode_table: ModeTable) -> None:
        self.table = mode_table
        self.latest = self._extended(mode_table.compiled)

    @cached_property
    def _values(self) -> NDArray[np.float64]:
        """See :class:`henon_ref.henon.distinct_constants.DistinctConstants`."""
        return np.zeros(1)

    @cached_property
    def _rows(self) -> GrowingRows:
        """The modes' rows of constants."""
        return GrowingRows(np.float64, (0, 0))

    @property
    @abstractmethod
    def in_doubles(self) -> ModeEvaluation:
        """The modes in double precision."""

    @property
    @abstractmethod
    def precise(self) -> PreciseModes:
        """The modes in multiprecision."""

    @abstractmethod
    def _pairs(self, expressions: Sequence[sp.Expr]) -> NDArray[np.float64]:
        """Constants in parameters, each as its double and what that leaves, shape (2 k,); NaN for one that is none."""

    @cached_property
    def jumps(self) -> Jumps:
        """The resets' maps, in multiprecision."""
        return Jumps(self.precise)

    def update(self) -> LoopData:
        """Take in modes that have been compiled since."""
        with one_at_a_time(), compiling():
            compiled = self.table.compiled
            if self.latest.compiled is not compiled:
                self.latest = self._extended(compiled)
            return self.latest

    def _extended(self, compiled: CompiledModes) -> LoopData:
        known = len(self._values) // 2
        if compiled.constants > known:
            new = self._pairs(self.table.constants.expressions[known : compiled.constants])
            self._values = np.concatenate([self._values, new])
        if len(compiled.sources) > len(self._rows):
            self._rows.extend(self._values[compiled.sources[len(self._rows) :]])
        return loop_data(self.table, compiled, self._rows.rows, self._normals)

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Constants of the normal velocities of all surfaces, in states and signs."""
        made = self.table.normals
        pairs = self._pairs(() if made is None else made.tape.constants).reshape(-1, 2)
        return np.concatenate([pairs[:, 0], pairs[:, 1], [0.0]])


class ExactConstants(ModeConstants):
    """From exact numbers, each constant rounded once.

    Parameters
    ----------
    mode_table : ModeTable
        Of a system, with or without values of its parameters.
    values : FilippovSystem
        The system with values of all parameters.
    """

    def __init__(self, mode_table: ModeTable, values: FilippovSystem) -> None:
        self._system = values
        super().__init__(mode_table)

    @cached_property
    def in_doubles(self) -> ModeEvaluation:
        """See :class:`ModeConstants`."""
        return in_doubles(self.table.system, self._system)

    @cached_property
    def precise(self) -> PreciseModes:
        """See :class:`ModeConstants`."""
        system, values = self.table.system, self._system
        return PreciseModes(system, self.in_doubles, lambda: in_balls(system, values))

    def _pairs(self, expressions: Sequence[sp.Expr]) -> NDArray[np.float64]:
        return np.array([part for each in expressions for part in self._pair(each)])

    def _pair(self, expression: sp.Expr) -> Pair:
        try:
            return double_double(self._system.numeric(expression))
        except ModelError:  # a mode that is never entered may have it: who enters it is told that it is not finite
            return math.nan, math.nan
