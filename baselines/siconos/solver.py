"""``siconos``: relay and time stepping of Siconos, of order 1 by design, run by the Python that it is installed for.

Debian has it as ``python3-siconos`` for ``/usr/bin/python3``; :data:`VARIABLE` names another interpreter. Newton's
iteration, the relay and the theta method (theta = 1) are Siconos'; ``relay.py`` says how modes are read off.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files

from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError

VARIABLE = "SICONOS_PYTHON"
"""Environment variable of the interpreter that has Siconos."""
DEFAULT = "/usr/bin/python3"
PACKAGE = "python3-siconos"
ENVIRONMENT = {"PYTHONPATH": "", "PYTHONHOME": "", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
SECONDS = 60.0
"""Wall time in which the interpreter tells whether it has Siconos [s]."""


def interpreter() -> str:
    """The Python that is asked."""
    return os.environ.get(VARIABLE) or DEFAULT


def siconos_version() -> str:
    """Version of Siconos, by Debian's package where it is one; empty where it is not installed."""
    return _version_of(interpreter())


@cache
def _version_of(python: str) -> str:
    if shutil.which(python) is None:
        return ""
    asked = "import importlib.util, sys; sys.exit(importlib.util.find_spec('siconos') is None)"
    if _said(python, "-c", asked) is None:
        return ""
    package = _said("dpkg-query", "-W", "-f", "${Version}", PACKAGE) if python == DEFAULT else None
    return package or "unknown"


def _said(*command: str) -> str | None:
    """What a command writes; None where it fails."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=SECONDS, check=False, env=os.environ | ENVIRONMENT
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


@dataclass(frozen=True)
class SiconosSolver(ProgramSolver):
    """Siconos by the protocol.

    Counts: ``steps`` are steps; nothing else is counted.
    """

    @property
    def version(self) -> str:
        """Of Siconos, empty where it is not installed."""
        return siconos_version()

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` where there is no Siconos."""
        if not siconos_version():
            raise UnavailableError(
                f"{interpreter()} has no siconos (Debian: {PACKAGE}; {VARIABLE} names another Python)"
            )

    def built(self, text: Problem) -> tuple[str, ...]:
        """The interpreter with the program's file."""
        self.check()
        with as_file(files("henon_ref.baselines.siconos").joinpath(*self.command)) as path:
            return interpreter(), str(path), siconos_version()


RELAY = SiconosSolver("siconos", ("relay.py",), landing="step", fixed_step=True, environment=ENVIRONMENT)
