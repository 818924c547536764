"""Constants of compiled modes at given parameter values, computed in microseconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import chain
from struct import Struct
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.integrator.constant_program import ConstantProgram, ProgramWriter, constant_program
from henon_ref.integrator.mode_table import CompiledModes, ModeTable
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.records import Workspace
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.library import doubles, ffi, integers, kernel
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME

if TYPE_CHECKING:
    from henon_ref.integrator.precise_modes import PreciseModes, SharedTapes, StartMode
    from henon_ref.modes.mode_evaluation import ModeEvaluation


class LoopData(NamedTuple):
    """Data of the compiled modes that the compiled loop reads, shared by runs."""

    compiled: CompiledModes
    memory: Any
    """Memory that the tables point to."""
    tables: Any
    """``struct tables`` of ``henon_ref/kernel/kernel.h``."""


class LoopProgram:
    """Program of the constants of all compiled modes, followed by those of the normal velocities.

    ``writer`` writes programs in the parameters.
    """

    def __init__(self, table: ModeTable, writer: ProgramWriter) -> None:
        compiled, velocities = table.compiled, table.normals
        expressions = table.constants[: compiled.constants]
        own = () if velocities is None else velocities.tape.constants
        places = np.arange(1 + 2 * len(expressions), 1 + 2 * (len(expressions) + len(own)))
        self.compiled, self.program = compiled, writer.program([*expressions, *own])
        self._sources = np.concatenate([compiled.sources.ravel(), places[::2], places[1::2], [0]])
        self._template = ffi.new("struct tables *")
        _describe(self._template, table, compiled)
        self._at_once = self.program.compiled(self._sources)

    def at(self, values: Sequence[float]) -> LoopData | None:
        """Compute the constants at one point; None if one contains a function, is not finite, or suffers cancellation.

        ``values``: a pair of doubles for each parameter.
        """
        if self._at_once is None:
            return None
        program, pack, room, _ = self._at_once
        block = ffi.new("double[]", ffi.sizeof("struct tables") // 8 + room)
        tables = kernel.point_tables(self._template, program, pack(*values), block)
        return LoopData(self.compiled, block, tables) if tables else None

    @property
    def bytes_a_point(self) -> int:
        """Memory of :meth:`numbers` per point [bytes]."""
        return 8 * (self.program.places_a_point + self._sources.size)

    def numbers(self, values: NDArray[np.float64], exact: Callable[[int], Sequence[sp.Expr]]) -> NDArray[np.float64]:
        """Compute the constants at points with ``values``, shape (points, parameters, 2): one row per point.

        ``exact`` returns the exact values of a point, by index.
        """
        found = np.concatenate([np.zeros((len(values), 1)), self.program.pairs(values, exact)], axis=1)
        return np.take(found, self._sources, axis=1)

    def of(self, numbers: NDArray[np.float64]) -> LoopData:
        """Return data with the constants of the first point in the result of :meth:`numbers`."""
        tables = ffi.new("struct tables *", self._template[0])
        tables.numbers, behind = doubles(numbers), self.compiled.sources.size
        if tables.selection.velocities:
            tables.selection.constants = tables.numbers + behind
        return LoopData(self.compiled, numbers, tables)


def _describe(tables: Any, mode_table: ModeTable, compiled: CompiledModes) -> None:
    """Fill tables with the compiled modes, except for their constants."""
    tables.modes, tables.count = ffi.from_buffer(compiled.records), len(compiled.records)
    tables.tapes, tables.length = compiled.sources.shape[1:]
    if mode_table.contacts and len(compiled.records):
        tables.contacts, tables.owned_ends, tables.owned = mode_table.contacts, *map(integers, mode_table.owned)
    velocities, selection = mode_table.normals, tables.selection
    if velocities is not None:
        selection.velocities = ffi.cast("expand_code", velocities.address)
        selection.surfaces, selection.decoupled = len(mode_table.system.surfaces), mode_table.decoupled
        if velocities.contacts is not None:
            selection.contact, selection.beside = integers(velocities.contacts), integers(velocities.beside)


class ParameterPrograms:
    """Programs of one system in its symbolic parameters."""

    def __init__(self, mode_table: ModeTable) -> None:
        self.table, self.system = mode_table, mode_table.system
        self.parameters = parameters_in(self.system)
        """Symbols in the system's expressions, by name; this is the order of all values."""
        self.surfaces = len(self.system.surfaces)
        self.pack = Struct(f"{2 * (2 + len(self.system.states) + len(self.parameters))}d").pack
        """Packs the pairs of a start: horizon, initial time, states, parameters."""
        self._writer = ProgramWriter(self.parameters)
        self._loop: LoopProgram | None = None

    def loop(self) -> LoopProgram:
        """Return the program for the modes compiled so far."""
        made = self._loop
        if made is None or made.compiled is not self.table.compiled:
            with one_at_a_time():
                made = self._loop = LoopProgram(self.table, self._writer)
        return made

    @cached_property
    def start(self) -> ConstantProgram:
        """Program of the surfaces, then the ``valid`` expressions, in time, states and parameters."""
        with one_at_a_time():
            symbols = (TIME, *self.system.states, *self.parameters)
            return constant_program(symbols, (*self.system.surfaces, *self.system.valid))

    @cached_property
    def shared_tapes(self) -> SharedTapes:
        """Tapes that decide modes in Python, for all parameter values."""
        from henon_ref.integrator.precise_modes import SharedTapes  # rarely needed

        return SharedTapes(self.system, self.parameters)


