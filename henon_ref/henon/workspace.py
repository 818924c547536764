"""The array that the compiled loop works on, and its parts."""

from __future__ import annotations

from numba.extending import register_jitable

from henon_ref.henon.polynomial import DEPTH
from henon_ref.henon.primitives import doubles_at, rows_of
from henon_ref.henon.registers import F_STATE, I_SIZE, R_STATE
from henon_ref.henon.rows import row_length
from henon_ref.jit import inner

BANDS = 6 + 2 * DEPTH
"""Rows of the work space that root isolation needs."""


@register_jitable
def work_places(n, most, order, block):  # type: ignore[no-untyped-def]
    """Of an array that the loop works on: length of a row of the band, where its other parts begin, and its length."""
    width = row_length(order)
    room = (2 * (n + most + 1) + BANDS) * width
    before = room + 3 * (n + most)
    records = before + F_STATE + 2 * n + I_SIZE + 2 * most
    return width, room, before, records, records + block * (R_STATE + n)


@inner()
def work_space(address, n, most, order, block):  # type: ignore[no-untyped-def]
    """Parts of an array that the loop works on.

    Parameters
    ----------
    address : int
        Where it is in memory; it is as long as :func:`work_places` says.
    n, most, order, block : int
        States; guards of the largest mode, G; order; transitions kept.

    Returns
    -------
    band : ndarray, shape (2 (n + G + 1) + BANDS, row length)
        Taylor coefficients of states and guards in units of sigma, then the norms of the last ones; the same at the
        end of a step that is checked; what isolating roots needs.
    room : ndarray, shape (3 n + 3 G,)
        Change of the states over a step and bounds of the guards from below; a state; normal velocities.
    before : ndarray, shape (F_STATE + 2 n + I_SIZE + 2 G,)
        The run as it was when the loop was called.
    records : ndarray, shape (block, R_STATE + n)
        Transitions, a row each.
    """
    width, room, before, records, end = work_places(n, most, order, block)
    work = doubles_at(address, 1, end)[0]
    band = rows_of(work, 0, 2 * (n + most + 1) + BANDS, width)
    return band, work[room:before], work[before:records], rows_of(work, records, block, R_STATE + n)
