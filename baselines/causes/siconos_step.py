"""Siconos' time stepping, by the program ``programs/siconos_step.py`` and the Python that has it."""

from __future__ import annotations

import math
import os
from functools import cache, partial

from henon_ref.baselines.causes.base import PROGRAMS, Printed, cause, holds, printed
from henon_ref.baselines.siconos.solver import ENVIRONMENT, interpreter

shows = partial(cause, "siconos", docs="https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/")


@cache
def seen() -> Printed:
    """What the program prints."""
    return printed([interpreter(), str(PROGRAMS / "siconos_step.py")], os.environ | ENVIRONMENT)


@shows("siconos-step", "Time stepping locates no event")
def error_of_a_step() -> str:
    """A time-stepping scheme has no events: what happens is known to a step, with an error of its order, one, and what
    begins and ends within a step does not happen.

    A block on a spring of 1, friction 1/4, from (1.1, 0): it turns at pi.
    """
    errors = {step: abs(time - math.pi) for step, time in seen()["turn"]}
    holds(len(errors) == 2 and all(1e-5 < error < 3 * step for step, error in errors.items()), f"{errors}")
    words = " and ".join(f"{error:.1e} s with steps of {step:g} s" for step, error in errors.items())
    return f"a block that turns at pi is told to do so with an error of {words}"


@shows("siconos-no-solution", "A step that has no solution is a warning")
def step_without_a_solution() -> str:
    """In front of a blow-up the equation of an implicit step has no solution any more. Newton's iteration stops after
    so many iterations with a warning, what it has then is the state, and the run goes on.

    x' = x^2 from 1 ends at t = 1; x = x0 + h x^2 has no solution from x0 = 1/(4 h) on.
    """
    ((steps, last, negative),) = seen()["pole"]
    holds(steps == 2000 and math.isfinite(last), f"{steps:g} steps, x = {last} at the end")
    holds(990 <= negative <= 1010, f"x < 0 after {negative:g} steps")
    return (
        f"x' = x² from 1 ends at t = 1; in steps of 0.001 x is negative from t = {negative / 1e3:.3f} on, and the run "
        f"ends at 2 with x = {last:.3g}"
    )


@shows("siconos-steep", "The sign of a large surface function is lost")
def sign_of_a_steep_surface() -> str:
    """Where the surface function falls to 1e15 and beyond, the sign that the solver of the relay's complementarity
    problem gives is often not its sign. Our adapter ends the run at the first such step.

    x' = 1 from 1 and the surface function 1 - exp(50 (x - 1)): negative from the first step on.
    """
    ((wrong, first),) = seen()["steep"]
    holds(wrong > 0 and 1.5 < first < 2.0, f"{wrong:g} steps, the first at x = {first}")
    return (
        f"of 1 - exp(50 (x - 1)), which is negative, the relay's sign is not -1 after {wrong:g} steps from "
        f"x = {first:.3g} on"
    )


@shows("siconos-rounding", "A slide between very different fields is rounded off its surface")
def rounding_of_a_slide() -> str:
    """In a slide the two fields cancel: what is left of a step is known to its length times the larger field, rounded.
    Where that is more than a step of the slower field leads back, the run leaves the surface.

    x' = -size above the surface x = 0 and 1 below it, from x = 0: it stays there.
    """
    (_, slow), (_, fast) = seen()["slide"]
    holds(slow < 1e-14 and fast > 1e-3, f"{slow}, {fast}")
    return (
        f"a slide on x = 0, between x' = 1 and -100, stays within {slow:.0e} of it; between 1 and -1e18, in steps of "
        f"0.001, x reaches {fast:.2g}"
    )


@shows("siconos-damping", "A step damps what oscillates")
def damping_of_a_step() -> str:
    """The theta method with theta = 1 is implicit Euler: each step divides the energy of an oscillation of frequency w
    by 1 + (w h)^2, and times run away from the exact ones. (With theta = 1/2 the adapter loses short slides.)

    x'' = -10^4 x from 1 is -1 after half a turn, 31 steps; a step divides the energy by 1 + (w h)^2.
    """
    ((lowest,),) = seen()["swing"]
    holds(abs(-lowest - (1.0 + 1e-2) ** (-31 / 2)) < 0.01, f"{lowest}")
    return f"x'' = -10⁴ x from 1 swings to {lowest:.3f} in steps of 0.001, not to -1"
