"""Causes of libraries that are not called from Python: CVODE from C, Octave's ``ode45``, Siconos (``programs/``)."""

from __future__ import annotations

import math
import os
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.baselines.causes.base import PROGRAMS, ClaimError, Printed, cause, holds, printed
from henon_ref.baselines.programs.cvode_c import LIBRARIES, tools
from henon_ref.baselines.programs.interpreted import ENVIRONMENT, OCTAVE, siconos_python
from henon_ref.errors import UnavailableError

from_c, octave = partial(cause, "sundials"), partial(cause, "octave")
siconos = partial(cause, "siconos", docs="https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/")


@cache
def printed_from_c() -> Printed:
    """Return the output of ``cvode_events.c``: flag, time, state and steps of each run."""
    try:
        compiler, include = tools()
    except UnavailableError as error:
        raise ClaimError(str(error)) from error
    with TemporaryDirectory() as folder:
        libraries = [f"-L{include.parent / 'lib'}", *(f"-l{name}" for name in LIBRARIES)]
        source, program = PROGRAMS / "cvode_events.c", str(Path(folder) / "program")
        printed([compiler, "-O2", f"-I{include}", str(source), "-o", program, *libraries])
        return printed([program])


@cache
def printed_by_octave() -> Printed:
    return printed([*OCTAVE, str(PROGRAMS / "octave_events.m")])


@cache
def printed_by_siconos() -> Printed:
    return printed([siconos_python(), str(PROGRAMS / "siconos_step.py")], os.environ | ENVIRONMENT)


@from_c("cvode-c-pair", "CVODE from C: two roots in one step cancel", "https://github.com/llnl/sundials/issues/881")
def pair_in_one_step() -> str:
    """Rootfinding compares signs at the two ends of an internal step. An even number of roots in between leaves no
    trace. It is the library's, not its binding's.

    x' = 1 through x^2 = d^2/4.
    """
    for method in ("adams", "bdf"):
        flag, end, _, steps = printed_from_c()[f"pair-{method}"][0]
        holds(flag == 0 and end == 2 and steps < 100, f"{method}: flag {flag:g} at t = {end}")
    flag, end, x, steps = printed_from_c()["turn-adams"][0]
    holds(flag == 0 and end == 2 and x > 0, f"x' = t - 1: flag {flag:g} at t = {end}, x = {x}")
    return (
        "roots at t = 0.95 and 1.05 are reported neither by Adams nor by BDF; the run ends at 2. Of x' = t - 1 from "
        f"3/8, zero at 1/2 and 3/2, Adams takes {steps:g} steps to t = 2 and reports no root"
    )


@from_c(
    "cvode-c-error",
    "CVODE from C: a tolerance bounds the error of a step, not that of the run",
    "https://sundials.readthedocs.io/en/latest/cvode/Mathematics_link.html",
)
def error_of_a_run() -> str:
    """Errors of the steps add up to several tolerances. Where the surface is further off than the tolerance and not
    than that, CVODE's own solution crosses it and comes back, and both roots are reported.

    x' = 4 (t - 1)^3 from 1 + 1e-8 never comes below 1e-8; tolerances 1e-6.
    """
    flag, root, x, _ = printed_from_c()["flat-bdf"][0]
    _, _, least, _ = printed_from_c()["flat-end"][0]
    holds(flag == 2 and abs(x) < 1e-15 and 0.9 < root < 1, f"flag {flag:g} at t = {root}, x = {x}")
    holds(least < -2e-6, f"x = {least} at t = 1")
    return f"x = (t - 1)⁴ + 1e-8 has no root; at 1e-6 BDF has x = {least:.1e} at t = 1, and a root at {root:.4f}"


@from_c("cvode-c-late-end", "The end of a field is found late by the root of the tolerance")
def end_of_a_field() -> str:
    """Where a field has no value any more CVODE makes its steps shorter until it gives up. What the tolerance leaves in
    a level that runs out like (2 - t)² is its root in the time, and more after a restart at order 1.

    h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2.
    """
    ends = {}
    for which in ("loose", "tight"):
        flag, ends[which], level, _ = printed_from_c()[f"tank-{which}"][0]
        holds(flag < 0 and ends[which] > 2, f"{which}: flag {flag:g} at t = {ends[which]}, h = {level}")
    holds(ends["loose"] - 2 > 1e-4 > ends["tight"] - 2, f"{ends}")
    return f"h' = -sqrt(h) ends at t = {ends['loose']:.4f} at 1e-6, at {ends['tight']:.6f} at 1e-12, not at 2"


