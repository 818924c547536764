"""Records that the compiled loop and Python share: of modes, guards and transitions, and the numbers in their fields.

Compiled code reads them through views of rows (:mod:`henon_ref.jit.views`): one machine code for every system.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import from_dtype
from numba.extending import intrinsic

from henon_ref.jit.views import begin_of, begin_of_row

# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, RELEASED, CROSSING, GRAZE, RESET = range(5)
# Surfaces whose event is not decided by two normal velocities alone: they act on each other, or reset the state.
COUPLED, RESETTING = 1, 2
# Ways of landing.
HENON, NEWTON, BRENT, BRACKET = range(4)
LANDINGS = ("henon", "newton", "brent", "bracket")

MODE = np.dtype(
    [
        ("guards", "i8"),  # how many there are
        ("expansion", "i8"), ("step_end", "i8"), ("normal_velocities", "i8"), ("bernstein", "i8"),  # addresses of code
        ("polynomial_degree", "i8"),  # of the motion, if that is a polynomial which the expansion holds whole; else 0
        ("slopes", "i8"),  # where the field has branch points, the code of its first coefficients alone; else 0
        ("guards_branch", "i8"),  # whether some guard has branch points
        ("number", "i8"),  # of the mode (henon_ref.filippov.modes.mode_number); 0 where no jump is compiled
        ("surfaces", "i8"),  # of the system
        ("jump", "i8"),  # address of what makes jumps; a mode's record is as long as a guard's
    ],
    align=True,
)  # fmt: skip
"""A compiled mode."""
GUARD = np.dtype(
    [
        ("kind", "i8"),
        ("index", "i8"),  # of the surface, or of the valid expression
        ("rising_only", "i8"),  # whether it may begin below zero, and counts once it has risen
        ("hold_zone", "i8"),  # whether the mode after it is decided by a hold zone
        ("coupled", "i8"),  # COUPLED where its surface and one that the mode slides on act on each other; RESETTING
        ("mode_across", "i8"), ("mode_stuck", "i8"),  # rows of the modes behind it, -1 where not compiled
        ("zeros_at_release", "i8"),  # with which its surface is left; 0: to be measured, or the guard is no release
        ("side", "i8"),  # of its surface on which the mode is, -1 or +1; 0 for guards that are no surface's
        ("branches", "i8"),  # whether it has branch points of its own
        ("jump", "i8"),  # address of the map of its surface, if that resets the state and it is compiled; else 0
    ],
    align=True,
)  # fmt: skip
"""A guard of a compiled mode. ``mode_across``: after a crossing, or a release."""
TRANSITION = np.dtype(
    [
        ("time", "f8"), ("time_low", "f8"),  # s, and what rounding it lost
        ("from_mode", "i4"), ("to_mode", "i4"),  # rows of the compiled modes
        ("surface", "i2"), ("kind", "i1"), ("landing", "i1"),
    ],
    align=True,
)  # fmt: skip
"""A transition; behind it in memory stands the state, n doubles (see :func:`transition_dtype`)."""
TRANSITION_PLACES = TRANSITION.itemsize // 8
"""Its length in doubles."""
RECORD_PLACES = MODE.itemsize // 8
"""Length of a mode's record in integers, which is that of a guard's."""
assert MODE.itemsize == GUARD.itemsize


STEP = np.dtype(
    [
        ("time", "f8"), ("time_low", "f8"),  # s: its start, and what rounding it lost
        ("length", "f8"),  # s: taken
        ("unit", "f8"),  # s: of the coefficients
        ("mode", "i8"),  # row of the compiled modes
    ],
    align=True,
)  # fmt: skip
"""A step that was taken; behind it in memory stand the states' Taylor coefficients (see :func:`step_dtype`)."""
STEP_PLACES = STEP.itemsize // 8
"""Its length in doubles."""


def mode_dtype(guards: int) -> np.dtype[Any]:
    """A mode with its guards, as one row of a table; ``guards``: of the largest mode."""
    return np.dtype([("mode", MODE), ("guards", GUARD, (guards,))])


def transition_dtype(states: int) -> np.dtype[Any]:
    """A transition with its state."""
    assert TRANSITION.names is not None
    fields = [(name, TRANSITION[name]) for name in TRANSITION.names]
    return np.dtype([*fields, ("state", "f8", (states,))], align=True)


def step_dtype(states: int, order: int) -> np.dtype[Any]:
    """A step with the states' coefficients: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k."""
    assert STEP.names is not None
    fields = [(name, STEP[name]) for name in STEP.names]
    return np.dtype([*fields, ("coefficients", "f8", (states, order + 1))], align=True)


def record_view(record: np.dtype[Any]) -> Any:
    """What sees, in compiled code, the begin of a row (or of rows) as a record.

    A record array as an argument would cost a call 120 ns.
    """
    kind = from_dtype(record)

    @intrinsic
    def view(typing, row):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            begin = begin_of(context, builder, row, arguments[0])
            return builder.bitcast(begin, context.get_value_type(kind))

        return kind(row), codegen

    return view


def record_in_rows(record: np.dtype[Any], first: int) -> Any:
    """The same for one of several rows, of which those before ``first`` are something else."""
    kind = from_dtype(record)

    @intrinsic
    def view(typing, rows, place):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            rows, place = arguments
            begin = begin_of_row(builder, rows, builder.add(place, place.type(first)))
            return builder.bitcast(begin, context.get_value_type(kind))

        return kind(rows, place), codegen

    return view


step_of = record_view(STEP)
"""(row) -> the step that begins there."""
mode_of = record_view(MODE)
"""(layout) -> the mode whose table that is."""
guard_of = record_in_rows(GUARD, 1)
"""(layout, g) -> its guard g."""
transition_of = record_in_rows(TRANSITION, 0)
"""(records, k) -> transition k."""
