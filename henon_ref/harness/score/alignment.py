"""The alignment of two keyed sequences with the fewest edits, ties broken by time.

A banded Needleman-Wunsch recursion, one row a reference transition, vectorised along the row. Only pairs
whose times agree within a bound are allowed, so that a row needs no more than the run's transitions near it:
memory is ``BAND`` bytes a row, whatever the run did.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BAND = 128
"""Transitions of the run, the nearest in time, that one reference transition may be paired with."""
TIE = 1e-7
"""Weight of a full time bound against one edit; below 1 / (number of transitions), so that edits come first."""

_UP, _LEFT, _DIAGONAL = 0, 1, 2


def align(
    ref_keys: NDArray[np.int64],
    ref_times: NDArray[np.float64],
    run_keys: NDArray[np.int64],
    run_times: NDArray[np.float64],
    bound: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Pairs of an alignment with the fewest edits, and the least sum of time differences among those.

    Parameters
    ----------
    ref_keys : ndarray, shape (m, 2)
        Integer keys; the second is an alternative, -1 where there is none.
    ref_times : ndarray, shape (m,)
        Non-decreasing times [s].
    run_keys : ndarray, shape (n, 2)
    run_times : ndarray, shape (n,)
        Times [s]; one that is not finite is never paired.
    bound : ndarray, shape (m,)
        Largest time difference of a pair [s].

    Returns
    -------
    ndarray, shape (k, 2)
        Indices (reference, run), both increasing.
    """
    m, n = len(ref_times), len(run_times)
    if not m or not n:
        return np.zeros((0, 2), dtype=np.intp)
    if m == n and bool(np.all(_allowed(ref_keys, ref_times, run_keys, run_times, bound))):
        return np.repeat(np.arange(m)[:, None], 2, axis=1)
    low, high = _windows(ref_times, run_times, bound)
    choice = _fill(ref_keys, ref_times, run_keys, run_times, bound, low, high)
    return _trace(choice, low, high)


def _allowed(
    ref_keys: NDArray[np.int64],
    ref_times: NDArray[np.float64],
    run_keys: NDArray[np.int64],
    run_times: NDArray[np.float64],
    bound: NDArray[np.float64] | float,
) -> NDArray[np.bool_]:
    """Whether pairs (broadcast over the leading axes) have the same key and agree in time."""
    same = (ref_keys[..., 0] == run_keys[..., 0]) | (ref_keys[..., 1] == run_keys[..., 1])
    return same & (np.abs(ref_times - run_times) <= bound)


def _windows(
    ref_times: NDArray[np.float64], run_times: NDArray[np.float64], bound: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Half-open ranges of the run's transitions that each reference transition may be paired with."""
    ordered = np.maximum.accumulate(np.where(np.isfinite(run_times), run_times, -np.inf))
    reach = float(bound.max())
    low = np.searchsorted(ordered, ref_times - reach, side="left")
    high = np.searchsorted(ordered, ref_times + reach, side="right")
    centre = np.searchsorted(ordered, ref_times, side="left")
    low = np.maximum(low, centre - BAND // 2)
    high = np.minimum(high, centre + BAND // 2)
    return np.maximum.accumulate(low), np.maximum.accumulate(np.maximum(high, low))


def _fill(
    ref_keys: NDArray[np.int64],
    ref_times: NDArray[np.float64],
    run_keys: NDArray[np.int64],
    run_times: NDArray[np.float64],
    bound: NDArray[np.float64],
    low: NDArray[np.intp],
    high: NDArray[np.intp],
) -> list[NDArray[np.int8]]:
    """Where each cell's best alignment comes from.

    ``before[k]`` is the best value of the rows above with the run's first ``low - 1 + k`` transitions used.
    """
    choice: list[NDArray[np.int8]] = []
    edge_low, before = int(low[0]), np.zeros(1)
    for i in range(len(ref_times)):
        start, stop = int(low[i]), int(high[i])
        # The row above, on this row's columns: constant past its end, cut off before this row's start.
        above = before[start - edge_low :]
        if above.size == 0:
            above = before[-1:]
        above = above[: stop - start + 1]
        if above.size < stop - start + 1:
            above = np.concatenate([above, np.full(stop - start + 1 - above.size, before[-1])])
        allowed = _allowed(ref_keys[i], ref_times[i], run_keys[start:stop], run_times[start:stop], bound[i])
        slip = np.abs(ref_times[i] - run_times[start:stop])
        gain = np.where(allowed, 1.0 - TIE * slip / max(bound[i], np.finfo(float).tiny), -np.inf)
        diagonal = above[:-1] + gain
        best = np.maximum(above[1:], diagonal)
        row = np.maximum.accumulate(np.concatenate([above[:1], best]))
        choice.append(np.where(row[1:] > best, _LEFT, np.where(diagonal > above[1:], _DIAGONAL, _UP)).astype(np.int8))
        edge_low, before = start, row
    return choice


def _trace(choice: list[NDArray[np.int8]], low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.intp]:
    """Walk back from the last cell along the choices made."""
    pairs: list[tuple[int, int]] = []
    i, j = len(choice) - 1, int(high[-1])
    while i >= 0:
        j = min(j, int(high[i]))
        start = int(low[i])
        if j <= start:
            i -= 1
            continue
        taken = choice[i][j - 1 - start]
        if taken == _DIAGONAL:
            pairs.append((i, j - 1))
            i, j = i - 1, j - 1
        elif taken == _LEFT:
            j -= 1
        else:
            i -= 1
    return np.array(pairs[::-1], dtype=np.intp).reshape(-1, 2)
