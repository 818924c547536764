"""Constants of the modes' tapes, each once: modes with the same entries for its own surfaces have it in common."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.filippov.mode_tape import ModeTape
from henon_ref.filippov.modes import Mode

Table = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Of the places in rows of constants, one after the other, the surface of each, the one behind the last for none; and
what is put there for that surface's entry -1, 0 and +1, shape (3, places): -1 where it has none yet, or is that of
several surfaces."""


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
        self._tables: dict[tuple[ModeTape, ...], Table] = {}

    def sources(self, tapes: tuple[ModeTape, ...], mode: Mode) -> NDArray[np.int64]:
        """Places in that row of a mode's constants, shape (tapes, K).

        Of each tape the doubles come first, then what the rounding lost of them, then zeros.
        """
        if tapes not in self._tables:
            self._tables[tapes] = _empty_table(tapes, len(mode))
        surfaces, table = self._tables[tapes]
        columns = np.array((*mode, 0))[surfaces] + 1
        found = table[columns, np.arange(len(surfaces))].reshape(len(tapes), -1)
        if found.min() < 0:
            for row, tape in enumerate(tapes):
                count = len(tape.tape.constants)
                for at in np.flatnonzero(found[row, :count] < 0).tolist():
                    number = self._number(tape, at, mode)
                    found[row, at], found[row, count + at] = 1 + 2 * number, 2 + 2 * number
                    if len(tape.owners[at]) < 2:
                        for place in (at, count + at):
                            flat = row * found.shape[1] + place
                            table[columns[flat], flat] = found[row, place]
        return found

    def _number(self, tape: ModeTape, at: int, mode: Mode) -> int:
        key = tape, at, tuple(mode[i] for i in tape.owners[at])
        if key not in self._numbers:
            self._numbers[key] = len(self.expressions)
            self.expressions.append(tape.constant(at, mode))
        return self._numbers[key]


def _empty_table(tapes: tuple[ModeTape, ...], surfaces: int) -> Table:
    width = max([1, *(2 * len(tape.tape.constants) for tape in tapes)])
    owners, places = np.full((len(tapes), width), surfaces), np.zeros((3, len(tapes), width), dtype=np.int64)
    for row, tape in enumerate(tapes):
        first = [own[0] if own else surfaces for own in tape.owners]
        owners[row, : 2 * len(first)], places[:, row, : 2 * len(first)] = 2 * first, -1
    return owners.ravel(), places.reshape(3, -1)
