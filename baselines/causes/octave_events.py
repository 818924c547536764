"""Octave's ``ode45`` and its events, by the program ``programs/octave_events.m``."""

from __future__ import annotations

import math
import subprocess
from functools import cache
from importlib.resources import as_file, files

from henon_ref.baselines.causes.base import Cause, ClaimError, holds
from henon_ref.baselines.octave.solver import OPTIONS, PROGRAM

SECONDS = 300.0
"""Wall time of the program [s]."""


@cache
def seen() -> dict[str, list[list[float]]]:
    """What the program prints: name -> the numbers of each of its lines."""
    with as_file(files("henon_ref.baselines.causes.programs").joinpath("octave_events.m")) as path:
        try:
            done = subprocess.run(
                [PROGRAM, *OPTIONS, str(path)], capture_output=True, text=True, timeout=SECONDS, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ClaimError(f"{PROGRAM}: {error}") from error
    found: dict[str, list[list[float]]] = {}
    for name, *numbers in (line.split() for line in done.stdout.splitlines() if line.strip()):
        found.setdefault(name, []).append([float(number) for number in numbers])
    return found


def straight_line() -> str:
    """x'' = -x from (1, 0) falls through zero at pi/2; a ball thrown up from its surface is back at 2."""
    errors = [abs(time - math.pi / 2) for _, time in seen()["line"]]
    tolerances = [tolerance for tolerance, _ in seen()["line"]]
    (ball,) = seen()["ball"][0]
    holds(all(error > 10 * tol for error, tol in zip(errors, tolerances, strict=True)), f"errors {errors}")
    holds(abs(ball - 2) > 1e-4, f"the ball is back at {ball}")
    words = ", ".join(f"{error:.1e} s" for error in errors)
    return f"pi/2 is missed by {words} at 1e-6, 1e-9, 1e-12; a ball thrown up at 1e-9 is back at {ball:.6f}, not 2"


def pair_in_one_step() -> str:
    """x' = 1 through x^2 = d^2/4."""
    count, end = seen()["pair"][0]
    holds(count == 0 and end == 2, f"{count} events, the run ends at {end}")
    return "roots at t = 0.95 and 1.05 are not reported; the run ends at 2"


def first_step() -> str:
    """x' = -1 from 0.001, first step 0.1."""
    end, x = seen()["first"][0]
    holds(end == 2 and x < -1.9, f"the run ends at {end} with x = {x}")
    return f"x falls through zero in the first step, at t = 0.001; the run goes on to t = {end:g}, x = {x:.3f}"


def first_in_the_list() -> str:
    """Two surfaces in one step: x = 0 is reached first, and listed second."""
    number, time = seen()["several"][0]
    holds(number == 1, f"event {number:g} at {time}")
    return f"of x + 0.01 and x, which falls first at t = 1, it stops for the first in the list, at t = {time:.3f}"


def blow_up() -> str:
    """x' = x^2 from 1 ends at t = 1."""
    end, x = seen()["pole"][0]
    holds(end < 2 and x < 1e100, f"it ends at {end} with x = {x}")
    return f"x' = x² ends at t = {end:.9f} with x = {x:.1e}, by a step that is too small"


def no_number() -> str:
    """An event function that is NaN from x = 1 on."""
    count, end = seen()["nan"][0]
    holds(count == 0 and end == 2, f"{count:g} events, the run ends at {end}")
    return f"an event function that is NaN from x = 1 on is passed over; the run ends at {end:g} as if nothing were"


def state_without_value() -> str:
    """y' = sqrt(1 - t) from 0, which is no number from t = 1 on."""
    finite, end, y = seen()["lost"][0]
    holds(finite < 1 and end == 2 and math.isnan(y), f"finite up to {finite}, the run ends at {end} with y = {y}")
    return (
        f"y' = sqrt(1 - t) is NaN from t = 1 on; the state is so from the step on that begins at {finite:.4f}, and "
        + (f"the run ends at {end:g} as if nothing were")
    )


OCTAVE = (
    Cause(
        "octave-line",
        "octave",
        "An event lies on the straight line between the ends of a step",
        "`ode45` interpolates the event function, and the state, linearly between the two ends of the step that passed "
        "the event. The error of its time is the square of the step, whatever the tolerances.",
        straight_line,
    ),
    Cause(
        "octave-pair",
        "octave",
        "Octave: two roots in one step cancel",
        "Signs are compared at the two ends of a step. An even number of roots in between leaves no trace.",
        pair_in_one_step,
    ),
    Cause(
        "octave-first-step",
        "octave",
        "An event in the first step does not stop the run",
        "What is meant for a start on an event surface holds for the whole first step. The adapter makes that one "
        "short.",
        first_step,
    ),
    Cause(
        "octave-listed",
        "octave",
        "Of several events in one step the first in the list counts",
        "It is not the earliest one that stops the run, but the one with the lowest index.",
        first_in_the_list,
    ),
    Cause(
        "octave-blow-up",
        "octave",
        "A blow-up is a step that is too small",
        "`ode45` has no word for divergence: it warns and returns where its step is too small.",
        blow_up,
    ),
    Cause(
        "octave-nan",
        "octave",
        "An event function without a value is no event",
        "The sign of NaN is NaN, and equal to no direction: a run goes on beyond the end of its event function.",
        no_number,
    ),
    Cause(
        "octave-nan-state",
        "octave",
        "A step to a state without a value is accepted",
        "The error of such a step is NaN, and not greater than its bound: `ode45` goes on to the horizon with a state "
        "that is no number. The adapter ends the run at the last state that is one, a step in front of the end.",
        state_without_value,
    ),
)