@from_c("cvode-c-infinite-jacobian", "With an infinite Jacobian every step is accepted")
def infinite_jacobian() -> str:
    """Newton's matrix is infinite then, its correction zero, and the iteration has converged: the state stays where it
    is, whatever its rate, and the steps grow. The adapter refuses such a Jacobian, as it does a field without a
    value.

    h' = -1/4 - sqrt(h) from 1/4: nothing is left at t = 1 - log(3)/2, where the Jacobian is infinite.
    """
    flag, end, level, steps = printed_from_c()["pump-infinite"][0]
    holds(flag >= 0 and end == 4 and level == 0, f"flag {flag:g} at t = {end}, h = {level}")
    refused, gave_up, _, _ = printed_from_c()["pump-refused"][0]
    holds(refused < 0 and gave_up < 1, f"refused: flag {refused:g} at t = {gave_up}")
    return (
        f"h' = -1/4 - sqrt(h), which would be negative from t = {gave_up:.4f} on, stays at 0 to t = {end:g} in "
        f"{steps:g} steps; where the Jacobian is refused CVODE gives up at {gave_up:.4f}"
    )


@octave("octave-line", "An event lies on the straight line between the ends of a step")
def straight_line() -> str:
    """`ode45` interpolates the event function, and the state, linearly between the two ends of the step that passed the
    event. The error of its time is the square of the step, whatever the tolerances.

    x'' = -x from (1, 0) falls through zero at pi/2; a ball thrown up from its surface is back at 2.
    """
    errors = [abs(time - math.pi / 2) for _, time in printed_by_octave()["line"]]
    tolerances = [tolerance for tolerance, _ in printed_by_octave()["line"]]
    ((ball,),) = printed_by_octave()["ball"]
    holds(all(error > 10 * tol for error, tol in zip(errors, tolerances, strict=True)), f"errors {errors}")
    holds(abs(ball - 2) > 1e-4, f"the ball is back at {ball}")
    words = ", ".join(f"{error:.1e} s" for error in errors)
    return f"pi/2 is missed by {words} at 1e-6, 1e-9, 1e-12; a ball thrown up at 1e-9 is back at {ball:.6f}, not 2"


@octave("octave-pair", "Octave: two roots in one step cancel")
def octave_pair_in_one_step() -> str:
    """Signs are compared at the two ends of a step. An even number of roots in between leaves no trace.

    x' = 1 through x^2 = d^2/4.
    """
    count, end = printed_by_octave()["pair"][0]
    holds(count == 0 and end == 2, f"{count} events, the run ends at {end}")
    return "roots at t = 0.95 and 1.05 are not reported; the run ends at 2"


@octave("octave-first-step", "An event in the first step does not stop the run")
def first_step() -> str:
    """What is meant for a start on an event surface holds for the whole first step. The adapter makes that one short.

    x' = -1 from 0.001, first step 0.1.
    """
    end, x = printed_by_octave()["first"][0]
    holds(end == 2 and x < -1.9, f"the run ends at {end} with x = {x}")
    return f"x falls through zero in the first step, at t = 0.001; the run goes on to t = {end:g}, x = {x:.3f}"


@octave("octave-listed", "Of several events in one step the first in the list counts")
def octave_first_in_the_list() -> str:
    """It is not the earliest one that stops the run, but the one with the lowest index.

    Two surfaces in one step: x = 0 is reached first, and listed second.
    """
    number, time = printed_by_octave()["several"][0]
    holds(number == 1, f"event {number:g} at {time}")
    return f"of x + 0.01 and x, which falls first at t = 1, it stops for the first in the list, at t = {time:.3f}"


@octave("octave-blow-up", "A blow-up is a step that is too small")
def blow_up() -> str:
    """`ode45` has no word for divergence: it warns and returns where its step is too small.

    x' = x^2 from 1 ends at t = 1.
    """
    end, x = printed_by_octave()["pole"][0]
    holds(end < 2 and x < 1e100, f"it ends at {end} with x = {x}")
    return f"x' = x² ends at t = {end:.9f} with x = {x:.1e}, by a step that is too small"


@octave("octave-nan", "An event function without a value is no event")
def no_number() -> str:
    """The sign of NaN is NaN, and equal to no direction: a run goes on beyond the end of its event function.

    An event function that is NaN from x = 1 on.
    """
    count, end = printed_by_octave()["nan"][0]
    holds(count == 0 and end == 2, f"{count:g} events, the run ends at {end}")
    return f"an event function that is NaN from x = 1 on is passed over; the run ends at {end:g} as if nothing were"


