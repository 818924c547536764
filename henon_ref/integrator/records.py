"""Data that the compiled loop and Python share (``henon_ref/kernel/kernel.h``).

The module defines the records and their constants, and the memory block of a run with views of its parts (``struct
places`` gives their offsets). It also converts modes of many contacts. Such a mode is not a row of a table but a number
in base 4: digit i, from the last, is 1 plus the entry of contact i. In memory it occupies several words
(``kernel/contacts.c``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain, product
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.library import doubles, ffi, kernel, record_dtype
from henon_ref.modes.mode import Mode

LANDINGS = ("henon", "newton", "brent", "bracket")
"""Names of the landing methods, then of bisection, their fallback."""
TRANSITION, STEP = record_dtype("transition"), record_dtype("step")
"""Record of a transition, followed in memory by the state (:func:`transition_dtype`); record of a step, followed by the
states' Taylor coefficients (:func:`step_dtype`)."""
TRANSITION_PLACES, STEP_PLACES = TRANSITION.itemsize // 8, STEP.itemsize // 8
"""Lengths of these records in doubles."""
CHUNK: int = kernel.CHUNK
"""Number of transitions in one block of memory."""
STATE_PLACE: int = kernel.places_of(0, 0, 0, 0, 0).state
"""Offset of the state; its rounding errors and the state before the last jump follow."""
_MODE_PLACE: int = ffi.offsetof("struct run", "mode")
"""Offset of the mode and the counts that follow it, in bytes."""


def mode_dtype(guards: int) -> np.dtype[Any]:
    """Row of a mode table: a mode and its guards (``guards`` of the largest mode)."""
    return np.dtype([("mode", record_dtype("mode")), ("guards", record_dtype("guard"), (guards,))])


def transition_dtype(states: int) -> np.dtype[Any]:
    """Transition and its state."""
    return _followed(TRANSITION, "state", (states,))


def step_dtype(states: int, order: int) -> np.dtype[Any]:
    """Step and its coefficients: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k."""
    return _followed(STEP, "coefficients", (states, order + 1))


def _followed(record: np.dtype[Any], name: str, shape: tuple[int, ...]) -> np.dtype[Any]:
    """Record followed by doubles."""
    assert record.names is not None
    return np.dtype([*((field, record[field]) for field in record.names), (name, "f8", shape)], align=True)


@dataclass(frozen=True, eq=False)
class Workspace:
    """Memory of one run; reusable by a later run."""

    block: NDArray[np.float64]
    """Entire memory."""
    run: Any
    """Pointer to it, as ``struct run *``."""
    state: NDArray[np.float64]
    """View: scalars and vectors of the run."""
    memory: memoryview
    """Memoryview of ``state``."""
    band: NDArray[np.float64]
    """View: coefficients of the last expansion, one row per state, then per guard."""
    start_room: Any
    """Room of ``start_run`` of ``kernel/start.c``, of doubles."""
    entries: NDArray[np.int64]
    """View: words of the mode's entries, if modes are numbers."""
    since: NDArray[np.float64]
    """View: first time at which each guard was below its rounding error [s] (``rounding_place`` of the kernel)."""
    unpack: Callable[[memoryview], tuple[Any, ...]]
    """Reads time, mode, steps, expansions, guard evaluations, transitions, guards below rounding, the state, and then
    the words of the mode's entries as bytes from ``memory``, in the time in which NumPy reads one of them."""
    transitions: NDArray[np.float64]
    """View: transitions, shape (CHUNK, TRANSITION_PLACES + n). Each row is a :data:`TRANSITION` and a state; with
    contacts, the words of the modes before and after follow. (Rows of doubles are copied much faster than records.)"""

    @classmethod
    def of(cls, sizes: tuple[int, ...], start_room: int) -> Workspace:
        """Allocate a workspace for ``sizes``: states, largest number of guards, order, contacts (0 if a mode is a row),
        and constants of a mode of contacts. The memory is zero, as the loop requires.
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
            ffi.new("double[]", start_room),
            block[own.entries : own.since].view(np.int64),
            block[own.since : own.end_of_state],
            Struct(
                f"d{_MODE_PLACE - 8}x6q{8 * STATE_PLACE - _MODE_PLACE - 48}x{sizes[0]}d"
                f"{8 * (own.entries - STATE_PLACE - sizes[0])}x{8 * (own.since - own.entries)}s"
            ).unpack_from,
            block[own.records :].reshape(CHUNK, -1),
        )


_FOURS = [tuple(digit - 1 for digit in reversed(four)) for four in product(range(4), repeat=4)]
"""The four entries in each byte."""


def words_of(contacts: int) -> int:
    """Number of words of a mode; 0 if a mode is a row."""
    return int(kernel.words_of(contacts))


def packed(mode: Mode) -> int:
    """Return a mode as a number.

    >>> packed((1, 0, -1)), unpacked(packed((1, 0, -1)), 3)
    (6, (1, 0, -1))
    """
    return int("".join(str(1 + entry) for entry in reversed(mode)), 4)


def unpacked(number: int, contacts: int) -> Mode:
    """Return the mode of a number."""
    return _entries(number.to_bytes(8 * words_of(contacts), "little"), contacts)


def written(number: int, contacts: int) -> NDArray[np.int64]:
    """Return the words of a number, shape (words,)."""
    return np.frombuffer(number.to_bytes(8 * words_of(contacts), "little"), dtype="<i8")


def read(words: bytes) -> int:
    """Return the number in the given words."""
    return int.from_bytes(words, "little")


def numbered(words: NDArray[np.int64], contacts: int) -> tuple[tuple[Mode, ...], NDArray[np.int64]]:
    """Return the distinct modes in ``words``, shape (k, number of words), and the index of each row among them."""
    rows = np.ascontiguousarray(words).view(f"V{8 * words.shape[1]}")[:, 0]
    different, places_among = np.unique(rows, return_inverse=True)
    return tuple(_entries(row.tobytes(), contacts) for row in different), places_among.astype(np.int64)


def _entries(four_each: bytes, contacts: int) -> Mode:
    return tuple(chain.from_iterable(map(_FOURS.__getitem__, four_each)))[:contacts]
