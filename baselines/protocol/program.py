"""A solver that runs an external program by the protocol (:mod:`henon_ref.baselines.protocol`).

The program's output is checked against the protocol and the request before it becomes a trajectory.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from pydantic_core import from_json

from henon_ref.baselines.protocol.exchange import exchange
from henon_ref.baselines.protocol.messages import VERSION, Point, Request, Response
from henon_ref.baselines.protocol.messages import Problem as ProblemText
from henon_ref.baselines.protocol.messages import Transition as Event
from henon_ref.baselines.protocol.problem_text import problem_text
from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.modes.kinks import visible
from henon_ref.modes.mode import transition_kind
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.solver import Run
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Trajectory, Transition

SHOWN = 60
"""Characters of a refused value in a message."""


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
        decision = initial_mode(in_doubles(problem.system).at_start(problem), problem)
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
            seconds=86400.0 if deadline is None else deadline,
            most_transitions=100_000,
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

        ContractError if the program gives no valid response (DeadlineError if it has to be stopped);
        UnsupportedError, UnavailableError if that is its status.
        """
        request, self.wall_s = self.request, math.nan
        response = self._response(request)
        self.wall_s = response.wall_s[-1] if response.wall_s else math.nan
        found = trajectory(response, request, self._solver.landing)
        return found._replace(transitions=visible(self._problem.system, found.transitions))

    def times(self, count: int) -> tuple[float, ...]:
        """Return the wall times of ``count`` runs in one process, after one untimed run [s].

        ContractError if the program gives no valid response, or another number of times.
        """
        response = self._response(self.request.model_copy(update={"untimed": 1, "timed": count}))
        if len(response.wall_s) != count:
            raise ContractError(f"the program gives {len(response.wall_s)} times of {count} runs")
        self.wall_s = response.wall_s[-1]
        return tuple(response.wall_s)

    def _response(self, request: Request) -> Response:
        runs = request.untimed + request.timed
        # A run may exceed its deadline by a quarter; 0.8 s are for the program's start, reading and writing.
        seconds = 1.25 * request.seconds * runs + 0.8
        sent = request.model_dump_json().encode()
        return read_response(exchange(self._command, sent, seconds, self._solver.environment), request)


def read_response(output: bytes, request: Request) -> Response:
    """Read a program's output as a response to the request.

    If it is not valid, the ContractError names the place, the value there and the allowed values.
    """
    if not output.strip():
        raise ContractError("the program wrote nothing, wanted a response in JSON")
    _check_size(output, request)
    try:
        message = from_json(output)
    except ValueError as error:
        raise _refused(f"Invalid JSON: {error}") from None
    _check_fields(message)
    try:
        response = Response.model_validate(message)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        where = f"{place}: " if place else ""
        found = repr(first["input"])[:SHOWN]
        raise _refused(f"{where}{first['msg']}, not {found}") from None
    _check(response, request)
    return response


def _check_size(output: bytes, request: Request) -> None:
    """Refuse an output that is longer than any response to the request, before it is parsed."""
    # Bounds of the commas and brackets: 10 in a transition without its state, 20,000 in the rest, texts included.
    most = (request.most_transitions + 1) * (10 + len(request.problem.states)) + request.timed + 20_000
    if output.count(b",") + output.count(b"[") + output.count(b"{") > most:
        raise _refused(f"transitions: the response is longer than one of {request.most_transitions} transitions")


def _check_fields(message: Any) -> None:
    """Refuse objects with too many fields: the validation would collect an error for each."""
    events = message.get("transitions") if isinstance(message, dict) else None
    most = 100
    parts = message.items() if isinstance(message, dict) and len(message) <= most else ()
    each = ((f"transitions.{k}", event) for k, event in enumerate(events)) if isinstance(events, list) else ()
    for place, value in chain([("response", message)], parts, each):
        if isinstance(value, dict) and len(value) > most:
            raise _refused(f"{place[:SHOWN]}: it has {len(value)} fields")


def trajectory(response: Response, request: Request, landing: str) -> Trajectory:
    """Convert a response to a trajectory; UnsupportedError, UnavailableError if that is its status."""
    if response.status == "unsupported":
        raise UnsupportedError(response.reason or "the program does not do this problem")
    if response.status == "unavailable":
        raise UnavailableError(response.reason or "what the program needs is missing")
    end = _end(response, request)
    work = response.work
    return Trajectory(
        status=response.status,
        transitions=[
            Transition(
                transition_kind(event.before, event.after),
                *(0, (event.before,), (event.after,), event.time, tuple(event.state)),
                landing=landing,
            )
            for event in response.transitions
        ],
        end_time=end.time,
        end_state=tuple(end.state),
        end_mode=(end.mode,),
        reason=short_line(response.reason),
        counts=Counts(work.steps, work.fields, work.guards),
        max_surface_drift=response.max_surface_drift,
    )


def _end(response: Response, request: Request) -> Point:
    if response.end is not None:
        return response.end
    if not response.transitions:
        return request.problem.start
    last = response.transitions[-1]
    return Point(time=last.time, state=last.state, mode=last.after)


def _check(response: Response, request: Request) -> None:
    """Refuse a response that contradicts the request or itself."""
    start, until = request.problem.start, request.problem.until
    slack = 64 * sys.float_info.epsilon * max(abs(start.time), abs(until))
    latest, mode = start.time, start.mode
    for k, event in enumerate(response.transitions):
        _check_point(f"transitions.{k}", event, request, slack)
        if event.time < latest - slack:
            raise _refused(f"transitions.{k}.time: {event.time!r} is before {latest!r}, the time of the one before")
        if event.before != mode:
            raise _refused(f"transitions.{k}.before: {event.before} is not {mode}, the mode that the run was in")
        latest, mode = max(latest, event.time), event.after
    if response.end is not None:
        _check_point("end", response.end, request, slack)
    if response.status != "ok":
        return
    end = _end(response, request)
    if end.time < until - slack or end.mode != mode:
        raise _refused(f"end: a run that is ok ends at {until!r} in mode {mode}, not at {end.time!r} in {end.mode}")
    if len(response.wall_s) != request.timed:
        raise _refused(f"wall_s: {len(response.wall_s)} times, wanted {request.timed}, one a timed run")


def _check_point(place: str, point: Point | Event, request: Request, slack: float) -> None:
    """Refuse a time outside the run, and a state that is not one finite number per state."""
    start, until, state = request.problem.start.time, request.problem.until, point.state
    if not start - slack <= point.time <= until + slack:
        raise _refused(f"{place}.time: {point.time!r} is not from {start!r} to {until!r}")
    if len(state) != len(request.problem.states) or not all(map(math.isfinite, state)):
        raise _refused(f"{place}.state: {len(state)} numbers, wanted {len(request.problem.states)}, one a state")


def _refused(words: str) -> ContractError:
    return ContractError(short_line(f"the program's response is refused: {words}"))
