"""Causes of libraries that are not called from Python: CVODE from C, Octave's ``ode45``, Siconos (``programs/``)."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.baselines.causes.base import ClaimError, cause, holds
from henon_ref.baselines.cvode_c import compile_program
from henon_ref.baselines.interpreted import ENVIRONMENT, OCTAVE, siconos_python
from henon_ref.errors import UnavailableError

PROGRAMS = Path(__file__).parent / "programs"
"""Folder of the programs in other languages."""
from_c, octave = partial(cause, "sundials"), partial(cause, "octave")
siconos = partial(cause, "siconos", docs="https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/")


class Printed(dict[str, list[list[float]]]):
    """Output of a program: maps a name to the numbers of each of its lines."""

    def __missing__(self, name: str) -> list[list[float]]:
        raise ClaimError(f"the program has printed no '{name}'")


def printed(command: Sequence[str], environment: dict[str, str] | None = None) -> Printed:
    """Run a program whose lines consist of a name and numbers; other lines, printed by the library, are ignored.

    ClaimError if the program cannot be run.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=300.0, check=False, env=environment)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ClaimError(f"{command[0]}: {error}") from error
    found = Printed()
    for name, *numbers in (line.split() for line in done.stdout.splitlines() if line.strip()):
        try:
            found.setdefault(name, []).append([float(number) for number in numbers])
        except ValueError:
            continue
    return found


@cache
def printed_from_c() -> Printed:
    """Return the output of ``cvode_events.c``: flag, time, state and steps of each run."""
    source = PROGRAMS / "cvode_events.c"
    with TemporaryDirectory() as folder:
        program = Path(folder, "cvode_events")
        try:
            compile_program({source.name: source.read_text(encoding="utf-8")}, program)
        except UnavailableError as error:
            raise ClaimError(str(error)) from error
        return printed([str(program)])


@cache
def printed_by_octave() -> Printed:
    return printed([*OCTAVE, str(PROGRAMS / "octave_events.m")])


@cache
def printed_by_siconos() -> Printed:
    return printed([siconos_python(), str(PROGRAMS / "siconos_step.py")], os.environ | ENVIRONMENT)


@from_c(
    "cvode-c-pair",
    "CVODE from C: two roots within one step are not found",
    "https://github.com/llnl/sundials/issues/881",
)
def pair_in_one_step() -> str:
    """Rootfinding compares the signs of a root function at both ends of an internal step, and does not find an even
    number of roots in between. This is a property of the library, not of its Python binding.

    x' = 1 through x^2 = d^2/4.
    """
    for method in ("adams", "bdf"):
        flag, end, _, steps = printed_from_c()[f"pair-{method}"][0]
        holds(flag == 0 and end == 2 and steps < 100, f"{method}: flag {flag:g} at t = {end}")
    flag, end, x, steps = printed_from_c()["turn-adams"][0]
    holds(flag == 0 and end == 2 and x > 0, f"x' = t - 1: flag {flag:g} at t = {end}, x = {x}")
    return (
        "neither Adams nor BDF reports the roots at t = 0.95 and 1.05; the run ends at 2. For x' = t - 1 from 3/8, "
        f"which is zero at 1/2 and 3/2, Adams takes {steps:g} steps to t = 2 and reports no root"
    )


@from_c(
    "cvode-c-error",
    "CVODE from C: the tolerance bounds the error of a step, not of the run",
    "https://sundials.readthedocs.io/en/latest/cvode/Mathematics_link.html",
)
def error_of_a_run() -> str:
    """The errors of the steps add up to several tolerances. If the distance from a surface is smaller than this sum,
    CVODE's solution may cross the surface and return, and both roots are reported.

    x' = 4 (t - 1)^3 from 1 + 1e-8 never comes below 1e-8; tolerances 1e-6.
    """
    flag, root, x, _ = printed_from_c()["flat-bdf"][0]
    _, _, least, _ = printed_from_c()["flat-end"][0]
    holds(flag == 2 and abs(x) < 1e-15 and 0.9 < root < 1, f"flag {flag:g} at t = {root}, x = {x}")
    holds(least < -2e-6, f"x = {least} at t = 1")
    return f"x = (t - 1)⁴ + 1e-8 has no root; at 1e-6 BDF has x = {least:.1e} at t = 1, and a root at {root:.4f}"


@from_c("cvode-c-late-end", "The end of the domain of a field is found late, by the square root of the tolerance")
def end_of_a_field() -> str:
    """Beyond the domain of a field CVODE shortens its steps until it fails. If a level decreases to zero like (2 - t)²,
    an error of the size of the tolerance in the level changes the time of its end by the square root of the tolerance,
    and by more after a restart at order 1.

    h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2.
    """
    ends = {}
    for which in ("loose", "tight"):
        flag, ends[which], level, _ = printed_from_c()[f"tank-{which}"][0]
        holds(flag < 0 and ends[which] > 2, f"{which}: flag {flag:g} at t = {ends[which]}, h = {level}")
    holds(ends["loose"] - 2 > 1e-4 > ends["tight"] - 2, f"{ends}")
    return f"h' = -sqrt(h) ends at t = {ends['loose']:.4f} at 1e-6 and {ends['tight']:.6f} at 1e-12 instead of 2"


