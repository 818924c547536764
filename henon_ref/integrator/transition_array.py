"""Array of transitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.records import (
    LANDINGS,
    TRANSITION,
    TRANSITION_PLACES,
    numbered,
    transition_dtype,
    words_of,
)
from henon_ref.modes.kinks import HiddenKinks
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Kind, Trajectory, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze", "reset")
"""Names of the kinds, indexed by the constants of :mod:`henon_ref.integrator.records`."""


class TransitionArray(Sequence[Transition]):
    """Sequence of transitions stored as rows of an array; an item is converted to a :class:`Transition` on access.

    Parameters
    ----------
    rows : ndarray, shape (k, TRANSITION_PLACES + n)
        Each row is a :data:`henon_ref.integrator.records.TRANSITION` followed by a state.
    modes : sequence
        Modes, indexed by the fields ``from_mode`` and ``to_mode``.
    contacts : int, optional
        Number of entries of a mode, if the words of the modes before and after follow each state
        (:mod:`henon_ref.integrator.records`). They are converted to indices and modes on first access.
    kinks : HiddenKinks, optional
        Kinks whose transitions are left out if another branch hides them; on first access, too.
    """

    __slots__ = ("_made_of", "_numbered")

    def __init__(
        self, rows: NDArray[np.float64], modes: Sequence[Mode], contacts: int = 0, kinks: HiddenKinks | None = None
    ) -> None:
        self._made_of = rows, modes, contacts, kinks
        self._numbered = None if contacts or kinks else (rows, modes)

    def _in_numbers(self) -> tuple[NDArray[np.float64], Sequence[Mode]]:
        """Return rows with indices of modes, and these modes."""
        if self._numbered is None:
            rows, modes, contacts, kinks = self._made_of
            if contacts:
                rows, modes = numbered_rows(rows, contacts)
            if kinks:
                records, modes = _records(rows), tuple(modes)
                rows, modes = rows[kinks.are_transitions(records, modes)], tuple(map(kinks.shown, modes))
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

    def visible(self, kinks: HiddenKinks) -> TransitionArray:
        """Return the transitions that are not on hidden kinks, with modes converted by :meth:`HiddenKinks.shown`."""
        rows, modes, contacts, _ = self._made_of
        return TransitionArray(rows, modes, contacts, kinks)

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
            rows, modes, contacts, kinks = self._made_of
            return TransitionArray(self.rows[at], self.modes) if kinks else TransitionArray(rows[at], modes, contacts)
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


def shown(found: Trajectory, kinks: HiddenKinks | None) -> Trajectory:
    """Return the result of a run without transitions on kinks that another branch hides."""
    if kinks is None:
        return found
    transitions = found.transitions
    if isinstance(transitions, TransitionArray):
        transitions = transitions.visible(kinks)
    return found._replace(transitions=transitions, end_mode=kinks.shown(found.end_mode))


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
