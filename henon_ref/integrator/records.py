"""What the compiled loop and Python share, as ``henon_ref/kernel/kernel.h`` describes it.

Records and the numbers in their fields; the memory that a run works on: its block, which the loop is handed (where its
parts stand says ``struct places``), with views of the parts; and modes of many contacts. Such a mode is no row of a
table but a number, of base 4, the first contact's entry being its last digit (-1 is written as 0, 0 as 1, +1 as 2); in
memory it is some words (``kernel/contacts.c``).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.shared import doubles, ffi, kernel, record_dtype
from henon_ref.modes.mode import Mode

STICK: int = kernel.STICK
RELEASED: int = kernel.RELEASED
CROSSING: int = kernel.CROSSING
GRAZE: int = kernel.GRAZE
RESET: int = kernel.RESET
"""Kinds of transitions."""
HENON: int = kernel.HENON
NEWTON: int = kernel.NEWTON
BRENT: int = kernel.BRENT
"""Ways of landing."""
LANDINGS = ("henon", "newton", "brent", "bracket")
"""Their names, and that of bisection, which they fall back on."""
MODE, GUARD = record_dtype("mode"), record_dtype("guard")
"""A compiled mode, and a guard of it."""
TRANSITION, STEP = record_dtype("transition"), record_dtype("step")
"""A transition, behind which in memory stands the state, n doubles (:func:`transition_dtype`); a step that was taken,
behind it the states' Taylor coefficients (:func:`step_dtype`)."""
TRANSITION_PLACES, STEP_PLACES = TRANSITION.itemsize // 8, STEP.itemsize // 8
"""Their lengths in doubles."""
CHUNK: int = kernel.CHUNK
"""Transitions kept in one block of memory."""
RUN = record_dtype("run")
"""A run's scalars, the same for every system; the vectors stand behind them."""
STATE_PLACE: int = kernel.places_of(0, 0, 0, 0, 0).state
"""Where the state stands, followed by what rounding it lost, and by the state before the last jump."""


def mode_dtype(guards: int) -> np.dtype[Any]:
    """A mode with its guards, as one row of a table; ``guards``: of the largest mode."""
    return np.dtype([("mode", MODE), ("guards", GUARD, (guards,))])


def transition_dtype(states: int) -> np.dtype[Any]:
    """A transition with its state."""
    return _followed(TRANSITION, "state", (states,))


def step_dtype(states: int, order: int) -> np.dtype[Any]:
    """A step with the states' coefficients: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k."""
    return _followed(STEP, "coefficients", (states, order + 1))


def _followed(record: np.dtype[Any], name: str, shape: tuple[int, ...]) -> np.dtype[Any]:
    """A record and the doubles that stand behind it."""
    assert record.names is not None
    return np.dtype([*((field, record[field]) for field in record.names), (name, "f8", shape)], align=True)


@dataclass(frozen=True, eq=False)
class Workspace:
    """Memory of one run at a time."""

    block: NDArray[np.float64]
    """All of it."""
    run: Any
    """The same as the compiled loop takes it: a pointer."""
    state: NDArray[np.float64]
    """A view: the run's scalars and vectors."""
    memory: memoryview
    """The same as bytes."""
    band: NDArray[np.float64]
    """A view: coefficients of the last expansion, a row a state, then a guard."""
    transitions: NDArray[np.float64]
    """A view: transitions, shape (CHUNK, TRANSITION_PLACES + n), each :data:`TRANSITION` and a
    state, and behind it with contacts the words of the mode before and after. (An array of records is copied field by
    field: as long as half of a short run.)"""

    @classmethod
    def of(cls, *sizes: int) -> Workspace:
        """For systems of some sizes: states, guards of the largest mode, order, contacts that a mode is entries of (0
        where it is a row), and constants of such a mode.

        Parts of an unused one may be used at once: they are zero where the loop takes that for granted.
        """
        own = kernel.places_of(*sizes)
        block = np.zeros(own.size + kernel.ALIGNMENT)
        first = -(block.ctypes.data // 8) % kernel.ALIGNMENT
        block = block[first : first + own.size]
        return cls(
            block,
            ffi.cast("struct run *", doubles(block)),
            block[: own.end_of_state],
            block[: own.end_of_state].data.cast("B"),
            block[own.band : own.room].reshape(-1, own.width),
            block[own.records :].reshape(CHUNK, -1),
        )


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
    return int("".join(str(1 + entry) for entry in reversed(mode)), 4)


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
    """Different modes among some, shape (k, words), and the place of each among these."""
    rows = np.ascontiguousarray(words).view(f"V{8 * words.shape[1]}")[:, 0]
    different, places_among = np.unique(rows, return_inverse=True)
    return tuple(_entries(row.tobytes(), contacts) for row in different), places_among.astype(np.int64)


def _entries(four_each: bytes, contacts: int) -> Mode:
    return tuple(chain.from_iterable(map(_FOURS.__getitem__, four_each)))[:contacts]