@from_c("cvode-c-infinite-jacobian", "With an infinite Jacobian, every step is accepted")
def infinite_jacobian() -> str:
    """The matrix of Newton's iteration is then infinite and its correction zero, so that the iteration converges at
    once: the state remains constant for any field, and the steps grow. The adapter reports an error for an infinite
    Jacobian, and for a field that is not finite.

    h' = -1/4 - sqrt(h) from 1/4: nothing is left at t = 1 - log(3)/2, where the Jacobian is infinite.
    """
    flag, end, level, steps = printed_from_c()["pump-infinite"][0]
    holds(flag >= 0 and end == 4 and level == 0, f"flag {flag:g} at t = {end}, h = {level}")
    refused, gave_up, _, _ = printed_from_c()["pump-refused"][0]
    holds(refused < 0 and gave_up < 1, f"refused: flag {refused:g} at t = {gave_up}")
    return (
        f"h' = -1/4 - sqrt(h), which would be negative from t = {gave_up:.4f} on, remains 0 until t = {end:g} in "
        f"{steps:g} steps; if the Jacobian is reported as an error, CVODE fails at {gave_up:.4f}"
    )


@octave("octave-line", "An event is located by linear interpolation over a step")
def straight_line() -> str:
    """`ode45` interpolates the event function and the state linearly between both ends of the step that contains the
    event. The error of the event's time is of the order of the square of the step, for any tolerance.

    x'' = -x from (1, 0) falls through zero at pi/2; a ball that is thrown up from its surface returns at 2.
    """
    errors = [abs(time - math.pi / 2) for _, time in printed_by_octave()["line"]]
    tolerances = [tolerance for tolerance, _ in printed_by_octave()["line"]]
    ((ball,),) = printed_by_octave()["ball"]
    holds(all(error > 10 * tol for error, tol in zip(errors, tolerances, strict=True)), f"errors {errors}")
    holds(abs(ball - 2) > 1e-4, f"the ball returns at {ball}")
    words = ", ".join(f"{error:.1e} s" for error in errors)
    return f"the error of pi/2 is {words} at 1e-6, 1e-9, 1e-12; at 1e-9 the ball returns at {ball:.6f} instead of 2"


@octave("octave-pair", "Octave: two roots within one step are not found")
def octave_pair_in_one_step() -> str:
    """Signs are compared at both ends of a step, so that an even number of roots in between is not found.

    x' = 1 through x^2 = d^2/4.
    """
    count, end = printed_by_octave()["pair"][0]
    holds(count == 0 and end == 2, f"{count} events, the run ends at {end}")
    return "roots at t = 0.95 and 1.05 are not reported; the run ends at 2"


@octave("octave-first-step", "An event in the first step does not stop the run")
def first_step() -> str:
    """Events in the first step are ignored, so that a run can start on an event surface. The adapter makes the first
    step short.

    x' = -1 from 0.001, first step 0.1.
    """
    end, x = printed_by_octave()["first"][0]
    holds(end == 2 and x < -1.9, f"the run ends at {end} with x = {x}")
    return f"x falls through zero in the first step, at t = 0.001; the run continues to t = {end:g}, x = {x:.3f}"


@octave("octave-listed", "Of several events within one step, the one with the lowest index stops the run")
def octave_first_in_the_list() -> str:
    """The earliest event does not stop the run if an event with a lower index is in the same step.

    Two surfaces in one step: x = 0 is reached first, and has the higher index.
    """
    number, time = printed_by_octave()["several"][0]
    holds(number == 1, f"event {number:g} at {time}")
    return f"of x + 0.01 and x, which is zero earlier, at t = 1, the run stops at the former, at t = {time:.3f}"


@octave("octave-blow-up", "A blow-up is reported as a step that is too small")
def blow_up() -> str:
    """`ode45` does not detect divergence: it warns and returns when its step becomes too small.

    x' = x^2 from 1 ends at t = 1.
    """
    end, x = printed_by_octave()["pole"][0]
    holds(end < 2 and x < 1e100, f"it ends at {end} with x = {x}")
    return f"x' = x² ends at t = {end:.9f} with x = {x:.1e}, because the step is too small"


@octave("octave-nan", "An event function that is NaN causes no event")
def no_number() -> str:
    """The sign of NaN is NaN and therefore equal to no direction, so that the run continues beyond the domain of the
    event function.

    An event function that is NaN from x = 1 on.
    """
    count, end = printed_by_octave()["nan"][0]
    holds(count == 0 and end == 2, f"{count:g} events, the run ends at {end}")
    return f"an event function that is NaN from x = 1 on has no effect; the run ends at {end:g} without an error"


