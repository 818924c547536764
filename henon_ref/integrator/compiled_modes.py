"""Tables of compiled modes, which grow by a row a mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, DTypeLike, NDArray

from henon_ref.modes.equations import ModeTape
from henon_ref.modes.mode import Mode


@dataclass(frozen=True, eq=False)
class CompiledModes:
    """The modes that are compiled at one time: views of tables that grow behind them.

    Links to modes that come later are put into it, unless somebody reads it then (see
    :class:`henon_ref.integrator.mode_table.ModeTable`).
    """

    records: NDArray[Any]
    """Shape (M,) of :func:`henon_ref.integrator.records.mode_dtype`."""
    sources: NDArray[np.int64]
    """(M, tapes, K): where each number of a mode's rows of constants is found among those of all modes."""
    constants: int
    """How many constants these are."""


class Owned(NamedTuple):
    """Constants of contacts, as ``struct tables`` of ``kernel.h`` has them."""

    ends: NDArray[np.int64]
    """Of each contact, where its places end."""
    places: NDArray[np.int64]
    """In a mode's row of constants."""


class Readers(list[None]):
    """An entry for each thread that is within ``with readers:``."""

    def __enter__(self) -> None:
        self.append(None)

    def __exit__(self, *_: object) -> None:
        self.pop()


class GrowingRows:
    """Rows of an array of a constant or growing width; those that were handed out stay where they are.

    Its room doubles, so that a row costs its own length. Whoever has fewer rows does not see the new ones.

    Parameters
    ----------
    dtype : dtype
    shape : tuple of int
        Of a row; a row that is larger widens all, with zeros behind them.
    """

    def __init__(self, dtype: DTypeLike, shape: tuple[int, ...]) -> None:
        self._room = np.zeros((0, *shape), dtype=dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def rows(self) -> NDArray[Any]:
        """Those that there are: a view."""
        return self._room[: self._count]

    def append(self, row: ArrayLike) -> None:
        """Add a row."""
        self.extend(np.asarray(row)[None])

    def extend(self, rows: NDArray[Any]) -> None:
        """Add some rows."""
        needed, shape = self._count + len(rows), rows.shape[1:]
        wider = tuple(map(max, self._room.shape[1:], shape))
        if needed > len(self._room) or wider != self._room.shape[1:]:
            self._move(max(needed, 2 * self._count), wider)
        self._room[(slice(self._count, needed), *map(slice, shape))] = rows
        self._count = needed

    def move(self) -> None:
        """Leave the rows that were handed out to those who have them."""
        self._move(len(self._room), self._room.shape[1:])

    def _move(self, count: int, shape: tuple[int, ...]) -> None:
        before, self._room = self.rows, np.zeros((count, *shape), dtype=self._room.dtype)
        self._room[tuple(map(slice, before.shape))] = before


class DistinctConstants:
    """Constants of the modes' tapes, each once, numbered as modes ask for them.

    Modes with the same entries for a constant's own surfaces have it in common.

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
