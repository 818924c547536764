"""The time of a run: a double and what rounding has lost of it."""

from __future__ import annotations

from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS


@inner(forceinline=True)
def add_to_time(run, step):  # type: ignore[no-untyped-def]
    """t += step as a compensated sum (Neumaier), so that late times lose no digits of a duration."""
    t = run.time
    total = t + step
    part = total - t
    lost = (t - (total - part)) + (step - part)
    low = run.time_low + lost
    run.time = total + low
    run.time_low = low - (run.time - total)


@inner(forceinline=True)
def below_time_resolution(run, step):  # type: ignore[no-untyped-def]
    """Whether a step is too short to move a double's time."""
    return step <= 0.25 * EPS * abs(run.time)


@inner(forceinline=True)
def below_compensated_resolution(run, step):  # type: ignore[no-untyped-def]
    """Whether it is too short even for what rounding has lost of the time."""
    return step <= 0.25 * EPS * EPS * abs(run.time)


@inner(forceinline=True)
def remaining(run):  # type: ignore[no-untyped-def]
    """Time left up to the horizon."""
    return (run.horizon - run.time) + (run.horizon_low - run.time_low)
