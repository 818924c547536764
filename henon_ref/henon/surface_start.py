"""The mode at a start that lies on one surface, from the normal velocities on both sides where these are clear."""

from __future__ import annotations

from henon_ref.henon.mode_selection import CLEAR_MARGIN
from henon_ref.henon.records import SURFACE, guard_of, mode_of
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner, njit
from henon_ref.jit.primitives import larger
from henon_ref.jit.views import row_of, rows_in

UNCLEAR = -1
"""In place of a row: Python has to decide, or the mode is not compiled."""


@inner()
def mode_on_surface(tables, numbers, row, surface, t, x, n, speeds):  # type: ignore[no-untyped-def]
    """Row of the mode that follows, and the zeros with which its surface is left (0: it slides).

    The one mode of three whose own field keeps it (Filippov 1988, Sec. 2.10): both normal velocities point at the
    surface, or both to one side. Where they point away from it both slips do, and Python says so.

    Parameters
    ----------
    tables, numbers : ndarray
        See :func:`henon_ref.henon.loop.advance`.
    row : int
        Of the mode below the surface, where its sign is -1.
    surface : int
    t, x, n
        The start, and the number of states.
    speeds : row of n + 2 G doubles
        Work space.
    """
    layout = rows_in(tables, row)
    for g in range(mode_of(layout).guards):
        guard = guard_of(layout, g)
        if guard.kind == SURFACE and guard.index == surface:
            call_expand(mode_of(layout).normal_velocities, t, 0.0, 1.0, x, rows_in(numbers, row)[1], speeds)
            below, above = speeds[n + 2 * g], speeds[n + 2 * g + 1]
            margin = CLEAR_MARGIN * larger(abs(below), abs(above))
            if below > margin and above < -margin:
                return guard.mode_stuck, 0
            if below > margin and above > margin:
                return guard.mode_across, 1
            if below < -margin and above < -margin:
                return row, 1
            return UNCLEAR, 0
    return UNCLEAR, 0


@njit()
def mode_at_start(tables, numbers, row, surface, t, x, speeds):  # type: ignore[no-untyped-def]
    """:func:`mode_on_surface` for Python; ``x`` and ``speeds`` are arrays."""
    return mode_on_surface(tables, numbers, row, surface, t, row_of(x), x.size, row_of(speeds))
