"""Runs of many points of one system in compiled code; points set aside run from Python, with equal bits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ModelError
from henon_ref.integrator.constants import LoopData
from henon_ref.integrator.integrator import Integrator, Start, out_of_steps, row_at_start, run_template
from henon_ref.integrator.pairs import decimal_pairs, exact_expression
from henon_ref.integrator.records import (
    CHUNK,
    TRANSITION_PLACES,
    Workspace,
    numbered,
    transition_dtype,
    words_of,
    written,
)
from henon_ref.integrator.run import Run
from henon_ref.integrator.run_result import numbered_rows
from henon_ref.kernel.library import doubles, ffi, integers, kernel, record_dtype
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Status, Trajectory

END = record_dtype("end")
"""Record of the end of a run."""
AT_ONCE = 4096
"""Largest number of points whose constants are in memory at once."""
MEMORY = 1 << 26
"""Approximate limit on the memory of these constants [bytes]: with many modes, fewer points at once."""
BUFFER = 4 * CHUNK
"""Initial capacity of the buffer of transitions."""
STEPS = 1_000_000
"""Number of steps after which a call returns, so that interrupts are noticed: some tenths of a second."""
STEPS_ALONE = 1_000_000
"""Number of steps of an integrator after which it takes the steps of several runs together: compiling the code for this
takes about as long as these steps."""
TRIES = 16
"""Number of consecutive points set aside without a new mode after which the call no longer stops for them."""


class Keep(NamedTuple):
    """Selection of the transitions that are kept."""

    after: float = -np.inf
    """Transitions before this time are dropped [s]."""
    open_sticks: bool = False
    """Whether both ends of a stick that is open at ``after`` are kept, its start directly before its release."""


NOTHING = Keep(np.inf)


class ExactPoint(NamedTuple):
    """Numbers of a point, as arguments of :meth:`Integrator.begin`."""

    values: tuple[Any, ...]
    initial: Sequence[Any]
    start: Any
    until: Any


def _pairs(numbers: ArrayLike, axes: int) -> NDArray[np.float64]:
    """Return pairs of doubles unchanged, and doubles as pairs of the printed decimal numbers (``axes``: least ndim)."""
    found = np.asarray(numbers, dtype=np.float64)
    if found.ndim == max(axes, 1) + 1 and found.shape[-1] == 2:
        return found
    return decimal_pairs(np.atleast_2d(found) if axes else found)


class PointRuns:
    """Runs of many points: iterating does the runs; the attributes then hold their ends.

    The iterator yields arrays of the kept transitions, of type :attr:`transition_dtype`; the transitions of one point
    are in one array, in order of time. The points are in no particular order. The results depend
    neither on which points are run together nor on what was compiled before.

    ``integrator``: of a system without parameter values; ``values``, shape (points or 1, parameters): of
    :attr:`Integrator.parameters`, in their order, one row for all points or one for each; ``initial``, shape (points,
    n); ``start``, ``until``: one time or one of each point [s]. Doubles stand for the decimal numbers that Python
    prints; arrays with a further axis of length 2 are pairs (see :mod:`henon_ref.integrator.pairs`). ``keep``: by
    default no transition is kept. ``mode``: surface -> -1, 0 or +1, for starts on a surface from which several motions
    are possible; Python decides these. ``held``, bool of shape (points, surfaces): surfaces that held before, as of
    :meth:`Integrator.begin`. ``exact`` returns the exact numbers of a point, by index; by default the printed decimal
    numbers. ``settings``: of :func:`henon_ref.integrator.integrator.run_template`.

    :attr:`ends`, of type :data:`END`: time, number of the mode, and counts at the end of each run; :attr:`states`,
    shape (points, n), there. :attr:`others`: point -> Trajectory of the points that were set aside, without
    transitions. :attr:`refused`: points that have no initial mode. :attr:`held_entries`: point that was set aside ->
    surface, of those ``held`` before -> its entry in the mode at the start.
    """

    def __init__(
        self,
        integrator: Integrator,
        values: ArrayLike,
        initial: ArrayLike,
        *,
        start: ArrayLike = 0.0,
        until: ArrayLike,
        keep: Keep = NOTHING,
        mode: Mapping[int, int] | None = None,
        held: ArrayLike | None = None,
        exact: Callable[[int], ExactPoint] | None = None,
        **settings: Any,
    ) -> None:
        if integrator.system.parameters:
            raise ModelError("an integrator of a system with values of its parameters runs that system alone")
        self.integrator, self.keep, self.given_mode, self._exact = integrator, keep, mode, exact
        self.held, self.settings = None if held is None else np.asarray(held, dtype=bool), settings
        self.values = _pairs(values, 2)
        self.initial = _pairs(initial, 2)
        points, n = self.initial.shape[:2]
        self.times = np.empty((points, 2, 2))
        self.times[:, 0], self.times[:, 1] = _pairs(start, 0), _pairs(until, 0)
        self.ends = np.zeros(points, dtype=END)
        self.states = np.zeros((points, n))
        self.others: dict[int, Trajectory] = {}
        self.refused = set[int]()
        self.held_entries: dict[int, dict[int, int]] = {}
        self._numbers: dict[Mode, int] = {}

    @property
    def modes(self) -> Sequence[Mode]:
        """Modes, indexed by the numbers in transitions and ends."""
        return list(self._numbers) if self.integrator.mode_table.contacts else self.integrator.mode_table.modes

    def numbers(self, modes: Iterable[Mode]) -> NDArray[np.int64]:
        """Return the numbers of modes of contacts."""
        found = [self._numbers.setdefault(mode, len(self._numbers)) for mode in modes]
        return np.array(found, dtype=np.int64)

    @property
    def transition_dtype(self) -> np.dtype[Any]:
        """Type of a kept transition: ``point``, then :func:`henon_ref.integrator.records.transition_dtype`."""
        kind = transition_dtype(self.states.shape[1])
        assert kind.names is not None
        return np.dtype([("point", "i8"), *((name, kind[name]) for name in kind.names)], align=True)

    def status(self, point: int) -> tuple[Status, str]:
        """Return the status of a point's run, and the reason if it is not ``ok``."""
        if point in self.others:
            return self.others[point].status, self.others[point].reason
        if self.ends["code"][point] == kernel.BUDGET_SPENT:
            return "failed", out_of_steps(self.ends["steps"][point], self.ends["time"][point])
        return "ok", ""

    def exact(self, point: int) -> ExactPoint:
        """Return the exact numbers of a point."""
        if self._exact is not None:
            return self._exact(point)
        values, (begin, until) = self.values[point if len(self.values) > 1 else 0], self.times[point, :, 0].tolist()
        return ExactPoint(tuple(values[:, 0].tolist()), self.initial[point, :, 0].tolist(), begin, until)

    def start(self, point: int) -> Start:
        """Return the start of a point's run."""
        values, initial, begin, until = self.exact(point)
        held = () if self.held is None else np.flatnonzero(self.held[point]).tolist()
        given = {"start": begin, "until": until, "mode": self.given_mode, "held": held}
        return self.integrator.begin(values, initial, **given, **self.settings)

    def __iter__(self) -> Iterator[NDArray[Any]]:
        first, points = 0, len(self.initial)
        while first < points:
            own = self.integrator.programs.loop().bytes_a_point if len(self.values) > 1 else 0
            last = min(first + max(1, AT_ONCE if not own else min(AT_ONCE, MEMORY // own)), points)
            yield from _Part(self, first, last).run()
            first = last


class _Slot:
    """One of the runs in progress, and the buffer of its transitions; ``record``: a ``struct slot``."""

    def __init__(self, record: Any, workspace: Workspace, surfaces: int, width: int) -> None:
        self.record, self.workspace = record, workspace
        self.pending = np.zeros((surfaces, width))
        record.block, record.pending = doubles(workspace.block), doubles(self.pending)
        self._use(np.empty((BUFFER, width)))

    def _use(self, kept: NDArray[np.float64]) -> None:
        self.kept, self.record.kept, self.record.capacity = kept, doubles(kept), len(kept)

    def finished(self) -> NDArray[np.float64]:
        """Take the transitions of finished points out of the buffer."""
        slot, kept = self.record, self.kept
        found, rest = kept[: slot.finished].copy(), kept[slot.finished : slot.filled].copy()
        if not len(found) and slot.running:  # one point has filled the buffer
            self._use(np.empty((2 * len(kept), kept.shape[1])))
        self.kept[: len(rest)] = rest
        slot.filled, slot.finished = len(rest), 0
        return found


class _Part:
    """Points ``first`` to ``last - 1``, whose constants are in memory together."""

    def __init__(self, runs: PointRuns, first: int, last: int) -> None:
        self.runs, self.first, self.part = runs, first, slice(first, last)
        self.integrator, self.table = runs.integrator, runs.integrator.mode_table
        self.values = runs.values[self.part] if len(runs.values) > 1 else runs.values
        self.numbers = np.concatenate([runs.times[self.part, ::-1], runs.initial[self.part]], axis=1)
        self.words = words_of(self.table.contacts)
        self.rows, self.surfaces = self._rows()
        self.template = self._template(kernel.ALONE)
        self.points = points = ffi.new("struct points *")
        points.count, points.start, points.numbers = len(self.rows), self.template, doubles(self.numbers)
        points.rows, points.surfaces = integers(self.rows), integers(self.surfaces)
        points.ends = ffi.cast("struct end *", ffi.from_buffer(runs.ends[self.part]))
        points.states, (points.after, points.open_sticks) = doubles(runs.states[self.part]), runs.keep
        points.width = 1 + TRANSITION_PLACES + runs.states.shape[1] + 2 * self.words
        points.surface_count, points.stop_aside = len(runs.integrator.system.surfaces), True
        self.records, self.slots = ffi.new("struct slot[]", kernel.SLOTS), list[_Slot]()

    def run(self) -> Iterator[NDArray[Any]]:
        """Do the runs; yield the kept transitions."""
        try:
            yield from self._compiled()
        finally:
            self.integrator.free += [slot.workspace for slot in self.slots]
        for point in np.flatnonzero(self.runs.ends["code"][self.part] == kernel.SET_ASIDE).tolist():
            if self.first + point not in self.runs.others:
                yield from self._in_python(point)

    def _compiled(self) -> Iterator[NDArray[Any]]:
        points, integrator, table, slots = self.points, self.integrator, self.table, self.slots
        tries, data, codes = TRIES, None, {kernel.RUNNING}
        while codes != {kernel.DONE}:
            left = STEPS_ALONE - integrator.steps_of_points
            self._open(together=left <= 0)
            points.steps = left if left > 0 else STEPS
            if data is None or data.compiled is not table.compiled:
                tries, data = TRIES, self._constants()
            integrator.steps_of_points += kernel.run_points(self.records, len(slots), points, data.tables)
            codes = {slot.record.code for slot in slots}
            for slot in slots:
                if slot.record.code == kernel.ASIDE:
                    yield from self._in_python(slot.record.point)
                    tries -= 1
                    points.stop_aside = tries > 0 or data.compiled is not table.compiled
                elif slot.record.code == kernel.BUFFER_FULL:
                    yield from self._handed_out(slot)
        for slot in slots:
            yield from self._handed_out(slot)
        if self.words:
            done = np.flatnonzero(self.runs.ends["code"][self.part] != kernel.SET_ASIDE)
            modes, places = numbered(self.rows[done], table.contacts)
            self.runs.ends["mode"][self.first + done] = self.runs.numbers(modes)[places]

    def _template(self, stepping: int) -> Any:
        return run_template(self.table.sizes, stepping=stepping, **self.runs.settings)

    def _open(self, together: bool) -> None:
        """Provide a slot, or several whose steps are taken together."""
        points, slots = self.points, self.slots
        several = together and points.count > 1 and self.table.compile_lanes()
        count = min(kernel.SLOTS, points.count) if several else 1
        if len(slots) < count > 1:
            points.start = self.template = self._template(kernel.TOGETHER)
            for slot in slots:
                slot.workspace.run.stepping = kernel.TOGETHER
        for i in range(len(slots), count):
            slots.append(_Slot(self.records + i, self.integrator.workspace(), points.surface_count, points.width))

    def _array(self, kept: NDArray[np.float64]) -> NDArray[Any]:
        """Convert rows of the buffer to the array of transitions that is yielded."""
        contacts, rows = self.runs.integrator.mode_table.contacts, kept
        if contacts:
            own, modes = numbered_rows(kept[:, 1:], contacts)
            rows = np.column_stack([kept[:, 0], own])  # copies the points' numbers bit by bit
        found = rows.view(self.runs.transition_dtype)[:, 0]
        if contacts:
            numbers = self.runs.numbers(modes)
            for end in ("from_mode", "to_mode"):
                found[end] = numbers[found[end]]
        return found

    def _rows(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the row (or words) of each point's initial mode, and the surface that it starts on (-1: none).

        On a surface this is the row of the mode below it; it is -1 if the start is not clear.
        """
        runs, integrator = self.runs, self.runs.integrator
        values = np.broadcast_to(self.values, (len(self.numbers), *self.values.shape[1:]))
        signs = integrator.programs.start.signs_at(np.concatenate([self.numbers[:, 1:], values], axis=1))
        contacts = integrator.mode_table.contacts
        rows, surfaces = np.full((len(signs), max(self.words, 1)), -1), np.full(len(signs), -1)
        if runs.given_mode:
            return rows, surfaces
        modes, places = np.unique(signs, axis=0, return_inverse=True)
        for k, mode in enumerate(modes.tolist()):
            found = row_at_start(integrator.mode_table, mode)
            if found is not None:
                own = places.ravel() == k
                row, surfaces[own] = found
                rows[own] = written(row, contacts) if contacts else row
        if runs.held is not None:
            rows[(runs.held[self.part] & (signs[:, : runs.held.shape[1]] != 0)).any(axis=1)] = -1
        return rows, surfaces

    def _constants(self) -> LoopData:
        """Return the compiled modes with the constants of all points, or of the first point if all are equal."""
        program = self.integrator.programs.loop()
        numbers = program.numbers(
            self.values, lambda point: [exact_expression(v) for v in self.runs.exact(self.first + point).values]
        )
        self.points.numbers_step = numbers.shape[1] if len(numbers) > 1 else 0
        return program.of(numbers)

    def _handed_out(self, slot: _Slot) -> Iterator[NDArray[Any]]:
        """Yield the transitions of the points that a slot has finished."""
        found = slot.finished()
        if len(found):
            found.view(np.int64)[:, 0] += self.first
            yield self._array(found)

    def _in_python(self, point: int) -> Iterator[NDArray[Any]]:
        """Run a point that was set aside; yield its transitions."""
        runs, number = self.runs, self.first + point
        run, ends = Run(runs.integrator, runs.start(number)), runs.ends[number]
        if run.start.refused is not None:
            runs.refused.add(number)
        elif runs.held is not None:
            runs.held_entries[number] = {i: run.mode[i] for i in np.flatnonzero(runs.held[number]).tolist()}
        ends["transitions"], slot, width = 0, ffi.new("struct slot *"), self.points.width
        pending = np.zeros((self.points.surface_count, width))
        slot.point, slot.pending = number, doubles(pending)
        kept = [np.empty((0, width))]
        for block in run.stream():
            room, records = np.empty((len(block) + len(pending), width)), np.ascontiguousarray(block.recorded)
            slot.kept, slot.filled = doubles(room), 0
            kernel.keep_transitions(slot, self.points, doubles(records), len(records))
            kept.append(room[: slot.filled])
            ends["transitions"] += len(block)
        end = run.ended
        assert end is not None
        runs.others[number], runs.states[number] = end._replace(transitions=()), end.end_state
        ends["time"], ends["time_low"], ends["code"] = end.end_time, 0.0, kernel.SET_ASIDE
        if run.start.refused is None:
            ends["time_low"] = run.scalars.time_low
        table = runs.integrator.mode_table
        ends["mode"] = runs.numbers([end.end_mode])[0] if table.contacts else table.index.get(end.end_mode, -1)
        ends["steps"], ends["expansions"], ends["guard_evaluations"] = end.counts
        if len(found := np.concatenate(kept)):
            yield self._array(found)
