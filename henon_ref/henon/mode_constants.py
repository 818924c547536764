"""Constants of compiled modes at given parameter values, and what decides modes with them in Python."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.mode_tape import ModeTape
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.switching import Switching
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.jump import Jumps
from henon_ref.henon.mode_table import CompiledModes, ModeTable
from henon_ref.henon.precise_modes import BallSwitching, PreciseModes
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import doubles, ffi, integers
from henon_ref.precision import one_at_a_time

Pair = tuple[float, float]
"""A number as its double and what that leaves."""


class LoopData(NamedTuple):
    """What the compiled loop reads of the modes that are compiled, apart from a run's own memory."""

    compiled: CompiledModes
    numbers: NDArray[np.float64]
    """(M, 2 or 3, K): for each mode the constants of its expansion, of its probe, and of the maps of resets where
    compiled code makes jumps, rounded to double; behind them what the rounding lost of each."""
    normals: NDArray[np.float64]
    """Constants of the normal velocities of all surfaces, likewise; none where the loop selects no mode by them."""
    tables: Any
    """All this as the loop takes it: ``struct tables`` of ``henon_ref/kernel/kernel.h``, which points into it."""


def loop_data(
    mode_table: ModeTable, compiled: CompiledModes, numbers: NDArray[np.float64], normals: NDArray[np.float64]
) -> LoopData:
    """Modes that are compiled with their constants; those of the first point where there are several points'."""
    tables = ffi.new("struct tables *")
    tables.modes, tables.count = ffi.from_buffer(compiled.records), len(compiled.modes)
    tables.numbers = doubles(numbers)
    tables.tapes, tables.length = numbers.shape[-2:]
    if compiled.rows.size:
        velocities, selection = mode_table.normals, tables.selection
        assert velocities is not None
        selection.velocities, selection.constants = ffi.cast("expand_code", velocities.address), doubles(normals)
        selection.signs, selection.rows = integers(compiled.signs), integers(compiled.rows)
        selection.surfaces, selection.decoupled = compiled.signs.shape[1], mode_table.decoupled
    return LoopData(compiled, numbers, normals, tables)


class ModeConstants(ABC):
    """A system's compiled modes at given parameter values.

    Attributes
    ----------
    latest : LoopData
        For the modes that were compiled when it was last asked for; replaced as a whole by :meth:`update`.
    """

    latest: LoopData

    @property
    @abstractmethod
    def switching(self) -> Switching:
        """What decides modes in double precision."""

    @property
    @abstractmethod
    def precise(self) -> PreciseModes:
        """The modes in multiprecision."""

    @cached_property
    def jumps(self) -> Jumps:
        """The resets' maps, in multiprecision."""
        return Jumps(self.precise)

    @abstractmethod
    def update(self) -> LoopData:
        """Take in modes that have been compiled since."""


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
        self._table, self._values = mode_table, values
        self._known: dict[tuple[ModeTape, int, tuple[int, ...]], Pair] = {}
        self._rows = np.zeros((0, 0, 1))
        self.latest = self._extended(mode_table.compiled, np.zeros((0, 0, 1)))

    @cached_property
    def switching(self) -> Switching:
        """See :class:`ModeConstants`."""
        return Switching(self._table.system, self._values)

    @cached_property
    def precise(self) -> PreciseModes:
        """See :class:`ModeConstants`."""
        system, values = self._table.system, self._values
        return PreciseModes(system, self.switching, lambda: BallSwitching(system, values))

    def update(self) -> LoopData:
        """See :class:`ModeConstants`."""
        with one_at_a_time(), compiling():
            if self.latest.compiled is not self._table.compiled:
                self.latest = self._extended(self._table.compiled, self.latest.numbers)
            return self.latest

    def _extended(self, compiled: CompiledModes, numbers: NDArray[np.float64]) -> LoopData:
        rows = [
            [self._numbers(tape, mode) for tape in code.tapes]
            for mode, code in zip(compiled.modes[len(numbers) :], compiled.codes[len(numbers) :], strict=True)
        ]
        longest = max([numbers.shape[2], *(len(constants) for row in rows for constants in row)])
        if len(compiled.modes) > len(self._rows) or longest > self._rows.shape[2]:
            tapes = max((len(code.tapes) for code in compiled.codes), default=0)
            self._rows = np.zeros((2 * len(compiled.modes), tapes, longest))
            self._rows[: len(numbers), : numbers.shape[1], : numbers.shape[2]] = numbers
        found = self._rows[: len(compiled.modes)]  # whoever has fewer rows of it does not see the new ones
        for place, row in enumerate(rows, start=len(numbers)):
            for own, constants in zip(found[place], row, strict=True):
                own[: len(constants)] = constants
        return loop_data(self._table, compiled, found, self._normals if compiled.rows.size else np.zeros(0))

    def _numbers(self, tape: ModeTape, mode: Mode) -> list[float]:
        pairs = [self._number(tape, at, mode) for at in range(len(tape.tape.constants))]
        return [high for high, _ in pairs] + [low for _, low in pairs]

    def _number(self, tape: ModeTape, at: int, mode: Mode) -> Pair:
        """A constant, which is the same in all modes with the same entries for its own surfaces."""
        key = tape, at, tuple(mode[i] for i in tape.owners[at])
        if key not in self._known:
            try:
                self._known[key] = double_double(self._values.numeric(tape.constant(at, mode)))
            except ModelError:  # a mode that is never entered may have it: who enters it is told that it is not finite
                self._known[key] = math.nan, math.nan
        return self._known[key]

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Constants of the normal velocities of all surfaces, in states and signs."""
        made = self._table.normals
        assert made is not None
        pairs = [double_double(self._values.numeric(c)) for c in made.tape.constants]
        return np.array([*(p[0] for p in pairs), *(p[1] for p in pairs), 0.0])
