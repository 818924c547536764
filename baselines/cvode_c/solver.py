"""``cvode-c-adams`` and ``cvode-c-bdf``: SUNDIALS' CVODE with its own rootfinding, called from C.

Both solve their implicit steps by Newton's iteration with a dense Jacobian, as the adapters with a binding do: for
Adams that is the faster of SUNDIALS' two ways (``cvode.c`` has what was measured). Right-hand sides, Jacobians and
guards are C made from the text of a request and compiled once a system; every event is followed by ``CVodeReInit``.
"""

from __future__ import annotations

from dataclasses import dataclass

from henon_ref.baselines.cvode_c.build import library_version, program_for, tools
from henon_ref.baselines.cvode_c.equations import c_equations
from henon_ref.baselines.protocol.messages import Problem
from henon_ref.baselines.protocol.program import ProgramSolver


@dataclass(frozen=True)
class CvodeFromC(ProgramSolver):
    """CVODE in a C program of its own.

    Counts: ``steps`` are internal steps, ``rhs_evaluations`` CVODE's own count, ``event_evaluations`` evaluations of
    all guards together.
    """

    @property
    def version(self) -> str:
        """Of SUNDIALS, empty where its headers are not installed."""
        return library_version()

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` where the program cannot be compiled."""
        tools()

    def built(self, text: Problem) -> tuple[str, ...]:
        """The program for this system, compiled where it is not in the cache."""
        return str(program_for(c_equations(text))), *self.command


ADAMS = CvodeFromC("cvode-c-adams", ("adams",), landing="illinois")
BDF = CvodeFromC("cvode-c-bdf", ("bdf",), landing="illinois")
