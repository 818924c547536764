"""What a run leaves behind: transitions, samples, and the mode that is entered with them."""

from __future__ import annotations

from numba import boolean, float64, int64

from henon_ref.henon.compile_units import compile_unit
from henon_ref.henon.records import (
    CROSSING,
    RELEASED,
    STEP_PLACES,
    STICK,
    SURFACE,
    TRANSITION_PLACES,
    guard_of,
    mode_of,
    step_of,
    transition_of,
)
from henon_ref.henon.state import RUN_RECORD, since_of
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger
from henon_ref.jit.views import GRID, rest_of, row_at
from henon_ref.roots.double import value

MOST_AT_ONCE = 64
"""Events in a row, each closer to the last than the resolution of time, before they count as accumulating."""


@inner(forceinline=True)
def record_transition(run, x, records, kind, index, side, source, target, landing):  # type: ignore[no-untyped-def]
    """Write a transition down; ``side`` of the surface that it came from, 0 for a release.

    Notes whether the run is to end on that surface. Of one that has been below its rounding nothing is told.
    """
    if run.below_rounding != 0 and since_of(run, x)[index] <= run.time:
        return
    made, state = transition_of(records, run.transitions), rest_of(records[run.transitions], TRANSITION_PLACES)
    made.time, made.time_low = run.time, run.time_low
    made.kind, made.surface, made.landing = kind, index, landing
    made.from_mode, made.to_mode = source, target
    for i in range(run.states):
        state[i] = x[i]
    run.transitions += 1
    ends_here = run.stop_falling if side > 0 else run.stop_rising if side < 0 else 0
    if ends_here != 0 and ends_here >> index & 1:
        run.stopped = 1


@inner()
def events_accumulate(run):  # type: ignore[no-untyped-def]
    """Count events that time cannot tell apart; True once there are too many in a row."""
    gap = (run.time - run.event_time) + (run.time_low - run.event_time_low)
    run.events_at_once = run.events_at_once + 1 if gap <= 2.0 * EPS * abs(run.time) else 0
    run.event_time, run.event_time_low = run.time, run.time_low
    return run.events_at_once >= MOST_AT_ONCE


@inner()
def fill_samples(run, c, order, part, mode, samples):  # type: ignore[no-untyped-def]
    """Fill the samples that lie on the step just taken, up to ``part`` (in the unit): time, states, mode."""
    while run.next_sample < samples.shape[0]:
        k = run.next_sample
        at = ((samples[k, 0] - run.time) - run.time_low) / run.unit
        if at > part:
            return
        n = samples.shape[1] - 2
        for i in range(n):
            samples[k, 1 + i] = value(c[i], order, larger(at, 0.0))
        samples[k, 1 + n] = mode
        run.next_sample = k + 1


@inner()
def record_step(run, c, length, mode):  # type: ignore[no-untyped-def]
    """Write down the step that is about to be taken; True where there is no room for another one."""
    columns = run.order + 1
    row = rest_of(row_at(run.dense), run.dense_steps * (STEP_PLACES + run.states * columns))
    step, coefficients = step_of(row), rest_of(row, STEP_PLACES)
    step.time, step.time_low, step.length, step.unit, step.mode = run.time, run.time_low, length, run.unit, mode
    for i in range(run.states):
        for k in range(columns):
            coefficients[i * columns + k] = c[i, k]
    run.dense_steps += 1
    return run.dense_steps >= run.dense_capacity


_record_step = compile_unit(record_step, boolean, RUN_RECORD, GRID, float64, int64)


@inner()
def change_mode(run, x, records, known_zeros, target, layout, after, hits, signs):  # type: ignore[no-untyped-def]
    """Go over to a mode in which several surfaces may have changed; False where Python has to tell of it."""
    mode, landing = run.mode, run.landing
    changes = 0
    for i in range(signs.shape[1]):
        changes += 1 if signs[mode, i] != signs[target, i] else 0
    if changes == 0 or run.transitions + changes > run.transition_capacity:
        return False
    for i in range(signs.shape[1]):
        before, now = signs[mode, i], signs[target, i]
        if before != now:
            kind = STICK if now == 0 else RELEASED if before == 0 else CROSSING
            record_transition(run, x, records, kind, i, before, mode, target, landing)
    for g in range(mode_of(after).guards):
        known_zeros[g] = 0
        if guard_of(after, g).kind == SURFACE:  # left with a speed: the decision was a clear one
            surface = guard_of(after, g).index
            known_zeros[g] = 1 if signs[mode, surface] == 0 else 0
            for k in range(mode_of(layout).guards):
                if hits[k] == 1 and guard_of(layout, k).index == surface:
                    known_zeros[g] = 1
    run.mode = target
    return True


@inner(forceinline=True)
def set_known_zeros(known_zeros, layout, surface, zeros):  # type: ignore[no-untyped-def]
    """Known zeros of the guards at the start of a mode: those of the surface just left."""
    for g in range(mode_of(layout).guards):
        same = guard_of(layout, g).kind == SURFACE and guard_of(layout, g).index == surface
        known_zeros[g] = zeros if same else 0
