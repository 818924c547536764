"""What a run leaves behind: transitions, samples, and the mode that is entered with them."""

from __future__ import annotations

from henon_ref.henon.state import (
    CROSSING,
    F_EVENT_TIME,
    F_EVENT_TIME_LOW,
    F_TIME,
    F_TIME_LOW,
    F_UNIT,
    G_INDEX,
    G_KIND,
    I_EVENTS_AT_ONCE,
    I_LANDING,
    I_MODE,
    I_NEXT_SAMPLE,
    I_STATES,
    I_TRANSITION_CAPACITY,
    I_TRANSITIONS,
    R_FROM,
    R_KIND,
    R_LANDING,
    R_STATE,
    R_SURFACE,
    R_TIME,
    R_TIME_LOW,
    R_TO,
    RELEASED,
    STICK,
    SURFACE,
    T_GUARDS,
)
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger
from henon_ref.roots.double import value

MOST_AT_ONCE = 64
"""Events in a row, each closer to the last than the resolution of time, before they count as accumulating."""


@inner(forceinline=True)
def record_transition(floats, integers, x, records, kind, index, source, target, landing):  # type: ignore[no-untyped-def]
    """Write a transition down."""
    row = records[integers[I_TRANSITIONS]]
    row[R_TIME], row[R_TIME_LOW] = floats[F_TIME], floats[F_TIME_LOW]
    row[R_KIND], row[R_SURFACE], row[R_FROM], row[R_TO], row[R_LANDING] = kind, index, source, target, landing
    for i in range(integers[I_STATES]):
        row[R_STATE + i] = x[i]
    integers[I_TRANSITIONS] += 1


@inner()
def events_accumulate(floats, integers):  # type: ignore[no-untyped-def]
    """Count events that time cannot tell apart; True once there are too many in a row."""
    gap = (floats[F_TIME] - floats[F_EVENT_TIME]) + (floats[F_TIME_LOW] - floats[F_EVENT_TIME_LOW])
    integers[I_EVENTS_AT_ONCE] = integers[I_EVENTS_AT_ONCE] + 1 if gap <= 2.0 * EPS * abs(floats[F_TIME]) else 0
    floats[F_EVENT_TIME], floats[F_EVENT_TIME_LOW] = floats[F_TIME], floats[F_TIME_LOW]
    return integers[I_EVENTS_AT_ONCE] >= MOST_AT_ONCE


@inner()
def fill_samples(floats, integers, c, order, part, mode, samples):  # type: ignore[no-untyped-def]
    """Fill the samples that lie on the step just taken, up to ``part`` (in units of unit): time, states, mode."""
    while integers[I_NEXT_SAMPLE] < samples.shape[0]:
        k = integers[I_NEXT_SAMPLE]
        at = ((samples[k, 0] - floats[F_TIME]) - floats[F_TIME_LOW]) / floats[F_UNIT]
        if at > part:
            return
        n = samples.shape[1] - 2
        for i in range(n):
            samples[k, 1 + i] = value(c[i], order, larger(at, 0.0))
        samples[k, 1 + n] = mode
        integers[I_NEXT_SAMPLE] = k + 1


@inner()
def change_mode(floats, integers, x, records, known_zeros, target, layout, after, hits, signs):  # type: ignore[no-untyped-def]
    """Go over to a mode in which several surfaces may have changed; False where Python has to tell of it."""
    mode, landing = integers[I_MODE], integers[I_LANDING]
    changes = 0
    for i in range(signs.shape[1]):
        changes += 1 if signs[mode, i] != signs[target, i] else 0
    if changes == 0 or integers[I_TRANSITIONS] + changes > integers[I_TRANSITION_CAPACITY]:
        return False
    for i in range(signs.shape[1]):
        before, now = signs[mode, i], signs[target, i]
        if before != now:
            kind = STICK if now == 0 else RELEASED if before == 0 else CROSSING
            record_transition(floats, integers, x, records, kind, i, mode, target, landing)
    for g in range(after[0, T_GUARDS]):
        known_zeros[g] = 0
        if after[1 + g, G_KIND] == SURFACE:  # left with a speed: the decision was a clear one
            surface = after[1 + g, G_INDEX]
            known_zeros[g] = 1 if signs[mode, surface] == 0 else 0
            for k in range(layout[0, T_GUARDS]):
                if hits[k] == 1 and layout[1 + k, G_INDEX] == surface:
                    known_zeros[g] = 1
    integers[I_MODE] = target
    return True


@inner(forceinline=True)
def set_known_zeros(known_zeros, layout, surface, zeros):  # type: ignore[no-untyped-def]
    """Known zeros of the guards at the start of a mode: those of the surface just left."""
    for g in range(layout[0, T_GUARDS]):
        same = layout[1 + g, G_KIND] == SURFACE and layout[1 + g, G_INDEX] == surface
        known_zeros[g] = zeros if same else 0
