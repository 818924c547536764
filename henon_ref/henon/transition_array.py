"""Transitions of a run as an array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from henon_ref.filippov.modes import Mode
from henon_ref.henon.state import LANDINGS, R_FROM, R_KIND, R_LANDING, R_STATE, R_SURFACE, R_TIME, R_TIME_LOW, R_TO
from henon_ref.trajectory import Kind, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze")
"""By the numbers of :mod:`henon_ref.henon.state`."""


class TransitionArray(Sequence[Transition]):
    """Transitions kept as rows of an array; each becomes a :class:`Transition` when it is looked at.

    Parameters
    ----------
    records : ndarray, shape (k, R_STATE + n)
    modes : tuple
        Modes by the numbers that the records hold.
    """

    __slots__ = ("_modes", "_records")

    def __init__(self, records: NDArray[np.float64], modes: tuple[Mode, ...]) -> None:
        self._records, self._modes = records, modes

    @property
    def times(self) -> NDArray[np.float64]:
        """Time and what rounding it lost [s], shape (k, 2)."""
        return self._records[:, [R_TIME, R_TIME_LOW]]

    @property
    def kinds(self) -> NDArray[np.int64]:
        """Index into :data:`KINDS`, shape (k,)."""
        return self._records[:, R_KIND].astype(np.int64)

    def __len__(self) -> int:
        return len(self._records)

    @overload
    def __getitem__(self, at: int) -> Transition: ...
    @overload
    def __getitem__(self, at: slice) -> TransitionArray: ...
    def __getitem__(self, at: int | slice) -> Transition | TransitionArray:
        if isinstance(at, slice):
            return TransitionArray(self._records[at], self._modes)
        row = self._records[at].tolist()
        return Transition(
            kind=KINDS[int(row[R_KIND])],
            surface=int(row[R_SURFACE]),
            from_mode=self._modes[int(row[R_FROM])],
            to_mode=self._modes[int(row[R_TO])],
            time=row[R_TIME],
            state=tuple(row[R_STATE:]),
            time_low=row[R_TIME_LOW],
            landing=LANDINGS[int(row[R_LANDING])],
        )
