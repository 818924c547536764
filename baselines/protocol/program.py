"""A solver that runs an external program by the protocol (:mod:`henon_ref.baselines.protocol`)."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.protocol.exchange import Limits, ProgramTimeoutError, exchange
from henon_ref.baselines.protocol.messages import VERSION, Request, Response
from henon_ref.baselines.protocol.messages import Problem as ProblemText
from henon_ref.baselines.protocol.problem_text import problem_text
from henon_ref.baselines.protocol.reader import read_response, trajectory
from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.modes.kinks import visible
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.solver import Run
from henon_ref.text import short_line
from henon_ref.trajectory import Trajectory

FOREVER = 86400.0
"""Deadline of a run that has none [s]."""
BEYOND = 0.25
"""A run may exceed its deadline by this part of it before the program is stopped."""
START_SECONDS = 0.8
"""Processor time that a program may use in addition, to start, read and write [s]."""
MOST_TRANSITIONS = 100_000


@dataclass(frozen=True)
class ProgramSolver:
    """A :class:`henon_ref.solver.Solver` that starts a program in any language, one process per request.

    Counts: ``steps``, ``rhs_evaluations`` and ``event_evaluations`` are the program's ``work``. Wall times are measured
    by the program's own clock, without its start, reading and writing.
    """

    name: str
    command: tuple[str, ...]
    """Program and arguments; they are not read by a shell."""
    landing: str
    """How the program puts the end of a step on the surface, for the ``landing`` column."""
    fixed_step: bool = False
    environment: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Environment variables of the program, in addition to those of this process."""
    library_version: str = ""
    """Version of the library that the program uses, for the results; empty if it is unknown."""

    @property
    def version(self) -> str:
        """Version of the library that the program uses; empty if it is unknown."""
        return self.library_version

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Write the problem as text; see :meth:`henon_ref.solver.Solver.prepare`."""
        if (step is None) == self.fixed_step or (rtol is None) != self.fixed_step:
            driver = "step" if self.fixed_step else "rtol (and atol)"
            raise UnsupportedError(f"{self.name} is driven by {driver} alone")
        decision = initial_mode(in_doubles(problem.system), problem.start, problem.initial, problem.initial_mode)
        if decision.mode is None:
            initial = tuple(float(v) for v in problem.initial)
            nowhere = (0,) * len(problem.system.surfaces)
            ended = Trajectory(decision.ending, (), float(problem.start), initial, nowhere, decision.reason)
            return lambda: ended
        text = problem_text(problem, decision.mode)
        request = Request(
            protocol=VERSION,
            problem=text,
            rtol=rtol,
            atol=rtol if atol is None else atol,
            step=step,
            untimed=0,
            timed=1,
            seconds=FOREVER if deadline is None else deadline,
            most_transitions=MOST_TRANSITIONS,
        )
        return ProgramRun(self, self.built(text), problem, request)

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` if the program does not exist."""
        if shutil.which(self.command[0]) is None:
            raise UnavailableError(f"there is no program {self.command[0]}")

    def built(self, text: ProblemText) -> tuple[str, ...]:
        """Return the command for one problem; a subclass may compile its program here."""
        return self.command


class ProgramRun:
    """One problem for one program, prepared for repeated runs (:class:`henon_ref.solver.SelfTimedRun`)."""

    def __init__(self, solver: ProgramSolver, command: tuple[str, ...], problem: Problem, request: Request) -> None:
        self._solver, self._command, self._problem, self.request = solver, command, problem, request
        self.wall_s = math.nan
        """Wall time of the latest run by the program's own clock [s]; NaN if the response has none."""

    def __call__(self) -> Trajectory:
        """Run once, in a new process.

        Raises
        ------
        ContractError
            If the program gives no response, or an invalid one.
        UnsupportedError, UnavailableError
            If the response has this status.
        """
        request, start = self.request, self.request.problem.start
        self.wall_s = math.nan
        try:
            response = self._response(request)
        except ProgramTimeoutError as error:
            return Trajectory("timeout", (), start.time, tuple(start.state), (start.mode,), short_line(str(error)))
        self.wall_s = response.wall_s[-1] if response.wall_s else math.nan
        found = trajectory(response, request, self._solver.landing)
        return found._replace(transitions=visible(self._problem.system, found.transitions))

    def times(self, count: int) -> tuple[float, ...]:
        """Return the wall times of ``count`` runs in one process, after one untimed run [s].

        Raises
        ------
        ContractError
            If the program gives no response, an invalid one, or another number of times.
        """
        response = self._response(self.request.model_copy(update={"untimed": 1, "timed": count}))
        if len(response.wall_s) != count:
            raise ContractError(f"the program gives {len(response.wall_s)} times of {count} runs")
        self.wall_s = response.wall_s[-1]
        return tuple(response.wall_s)

    def _response(self, request: Request) -> Response:
        runs = request.untimed + request.timed
        seconds = (1.0 + BEYOND) * request.seconds * runs + START_SECONDS
        sent = request.model_dump_json().encode()
        return read_response(exchange(self._command, sent, Limits(seconds), self._solver.environment), request)
