"""A run's state, which the compiled loop and Python share: return codes, scalars with names, and places of vectors."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numba import from_dtype
from numba.extending import register_jitable

from henon_ref.henon.records import record_view
from henon_ref.jit.njit import inner
from henon_ref.jit.views import integers_in, rest_of


class ReturnCode(IntEnum):
    """Why the compiled loop returned. (It returns the value: making the member of it costs some percent of a run.)"""

    HORIZON = 0
    SELECT_MODE = 1
    BLOCK_FULL = 2
    DIVERGED = 3
    STALLED = 4
    BUDGET_SPENT = 5
    LEFT_DOMAIN = 6
    EVENTS_ACCUMULATE = 7
    UNDECIDED_EVENT = 8
    MODE_NOT_COMPILED = 9
    STEPS_FULL = 10
    STOPPED = 11


# Between its own parts: an event is to be gone through, or there is nothing to say.
EVENT, ON = 20, 21
REMEMBERED_STEPS = 64
"""Modes of which a run keeps the last step, the first that it comes to: one seen before begins with it."""
RUN = np.dtype(
    [
        ("time", "f8"), ("time_low", "f8"),  # s, and what rounding it lost
        ("unit", "f8"),  # s: unit of the expansion
        ("begin", "f8"),  # s: of the run
        ("rest_part", "f8"),  # of the run that later flights may last together where impacts have come to their limit
        ("event_time", "f8"), ("event_time_low", "f8"),  # s: last event
        ("suspect", "f8"),  # s: where an undecided event is, from the step's start
        ("step_length", "f8"),  # s: of an undecided step
        ("longest_step", "f8"),  # s: that a mode just entered, or one with branch points, may begin with
        ("horizon", "f8"), ("horizon_low", "f8"),  # s
        ("tolerance", "f8"),  # local error, relative to each row's size on the step
        ("mode", "i8"), ("steps", "i8"), ("expansions", "i8"), ("guard_evaluations", "i8"), ("transitions", "i8"),
        ("below_rounding", "i8"),  # surfaces, and expressions of the model's end, that have been below their rounding
        ("guard", "i8"), ("landing", "i8"),  # last guard hit, and its landing
        ("stalled", "i8"),  # steps that time cannot tell apart
        ("events_at_once", "i8"),  # events that it cannot tell apart
        ("next_sample", "i8"),
        ("stepped_mode", "i8"),  # mode of the last step, -1 before the first
        ("remembered", "i8"),  # modes of which the last step is kept
        ("step_place", "i8"),  # of the present one among them
        ("pending_kind", "i8"),  # of the event that leads to a mode without a row
        ("pending_mode", "i8"),  # number of that mode, after a reset
        ("event_pending", "i8"),  # 1 where the event that the run stands at is still to be gone through
        ("order", "i8"),
        ("method", "i8"),  # of landing
        ("transition_capacity", "i8"),  # of a block of memory
        ("states", "i8"), ("guards", "i8"),  # guards: of the largest mode
        ("stop_falling", "i8"), ("stop_rising", "i8"),  # surfaces, a bit each, on which the run ends
        ("stopped", "i8"),  # 1 once it has come to one
        ("more_digits", "i8"),  # 1 where multiprecision may go from the start to where the run is in its first mode
        ("most_steps", "i8"),  # after which the run is to end
        ("dense", "i8"), ("dense_steps", "i8"), ("dense_capacity", "i8"),  # address of steps (0: none), how many, room
    ],
    align=True,
)  # fmt: skip
"""A run's scalars, the same for every system; behind them in one block of doubles: the last step of modes [s], shape
(REMEMBERED_STEPS,); x, what rounding it lost, and x before the last jump, shape (n,) each; as integers known zeros of
each guard at the present point (the surface just left), which are divided out, 1 for one that is at zero, and 1 for
one that is below its own rounding on the present step, shape (G,) each; and since when one has been so [s], infinite
where it has not, shape (G,) by :func:`rounding_place`."""
RUN_RECORD = from_dtype(RUN)
"""Its type in compiled code."""
LAST_STEPS = RUN.itemsize // 8
"""Where, in doubles, the last steps stand in the block."""
STATE_PLACE = LAST_STEPS + REMEMBERED_STEPS
"""Where the state stands, followed by what rounding it lost, and by the state before the last jump."""


run_of = record_view(RUN)
"""(block) -> the scalars of a run at the begin of its block."""


@register_jitable
def state_places(n, most):  # type: ignore[no-untyped-def]
    """Length of a run's scalars and vectors, in doubles: of n states, and as many guards as the largest mode has."""
    return STATE_PLACE + 3 * n + 4 * most


@inner(forceinline=True)
def vectors_of(block, n, most):  # type: ignore[no-untyped-def]
    """Rows behind the scalars: last steps, x, what rounding it lost, known zeros, guards at zero, below rounding."""
    integers = integers_in(rest_of(block, STATE_PLACE + 3 * n))
    x = rest_of(block, STATE_PLACE)
    return rest_of(block, LAST_STEPS), x, rest_of(x, n), integers, rest_of(integers, most), rest_of(integers, 2 * most)


@inner(forceinline=True)
def since_of(run, x):  # type: ignore[no-untyped-def]
    """Row of the times since when guards have been below their rounding; ``x`` begins where the state stands."""
    return rest_of(x, 3 * run.states + 3 * run.guards)


@register_jitable
def rounding_place(valid, index, most):  # type: ignore[no-untyped-def]
    """Where in that row a surface stands, or an expression of the model's end (``valid``), of that index."""
    return most - 1 - index if valid else index


NOWHERE = -1
"""In place of the guard last hit: nothing was hit, a guard is at zero where a step begins."""
TANGENT = 1e-9
"""Relative normal velocity below which a contact is left to Python's mode selection."""
RUN_VIEW = np.dtype((np.record, RUN))
"""What Python sees the scalars as."""
