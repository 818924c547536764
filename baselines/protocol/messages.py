"""Request and response of the protocol, and their JSON Schema.

Each is one JSON object. All times are in seconds, states and parameters in units of their own. ``docs/protocol.md``
explains every field.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, FailFast, Field

VERSION = 1
"""Version of the protocol. It changes if a field changes its meaning or a new field cannot be ignored."""

Text = Annotated[str, Field(max_length=2000)]
Name = Annotated[str, Field(pattern="^[A-Za-z][A-Za-z0-9_]*$")]
Expression = Annotated[str, Field(min_length=1)]
Side = Annotated[int, Field(ge=-1, le=1)]
Version = Annotated[int, Field(ge=1, le=1)]
Count = Annotated[int, Field(ge=0, le=2**53)]
Number = Annotated[float, Field(allow_inf_nan=False)]
State = Annotated[list[Number], FailFast()]
Status = Literal["ok", "diverged", "nonunique", "invalid", "timeout", "failed", "unsupported", "unavailable"]


class Message(BaseModel):
    """Base class of all messages: unknown fields, and text in place of numbers, are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


class Successor(Message):
    """A possible next mode, or end of the run, after a guard has fallen."""

    mode: Side | None
    """The next mode; null if the run ends."""
    ends: Literal["nonunique", "invalid"] | None
    """The status with which the run ends; null if it continues."""
    when: list[Expression]
    """The successor applies if none of these is negative at the point, which lies on the surface. Empty: always."""


class Guard(Message):
    """A function that is positive inside a mode; the mode ends when it falls through zero."""

    kind: Literal["surface", "release", "valid"]
    """``surface``: the surface is reached; ``release``: the slide on it ends; ``valid``: the model ends."""
    expression: Expression
    """Value of the guard [unit of the surface, or of the release condition]."""
    rate: Expression
    """Time derivative of the guard along the mode's field [that unit / s]."""
    rate_slopes: list[Expression]
    """Derivative of ``rate`` in every state."""
    linear: bool
    """Whether the guard is linear in time and states. A nonlinear guard may oscillate while the states move along a
    straight line. A program that integrates its value (by ``rate``) with the states controls its error, too."""
    armed: bool
    """False: the guard may be negative when the mode begins, and counts once it has been positive."""
    successors: list[Successor]
    """The first successor that applies follows. If none does, the run is ``failed``."""


class Mode(Message):
    """The smooth equations of one mode."""

    mode: Side
    """-1 or +1: side of the surface; 0: a slide (stick) on the surface."""
    field: list[Expression]
    """Time derivative of each state [its unit / s]."""
    jacobian: list[list[Expression]]
    """Row i: derivatives of ``field[i]`` in every state."""
    guards: list[Guard]
    """Guards that end the mode. If several fall at once, a guard that ends the run counts first, then the first one."""


class Surface(Message):
    """The surface on which the sign switches."""

    name: Name
    """Name of the sign symbol."""
    expression: Expression
    """h(t, x); the sign is +1 where h is positive."""
    gradient: list[Expression]
    """Derivative of h in every state."""


class Point(Message):
    """Time, state and mode of a run."""

    time: Number
    """Time [s]."""
    state: State
    """State, in the order of ``states``."""
    mode: Side


class Problem(Message):
    """One initial-value problem with one surface."""

    states: list[Name]
    """Names of the states in expressions; the time is ``t``."""
    parameters: dict[Name, Number]
    """Names of the parameters in expressions, and their values."""
    surface: Surface
    modes: list[Mode]
    """Modes that have equations. A run that would enter another mode is ``failed``."""
    start: Point
    until: Number
    """Horizon, at which the run ends [s]."""


class Request(Message):
    """Message from henon_ref to the program, on the program's standard input."""

    protocol: Version
    """Version of the protocol."""
    problem: Problem
    rtol: Number | None
    """Relative tolerance; null for a solver with a fixed step."""
    atol: Number | None
    """Absolute tolerance [unit of each state]; null for a solver with a fixed step."""
    step: Number | None
    """Step [s]; null for a solver with tolerances."""
    untimed: Count
    """Number of runs to make first, without timing, to warm up."""
    timed: Count
    """Number of identical runs to make and time after these; at least 1."""
    seconds: Number
    """Processor time that a run may take [s]. A longer run ends itself as ``timeout``, with its transitions so far."""
    most_transitions: Count
    """Largest number of transitions. A run with more ends itself as ``failed``."""


class Transition(Message):
    """One change of mode."""

    time: Number
    """Time [s]."""
    before: Side
    """Mode just before: that of the start, or ``after`` of the previous transition."""
    after: Side
    """Mode just after; equal to ``before`` if the surface was only touched."""
    state: State
    """State at the transition, in the order of ``states``."""


class Work(Message):
    """Counts of one run; 0 if a count is unknown."""

    steps: Count = 0
    """Accepted steps."""
    fields: Count = 0
    """Evaluations of a field."""
    guards: Count = 0
    """Evaluations of guards, each guard counted separately."""


class Program(Message):
    """Name and version of the program."""

    name: Text
    version: Text
    """Version of the program or, better, of the library that it uses."""


class Response(Message):
    """Message from the program to henon_ref, alone on the program's standard output."""

    protocol: Version
    """Version of the protocol."""
    program: Program
    status: Status
    """End of the last run. ``unsupported``: the program cannot solve the problem; ``unavailable``: a library that it
    requires is missing."""
    reason: Text = ""
    """One sentence on why the status is not ``ok``."""
    transitions: Annotated[list[Transition], FailFast()] = []
    """All transitions of the last run up to its end, in order of time, for any status."""
    end: Point | None = None
    """End of the last run; at ``until`` if the status is ``ok``. Null: the run ended at its last transition."""
    max_surface_drift: Annotated[Number, Field(ge=0)] = 0.0
    """Largest abs(h) at a point that the run takes to be on the surface [unit of h]."""
    wall_s: Annotated[list[Annotated[Number, Field(gt=0)]], FailFast()] = []
    """Wall time of each timed run by the program's monotonic clock [s], without the program's start, reading,
    compiling and writing."""
    work: Work = Work()
    """Counts of the last run."""


def schema_text(message: type[Message]) -> str:
    """Return the JSON Schema of a message as text."""
    found: dict[str, Any] = message.model_json_schema()
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **found}, indent=1) + "\n"