@octave("octave-nan-state", "A step to a state without a value is accepted")
def state_without_value() -> str:
    """The error of such a step is NaN, and not greater than its bound: `ode45` goes on to the horizon with a state that
    is no number. The adapter ends the run at the last state that is one, a step in front of the end.

    y' = sqrt(1 - t) from 0, which is no number from t = 1 on.
    """
    finite, end, y = printed_by_octave()["lost"][0]
    holds(finite < 1 and end == 2 and math.isnan(y), f"finite up to {finite}, the run ends at {end} with y = {y}")
    return (
        f"y' = sqrt(1 - t) is NaN from t = 1 on; the state is so from the step on that begins at {finite:.4f}, and "
        f"the run ends at {end:g} as if nothing were"
    )


@siconos("siconos-step", "Time stepping locates no event")
def error_of_a_step() -> str:
    """A time-stepping scheme has no events: what happens is known to a step, with an error of its order, one, and what
    begins and ends within a step does not happen.

    A block on a spring of 1, friction 1/4, from (1.1, 0): it turns at pi.
    """
    errors = {step: abs(time - math.pi) for step, time in printed_by_siconos()["turn"]}
    holds(len(errors) == 2 and all(1e-5 < error < 3 * step for step, error in errors.items()), f"{errors}")
    words = " and ".join(f"{error:.1e} s with steps of {step:g} s" for step, error in errors.items())
    return f"a block that turns at pi is told to do so with an error of {words}"


@siconos("siconos-no-solution", "A step that has no solution is a warning")
def step_without_a_solution() -> str:
    """In front of a blow-up the equation of an implicit step has no solution any more. Newton's iteration stops after
    so many iterations with a warning, what it has then is the state, and the run goes on.

    x' = x^2 from 1 ends at t = 1; x = x0 + h x^2 has no solution from x0 = 1/(4 h) on.
    """
    ((steps, last, negative),) = printed_by_siconos()["pole"]
    holds(steps == 2000 and math.isfinite(last), f"{steps:g} steps, x = {last} at the end")
    holds(990 <= negative <= 1010, f"x < 0 after {negative:g} steps")
    return (
        f"x' = x² from 1 ends at t = 1; in steps of 0.001 x is negative from t = {negative / 1e3:.3f} on, and the run "
        f"ends at 2 with x = {last:.3g}"
    )


@siconos("siconos-steep", "The sign of a large surface function is lost")
def sign_of_a_steep_surface() -> str:
    """Where the surface function falls to 1e15 and beyond, the sign that the solver of the relay's complementarity
    problem gives is often not its sign. Our adapter ends the run at the first such step.

    x' = 1 from 1 and the surface function 1 - exp(50 (x - 1)): negative from the first step on.
    """
    ((wrong, first),) = printed_by_siconos()["steep"]
    holds(wrong > 0 and 1.5 < first < 2.0, f"{wrong:g} steps, the first at x = {first}")
    return (
        f"of 1 - exp(50 (x - 1)), which is negative, the relay's sign is not -1 after {wrong:g} steps from "
        f"x = {first:.3g} on"
    )


@siconos("siconos-rounding", "A slide between very different fields is rounded off its surface")
def rounding_of_a_slide() -> str:
    """In a slide the two fields cancel: what is left of a step is known to its length times the larger field, rounded.
    Where that is more than a step of the slower field leads back, the run leaves the surface.

    x' = -size above the surface x = 0 and 1 below it, from x = 0: it stays there.
    """
    (_, slow), (_, fast) = printed_by_siconos()["slide"]
    holds(slow < 1e-14 and fast > 1e-3, f"{slow}, {fast}")
    return (
        f"a slide on x = 0, between x' = 1 and -100, stays within {slow:.0e} of it; between 1 and -1e18, in steps of "
        f"0.001, x reaches {fast:.2g}"
    )


@siconos("siconos-damping", "A step damps what oscillates")
def damping_of_a_step() -> str:
    """The theta method with theta = 1 is implicit Euler: each step divides the energy of an oscillation of frequency w
    by 1 + (w h)^2, and times run away from the exact ones. (With theta = 1/2 the adapter loses short slides.)

    x'' = -10^4 x from 1 is -1 after half a turn, 31 steps; a step divides the energy by 1 + (w h)^2.
    """
    ((lowest,),) = printed_by_siconos()["swing"]
    holds(abs(-lowest - (1.0 + 1e-2) ** (-31 / 2)) < 0.01, f"{lowest}")
    return f"x'' = -10⁴ x from 1 swings to {lowest:.3f} in steps of 0.001, not to -1"
