"""Check of a program's output against the protocol and the request, and its conversion to a trajectory."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from itertools import chain
from typing import Any

from pydantic import ValidationError
from pydantic_core import from_json

from henon_ref.baselines.protocol.messages import Point, Request, Response
from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.modes.mode import transition_kind
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Trajectory, Transition

ROUNDINGS = 64
"""Allowed error of a time, in roundings of the largest time of the problem."""

FIELDS = 10
"""Upper bound of the commas and brackets of a transition in JSON, without its state."""
TEXT = 20_000
"""Upper bound of the commas and brackets in the rest of a response, texts included."""
MOST_FIELDS = 100
"""Largest number of fields of one object."""
SHOWN = 60
"""Characters of a refused value in a message."""


def read_response(output: bytes, request: Request) -> Response:
    """Read a program's output as a response to the request.

    Raises
    ------
    ContractError
        If the output is not a valid response; the message names the place, the value there and the allowed values.
    """
    if not output.strip():
        raise ContractError("the program wrote nothing, wanted a response in JSON")
    _check_size(output, request)
    try:
        message = from_json(output)
    except ValueError as error:
        raise ContractError(short_line(f"the program's response is refused: Invalid JSON: {error}")) from None
    _check_fields(message)
    try:
        response = Response.model_validate(message)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        where = f"{place}: " if place else ""
        found = repr(first["input"])[:SHOWN]
        raise ContractError(
            short_line(f"the program's response is refused: {where}{first['msg']}, not {found}")
        ) from None
    _check(response, request)
    return response


def _check_size(output: bytes, request: Request) -> None:
    """Refuse an output that is longer than any response to the request, before it is parsed."""
    most = (request.most_transitions + 1) * (FIELDS + len(request.problem.states)) + request.timed + TEXT
    if output.count(b",") + output.count(b"[") + output.count(b"{") > most:
        raise _refused("transitions", f"the response is longer than one of {request.most_transitions} transitions")


def _check_fields(message: Any) -> None:
    """Refuse objects with too many fields: the validation would collect an error for each."""
    events = message.get("transitions") if isinstance(message, dict) else None
    parts = message.items() if isinstance(message, dict) and len(message) <= MOST_FIELDS else ()
    each = ((f"transitions.{k}", event) for k, event in enumerate(events)) if isinstance(events, list) else ()
    for place, value in chain([("response", message)], parts, each):
        if isinstance(value, dict) and len(value) > MOST_FIELDS:
            raise _refused(place[:SHOWN], f"it has {len(value)} fields")


def trajectory(response: Response, request: Request, landing: str) -> Trajectory:
    """Convert a response to a trajectory.

    Raises
    ------
    UnsupportedError, UnavailableError
        If the response has this status.
    """
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
    slack = ROUNDINGS * sys.float_info.epsilon * max(abs(start.time), abs(until))
    latest, mode = start.time, start.mode
    for k, event in enumerate(response.transitions):
        _check_point(f"transitions.{k}", event.time, event.state, request)
        if event.time < latest - slack:
            raise _refused(f"transitions.{k}.time", f"{event.time!r} is before {latest!r}, the time of the one before")
        if event.before != mode:
            raise _refused(f"transitions.{k}.before", f"{event.before} is not {mode}, the mode that the run was in")
        latest, mode = max(latest, event.time), event.after
    if response.end is not None:
        _check_point("end", response.end.time, response.end.state, request)
    if response.status != "ok":
        return
    end = _end(response, request)
    if end.time < until - slack or end.mode != mode:
        raise _refused("end", f"a run that is ok ends at {until!r} in mode {mode}, not at {end.time!r} in {end.mode}")
    if len(response.wall_s) != request.timed:
        raise _refused("wall_s", f"{len(response.wall_s)} times, wanted {request.timed}, one a timed run")


def _check_point(place: str, time: float, state: Sequence[float], request: Request) -> None:
    """Refuse a time outside the run, and a state that is not one finite number per state."""
    start, until = request.problem.start.time, request.problem.until
    slack = ROUNDINGS * sys.float_info.epsilon * max(abs(start), abs(until))
    if not start - slack <= time <= until + slack:
        raise _refused(f"{place}.time", f"{time!r} is not from {start!r} to {until!r}")
    if len(state) != len(request.problem.states) or not all(map(math.isfinite, state)):
        raise _refused(f"{place}.state", f"{len(state)} numbers, wanted {len(request.problem.states)}, one a state")


def _refused(place: str, words: str) -> ContractError:
    return ContractError(short_line(f"the program's response is refused: {place}: {words}"))
