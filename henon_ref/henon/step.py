"""Steps without events, and the compensated sum that the state is."""

from __future__ import annotations

from henon_ref.henon.compensated_time import add_to_time, below_compensated_resolution, below_time_resolution, remaining
from henon_ref.henon.recorder import _record_step
from henon_ref.henon.records import mode_of
from henon_ref.henon.state import REMEMBERED_STEPS
from henon_ref.henon.step_size import _flat_step_size, infinite, step_size
from henon_ref.henon.step_validation import tail_unconverged
from henon_ref.jit.calls import call_closing, call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger, smaller

BLOWN_UP = 1e100
"""A state beyond this has blown up (no smaller bound is safe whatever the units)."""
CHECKED_GROWTH = 4.0
"""A step this many times longer than the last is checked at its end before it is accepted."""
SHORTEST_UNIT = 1e-280
"""No unit is shorter."""
OVERFLOW_REDUCTION = 1e-100
"""How much shorter unit becomes where even coefficients of low order are infinite."""
STALLED_STEPS = 1000
"""Steps in a row too short to move a double's time before the run counts as stalled."""
LOST_WEIGHT = 100
"""So many of them is one that does not even move what rounding has lost of the time, nor makes a state grow."""
CUT_WEIGHT = 200
"""And so many one that had to be cut short before a singularity, nor makes a state grow."""
SHARP_CUT, SHARP_CUT_WEIGHT = 0.125, 25
"""And so many one of which a guard's branch point may leave less than this part: forty in a row lead from any scale to
the rounding of a root's argument, where only noise is left to agree with."""


@inner()
def state_grows(c, n, theta):  # type: ignore[no-untyped-def]
    """True if some state grows by a hundredth at least on a step of theta units, as one does that blows up."""
    found = False
    for i in range(n):
        found = found or (abs(c[i, 1]) * theta > 0.01 * abs(c[i, 0]) and (c[i, 1] > 0.0) == (c[i, 0] > 0.0))
    return found


@inner(forceinline=True)
def add_to_state(n, x, x_low, change):  # type: ignore[no-untyped-def]
    """x += change as a compensated sum; False where the state has blown up."""
    bounded = True
    for i in range(n):
        step = change[i] + x_low[i]
        total = x[i] + step
        part = total - x[i]
        x_low[i] = (x[i] - (total - part)) + (step - part)
        x[i] = total
        bounded = bounded and abs(total) < BLOWN_UP
    return bounded


@inner()
def enter_mode(run, remembered, last_steps):  # type: ignore[no-untyped-def]
    """Begin a mode with its own last step, if the run has been in it.

    Which modes are remembered depends on the run alone, not on what others have had compiled.
    """
    place = 0
    while place < run.remembered and remembered[place] != run.mode:
        place += 1
    if place == run.remembered:
        if place < REMEMBERED_STEPS:
            remembered[place] = run.mode
            run.remembered += 1
        else:  # the last place is for all others
            place -= 1
    run.step_place, run.stepped_mode = place, run.mode
    if last_steps[place] > 0.0:
        run.unit = smaller(last_steps[place], run.longest_step)


@inner(forceinline=True)
def event_free_steps(run, x, x_low, known_zeros, layout, constants, c, change, alone, shrunk, stop_at):  # type: ignore[no-untyped-def]
    """Take steps on which no guard can reach zero; come back with the coefficients of one that needs a look.

    ``alone``: look at the very first one, as where a guard stands at zero or a branch point may come. ``shrunk``: the
    unit has been made shorter for what is to be seen, and does not grow again here. Returns the step proposed in it; 0
    where the budget of steps is used up, -1 where the step size fell to zero, -2 where the state blew up, -3 where the
    block of steps is full.
    """
    n, guards = run.states, mode_of(layout).guards
    expansion, closing = mode_of(layout).expansion, mode_of(layout).step_end
    zeros = 0
    for g in range(guards):
        if known_zeros[g] > zeros:
            zeros = known_zeros[g]
    alone = alone or zeros > 0 or mode_of(layout).slopes > 0
    while True:
        if run.steps >= stop_at:
            return 0.0
        left = remaining(run)
        unit = run.unit
        call_expand(expansion, run.time, run.time_low, unit, x, constants, c)
        run.expansions += 1
        theta = step_size(c, n + guards, run.order, run.tolerance)
        if infinite(c, n + guards, mode_of(layout).polynomial_degree):
            theta = 0.0
        if zeros > 2 and theta > 0.0:
            theta = _flat_step_size(c, n, guards, known_zeros, run.order, run.tolerance)
        if theta < 1e-6 or (theta > 1e6 and unit < left and not shrunk):
            # unit is far from the step: bring it there and expand again before anything is read off. Where it is
            # much too long even the step is not accepted: it shrinks by degrees, and does not grow again here.
            least = OVERFLOW_REDUCTION if theta == 0.0 and infinite(c, n + guards, 2) else 1e-4
            new = larger(unit * larger(theta, least), 1e-290) if theta < 1.0 else smaller(unit * theta, left)
            if unit <= SHORTEST_UNIT and new <= unit:
                return -1.0
            if new < 0.5 * unit or new > 2.0 * unit:
                shrunk = shrunk or new < unit
                run.unit = new
                continue
        if shrunk:
            theta = smaller(theta, 1e6)
            shrunk = False
        step = theta * unit
        if below_time_resolution(run, step):
            run.stalled += (
                LOST_WEIGHT if below_compensated_resolution(run, step) and not state_grows(c, n, theta) else 1
            )
        if run.stalled > STALLED_STEPS:
            return -1.0
        if alone or step >= left or theta > CHECKED_GROWTH or tail_unconverged(c, n + guards, run.order, theta):
            return theta
        call_closing(closing, theta, c, change)
        for g in range(guards):
            if not change[n + g] > 0.0:
                return theta
        if not add_to_state(n, x, x_low, change):
            return -2.0
        if not below_time_resolution(run, step):
            run.stalled = 0
        full = run.dense != 0 and _record_step(run, c, step, run.mode)
        add_to_time(run, step)
        run.steps += 1
        run.unit = smaller(step, 1e3 * unit)
        if full:
            return -3.0


@inner()
def refine_release(run, x, x_low, layout, constants, ahead, change, row, unit, theta):  # type: ignore[no-untyped-def]
    """Put the end of a slide on its guard to the last digit, whatever the tolerance of the step that led there.

    A tangent point is where the field's normal velocity vanishes: left a little beside it, the field would
    point back at the surface, and the slide would begin anew. Newton's steps on the expansion at the landing.
    """
    for _ in range(3):
        call_expand(mode_of(layout).expansion, run.time, run.time_low, unit, x, constants, ahead)
        run.expansions += 1
        off, slope = ahead[row, 0], ahead[row, 1]
        size = abs(off) + abs(slope) * theta
        if abs(off) <= 2.0 * EPS * size or not slope < 0.0:
            return
        shift = -off / slope
        if abs(shift) > 0.1 * theta or run.time + shift * unit > run.horizon:
            return
        call_closing(mode_of(layout).step_end, shift, ahead, change)
        add_to_state(run.states, x, x_low, change)
        add_to_time(run, shift * unit)
