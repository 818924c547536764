"""Constants of the modes' tapes, each once: modes with the same entries for its own surfaces have it in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.filippov.mode_tape import ModeTape
from henon_ref.filippov.modes import Mode

Table = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Of a tape the surface of each constant, the last one for none; (constants, 3): its number for that surface's entry -1,
0 and +1, -1 where it has none yet, or belongs to several surfaces."""


class DistinctConstants:
    """Numbered as modes ask for them.

    Their values stand in one row: a zero, then of each its double and what the rounding lost.

    Attributes
    ----------
    expressions : list of Expr
        In parameters, by their numbers. It only grows.
    """

    def __init__(self) -> None:
        self.expressions: list[sp.Expr] = []
        self._numbers: dict[tuple[ModeTape, int, tuple[int, ...]], int] = {}
        self._tables: dict[ModeTape, Table] = {}

    def sources(self, tapes: Sequence[ModeTape], mode: Mode) -> NDArray[np.int64]:
        """Places in that row of a mode's constants, shape (tapes, K).

        Of each tape the doubles come first, then what the rounding lost of them, then zeros.
        """
        found = np.zeros((len(tapes), max([1, *(2 * len(tape.tape.constants) for tape in tapes)])), dtype=np.int64)
        for row, tape in zip(found, tapes, strict=True):
            numbers = self._of(tape, mode)
            count = len(numbers)
            row[:count], row[count : 2 * count] = 1 + 2 * numbers, 2 + 2 * numbers
        return found

    def _of(self, tape: ModeTape, mode: Mode) -> NDArray[np.int64]:
        """Numbers of a tape's constants in a mode."""
        if tape not in self._tables:
            first = [surfaces[0] if surfaces else len(mode) for surfaces in tape.owners]
            self._tables[tape] = np.array(first, dtype=np.int64), np.full((len(first), 3), -1)
        surfaces, table = self._tables[tape]
        columns = np.array((*mode, 0))[surfaces] + 1
        found: NDArray[np.int64] = table[np.arange(len(table)), columns]
        for at in np.flatnonzero(found < 0).tolist():
            owners = tape.owners[at]
            key = tape, at, tuple(mode[i] for i in owners)
            if key not in self._numbers:
                self._numbers[key] = len(self.expressions)
                self.expressions.append(tape.constant(at, mode))
            found[at] = self._numbers[key]
            if len(owners) < 2:
                table[at, columns[at]] = found[at]
        return found
