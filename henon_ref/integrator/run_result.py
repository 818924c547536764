"""Result of a run, made from the memory of the run when it is read; transitions as an array; dense output."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.records import (
    LANDINGS,
    TRANSITION,
    TRANSITION_PLACES,
    Workspace,
    numbered,
    read,
    transition_dtype,
    words_of,
)
from henon_ref.modes.kinks import are_visible, shown_mode
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Counts, Kind, Status, Trajectory, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze", "reset")
"""Names of the kinds, indexed by the constants of :mod:`henon_ref.integrator.records`."""


Reason = str | Callable[[], str]
"""Reason of an ending, or a function that returns it: making the sentence takes longer than many runs."""
_FIELDS = tuple(field.name for field in fields(Trajectory))


class TransitionArray(Sequence[Transition]):
    """Sequence of transitions stored as rows of an array; an item is converted to a :class:`Transition` on access.

    Each of the ``rows``, shape (k, TRANSITION_PLACES + n), is a :data:`henon_ref.integrator.records.TRANSITION`
    followed by a state; ``modes`` are indexed by its fields ``from_mode`` and ``to_mode``. ``contacts``: number of
    entries of a mode, if the words of the modes before and after follow each state
    (:mod:`henon_ref.integrator.records`); they are converted to indices and modes on first access. ``kinked``: system
    whose hidden kinks are left out (:mod:`henon_ref.modes.kinks`), on first access, too.
    """

    __slots__ = ("_made_of", "_numbered")

    def __init__(
        self, rows: NDArray[np.float64], modes: Sequence[Mode], contacts: int = 0, kinked: FilippovSystem | None = None
    ) -> None:
        self._made_of = rows, modes, contacts, kinked
        self._numbered = None if contacts or kinked else (rows, modes)

    def _in_numbers(self) -> tuple[NDArray[np.float64], Sequence[Mode]]:
        """Return rows with indices of modes, and these modes."""
        if self._numbered is None:
            rows, modes, contacts, kinked = self._made_of
            if contacts:
                rows, modes = numbered_rows(rows, contacts)
            if kinked:
                records, modes = _records(rows), tuple(modes)
                rows = rows[are_visible(kinked, records, modes)]
                modes = tuple(shown_mode(kinked, mode) for mode in modes)
            self._numbered = rows, modes
        return self._numbered

    @property
    def modes(self) -> Sequence[Mode]:
        """Modes, indexed by the fields ``from_mode`` and ``to_mode``."""
        return self._in_numbers()[1]

    @property
    def rows(self) -> NDArray[np.float64]:
        """Record and state of each transition."""
        return self._in_numbers()[0]

    @property
    def recorded(self) -> NDArray[np.float64]:
        """Rows as given to the constructor, without those on hidden kinks."""
        return self.rows if self._made_of[3] else self._made_of[0]

    def visible(self, kinked: FilippovSystem) -> TransitionArray:
        """Return the transitions that are not on hidden kinks, with modes as :func:`shown_mode` returns them."""
        rows, modes, contacts, _ = self._made_of
        return TransitionArray(rows, modes, contacts, kinked)

    @property
    def records(self) -> NDArray[Any]:
        """View as records, shape (k,), of :func:`henon_ref.integrator.records.transition_dtype`."""
        return _records(self.rows)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times as pairs of doubles [s], shape (k, 2)."""
        return self.recorded[:, :2]

    @property
    def kinds(self) -> NDArray[np.int64]:
        """Index into :data:`KINDS`, shape (k,)."""
        return self.records["kind"].astype(np.int64)

    def __len__(self) -> int:
        return len(self.recorded)

    @overload
    def __getitem__(self, at: int) -> Transition: ...
    @overload
    def __getitem__(self, at: slice) -> TransitionArray: ...
    def __getitem__(self, at: int | slice) -> Transition | TransitionArray:
        if isinstance(at, slice):
            rows, modes, contacts, kinked = self._made_of
            return TransitionArray(self.rows[at], self.modes) if kinked else TransitionArray(rows[at], modes, contacts)
        row = self.rows[at]
        time, low, source, target, surface, kind, landing = row[:TRANSITION_PLACES].view(TRANSITION)[0].tolist()
        return Transition(
            kind=KINDS[kind],
            surface=surface,
            from_mode=self.modes[source],
            to_mode=self.modes[target],
            time=time,
            state=tuple(row[TRANSITION_PLACES:].tolist()),
            time_low=low,
            landing=LANDINGS[landing],
        )


def _records(rows: NDArray[np.float64]) -> NDArray[Any]:
    return rows.view(transition_dtype(rows.shape[1] - TRANSITION_PLACES))[:, 0]


def shown(found: Trajectory, kinked: FilippovSystem | None) -> Trajectory:
    """Return the result of a run without transitions on hidden kinks of the system ``kinked``."""
    if kinked is None:
        return found
    transitions = found.transitions
    if isinstance(transitions, TransitionArray):
        transitions = transitions.visible(kinked)
    return found._replace(transitions=transitions, end_mode=shown_mode(kinked, found.end_mode))


