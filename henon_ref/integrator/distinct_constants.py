"""Constants of the modes' tapes, each once: modes with the same entries for its own surfaces have it in common."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.modes.equations import ModeTape
from henon_ref.modes.mode import Mode


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

    def sources(self, tapes: tuple[ModeTape, ...], mode: Mode) -> NDArray[np.int64]:
        """Places in that row of a mode's constants, shape (tapes, K).

        Of each tape the doubles come first, then what the rounding lost of them, then zeros.
        """
        found = np.zeros((len(tapes), max([1, *(2 * len(tape.tape.constants) for tape in tapes)])), dtype=np.int64)
        for row, tape in zip(found, tapes, strict=True):
            count = len(tape.tape.constants)
            row[:count] = [1 + 2 * self._number(tape, at, mode) for at in range(count)]
            row[count : 2 * count] = row[:count] + 1
        return found

    def _number(self, tape: ModeTape, at: int, mode: Mode) -> int:
        key = tape, at, tuple(mode[i] for i in tape.owners[at])
        if key not in self._numbers:
            self._numbers[key] = len(self.expressions)
            self.expressions.append(tape.constant(at, mode))
        return self._numbers[key]
