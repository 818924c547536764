"""The time of a run: a double and what rounding has lost of it."""

from __future__ import annotations

from henon_ref.henon.registers import F_LOW, F_TIME, F_UNTIL, F_UNTIL_LOW
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS


@inner(forceinline=True)
def add_time(floats, step):  # type: ignore[no-untyped-def]
    """t += step as a compensated sum (Neumaier), so that late times lose no digits of a duration."""
    t = floats[F_TIME]
    total = t + step
    part = total - t
    lost = (t - (total - part)) + (step - part)
    low = floats[F_LOW] + lost
    floats[F_TIME] = total + low
    floats[F_LOW] = low - (floats[F_TIME] - total)


@inner(forceinline=True)
def stands(floats, step):  # type: ignore[no-untyped-def]
    """Whether a step is too short to move a double's time."""
    return step <= 0.25 * EPS * abs(floats[F_TIME])


@inner(forceinline=True)
def lost(floats, step):  # type: ignore[no-untyped-def]
    """Whether it is too short even for what rounding has lost of the time."""
    return step <= 0.25 * EPS * EPS * abs(floats[F_TIME])


@inner(forceinline=True)
def remaining(floats):  # type: ignore[no-untyped-def]
    """Time left up to the horizon."""
    return (floats[F_UNTIL] - floats[F_TIME]) + (floats[F_UNTIL_LOW] - floats[F_LOW])
