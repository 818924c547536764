"""Siconos' time stepping, by the program ``programs/siconos_step.py`` and the Python that has it."""

from __future__ import annotations

import math
import os
import subprocess
from importlib.resources import as_file, files

from baselines.causes.base import Cause, ClaimError, holds
from baselines.siconos.solver import ENVIRONMENT, interpreter

SECONDS = 300.0
"""Wall time of the program [s]."""


def error_of_a_step() -> str:
    """A block on a spring of 1, friction 1/4, from (1.1, 0): it turns at pi."""
    with as_file(files("baselines.causes.programs").joinpath("siconos_step.py")) as path:
        command, variables = [interpreter(), str(path)], os.environ | ENVIRONMENT
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=True, env=variables)
        except (OSError, subprocess.SubprocessError) as error:
            raise ClaimError(f"{interpreter()}: {error}") from error
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("turn ")]
    errors = {float(step): abs(float(time) - math.pi) for _, step, time in lines}
    holds(len(errors) == 2 and all(1e-5 < error < 3 * step for step, error in errors.items()), f"{errors}")
    words = " and ".join(f"{error:.1e} s with steps of {step:g} s" for step, error in errors.items())
    return f"a block that turns at pi is told to do so with an error of {words}"


SICONOS = (
    Cause(
        "siconos-step",
        "siconos",
        "Time stepping locates no event",
        "A time-stepping scheme has no events: what happens is known to a step, with an error of its order, one, and "
        "what begins and ends within a step does not happen.",
        error_of_a_step,
        ("https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/",),
    ),
)
