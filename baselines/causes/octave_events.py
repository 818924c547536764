"""Octave's ``ode45`` and its events, by the program ``programs/octave_events.m``."""

from __future__ import annotations

import math
from functools import cache, partial

from henon_ref.baselines.causes.base import PROGRAMS, Printed, cause, holds, printed
from henon_ref.baselines.octave.solver import OPTIONS, PROGRAM

shows = partial(cause, "octave")


@cache
def seen() -> Printed:
    """What the program prints."""
    return printed([PROGRAM, *OPTIONS, str(PROGRAMS / "octave_events.m")])


@shows("octave-line", "An event lies on the straight line between the ends of a step")
def straight_line() -> str:
    """`ode45` interpolates the event function, and the state, linearly between the two ends of the step that passed the
    event. The error of its time is the square of the step, whatever the tolerances.

    x'' = -x from (1, 0) falls through zero at pi/2; a ball thrown up from its surface is back at 2.
    """
    errors = [abs(time - math.pi / 2) for _, time in seen()["line"]]
    tolerances = [tolerance for tolerance, _ in seen()["line"]]
    ((ball,),) = seen()["ball"]
    holds(all(error > 10 * tol for error, tol in zip(errors, tolerances, strict=True)), f"errors {errors}")
    holds(abs(ball - 2) > 1e-4, f"the ball is back at {ball}")
    words = ", ".join(f"{error:.1e} s" for error in errors)
    return f"pi/2 is missed by {words} at 1e-6, 1e-9, 1e-12; a ball thrown up at 1e-9 is back at {ball:.6f}, not 2"


@shows("octave-pair", "Octave: two roots in one step cancel")
def pair_in_one_step() -> str:
    """Signs are compared at the two ends of a step. An even number of roots in between leaves no trace.

    x' = 1 through x^2 = d^2/4.
    """
    count, end = seen()["pair"][0]
    holds(count == 0 and end == 2, f"{count} events, the run ends at {end}")
    return "roots at t = 0.95 and 1.05 are not reported; the run ends at 2"


@shows("octave-first-step", "An event in the first step does not stop the run")
def first_step() -> str:
    """What is meant for a start on an event surface holds for the whole first step. The adapter makes that one short.

    x' = -1 from 0.001, first step 0.1.
    """
    end, x = seen()["first"][0]
    holds(end == 2 and x < -1.9, f"the run ends at {end} with x = {x}")
    return f"x falls through zero in the first step, at t = 0.001; the run goes on to t = {end:g}, x = {x:.3f}"


@shows("octave-listed", "Of several events in one step the first in the list counts")
def first_in_the_list() -> str:
    """It is not the earliest one that stops the run, but the one with the lowest index.

    Two surfaces in one step: x = 0 is reached first, and listed second.
    """
    number, time = seen()["several"][0]
    holds(number == 1, f"event {number:g} at {time}")
    return f"of x + 0.01 and x, which falls first at t = 1, it stops for the first in the list, at t = {time:.3f}"


@shows("octave-blow-up", "A blow-up is a step that is too small")
def blow_up() -> str:
    """`ode45` has no word for divergence: it warns and returns where its step is too small.

    x' = x^2 from 1 ends at t = 1.
    """
    end, x = seen()["pole"][0]
    holds(end < 2 and x < 1e100, f"it ends at {end} with x = {x}")
    return f"x' = x² ends at t = {end:.9f} with x = {x:.1e}, by a step that is too small"


@shows("octave-nan", "An event function without a value is no event")
def no_number() -> str:
    """The sign of NaN is NaN, and equal to no direction: a run goes on beyond the end of its event function.

    An event function that is NaN from x = 1 on.
    """
    count, end = seen()["nan"][0]
    holds(count == 0 and end == 2, f"{count:g} events, the run ends at {end}")
    return f"an event function that is NaN from x = 1 on is passed over; the run ends at {end:g} as if nothing were"


@shows("octave-nan-state", "A step to a state without a value is accepted")
def state_without_value() -> str:
    """The error of such a step is NaN, and not greater than its bound: `ode45` goes on to the horizon with a state that
    is no number. The adapter ends the run at the last state that is one, a step in front of the end.

    y' = sqrt(1 - t) from 0, which is no number from t = 1 on.
    """
    finite, end, y = seen()["lost"][0]
    holds(finite < 1 and end == 2 and math.isnan(y), f"finite up to {finite}, the run ends at {end} with y = {y}")
    return (
        f"y' = sqrt(1 - t) is NaN from t = 1 on; the state is so from the step on that begins at {finite:.4f}, and "
        f"the run ends at {end:g} as if nothing were"
    )
