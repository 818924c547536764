"""How a campaign is run, and what is asked of each solver: tolerances or steps."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from henon_ref.errors import CaseError
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.reference import Expected
from henon_ref.modes.problem import Problem
from henon_ref.solver import Solver, fault

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
    """Where journals are kept, a folder a case; None: no journal. Who gives one removes them."""
    resume: bool = False
    """Whether rows that a journal holds are used."""
    timed: bool = True
    """Whether right runs are repeated for their wall times."""
    required: tuple[str, ...] = ()
    """Solvers that are run at all their settings, whatever time one of these takes."""

    def __post_init__(self) -> None:
        for name, entries in (("solvers", self.solvers), ("tolerances", self.tolerances)):
            if entries is not None and not entries:
                raise CaseError(f"{name} is empty; None stands for the case's own")
        own = [solver for solver in self.solvers or () if not isinstance(solver, str)]
        for solver in own:
            if words := fault(solver):
                raise CaseError(f"solvers: {shown(solver)} {words}")
        names = [solver if isinstance(solver, str) else solver.name for solver in self.solvers or ()]
        for solver in own:
            if names.count(solver.name) > 1:
                raise CaseError(f"solvers: more than one is named '{solver.name}'; rows are told apart by the name")
        for tolerance in self.tolerances or ():
            if not (_is_number(tolerance) and 1e-16 <= tolerance < 1):
                raise CaseError(f"a tolerance lies between 1e-16 and 1, not {shown(tolerance)}")
        for name, count in (("repeats", 1 if self.repeats is None else self.repeats), ("processes", self.processes)):
            if type(count) is not int or count < 1:
                raise CaseError(f"{name} is a whole number from 1 on, not {shown(count)}")
        if not (_is_number(self.timeout) and LEAST_TIMEOUT <= self.timeout < math.inf):
            raise CaseError(f"timeout is a number of seconds from {LEAST_TIMEOUT:g} on, not {shown(self.timeout)}")

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


def shown(value: object) -> str:
    """A value in few words."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


@dataclass(frozen=True)
class Setting:
    """One row's settings: a step for a fixed-step solver, tolerances for any other."""

    rtol: float | None = None
    """Relative tolerance."""
    atol: float | None = None
    """Absolute tolerance, in units of the state."""
    step: float | None = None
    """Step [s]."""

    @classmethod
    def of(cls, run: RunRow) -> Setting:
        """That of a row."""
        return cls(run.rtol, run.atol, run.step_s)

    @property
    def label(self) -> str:
        """As messages name it."""
        return f"step {self.step:g} s" if self.step is not None else f"rtol {self.rtol:g}"


def settings(
    *, fixed_step: bool, tolerances: Sequence[float], steps: Sequence[float], scale: float
) -> tuple[Setting, ...]:
    """The settings of one solver on one reading, from the loosest on; ``scale``: see :func:`state_scale`."""
    if fixed_step:
        return tuple(Setting(step=step) for step in sorted(set(steps), reverse=True))
    return tuple(Setting(rtol=rtol, atol=rtol * scale) for rtol in sorted(set(tolerances), reverse=True))


def state_scale(problem: Problem, expected: Expected | None) -> float:
    """Size of the state as a power of ten: of the largest entry at the start and at the truth's transitions.

    A power of ten, rounded towards 1, so that ``atol`` equals ``rtol`` wherever states are of order one, and so
    that the same system in other units is asked for the same digits.
    """
    sizes = [abs(float(value)) for value in problem.initial]
    if expected is not None:
        sizes.append(expected.state_size)
    largest = max((size for size in sizes if math.isfinite(size)), default=0.0)
    return 10.0 ** math.trunc(math.log10(largest)) if largest > 0 else 1.0
