"""Modes of many contacts as the compiled loop has them: entries of two bits each.

Such a mode is no row of a table but a number, of base 4, the first contact's entry being its last digit (-1 is written
as 0, 0 as 1, +1 as 2); in memory it is some words (``kernel/contacts.c``).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, product

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.shared import kernel
from henon_ref.modes.mode import Mode

_DIGITS = {-1: "0", 0: "1", 1: "2"}
_FOURS = [tuple(digit - 1 for digit in reversed(four)) for four in product(range(4), repeat=4)]
"""Of each byte its four entries."""


def words_of(contacts: int) -> int:
    """Words that a mode takes; 0 without contacts, where a mode is a row."""
    return int(kernel.words_of(contacts))


def packed(mode: Mode) -> int:
    """A mode as a number.

    Examples
    --------
    >>> packed((1, 0, -1)), unpacked(packed((1, 0, -1)), 3)
    (6, (1, 0, -1))
    """
    return int("".join(map(_DIGITS.__getitem__, reversed(mode))), 4)


def unpacked(number: int, contacts: int) -> Mode:
    """The mode of a number."""
    return _entries(number.to_bytes(8 * words_of(contacts), "little"), contacts)


def written(number: int, contacts: int) -> NDArray[np.int64]:
    """The words of a number, shape (words,)."""
    return np.frombuffer(number.to_bytes(8 * words_of(contacts), "little"), dtype="<i8")


def read(words: NDArray[np.int64]) -> int:
    """The number of some words."""
    return int.from_bytes(words.tobytes(), "little")


def numbered(words: NDArray[np.int64], contacts: int) -> tuple[tuple[Mode, ...], NDArray[np.int64]]:
    """Different modes among some, and the place of each among these.

    Parameters
    ----------
    words : ndarray, shape (k, words)
    contacts : int
    """
    rows = np.ascontiguousarray(words).view(f"V{8 * words.shape[1]}")[:, 0]
    different, places = np.unique(rows, return_inverse=True)
    return tuple(_entries(row.tobytes(), contacts) for row in different), places.astype(np.int64)


def _entries(four_each: Sequence[int], contacts: int) -> Mode:
    return tuple(chain.from_iterable(map(_FOURS.__getitem__, four_each)))[:contacts]