@octave("octave-nan-state", "A step to a state that is NaN is accepted")
def state_without_value() -> str:
    """The error of such a step is NaN, which is not greater than its bound, so that `ode45` continues to the horizon.
    The adapter ends the run at the last finite state, one step before the end of the field's domain.

    y' = sqrt(1 - t) from 0, which is NaN from t = 1 on.
    """
    finite, end, y = printed_by_octave()["lost"][0]
    holds(finite < 1 and end == 2 and math.isnan(y), f"finite up to {finite}, the run ends at {end} with y = {y}")
    return (
        f"y' = sqrt(1 - t) is NaN from t = 1 on; the state is NaN from the step that begins at {finite:.4f} on, and "
        f"the run ends at {end:g} without an error"
    )


@siconos("siconos-step", "Time stepping locates no event")
def error_of_a_step() -> str:
    """A time-stepping scheme has no events: the times of transitions have an error of the order of the step, and
    transitions that begin and end within a step are not found.

    A block on a spring with stiffness 1 and friction 1/4, from (1.1, 0): its velocity changes sign at pi.
    """
    errors = {step: abs(time - math.pi) for step, time in printed_by_siconos()["turn"]}
    holds(len(errors) == 2 and all(1e-5 < error < 3 * step for step, error in errors.items()), f"{errors}")
    words = " and ".join(f"{error:.1e} s with steps of {step:g} s" for step, error in errors.items())
    return f"the error of the time pi at which the velocity of a block changes sign is {words}"


@siconos("siconos-no-solution", "A step without a solution causes only a warning")
def step_without_a_solution() -> str:
    """Before a blow-up the equation of an implicit step has no solution. Newton's iteration stops with a warning after
    its largest number of iterations, its last value becomes the state, and the run continues.

    x' = x^2 from 1 ends at t = 1; x = x0 + h x^2 has no solution from x0 = 1/(4 h) on.
    """
    ((steps, last, negative),) = printed_by_siconos()["pole"]
    holds(steps == 2000 and math.isfinite(last), f"{steps:g} steps, x = {last} at the end")
    holds(990 <= negative <= 1010, f"x < 0 after {negative:g} steps")
    return (
        f"x' = x² from 1 ends at t = 1; in steps of 0.001 x is negative from t = {negative / 1e3:.3f} on, and the run "
        f"ends at 2 with x = {last:.3g}"
    )


@siconos("siconos-steep", "The sign of a large surface function is wrong")
def sign_of_a_steep_surface() -> str:
    """If the surface function is beyond 1e15 in absolute value, the solver of the relay's complementarity problem often
    returns the wrong sign. Our adapter ends the run at the first such step.

    x' = 1 from 1 and the surface function 1 - exp(50 (x - 1)): negative from the first step on.
    """
    ((wrong, first),) = printed_by_siconos()["steep"]
    holds(wrong > 0 and 1.5 < first < 2.0, f"{wrong:g} steps, the first at x = {first}")
    return (
        f"the relay's sign of 1 - exp(50 (x - 1)), which is negative, is not -1 after {wrong:g} steps, the first of "
        f"them at x = {first:.3g}"
    )


@siconos("siconos-rounding", "Rounding moves a slide between very different fields off its surface")
def rounding_of_a_slide() -> str:
    """In a slide the two fields cancel, and the rounding error of a step is its length times the larger field times the
    unit roundoff. If a step of the smaller field is shorter than this error, the run leaves the surface.

    x' = -size above the surface x = 0 and 1 below it, from x = 0: the exact run remains at 0.
    """
    (_, slow), (_, fast) = printed_by_siconos()["slide"]
    holds(slow < 1e-14 and fast > 1e-3, f"{slow}, {fast}")
    return (
        f"a slide on x = 0 between x' = 1 and -100 remains within {slow:.0e} of the surface; between 1 and -1e18, in "
        f"steps of 0.001, x reaches {fast:.2g}"
    )


@siconos("siconos-damping", "A step damps oscillations")
def damping_of_a_step() -> str:
    """The theta method with theta = 1 is the implicit Euler method: each step divides the energy of an oscillation of
    frequency w by 1 + (w h)^2, so that the errors of times grow. (With theta = 1/2 the adapter loses short slides.)

    x'' = -10^4 x from 1 is -1 after half a period, 31 steps.
    """
    ((lowest,),) = printed_by_siconos()["swing"]
    holds(abs(-lowest - (1.0 + 1e-2) ** (-31 / 2)) < 0.01, f"{lowest}")
    return f"x'' = -10⁴ x from 1 reaches {lowest:.3f} in steps of 0.001 instead of -1"
