"""What a run leaves behind: transitions, samples, and the mode that is entered with them."""

from __future__ import annotations

from henon_ref.henon.registers import (
    CROSS,
    F_LAST,
    F_LAST_LOW,
    F_LOW,
    F_SIGMA,
    F_TIME,
    FREE,
    G_INDEX,
    G_KIND,
    I_BLOCK,
    I_COUNT,
    I_CROWDED,
    I_LANDING,
    I_MODE,
    I_SAMPLE,
    I_STATES,
    R_FROM,
    R_KIND,
    R_LANDING,
    R_LOW,
    R_STATE,
    R_SURFACE,
    R_TIME,
    R_TO,
    STICK,
    SURFACE,
    T_GUARDS,
)
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger
from henon_ref.roots.double import value

CROWD = 64
"""Events in a row, each closer to the last than the resolution of time, before they count as accumulating."""


@inner(forceinline=True)
def record(floats, integers, x, records, kind, index, source, target, landing):  # type: ignore[no-untyped-def]
    """Write a transition down."""
    row = records[integers[I_COUNT]]
    row[R_TIME], row[R_LOW] = floats[F_TIME], floats[F_LOW]
    row[R_KIND], row[R_SURFACE], row[R_FROM], row[R_TO], row[R_LANDING] = kind, index, source, target, landing
    for i in range(integers[I_STATES]):
        row[R_STATE + i] = x[i]
    integers[I_COUNT] += 1


@inner()
def crowded(floats, integers):  # type: ignore[no-untyped-def]
    """Count events that time cannot tell apart; True once there are too many in a row."""
    gap = (floats[F_TIME] - floats[F_LAST]) + (floats[F_LOW] - floats[F_LAST_LOW])
    integers[I_CROWDED] = integers[I_CROWDED] + 1 if gap <= 2.0 * EPS * abs(floats[F_TIME]) else 0
    floats[F_LAST], floats[F_LAST_LOW] = floats[F_TIME], floats[F_LOW]
    return integers[I_CROWDED] >= CROWD


@inner()
def sample(floats, integers, c, order, part, mode, samples):  # type: ignore[no-untyped-def]
    """Fill the samples that lie on the step just taken, up to ``part`` (in units of sigma): time, states, mode."""
    while integers[I_SAMPLE] < samples.shape[0]:
        k = integers[I_SAMPLE]
        at = ((samples[k, 0] - floats[F_TIME]) - floats[F_LOW]) / floats[F_SIGMA]
        if at > part:
            return
        n = samples.shape[1] - 2
        for i in range(n):
            samples[k, 1 + i] = value(c[i], order, larger(at, 0.0))
        samples[k, 1 + n] = mode
        integers[I_SAMPLE] = k + 1


@inner()
def settle(floats, integers, x, records, multiplicity, target, layout, after, hits, signs):  # type: ignore[no-untyped-def]
    """Go over to a mode in which several surfaces may have changed; False where Python has to tell of it."""
    mode, landing = integers[I_MODE], integers[I_LANDING]
    changes = 0
    for i in range(signs.shape[1]):
        changes += 1 if signs[mode, i] != signs[target, i] else 0
    if changes == 0 or integers[I_COUNT] + changes > integers[I_BLOCK]:
        return False
    for i in range(signs.shape[1]):
        before, now = signs[mode, i], signs[target, i]
        if before != now:
            kind = STICK if now == 0 else FREE if before == 0 else CROSS
            record(floats, integers, x, records, kind, i, mode, target, landing)
    for g in range(after[0, T_GUARDS]):
        multiplicity[g] = 0
        if after[1 + g, G_KIND] == SURFACE:  # left with a speed: the decision was a clear one
            surface = after[1 + g, G_INDEX]
            multiplicity[g] = 1 if signs[mode, surface] == 0 else 0
            for k in range(layout[0, T_GUARDS]):
                if hits[k] == 1 and layout[1 + k, G_INDEX] == surface:
                    multiplicity[g] = 1
    integers[I_MODE] = target
    return True


@inner(forceinline=True)
def start(multiplicity, layout, surface, zeros):  # type: ignore[no-untyped-def]
    """Known zeros of the guards at the start of a mode: those of the surface just left."""
    for g in range(layout[0, T_GUARDS]):
        same = layout[1 + g, G_KIND] == SURFACE and layout[1 + g, G_INDEX] == surface
        multiplicity[g] = zeros if same else 0
