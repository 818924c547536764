"""Transitions of a run as an array."""

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
from henon_ref.trajectory import Kind, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze", "reset")
"""By the numbers of :mod:`henon_ref.integrator.records`."""


class TransitionArray(Sequence[Transition]):
    """Transitions kept as rows of an array; each becomes a :class:`Transition` when it is looked at.

    Parameters
    ----------
    rows : ndarray, shape (k, TRANSITION_PLACES + n)
        Each a record of :data:`henon_ref.integrator.records.TRANSITION` and a state.
    modes : sequence
        Modes by the numbers that the records hold.
    contacts : int, optional
        Where modes are entries of so many contacts: behind each state stand the words of the mode before and after
        (:mod:`henon_ref.integrator.records`), which become numbers, and modes, when somebody asks.
    """

    __slots__ = ("_made_of", "_numbered")

    def __init__(self, rows: NDArray[np.float64], modes: Sequence[Mode], contacts: int = 0) -> None:
        self._made_of = rows, modes, contacts
        self._numbered = None if contacts else (rows, modes)

    def _in_numbers(self) -> tuple[NDArray[np.float64], Sequence[Mode]]:
        """Rows, and modes by the numbers in them."""
        if self._numbered is None:
            rows, _, contacts = self._made_of
            self._numbered = numbered_rows(rows, contacts)
        return self._numbered

    @property
    def modes(self) -> Sequence[Mode]:
        """Modes by the numbers that the records hold."""
        return self._in_numbers()[1]

    @property
    def rows(self) -> NDArray[np.float64]:
        """A record and a state each."""
        return self._in_numbers()[0]

    @property
    def recorded(self) -> NDArray[np.float64]:
        """What it was made of."""
        return self._made_of[0]

    def visible(self, kinks: HiddenKinks) -> TransitionArray:
        """Those that are not on hidden kinks, their modes as :meth:`HiddenKinks.shown` has them."""
        if kinks.hides_none(self.modes):
            return self
        rows = self.rows[kinks.are_transitions(self.records, self.modes)]
        return TransitionArray(rows, tuple(map(kinks.shown, self.modes)))

    @property
    def records(self) -> NDArray[Any]:
        """Shape (k,) of :func:`henon_ref.integrator.records.transition_dtype`: a view."""
        return self.rows.view(transition_dtype(self.rows.shape[1] - TRANSITION_PLACES))[:, 0]

    @property
    def times(self) -> NDArray[np.float64]:
        """Time and what rounding it lost [s], shape (k, 2)."""
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
            rows, modes, contacts = self._made_of
            return TransitionArray(rows[at], modes, contacts)
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


def numbered_rows(rows: NDArray[np.float64], contacts: int) -> tuple[NDArray[np.float64], tuple[Mode, ...]]:
    """Rows without the words of the modes before and after at their end, which their records hold as numbers; and the
    modes of these.
    """
    words = words_of(contacts)
    ends = np.ascontiguousarray(rows[:, -2 * words :]).view(np.int64).reshape(-1, words)
    modes, places = numbered(ends, contacts)
    found = np.ascontiguousarray(rows[:, : -2 * words])
    states = found.shape[1] - TRANSITION_PLACES
    records = found.view(transition_dtype(states))[:, 0]
    records["from_mode"], records["to_mode"] = places.reshape(-1, 2).T
    return found, modes
