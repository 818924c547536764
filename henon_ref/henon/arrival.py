"""Where a closer look has led a run: the step is left behind, at a root, or at guards that touch zero."""

from __future__ import annotations

from henon_ref.henon.clock import remaining
from henon_ref.henon.registers import (
    F_LOW,
    F_TIME,
    F_UNTIL,
    F_UNTIL_LOW,
    G_HOLD,
    G_KIND,
    I_ARRIVED,
    I_GUARD,
    I_GUARDS,
    I_SIZE,
    I_STEPS,
    LANDED,
    SURFACE,
    T_GUARDS,
    TOLD,
    VALID,
)
from henon_ref.henon.views import rest_of
from henon_ref.henon.window import ACROSS, MISS, PASSED, ROOT, STEEP, TOUCH
from henon_ref.jit import njit


@njit()
def arrive(floats, integers, outcome):  # type: ignore[no-untyped-def]
    """Leave the step behind, the run being where the closer look has led it."""
    guard, most = integers[I_GUARD], integers[I_GUARDS]
    integers[I_STEPS] += 1
    for g in range(most):
        integers[I_SIZE + g] = 0
    if remaining(floats) < -2e-17 * abs(floats[F_UNTIL]):  # behind the horizon, by more than a sum's rounding
        floats[F_TIME], floats[F_LOW] = floats[F_UNTIL], floats[F_UNTIL_LOW]
    elif outcome == MISS:
        integers[I_SIZE + guard] = 2
    elif outcome != PASSED:
        integers[I_SIZE + most + guard] = 1
        integers[I_ARRIVED] = TOLD if outcome == ACROSS else LANDED if outcome == STEEP else 0


@njit()
def settle_touch(floats, integers, layout):  # type: ignore[no-untyped-def]
    """Leave the step behind where guards touch zero; TOUCH if surfaces are left again, to be told of: those hit.

    Where the guards hit stand, there are the orders of the touches, less than 0 for a guard that is next to zero only.
    A hold zone holds what only touches its surface, and a model ends where it only just does: that is a ROOT.
    """
    count, most, guard = layout[0, T_GUARDS], integers[I_GUARDS], integers[I_GUARD]
    orders = rest_of(integers, I_SIZE + most)
    if not _ends(layout, orders, guard):
        for g in range(count):
            if _ends(layout, orders, g):
                guard = g
    if _ends(layout, orders, guard):
        for g in range(count):
            orders[g] = 0
        integers[I_GUARD] = guard
        arrive(floats, integers, ROOT)
        return ROOT
    arrive(floats, integers, MISS)
    outcome, reached = MISS, integers[I_SIZE + guard] > 0
    for g in range(count):
        order = orders[g]
        orders[g] = 0
        if reached and order != 0:
            integers[I_SIZE + g] = abs(order)
            if order > 0 and layout[1 + g, G_KIND] == SURFACE:
                orders[g] = 1
                outcome = TOUCH
    return outcome


@njit()
def _ends(layout, orders, guard):  # type: ignore[no-untyped-def]
    """True if a guard's mode ends where it does no more than touch zero, and it does."""
    own = layout[1 + guard]
    return orders[guard] > 0 and (own[G_KIND] == VALID or (own[G_KIND] == SURFACE and own[G_HOLD] == 1))
