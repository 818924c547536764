"""Codes, and places in the arrays, that the compiled loop and Python share."""

from __future__ import annotations

# Why the loop came back.
(
    HORIZON,
    RESOLVE,
    FULL,
    DIVERGED,
    STALLED,
    PAUSE,
    INVALID,
    ACCUMULATED,
    DOUBTFUL,
    UNKNOWN,
) = range(10)
# Between its own parts: an event is to be gone through, or there is nothing to say.
EVENT, ON = 10, 11
# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, FREE, CROSS, GRAZE = range(4)
# Ways of landing.
HENON, NEWTON, BRENT, BRACKET = range(4)
LANDINGS = ("henon", "newton", "brent", "bracket")
# Floats of a run: t and what rounding it lost, sigma, time of the last event and what it lost; where on the step an
# undecided event is, and the step's end, both counted from its start; the longest step that a mode just entered, or one
# with branch points, may begin with; horizon and what rounding it lost; tolerance.
(
    F_TIME,
    F_LOW,
    F_SIGMA,
    F_LAST,
    F_LAST_LOW,
    F_NEAR,
    F_REACH,
    F_CAP,
    F_UNTIL,
    F_UNTIL_LOW,
    F_TOLERANCE,
    F_SIZE,
) = range(12)
REMEMBERED = 64
"""Modes of which the last step is kept, in the floats behind those above: a mode seen before begins with it."""
F_STATE = F_SIZE + REMEMBERED
"""Where the state stands, followed by what rounding it lost."""
# Integers of a run: mode; counts; last guard hit and its landing; steps that time cannot tell apart, events that it
# cannot tell apart; next sample; mode of the last step; kind of the event that leads to a mode not known yet; order;
# method of landing; transitions that a block of memory holds; address of the work space; states, and guards of the
# largest mode.
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
    I_ORDER,
    I_METHOD,
    I_BLOCK,
    I_WORK,
    I_STATES,
    I_GUARDS,
    I_SIZE,
) = range(19)
# Behind them, an integer a guard each: known zeros at the present point (the surface just left), which are divided
# out; 1 for a guard that is at zero.

# A mode's table: its own row, then a row a guard. T_EXACT: degree of the motion where that is a polynomial which the
# expansion holds whole, else 0. T_WARY: where the field has branch points, the code of its first coefficients alone,
# else 0.
T_GUARDS, T_EXPANSION, T_CLOSING, T_PROBE, T_BERNSTEIN, T_EXACT, T_WARY, T_SIZE = range(8)
# Kind, index, whether only its rise counts, whether it has a hold zone, whether it acts on a sliding surface; row of
# the mode after a crossing (or a release) and after a stick, -1 where not known yet. For a release the last is the
# number of zeros that the surface is left with.
G_KIND, G_INDEX, G_RISING, G_HOLD, G_ACTS, G_AFTER, G_STUCK = range(7)
# A transition.
R_TIME, R_LOW, R_KIND, R_SURFACE, R_FROM, R_TO, R_LANDING, R_STATE = range(8)

NOWHERE = -1
"""In place of the guard last hit: nothing was hit, a guard is at zero where a step begins."""
"""Distance from 1 to the next double."""
TANGENT = 1e-9
"""Relative normal velocity below which a contact is left to Python's mode selection."""
