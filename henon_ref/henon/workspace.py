"""The memory that the compiled loop works on, and its parts."""

from __future__ import annotations

from numba.extending import register_jitable

from henon_ref.henon.registers import R_STATE
from henon_ref.jit.ir_writer import row_length
from henon_ref.jit.njit import inner
from henon_ref.jit.views import rest_of, row_at, rows_of
from henon_ref.roots.double import DEPTH

BANDS = 6 + 2 * DEPTH
"""Rows of the work space that root isolation needs."""


@register_jitable
def work_places(n, most, order):  # type: ignore[no-untyped-def]
    """Of what the loop works on: length of a row of the band, and where the other two parts begin."""
    width = row_length(order)
    room = (2 * (n + most + 1) + BANDS) * width
    return width, room, room + 3 * (n + most)


@inner()
def work_space(address, n, most, order):  # type: ignore[no-untyped-def]
    """Parts of what the loop works on.

    Parameters
    ----------
    address : int
        Where it is in memory.
    n, most, order : int
        States; guards of the largest mode, G; order.

    Returns
    -------
    band : rows, shape (2 (n + G + 1) + BANDS, row length)
        Taylor coefficients of states and guards in units of sigma, then the norms of the last ones; the same at the
        end of a step that is checked; what isolating roots needs.
    room : row of 3 n + 3 G doubles
        Change of the states over a step and bounds of the guards from below; a state; normal velocities.
    records : rows, shape (transitions kept, R_STATE + n)
        Transitions, a row each.
    """
    width, room, records = work_places(n, most, order)
    work = row_at(address)
    own = rows_of(rest_of(work, records), R_STATE + n)
    return rows_of(work, width), rest_of(work, room), own
