"""``octave-ode45`` and ``siconos``: programs in the language of an interpreter that has the library.

Octave's ``ode45`` is that of Dormand and Prince, order 5, with terminal events. Octave 7 locates an event by a straight
line between the two ends of a step, whatever the tolerances, and takes the first of several in the order in which they
are listed (:mod:`henon_ref.baselines.causes.by_program`).

Siconos has a relay and time stepping, of order 1 by design. Debian has it as ``python3-siconos`` for
``/usr/bin/python3``; :data:`VARIABLE` names another interpreter. Newton's iteration, the relay and the theta method
(theta = 1) are Siconos'; ``relay.py`` says how modes are read off.
"""

from __future__ import annotations

import os
import re
import shutil
from functools import cache
from importlib.resources import as_file, files

from henon_ref.baselines.protocol.exchange import said_by
from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError

OCTAVE = ("octave-cli", "--no-init-file", "--no-history", "--quiet")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
VARIABLE = "SICONOS_PYTHON"
"""Environment variable of the interpreter that has Siconos."""
DEFAULT = "/usr/bin/python3"
PACKAGE = "python3-siconos"
ENVIRONMENT = {"PYTHONPATH": "", "PYTHONHOME": "", **ONE_THREAD}


@cache
def octave_version() -> str:
    """Of the ``octave-cli`` that is found, empty where there is none."""
    path = shutil.which(OCTAVE[0])
    if path is None:
        return ""
    found = re.search(r"version (\S+)", said_by(path, "--no-init-file", "--version") or "")
    return found[1] if found else ""


def siconos_python() -> str:
    """The Python that is asked for Siconos."""
    return os.environ.get(VARIABLE) or DEFAULT


@cache
def siconos_version(python: str) -> str:
    """Version of Siconos, by Debian's package where it is one; empty where that Python has it not."""
    if shutil.which(python) is None:
        return ""
    asked = "import importlib.util, sys; sys.exit(importlib.util.find_spec('siconos') is None)"
    if said_by(python, "-c", asked, environment=ENVIRONMENT) is None:
        return ""
    package = said_by("dpkg-query", "-W", "-f", "${Version}", PACKAGE) if python == DEFAULT else None
    return package or "unknown"


class InterpretedSolver(ProgramSolver):
    """A program in the language of an interpreter; ``command`` is its file here."""

    interpreter: tuple[str, ...]
    """What runs the file."""
    absent: str
    """What is said where the library is missing."""

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` where the library is missing."""
        if not self.version:
            raise UnavailableError(self.absent)

    def built(self, text: Problem) -> tuple[str, ...]:
        """The interpreter with the program's file, which is told the library's version."""
        self.check()
        with as_file(files("henon_ref.baselines.programs").joinpath(*self.command)) as path:
            return *self.interpreter, str(path), self.version


class OctaveSolver(InterpretedSolver):
    """Octave by the protocol.

    Counts: ``steps`` are accepted steps; nothing else is counted.
    """

    interpreter = OCTAVE
    absent = f"{OCTAVE[0]} is not installed (Debian: octave)"

    @property
    def version(self) -> str:
        """Of Octave, empty where it is not installed."""
        return octave_version()


class SiconosSolver(InterpretedSolver):
    """Siconos by the protocol.

    Counts: ``steps`` are steps; nothing else is counted.
    """

    @property
    def interpreter(self) -> tuple[str, ...]:  # type: ignore[override]
        """The Python that is asked."""
        return (siconos_python(),)

    @property
    def absent(self) -> str:  # type: ignore[override]
        """What is said where it has no Siconos."""
        return f"{siconos_python()} has no siconos (Debian: {PACKAGE}; {VARIABLE} names another Python)"

    @property
    def version(self) -> str:
        """Of Siconos, empty where it is not installed."""
        return siconos_version(siconos_python())


ODE45 = OctaveSolver("octave-ode45", ("ode45.m",), landing="linear", environment=ONE_THREAD)
RELAY = SiconosSolver("siconos", ("relay.py",), landing="step", fixed_step=True, environment=ENVIRONMENT)
