"""What is said on the two sides of the protocol, and its JSON Schema.

One request, one response, one JSON object each. All times are in the problem's unit of time [s], states and parameters
in units of their own; ``docs/protocol.md`` goes through every field.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, FailFast, Field

VERSION = 1
"""Of the protocol: another number where a field changes its meaning, or a program must know of a new one."""

Text = Annotated[str, Field(max_length=2000)]
Name = Annotated[str, Field(pattern="^[A-Za-z][A-Za-z0-9_]*$")]
Expression = Annotated[str, Field(min_length=1)]
Side = Annotated[int, Field(ge=-1, le=1)]
Version = Annotated[int, Field(ge=1, le=1)]
Count = Annotated[int, Field(ge=0, le=2**53)]
Number = Annotated[float, Field(allow_inf_nan=False)]
State = Annotated[list[Number], FailFast()]
End = Literal["nonunique", "invalid"]
Status = Literal["ok", "diverged", "nonunique", "invalid", "timeout", "failed", "unsupported", "unavailable"]


class Message(BaseModel):
    """No field that is not named; no text in place of a number."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


class Successor(Message):
    """What may follow where a guard has fallen."""

    mode: Side | None
    """The next mode; null where the run ends."""
    ends: End | None
    """The status with which the run ends there; null where it goes on."""
    when: list[Expression]
    """It follows where none of these is negative at the point, which lies on the surface. Empty: always."""


class Guard(Message):
    """A function that is positive inside a mode, which ends where it falls through zero."""

    kind: Literal["surface", "release", "valid"]
    """``surface``: the surface is reached; ``release``: the slide on it ends; ``valid``: the model ends."""
    expression: Expression
    """Its value [unit of the surface, or of the release condition]."""
    rate: Expression
    """Its time derivative along the mode's own field [that unit / s]."""
    rate_slopes: list[Expression]
    """Derivative of ``rate`` in every state."""
    linear: bool
    """Whether it is linear in time and states. One that is not may swing while the states move straight on: a program
    that integrates its value along (``rate``) chooses its steps by it, too."""
    armed: bool
    """False: it may be negative where the mode begins, and counts once it has been positive."""
    successors: list[Successor]
    """The first that holds follows. Where none does the run is ``failed``."""


class Mode(Message):
    """The smooth equations of one mode."""

    mode: Side
    """-1 or +1: that side of the surface; 0: a slide (stick) on it."""
    field: list[Expression]
    """Time derivative of each state [its unit / s]."""
    jacobian: list[list[Expression]]
    """Row i: derivatives of ``field[i]`` in every state."""
    guards: list[Guard]
    """What ends the mode. Where several fall at one time, one that ends the run comes first, then the first listed."""


class Surface(Message):
    """Where the sign switches."""

    name: Name
    """Of its sign symbol."""
    expression: Expression
    """h(t, x): the sign is +1 where it is positive."""
    gradient: list[Expression]
    """Its derivative in every state."""


class Point(Message):
    """A time, a state, a mode."""

    time: Number
    """[s]."""
    state: State
    """In the order of ``states``."""
    mode: Side


class Problem(Message):
    """One initial-value problem with one surface."""

    states: list[Name]
    """Names of the states in expressions; the time is ``t``."""
    parameters: dict[Name, Number]
    """Names of the parameters in expressions -> values."""
    surface: Surface
    modes: list[Mode]
    """Those that have equations. A run that would enter another is ``failed``."""
    start: Point
    until: Number
    """Horizon: the run ends here [s]."""


class Request(Message):
    """From henon_ref to the program, on its standard input."""

    protocol: Version
    """Version of the protocol."""
    problem: Problem
    rtol: Number | None
    """Relative tolerance; null for a solver of a fixed step."""
    atol: Number | None
    """Absolute tolerance [unit of each state]; null for a solver of a fixed step."""
    step: Number | None
    """Step [s]; null for a solver driven by tolerances."""
    untimed: Count
    """Runs to make first, to warm up."""
    timed: Count
    """Runs to make and time then, all alike; at least 1."""
    seconds: Number
    """Processor time that one run may take [s]. One that takes longer ends itself with ``timeout`` and what it has."""
    most_transitions: Count
    """A run with more ends itself with ``failed``."""


class Transition(Message):
    """One change of mode."""

    time: Number
    """[s]."""
    before: Side
    """Mode just before; the one of the start, or the ``after`` of the transition before this one."""
    after: Side
    """Mode just after; equal to ``before`` where the surface was touched only."""
    state: State
    """At the transition, in the order of ``states``."""


class Work(Message):
    """What one run has done; 0 where it is not counted."""

    steps: Count = 0
    """Accepted steps."""
    fields: Count = 0
    """Evaluations of a field."""
    guards: Count = 0
    """Evaluations of one guard each."""


class Program(Message):
    """Who answers."""

    name: Text
    version: Text
    """Of the program or, better, of the library in it."""


class Response(Message):
    """From the program, alone on its standard output."""

    protocol: Version
    """Version of the protocol."""
    program: Program
    status: Status
    """How the last run ended; ``unsupported``: it cannot do the problem; ``unavailable``: what it needs is missing."""
    reason: Text = ""
    """Why the status is not ``ok``: one sentence."""
    transitions: Annotated[list[Transition], FailFast()] = []
    """Of the last run, in order of time; all up to its end, however it ended."""
    end: Point | None = None
    """Where the last run ended; at ``until`` where the status is ``ok``. Null: where the last transition was."""
    max_surface_drift: Annotated[Number, Field(ge=0)] = 0.0
    """Largest abs(h) seen where the run claims to be on the surface [unit of h]."""
    wall_s: Annotated[list[Annotated[Number, Field(gt=0)]], FailFast()] = []
    """Wall time of each timed run by the program's own monotonic clock [s], as many as there were: of the run alone,
    without the program's start, reading, compiling and writing."""
    work: Work = Work()
    """Of the last run."""


def schema_text(message: type[Message]) -> str:
    """The JSON Schema of a message."""
    found: dict[str, Any] = message.model_json_schema()
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **found}, indent=1) + "\n"
