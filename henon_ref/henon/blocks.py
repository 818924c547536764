"""Transitions of a run as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.polynomial import LANDINGS
from henon_ref.model.modes import Mode
from henon_ref.trajectory import Kind, Transition

KINDS: tuple[Kind, ...] = ("stick", "release", "crossing", "graze")
"""By the numbers of :mod:`henon_ref.henon.registers`."""


@dataclass(slots=True, eq=False)
class TransitionBlock(Sequence[Transition]):
    """Transitions kept as arrays; each becomes a :class:`Transition` when it is looked at."""

    times: NDArray[np.float64]
    """(k, 2): time and what rounding it lost."""
    marks: NDArray[np.int64]
    """(k, 5): kind, surface, mode before, mode after, landing."""
    states: NDArray[np.float64]
    """(k, n)."""
    modes: tuple[Mode, ...]

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, at: int) -> Transition: ...
    @overload
    def __getitem__(self, at: slice) -> TransitionBlock: ...
    def __getitem__(self, at: int | slice) -> Transition | TransitionBlock:
        if isinstance(at, slice):
            return TransitionBlock(self.times[at], self.marks[at], self.states[at], self.modes)
        kind, surface, source, target, landing = self.marks[at]
        return Transition(
            kind=KINDS[kind],
            surface=int(surface),
            from_mode=self.modes[source],
            to_mode=self.modes[target],
            time=float(self.times[at, 0]),
            state=tuple(self.states[at].tolist()),
            time_low=float(self.times[at, 1]),
            landing=LANDINGS[landing],
        )
