"""``siconos``: relay and time stepping of Siconos, of order 1 by design, run by the Python that it is installed for.

Debian has it as ``python3-siconos`` for ``/usr/bin/python3``; :data:`VARIABLE` names another interpreter. Newton's
iteration, the relay and the theta method (theta = 1) are Siconos'; ``relay.py`` says how modes are read off.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files

from henon_ref.baselines.protocol.exchange import said_by
from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError

VARIABLE = "SICONOS_PYTHON"
"""Environment variable of the interpreter that has Siconos."""
DEFAULT = "/usr/bin/python3"
PACKAGE = "python3-siconos"
ENVIRONMENT = {"PYTHONPATH": "", "PYTHONHOME": "", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


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
    if said_by(python, "-c", asked, environment=ENVIRONMENT) is None:
        return ""
    package = said_by("dpkg-query", "-W", "-f", "${Version}", PACKAGE) if python == DEFAULT else None
    return package or "unknown"


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
