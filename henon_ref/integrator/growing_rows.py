"""An array that grows by rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


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
