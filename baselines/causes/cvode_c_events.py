"""SUNDIALS' CVODE from C, by the program ``programs/cvode_events.c``, compiled for it."""

from __future__ import annotations

import subprocess
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.baselines.causes.base import Cause, ClaimError, holds
from henon_ref.baselines.cvode_c.build import LIBRARIES, tools
from henon_ref.errors import UnavailableError

SECONDS = 120.0
"""Wall time of compiling, and of the program [s]."""


@cache
def seen() -> dict[str, list[float]]:
    """What the program prints: name -> return flag, time, state, steps."""
    try:
        compiler, include = tools()
    except UnavailableError as error:
        raise ClaimError(str(error)) from error
    with (
        as_file(files("henon_ref.baselines.causes.programs").joinpath("cvode_events.c")) as path,
        TemporaryDirectory() as folder,
    ):
        made = Path(folder) / "program"
        libraries = [f"-L{include.parent / 'lib'}", *(f"-l{name}" for name in LIBRARIES)]
        command = [compiler, "-O2", f"-I{include}", str(path), "-o", str(made), *libraries]
        try:
            subprocess.run(command, capture_output=True, timeout=SECONDS, check=True)
            done = subprocess.run([str(made)], capture_output=True, text=True, timeout=SECONDS, check=True)
        except (OSError, subprocess.SubprocessError) as error:
            raise ClaimError(f"the program cannot be compiled or run: {error}") from error
    lines = (line.split() for line in done.stdout.splitlines())
    return {name: [float(number) for number in numbers] for name, *numbers in lines}


def pair_in_one_step() -> str:
    """x' = 1 through x^2 = d^2/4."""
    for method in ("adams", "bdf"):
        flag, end, _, steps = seen()[f"pair-{method}"]
        holds(flag == 0 and end == 2 and steps < 100, f"{method}: flag {flag:g} at t = {end}")
    flag, end, x, steps = seen()["turn-adams"]
    holds(flag == 0 and end == 2 and x > 0, f"x' = t - 1: flag {flag:g} at t = {end}, x = {x}")
    return "roots at t = 0.95 and 1.05 are reported neither by Adams nor by BDF; the run ends at 2. Of x' = t - 1 " + (
        f"from 3/8, zero at 1/2 and 3/2, Adams takes {steps:g} steps to t = 2 and reports no root"
    )


def error_of_a_run() -> str:
    """x' = 4 (t - 1)^3 from 1 + 1e-8 never comes below 1e-8; tolerances 1e-6."""
    flag, root, x, _ = seen()["flat-bdf"]
    _, _, least, _ = seen()["flat-end"]
    holds(flag == 2 and abs(x) < 1e-15 and 0.9 < root < 1, f"flag {flag:g} at t = {root}, x = {x}")
    holds(least < -2e-6, f"x = {least} at t = 1")
    return f"x = (t - 1)⁴ + 1e-8 has no root; at 1e-6 BDF has x = {least:.1e} at t = 1, and a root at {root:.4f}"


def end_of_a_field() -> str:
    """h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2."""
    ends = {}
    for which in ("loose", "tight"):
        flag, ends[which], level, _ = seen()[f"tank-{which}"]
        holds(flag < 0 and ends[which] > 2, f"{which}: flag {flag:g} at t = {ends[which]}, h = {level}")
    holds(ends["loose"] - 2 > 1e-4 > ends["tight"] - 2, f"{ends}")
    return f"h' = -sqrt(h) ends at t = {ends['loose']:.4f} at 1e-6, at {ends['tight']:.6f} at 1e-12, not at 2"


def infinite_jacobian() -> str:
    """h' = -1/4 - sqrt(h) from 1/4: nothing is left at t = 1 - log(3)/2, where the Jacobian is infinite."""
    flag, end, level, steps = seen()["pump-infinite"]
    holds(flag >= 0 and end == 4 and level == 0, f"flag {flag:g} at t = {end}, h = {level}")
    refused, gave_up, _, _ = seen()["pump-refused"]
    holds(refused < 0 and gave_up < 1, f"refused: flag {refused:g} at t = {gave_up}")
    return (
        f"h' = -1/4 - sqrt(h), which would be negative from t = {gave_up:.4f} on, stays at 0 to t = {end:g} in "
        f"{steps:g} steps; where the Jacobian is refused CVODE gives up at {gave_up:.4f}"
    )


CVODE_C = (
    Cause(
        "cvode-c-pair",
        "sundials",
        "CVODE from C: two roots in one step cancel",
        "Rootfinding compares signs at the two ends of an internal step. An even number of roots in between leaves no "
        "trace. It is the library's, not its binding's.",
        pair_in_one_step,
        ("https://github.com/llnl/sundials/issues/881",),
    ),
    Cause(
        "cvode-c-late-end",
        "sundials",
        "The end of a field is found late by the root of the tolerance",
        "Where a field has no value any more CVODE makes its steps shorter until it gives up. What the tolerance leaves"
        " in a level that runs out like (2 - t)² is its root in the time, and more after a restart at order 1.",
        end_of_a_field,
    ),
    Cause(
        "cvode-c-infinite-jacobian",
        "sundials",
        "With an infinite Jacobian every step is accepted",
        "Newton's matrix is infinite then, its correction zero, and the iteration has converged: the state stays where "
        "it is, whatever its rate, and the steps grow. The adapter refuses such a Jacobian, as it does a field without "
        "a value.",
        infinite_jacobian,
    ),
    Cause(
        "cvode-c-error",
        "sundials",
        "CVODE from C: a tolerance bounds the error of a step, not that of the run",
        "Errors of the steps add up to several tolerances. Where the surface is further off than the tolerance and "
        "not than that, CVODE's own solution crosses it and comes back, and both roots are reported.",
        error_of_a_run,
        ("https://sundials.readthedocs.io/en/latest/cvode/Mathematics_link.html",),
    ),
)
