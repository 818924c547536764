"""Guards that lie below their own rounding: such a one decides nothing.

What rounding leaves of a state moves a guard, directly and through the motion: each state is moved by some units in its
last place, and the guard's series on the step looked at again. A root is decided where the guard falls, over as long as
a step is, by more than that, or is clearly below zero at the step's end. Else it is passed over on this step, and from
there on nothing is told of its surface (:func:`henon_ref.henon.recorder.record_transition`). The run goes on: where the
guard is clearly below zero later, the mode changes there.
"""

from __future__ import annotations

from numba import boolean, float64, int64

from henon_ref.henon.compile_units import compile_unit
from henon_ref.henon.records import VALID, guard_of, mode_of
from henon_ref.henon.state import RUN_RECORD, rounding_place, since_of
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger, smaller
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE
from henon_ref.roots.double import value

STATE_ROUNDING = 16.0 * EPS
"""Part of its size by which a state may be off: eight units in its last place."""
CLEAR_PART = 1e-4
"""A guard that falls by this part of the largest state is beyond rounding: on a step no motion makes 1e10 of it."""


@inner()
def guard_noise(run, x, layout, constants, c, ahead, point, row, theta):  # type: ignore[no-untyped-def]
    """What rounding of the states may make of a row on a step of ``theta`` units.

    ``ahead``, ``point``: work space of an expansion, and of a state. (Expansions for it are no part of the motion: they
    are not counted.)
    """
    noise = 0.0
    for i in range(run.states):
        point[i] = x[i]
    for i in range(run.states):
        if x[i] != 0.0:
            point[i] = x[i] + STATE_ROUNDING * x[i]
            call_expand(mode_of(layout).expansion, run.time, run.time_low, run.unit, point, constants, ahead)
            point[i] = x[i]
            power = 1.0
            for k in range(run.order + 1):
                noise += abs(ahead[row, k] - c[row, k]) * power
                power *= theta
    return noise


@inner()
def passed_over(run, x, layout, guard, part):  # type: ignore[no-untyped-def]
    """Note that a guard is below its rounding, ``part`` units behind the step's begin."""
    place = rounding_place(guard_of(layout, guard).kind == VALID, guard_of(layout, guard).index, run.guards)
    since, time = since_of(run, x), run.time + part * run.unit
    if not since[place] <= time:
        since[place] = time
        run.below_rounding += 1


@inner()
def known_below_rounding(run, x, layout, guard):  # type: ignore[no-untyped-def]
    """Whether a guard has been below its rounding before."""
    place = rounding_place(guard_of(layout, guard).kind == VALID, guard_of(layout, guard).index, run.guards)
    return since_of(run, x)[place] <= run.time


@inner()
def root_below_rounding(run, x, layout, constants, c, ahead, point, guard, tau, natural, flat):  # type: ignore[no-untyped-def]
    """Whether the root of a guard at ``tau`` is rounding's; noted then.

    ``natural``: length of the step that nothing has cut short, in the unit. ``flat``: the root may be none; it is left
    to multiprecision, the first time.
    """
    if flat:
        if run.below_rounding == 0 or not known_below_rounding(run, x, layout, guard):
            return False
        passed_over(run, x, layout, guard, tau)
        return True
    row, largest, slope = run.states + guard, 0.0, 0.0
    for i in range(run.states):
        largest = larger(largest, abs(x[i]))
    for k in range(run.order, 0, -1):
        slope = slope * tau + k * c[row, k]
    theta = _length(run, layout, natural)
    fall = larger(abs(slope) * theta, -value(c[row], run.order, theta))
    if fall >= CLEAR_PART * largest:
        return False
    if fall > guard_noise(run, x, layout, constants, c, ahead, point, row, theta):
        return False
    passed_over(run, x, layout, guard, tau)
    return True


@inner()
def fails_beyond_rounding(run, x, layout, constants, c, ahead, point, hits, faint, natural):  # type: ignore[no-untyped-def]
    """Of guards that are below zero where a step begins (``hits``), whether one falls further by more than rounding.

    Those that do not are no hits any more, and ``faint``.
    """
    found, theta = False, _length(run, layout, natural)
    for g in range(mode_of(layout).guards):
        if hits[g] == 1:
            row = run.states + g
            noise = guard_noise(run, x, layout, constants, c, ahead, point, row, theta)
            if noise > 0.0 and -value(c[row], run.order, theta) <= noise:
                hits[g], faint[g] = 0, 1
                passed_over(run, x, layout, g, 0.0)
            else:
                found = True
    return found


@inner()
def _length(run, layout, natural):  # type: ignore[no-untyped-def]
    """Length, in the unit, over which a guard is looked at: no coefficient limits that of a polynomial motion."""
    left = ((run.horizon - run.time) + (run.horizon_low - run.time_low)) / run.unit
    return smaller(natural, left) if mode_of(layout).polynomial_degree > 0 else natural


_given = RUN_RECORD, DOUBLES, TABLE, DOUBLES, GRID, GRID, DOUBLES
_root_below_rounding = compile_unit(root_below_rounding, boolean, *_given, int64, float64, float64, boolean)
_fails_beyond_rounding = compile_unit(fails_beyond_rounding, boolean, *_given, INTEGERS, INTEGERS, float64)
