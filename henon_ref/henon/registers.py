"""Codes, and places in the arrays, that the compiled loop and Python share."""

from __future__ import annotations

# Why the loop came back.
HORIZON, RESOLVE, FULL, DIVERGED, STALLED, PAUSE, INVALID, ACCUMULATED, DOUBTFUL, UNKNOWN = range(10)
# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, FREE, CROSS = 0, 1, 2
# Floats kept between calls: t and what rounding it lost, sigma, time of the last event and what it lost;
# where on the step a doubtful event is, and the step's end, both counted from its start; the largest sigma
# that a mode just entered may begin with.
F_TIME, F_LOW, F_SIGMA, F_LAST, F_LAST_LOW, F_NEAR, F_REACH, F_CAP, F_SIZE = range(9)
REMEMBERED = 64
"""Modes of which the last step is kept, in the floats behind those above: a mode seen before begins with it."""
# Integers kept between calls: mode; counts; last guard hit and its landing; steps that time cannot tell apart,
# events that it cannot tell apart; next sample; mode of the last step; kind of the event that leads to a mode
# not known yet.
(
    I_MODE,
    I_STEPS,
    I_RHS,
    I_EVENTS,
    I_COUNT,
    I_GUARD,
    I_LANDING,
    I_STALLED,
    I_CROWDED,
    I_SAMPLE,
    I_STEPPED,
    I_WHAT,
    I_SIZE,
) = range(13)

NOWHERE = -1
"""In place of the guard last hit: nothing was hit, a guard is at zero where a step begins."""
EPS = 2.220446049250313e-16
"""Distance from 1 to the next double."""
TANGENT = 1e-9
"""Relative normal velocity below which a contact is left to Python's closer look."""
