"""Transitions of a run as an array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from henon_ref.filippov.kinks import HiddenKinks
from henon_ref.filippov.modes import Mode
from henon_ref.henon.records import LANDINGS, TRANSITION, TRANSITION_PLACES, transition_dtype
from henon_ref.trajectory import Kind, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze", "reset")
"""By the numbers of :mod:`henon_ref.henon.records`."""


class TransitionArray(Sequence[Transition]):
    """Transitions kept as rows of an array; each becomes a :class:`Transition` when it is looked at.

    Parameters
    ----------
    rows : ndarray, shape (k, TRANSITION_PLACES + n)
        Each a record of :data:`henon_ref.henon.records.TRANSITION` and a state.
    modes : sequence
        Modes by the numbers that the records hold.
    """

    __slots__ = ("_modes", "_rows")

    def __init__(self, rows: NDArray[np.float64], modes: Sequence[Mode]) -> None:
        self._rows, self._modes = rows, modes

    @property
    def modes(self) -> Sequence[Mode]:
        """Modes by the numbers that the records hold."""
        return self._modes

    @property
    def rows(self) -> NDArray[np.float64]:
        """What it was made of."""
        return self._rows

    def visible(self, kinks: HiddenKinks) -> TransitionArray:
        """Those that are not on hidden kinks, their modes as :meth:`HiddenKinks.shown` has them."""
        if kinks.hides_none(self._modes):
            return self
        rows = self._rows[kinks.are_transitions(self.records, self._modes)]
        return TransitionArray(rows, tuple(map(kinks.shown, self._modes)))

    @property
    def records(self) -> NDArray[Any]:
        """Shape (k,) of :func:`henon_ref.henon.records.transition_dtype`: a view."""
        return self._rows.view(transition_dtype(self._rows.shape[1] - TRANSITION_PLACES))[:, 0]

    @property
    def times(self) -> NDArray[np.float64]:
        """Time and what rounding it lost [s], shape (k, 2)."""
        return self._rows[:, :2]

    @property
    def kinds(self) -> NDArray[np.int64]:
        """Index into :data:`KINDS`, shape (k,)."""
        return self.records["kind"].astype(np.int64)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, at: int) -> Transition: ...
    @overload
    def __getitem__(self, at: slice) -> TransitionArray: ...
    def __getitem__(self, at: int | slice) -> Transition | TransitionArray:
        if isinstance(at, slice):
            return TransitionArray(self._rows[at], self._modes)
        row = self._rows[at]
        time, low, source, target, surface, kind, landing = row[:TRANSITION_PLACES].view(TRANSITION)[0].tolist()
        return Transition(
            kind=KINDS[kind],
            surface=surface,
            from_mode=self._modes[source],
            to_mode=self._modes[target],
            time=time,
            state=tuple(row[TRANSITION_PLACES:].tolist()),
            time_low=low,
            landing=LANDINGS[landing],
        )
