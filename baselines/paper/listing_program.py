"""The program in the paper's appendix as it is printed, mistakes and all: ``listing.c``, called from Python.

What it does, step by step and mistake by mistake, stands there, at the lines that do it;
:mod:`henon_ref.baselines.paper.listing_variants` has each mistake as a switch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.paper.compiled import ffi, lib, rows

SINE, COSINE_1, COSINE_2 = math.sin(math.pi / 18), math.cos(math.pi / 9), math.cos(2 * math.pi / 9)
WIDTH = 2 * math.sqrt(3) / 3
EDGES = np.array([WIDTH * v for v in (COSINE_1, COSINE_2, SINE, -SINE, -COSINE_2, -COSINE_1)])
"""Tangent points z of Eq. (24), highest first: the stick zones are [1, 0], [3, 2] and [5, 4]."""


class End(NamedTuple):
    """How a run of the listing ended."""

    changes: int
    """Changes of mode."""
    mode: int
    slips: int
    """Steps in slip."""
    landings: int


def run_listing(
    x: NDArray[np.float64],
    h: float,
    steps: int,
    numbers: tuple[float, ...],
    changes: NDArray[np.float64],
    path: NDArray[np.float64],
) -> End:
    """The main loop: ``steps + 1`` passes.

    Parameters
    ----------
    x : ndarray, shape (3,)
        Time, position and velocity, which are moved.
    h, steps
        Length of a step [s] and their number.
    numbers : tuple of float
        m, k1, k2, mu0, vp, A, w.
    changes : ndarray, shape (k, 5)
        Takes a row (step, time, position, velocity, mode) a change of mode, as long as there is room.
    path : ndarray, shape (l, 3)
        Takes a row (time, position, velocity) a pass, as long as there is room.
    """
    end = lib.listing_run(
        rows(x, "struct belt_state"), rows(EDGES), h, steps + 1, ffi.new("struct belt *", numbers),
        rows(changes, "struct mode_change"), len(changes), rows(path, "struct belt_state"), len(path),
    )  # fmt: skip
    return End(end.changes, end.mode, end.slips, end.landings)


def effective_changes(rows: NDArray[np.float64], start: int) -> NDArray[np.float64]:
    """Changes of mode with the releases to a side that was never entered put right.

    Such a release is undone by the very next step, which lands again and turns to the other side: one
    release, at its own time, to that side.

    Parameters
    ----------
    rows : ndarray, shape (k, 5)
        Step, time, position, velocity and mode after each change.
    start : int
        Mode before the first.

    Returns
    -------
    ndarray, shape (at most k, 5)
    """
    modes = rows[:, 4]
    released = np.concatenate(([start], modes[:-1])) == 0
    undone = np.flatnonzero(released[:-1] & (np.diff(rows[:, 0]) == 1) & (modes[1:] != 0))
    kept = rows.copy()
    kept[undone, 4] = modes[undone + 1]
    return np.delete(kept, undone + 1, axis=0)
