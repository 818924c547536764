"""SUNDIALS' CVODE from C, by the program ``programs/cvode_events.c``, compiled for it."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.baselines.causes.base import PROGRAMS, ClaimError, Printed, cause, holds, printed
from henon_ref.baselines.cvode_c.build import LIBRARIES, tools
from henon_ref.errors import UnavailableError

shows = partial(cause, "sundials")


@cache
def seen() -> Printed:
    """What the program prints: return flag, time, state, steps."""
    try:
        compiler, include = tools()
    except UnavailableError as error:
        raise ClaimError(str(error)) from error
    with TemporaryDirectory() as folder:
        libraries = [f"-L{include.parent / 'lib'}", *(f"-l{name}" for name in LIBRARIES)]
        source, program = PROGRAMS / "cvode_events.c", str(Path(folder) / "program")
        printed([compiler, "-O2", f"-I{include}", str(source), "-o", program, *libraries])
        return printed([program])


@shows("cvode-c-pair", "CVODE from C: two roots in one step cancel", "https://github.com/llnl/sundials/issues/881")
def pair_in_one_step() -> str:
    """Rootfinding compares signs at the two ends of an internal step. An even number of roots in between leaves no
    trace. It is the library's, not its binding's.

    x' = 1 through x^2 = d^2/4.
    """
    for method in ("adams", "bdf"):
        flag, end, _, steps = seen()[f"pair-{method}"][0]
        holds(flag == 0 and end == 2 and steps < 100, f"{method}: flag {flag:g} at t = {end}")
    flag, end, x, steps = seen()["turn-adams"][0]
    holds(flag == 0 and end == 2 and x > 0, f"x' = t - 1: flag {flag:g} at t = {end}, x = {x}")
    return (
        "roots at t = 0.95 and 1.05 are reported neither by Adams nor by BDF; the run ends at 2. Of x' = t - 1 from "
        f"3/8, zero at 1/2 and 3/2, Adams takes {steps:g} steps to t = 2 and reports no root"
    )


@shows(
    "cvode-c-error",
    "CVODE from C: a tolerance bounds the error of a step, not that of the run",
    "https://sundials.readthedocs.io/en/latest/cvode/Mathematics_link.html",
)
def error_of_a_run() -> str:
    """Errors of the steps add up to several tolerances. Where the surface is further off than the tolerance and not
    than that, CVODE's own solution crosses it and comes back, and both roots are reported.

    x' = 4 (t - 1)^3 from 1 + 1e-8 never comes below 1e-8; tolerances 1e-6.
    """
    flag, root, x, _ = seen()["flat-bdf"][0]
    _, _, least, _ = seen()["flat-end"][0]
    holds(flag == 2 and abs(x) < 1e-15 and 0.9 < root < 1, f"flag {flag:g} at t = {root}, x = {x}")
    holds(least < -2e-6, f"x = {least} at t = 1")
    return f"x = (t - 1)⁴ + 1e-8 has no root; at 1e-6 BDF has x = {least:.1e} at t = 1, and a root at {root:.4f}"


@shows("cvode-c-late-end", "The end of a field is found late by the root of the tolerance")
def end_of_a_field() -> str:
    """Where a field has no value any more CVODE makes its steps shorter until it gives up. What the tolerance leaves in
    a level that runs out like (2 - t)² is its root in the time, and more after a restart at order 1.

    h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2.
    """
    ends = {}
    for which in ("loose", "tight"):
        flag, ends[which], level, _ = seen()[f"tank-{which}"][0]
        holds(flag < 0 and ends[which] > 2, f"{which}: flag {flag:g} at t = {ends[which]}, h = {level}")
    holds(ends["loose"] - 2 > 1e-4 > ends["tight"] - 2, f"{ends}")
    return f"h' = -sqrt(h) ends at t = {ends['loose']:.4f} at 1e-6, at {ends['tight']:.6f} at 1e-12, not at 2"


@shows("cvode-c-infinite-jacobian", "With an infinite Jacobian every step is accepted")
def infinite_jacobian() -> str:
    """Newton's matrix is infinite then, its correction zero, and the iteration has converged: the state stays where it
    is, whatever its rate, and the steps grow. The adapter refuses such a Jacobian, as it does a field without a
    value.

    h' = -1/4 - sqrt(h) from 1/4: nothing is left at t = 1 - log(3)/2, where the Jacobian is infinite.
    """
    flag, end, level, steps = seen()["pump-infinite"][0]
    holds(flag >= 0 and end == 4 and level == 0, f"flag {flag:g} at t = {end}, h = {level}")
    refused, gave_up, _, _ = seen()["pump-refused"][0]
    holds(refused < 0 and gave_up < 1, f"refused: flag {refused:g} at t = {gave_up}")
    return (
        f"h' = -1/4 - sqrt(h), which would be negative from t = {gave_up:.4f} on, stays at 0 to t = {end:g} in "
        f"{steps:g} steps; where the Jacobian is refused CVODE gives up at {gave_up:.4f}"
    )
