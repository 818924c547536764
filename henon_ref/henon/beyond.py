"""What lies beyond a flat root: whether the mode behind it leaves the surface for good, and with how many zeros."""

from __future__ import annotations

from henon_ref.henon.calls import call_expand
from henon_ref.henon.registers import (
    F_LOW,
    F_SIGMA,
    F_SIZE,
    F_STATE,
    F_TIME,
    G_INDEX,
    G_KIND,
    I_GUARDS,
    I_ORDER,
    I_RHS,
    I_STATES,
    I_WORK,
    REMEMBERED,
    SURFACE,
    T_EXPANSION,
    T_GUARDS,
)
from henon_ref.henon.views import rest_of
from henon_ref.henon.workspace import work_space
from henon_ref.jit import inner

HIGHEST = 8
"""Highest order with which a surface is left here."""
ZERO = 1e-15
"""Relative size below which a coefficient counts as zero at a root that was found with more digits."""
CLEAR = 1e-9
"""And above which it does not: what is between the two Python looks at."""
SHORTENED, TIMES = 0.125, 8
"""Where the terms do not fall, the unit of time is shortened so much, so often."""


@inner()
def zeros_beyond(floats, integers, target, layout, constants, surface):  # type: ignore[no-untyped-def]
    """With how many zeros a mode leaves a surface that the run stands on; 0 where it does not, or that is not clear.

    Its own field decides, by the first derivative that does not vanish: the surface has been reached with a speed of
    zero. No slide is possible where that leaves: of two fields that point the same way at a surface no mean is
    tangent to it (Filippov 1988, Sec. 4).
    """
    n, most = integers[I_STATES], integers[I_GUARDS]
    order = integers[I_ORDER]
    band = work_space(integers[I_WORK], n, most, order)[0]
    remembered = floats[F_SIZE + (target if target < REMEMBERED else REMEMBERED - 1)]
    sigma = remembered if remembered > 0.0 else floats[F_SIGMA]
    x = rest_of(floats, F_STATE)
    for g in range(layout[0, T_GUARDS]):
        if layout[1 + g, G_KIND] == SURFACE and layout[1 + g, G_INDEX] == surface:
            for _ in range(TIMES):
                call_expand(layout[0, T_EXPANSION], floats[F_TIME], floats[F_LOW], sigma, x, constants, band)
                integers[I_RHS] += 1
                if _falls(band[n + g], order):
                    return _leading(band[n + g], order)
                sigma *= SHORTENED
    return 0


@inner()
def _falls(series, order):  # type: ignore[no-untyped-def]
    """True if the last terms of a series do not count."""
    size = 0.0
    for k in range(1, order + 1):
        size += abs(series[k])
    return abs(series[order]) + abs(series[order - 1]) + abs(series[order - 2]) <= CLEAR * size


@inner()
def _leading(series, order):  # type: ignore[no-untyped-def]
    """Order of the first coefficient behind the constant one that is clearly not zero, and positive; else 0."""
    size = 0.0
    for k in range(1, order + 1):
        size += abs(series[k])
    for k in range(1, HIGHEST + 1):
        if abs(series[k]) > CLEAR * size:
            return k if series[k] > 0.0 else 0
        if not abs(series[k]) <= ZERO * size:
            return 0
    return 0
