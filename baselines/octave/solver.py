"""``octave-ode45``: Octave's ``ode45`` (Dormand and Prince, order 5) with terminal events, run by ``octave-cli``.

Octave 7 locates an event by a straight line between the two ends of a step, whatever the tolerances, and takes the
first of several in the order in which they are listed (:mod:`henon_ref.baselines.causes.octave_events`).
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files

from henon_ref.baselines.protocol.exchange import said_by
from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError

PROGRAM = "octave-cli"
OPTIONS = ("--no-init-file", "--no-history", "--quiet")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@cache
def octave_version() -> str:
    """Of the ``octave-cli`` that is found, empty where there is none."""
    path = shutil.which(PROGRAM)
    if path is None:
        return ""
    found = re.search(r"version (\S+)", said_by(path, "--no-init-file", "--version") or "")
    return found[1] if found else ""


@dataclass(frozen=True)
class OctaveSolver(ProgramSolver):
    """A program in Octave's language.

    Counts: ``steps`` are accepted steps; nothing else is counted.
    """

    @property
    def version(self) -> str:
        """Of Octave, empty where it is not installed."""
        return octave_version()

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` where there is no Octave."""
        if not octave_version():
            raise UnavailableError(f"{PROGRAM} is not installed (Debian: octave)")

    def built(self, text: Problem) -> tuple[str, ...]:
        """Octave with the program's file."""
        self.check()
        with as_file(files("henon_ref.baselines.octave").joinpath(*self.command)) as path:
            return PROGRAM, *OPTIONS, str(path)


ODE45 = OctaveSolver("octave-ode45", ("ode45.m",), landing="linear", environment=ONE_THREAD)
