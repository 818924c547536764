"""How a campaign is run, and who is told how it gets on."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.solver import Solver, fault
from henon_ref.workers.worker import Job

LEAST_TIMEOUT = 0.01
"""Shortest time that a run may be given [s]."""
MAIN = b"__main__"
"""The caller's main module, as a pickle names it."""
MOST_DRAWN = 6
"""Readings of a case that figures are drawn for; a family of dozens would be a heap of look-alikes."""


@dataclass(frozen=True)
class Options:
    """How a campaign is run.

    Raises
    ------
    CaseError
        For a value that is not allowed. Whether solvers exist is seen later
        (:mod:`henon_ref.harness.campaign.plan`).
    """

    solvers: tuple[str | Solver, ...] | None = None
    """Solvers to run, out of those that a case lists; None: all that it lists."""
    tolerances: tuple[float, ...] | None = None
    """In place of the cases' own."""
    repeats: int | None = None
    """Timing samples a row; None: as many as fit a fraction of a second."""
    timeout: float = 10.0
    """Processor time that one run may take [s]."""
    processes: int = 2
    """Runs at work at once."""
    memory: int = 4 * 2**30
    """Bytes one worker may hold, with all that it has started."""
    folder: Path | None = None
    """Where journals are kept, a folder a case; None: no journal."""
    resume: bool = False
    """Whether rows that a journal holds are used."""
    keep_journals: bool = False
    """Leave the journals where they are: the caller has more to do before nothing of this can be lost."""
    timed: bool = True
    """Whether right runs are repeated for their wall times."""
    required: tuple[str, ...] = ()
    """Solvers that are run at all their settings, whatever time one of these takes."""

    def __post_init__(self) -> None:
        for name, entries in (("solvers", self.solvers), ("tolerances", self.tolerances)):
            if entries is not None and not entries:
                raise CaseError(f"{name} is empty; None stands for the case's own")
        for solver in self.solvers or ():
            if not isinstance(solver, str) and (words := fault(solver)):
                raise CaseError(f"solvers: {_shown(solver)} {words}")
        names = [solver if isinstance(solver, str) else solver.name for solver in self.solvers or ()]
        for solver in self.solvers or ():
            if not isinstance(solver, str) and names.count(solver.name) > 1:
                raise CaseError(f"solvers: more than one is named '{solver.name}'; rows are told apart by the name")
        for tolerance in self.tolerances or ():
            if not (_is_number(tolerance) and 1e-16 <= tolerance < 1):
                raise CaseError(f"a tolerance lies between 1e-16 and 1, not {_shown(tolerance)}")
        for name, count in (("repeats", 1 if self.repeats is None else self.repeats), ("processes", self.processes)):
            if type(count) is not int or count < 1:
                raise CaseError(f"{name} is a whole number from 1 on, not {_shown(count)}")
        if not (_is_number(self.timeout) and LEAST_TIMEOUT <= self.timeout < math.inf):
            raise CaseError(f"timeout is a number of seconds from {LEAST_TIMEOUT:g} on, not {_shown(self.timeout)}")

    @property
    def of_main(self) -> bool:
        """Whether a solver is an object of the caller's main module, as in a script that defines one."""
        return any(not isinstance(solver, str) and MAIN in _pickled(solver) for solver in self.solvers or ())


def _pickled(value: object) -> bytes:
    """Empty where it cannot be pickled: which job that is, is told when it is to be sent."""
    try:
        return pickle.dumps(value)
    except Exception:  # noqa: BLE001 - whatever the solver's own classes do on the way into a pickle
        return b""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(value: object) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


Deliver = Callable[[Case, list[ReadingResult], list[Record]], None]
"""Takes a case, its readings' results and its rows, once the last of them is in."""

Draw = Callable[[ReadingResult, list[Record]], Job]
"""Makes the job that draws a reading's figures: its result is the files, by name."""


TRUTH = "truth"
"""What is said to be begun of a reading whose truth is computed, behind its name."""


class Observer:
    """Is told how a campaign gets on; this one shows nothing."""

    def truths(self, readings: int) -> None:
        """The truths of so many readings are being read or computed."""

    def truth(self, name: str) -> None:
        """The truth of a reading is known, or that there is none."""

    def runs(self, rows: int, kept: int) -> None:
        """So many rows are to be made, so many of them are kept from before."""

    def begun(self, case: str, what: str) -> None:
        """A run of a case is begun, or the computation of a truth."""

    def row(self, finished: Record) -> None:
        """A row is finished."""

    def tick(self) -> None:
        """Some time has passed."""
