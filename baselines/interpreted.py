"""``octave-ode45`` and ``siconos``: programs run by an interpreter (Octave, Python) that has the library.

Octave's ``ode45`` is the method of Dormand and Prince, order 5, with terminal events. Octave 7 locates an event on the
straight line between the two ends of a step, for any tolerance. Of several events in a step it takes the first in the
list, which may not be the first in time (:mod:`henon_ref.baselines.causes.by_program`).

Siconos solves a relay by time stepping, a method of order 1. Debian's package ``python3-siconos`` is for
``/usr/bin/python3``; :data:`VARIABLE` names another interpreter. Newton's iteration, the relay and the theta method
(theta = 1) are those of Siconos; ``relay.py`` determines the modes from its results.
"""

from __future__ import annotations

import os
import re
import shutil
from functools import cache
from pathlib import Path

from henon_ref.baselines.protocol.exchange import command_output
from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError
from henon_ref.workers import ONE_THREAD

OCTAVE = ("octave-cli", "--no-init-file", "--no-history", "--quiet")
VARIABLE = "SICONOS_PYTHON"
"""Environment variable of the interpreter that has Siconos."""
DEFAULT = "/usr/bin/python3"
PACKAGE = "python3-siconos"
ENVIRONMENT = {"PYTHONPATH": "", "PYTHONHOME": "", **ONE_THREAD}


@cache
def octave_version() -> str:
    """Version of ``octave-cli``; empty if it is not installed."""
    path = shutil.which(OCTAVE[0])
    if path is None:
        return ""
    found = re.search(r"version (\S+)", command_output(path, "--no-init-file", "--version") or "")
    return found[1] if found else ""


def siconos_python() -> str:
    """Path of the Python interpreter that runs Siconos."""
    return os.environ.get(VARIABLE) or DEFAULT


@cache
def siconos_version(python: str) -> str:
    """Version of Siconos (of Debian's package, otherwise ``unknown``); empty if ``python`` has no Siconos."""
    if shutil.which(python) is None:
        return ""
    probe = "import importlib.util, sys; sys.exit(importlib.util.find_spec('siconos') is None)"
    if command_output(python, "-c", probe, environment=ENVIRONMENT) is None:
        return ""
    package = command_output("dpkg-query", "-W", "-f", "${Version}", PACKAGE) if python == DEFAULT else None
    return package or "unknown"


class OctaveSolver(ProgramSolver):
    """Octave's ``ode45``.

    Counts: ``steps`` are accepted steps; all other counts are 0.
    """

    @property
    def version(self) -> str:
        return octave_version()

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` if Octave is missing."""
        if not self.version:
            raise UnavailableError(f"{OCTAVE[0]} is not installed (Debian: octave)")

    def built(self, text: Problem) -> tuple[str, ...]:
        return _command(self, *OCTAVE)


class SiconosSolver(ProgramSolver):
    """Siconos' time stepping.

    Counts: ``steps`` are time steps; all other counts are 0.
    """

    @property
    def version(self) -> str:
        return siconos_version(siconos_python())

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` if Siconos is missing."""
        if not self.version:
            python = siconos_python()
            raise UnavailableError(f"{python} has no siconos (Debian: {PACKAGE}; {VARIABLE} names another Python)")

    def built(self, text: Problem) -> tuple[str, ...]:
        return _command(self, siconos_python())


def _command(solver: ProgramSolver, *interpreter: str) -> tuple[str, ...]:
    """Return the command of a solver: interpreter, file of the program in ``programs/``, and version of the library."""
    solver.check()
    path = Path(__file__).parent.joinpath("programs", *solver.command)
    return *interpreter, str(path), solver.version


ODE45 = OctaveSolver("octave-ode45", ("ode45.m",), landing="linear", environment=ONE_THREAD)
RELAY = SiconosSolver("siconos", ("relay.py",), landing="step", fixed_step=True, environment=ENVIRONMENT)