def parameters_in(system: FilippovSystem) -> tuple[sp.Symbol, ...]:
    """Return the symbols in a system's expressions other than time, states and signs, by name."""
    symbols = set().union(*(e.free_symbols for e in system.expressions)) - {TIME, *system.states, *system.signs}
    return tuple(sorted(symbols, key=lambda symbol: symbol.name))


@dataclass(eq=False)
class ModeConstants:
    """Compiled modes of a system at given parameter values."""

    programs: ParameterPrograms
    values: tuple[float, ...]
    """Pair of doubles of each parameter, in the order of the programs."""
    exact: Callable[[], Sequence[sp.Expr]]
    """Returns the values as exact numbers; called only if double-double does not decide."""

    def __post_init__(self) -> None:
        self.is_finite = True
        """Whether the latest constants are finite."""
        self.latest = self.programs.loop().at(self.values) or self._in_balls()
        """Data of the modes compiled at the last :meth:`update`, which replaces it as a whole."""

    @property
    def table(self) -> ModeTable:
        return self.programs.table

    def update(self) -> LoopData:
        """Include the modes that have been compiled since the last update."""
        if self.latest.compiled is not self.table.compiled:
            with one_at_a_time(), compiling():
                self.latest = self.programs.loop().at(self.values) or self._in_balls()
        return self.latest

    def _in_balls(self) -> LoopData:
        """Return data for constants that :meth:`LoopProgram.at` does not compute."""
        program = self.programs.loop()
        numbers = program.numbers(np.array(self.values).reshape(1, -1, 2), lambda _: self.exact())
        self.is_finite = bool(np.isfinite(numbers).all())
        return program.of(numbers)

    def start(self, workspace: Workspace, template: Any, numbers: Sequence[Pair]) -> list[int] | None:
        """Write a start into a run's block (``start_run`` of ``kernel/start.c``); None if it is clear of all surfaces.

        The run is then in its mode. Otherwise return the signs of the surfaces, then of the ``valid`` expressions;
        UNCLEAR_SIGN for one that double-double does not decide. ``numbers``: horizon, initial time and states.
        """
        programs, compiled, room = self.programs, self.programs.start.alone, workspace.start_room
        program, packed = compiled.program if compiled else ffi.NULL, programs.pack(*chain(*numbers), *self.values)
        if kernel.start_run(workspace.run, template, self.latest.tables, program, programs.surfaces, packed, room):
            return None
        if not compiled:
            return self.signs(numbers[1:])
        signs: list[int] = ffi.unpack(ffi.cast("int64_t *", room), program.results)
        return signs

    def signs(self, point: Sequence[Pair]) -> list[int]:
        """Return the signs of surfaces and ``valid`` expressions at a time and states, as :meth:`start` does."""
        values = np.array([*chain(*point), *self.values]).reshape(1, -1, 2)
        found: list[int] = self.programs.start.signs_at(values)[0].tolist()
        return found

    def exact_signs(self, point: Sequence[Any]) -> list[int | None]:
        """Return the signs at a point of exact numbers; None for an expression without a value there."""
        return self.programs.start.signs((*point, *self.exact()))

    @cached_property
    def in_doubles(self) -> ModeEvaluation:
        """Modes in double precision."""
        return self.programs.shared_tapes.in_doubles(self.values[::2])

    @cached_property
    def start_mode(self) -> Callable[..., StartMode]:
        """:func:`henon_ref.integrator.precise_modes.start_mode` in these modes; the last 16 results are cached."""
        from henon_ref.integrator.precise_modes import start_mode  # rarely needed

        return lru_cache(maxsize=16)(partial(start_mode, self.in_doubles))

    @cached_property
    def precise(self) -> PreciseModes:
        """Modes in multiprecision."""
        from henon_ref.integrator.precise_modes import PreciseModes  # most runs have no use for it

        shared, values = self.programs.shared_tapes, tuple(self.exact())
        return PreciseModes(self.in_doubles, lambda: shared.in_balls(values))