def numbered_rows(rows: NDArray[np.float64], contacts: int) -> tuple[NDArray[np.float64], tuple[Mode, ...]]:
    """Move the words of the modes before and after from the end of each row into its record, as indices of the returned
    modes.
    """
    words = words_of(contacts)
    ends = np.ascontiguousarray(rows[:, -2 * words :]).view(np.int64).reshape(-1, words)
    modes, places = numbered(ends, contacts)
    found = np.ascontiguousarray(rows[:, : -2 * words])
    states = found.shape[1] - TRANSITION_PLACES
    records = found.view(transition_dtype(states))[:, 0]
    records["from_mode"], records["to_mode"] = places.reshape(-1, 2).T
    return found, modes


class RunResult(Trajectory):
    """Trajectory whose fields, except the status, are made when one is first read: they take longer than a short run.

    The memory of the run may be used for another run afterwards. ``kinked``: system whose hidden kinks are left out.
    """

    def __init__(
        self,
        table: ModeTable,
        workspace: Workspace,
        kinked: FilippovSystem | None = None,
        status: Status = "ok",
        reason: Reason = "",
    ) -> None:
        found = workspace.unpack(workspace.memory)
        rows = workspace.transitions[: found[5]].copy() if found[5] else None
        since = workspace.since.tolist() if found[6] else ()
        self.status, self._made_of = status, (table, found, rows, since, reason, kinked)

    def __getattr__(self, name: str) -> Any:
        """Make the fields; called for an attribute that does not exist."""
        if name not in _FIELDS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        table, found, rows, since, reason, kinked = self._made_of
        surfaces = len(table.system.surfaces)  # the ``valid`` expressions follow them
        self.transitions = () if rows is None else TransitionArray(rows, table.modes, table.contacts, kinked)
        self.end_time, self.end_state = found[0], found[7:-1]
        mode = table.mode(read(found[-1]) if table.contacts else found[1])
        self.end_mode = shown_mode(kinked, mode) if kinked else mode
        self.reason, self.counts = reason if isinstance(reason, str) else reason(), Counts(*found[2:5])
        self.undecided_after = tuple((i if i < surfaces else -1, t) for i, t in enumerate(since) if t < math.inf)
        return getattr(self, name)

    def __reduce__(self) -> Any:
        """Pickle the fields alone, not the compiled modes."""
        return Trajectory, tuple(getattr(self, name) for name in _FIELDS)


class DenseOutput:
    """Solution of a run as a function of time, from the Taylor polynomials of its steps.

    Attributes
    ----------
    begin, begin_low : ndarray, shape (k,)
        Start time of each step [s], a pair of doubles whose sum it is; the last entry is the end of the run.
    unit : ndarray, shape (k,)
        Unit of time of each step's polynomial [s].
    coefficients : ndarray, shape (k, n, order + 1)
        Taylor coefficients of the states on each step, in this unit.
    start, end : float
        Interval of the solution [s].
    """

    def __init__(self, steps: NDArray[Any], start: float, end: Trajectory) -> None:
        """``steps``: as :func:`henon_ref.integrator.records.step_dtype`; ``start``: initial time [s]."""
        rest = np.zeros((1, *steps["coefficients"].shape[1:]))
        rest[0, :, 0] = end.end_state  # constant after an early end
        self.begin, self.begin_low = np.append(steps["time"], end.end_time), np.append(steps["time_low"], 0.0)
        self.unit = np.append(steps["unit"], 1.0)
        self.coefficients = np.concatenate([steps["coefficients"], rest])
        self.start, self.end = start, end.end_time

    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the state at a time, shape (n,), or at m times, shape (n, m); at a jump, the state after it.

        Raises
        ------
        ArgumentError
            Also a ValueError, if a time lies outside the run or is not a number.
        """
        times = checked_times(t, self.start, self.end)
        flat = np.atleast_1d(times)
        value = self._on(np.maximum(np.searchsorted(self.begin, flat, side="right") - 1, 0), flat)
        return np.ascontiguousarray(value.T) if times.ndim else value[0]

    def before(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the state just before each of m jumps, at their times, shape (n, m)."""
        return np.ascontiguousarray(self._on(np.maximum(np.searchsorted(self.begin, times) - 1, 0), times).T)

    def _on(self, step: NDArray[np.intp], times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate the polynomial of ``step[i]`` at ``times[i]``, shape (m, n)."""
        part = ((times - self.begin[step]) - self.begin_low[step]) / self.unit[step]
        rows = self.coefficients[step]
        value: NDArray[np.float64] = rows[:, :, -1]
        for k in range(rows.shape[2] - 2, -1, -1):
            value = value * part[:, None] + rows[:, :, k]
        return value


def checked_times(t: ArrayLike, start: float, end: float) -> NDArray[np.float64]:
    """Return times as an array of zero or one dimension; ArgumentError unless all lie between start and end."""
    try:
        times = np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"t is {str(t)[:60]}; wanted a time, or a list or array of times") from None
    if times.ndim > 1:
        raise ArgumentError(f"t has the shape {times.shape}; wanted a time, or a list or array of times")
    outside = times[~((times >= start) & (times <= end))]
    if outside.size:
        raise ArgumentError(
            f"t = {outside.flat[0]:.17g} is not between the ends of the run, {start:.17g} and {end:.17g}"
        )
    return times
