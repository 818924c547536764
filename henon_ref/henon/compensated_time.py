"""The time of a run: a double and what rounding has lost of it."""

from __future__ import annotations

from henon_ref.henon.state import (
    F_HORIZON,
    F_HORIZON_LOW,
    F_TIME,
    F_TIME_LOW,
)
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS


@inner(forceinline=True)
def add_to_time(floats, step):  # type: ignore[no-untyped-def]
    """t += step as a compensated sum (Neumaier), so that late times lose no digits of a duration."""
    t = floats[F_TIME]
    total = t + step
    part = total - t
    lost = (t - (total - part)) + (step - part)
    low = floats[F_TIME_LOW] + lost
    floats[F_TIME] = total + low
    floats[F_TIME_LOW] = low - (floats[F_TIME] - total)


@inner(forceinline=True)
def below_time_resolution(floats, step):  # type: ignore[no-untyped-def]
    """Whether a step is too short to move a double's time."""
    return step <= 0.25 * EPS * abs(floats[F_TIME])


@inner(forceinline=True)
def below_compensated_resolution(floats, step):  # type: ignore[no-untyped-def]
    """Whether it is too short even for what rounding has lost of the time."""
    return step <= 0.25 * EPS * EPS * abs(floats[F_TIME])


@inner(forceinline=True)
def remaining(floats):  # type: ignore[no-untyped-def]
    """Time left up to the horizon."""
    return (floats[F_HORIZON] - floats[F_TIME]) + (floats[F_HORIZON_LOW] - floats[F_TIME_LOW])
