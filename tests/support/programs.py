"""Programs in place of solvers in other languages: each is a line of Python."""

from __future__ import annotations

import json
import sys

from henon_ref.baselines.protocol.messages import VERSION, Request
from henon_ref.baselines.protocol.problem_text import problem_text
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.casefile.case import parse_case
from henon_ref.modes.problem import Problem

PRELUDE = "import json, os, sys, time; request = json.load(sys.stdin); "
FINE = {
    "protocol": 1,
    "program": {"name": "fake", "version": "1"},
    "status": "ok",
    "transitions": [{"time": 1.0, "before": -1, "after": 1, "state": [0.0]}],
    "end": {"time": 2.0, "state": [1.0], "mode": 1},
    "wall_s": [0.001],
}
"""A right response to :func:`ramp`."""


RAMP = """
schema: 1
name: ramp
title: A state that crosses zero once
source: none
system: {state: [x], surfaces: {s: x}, field: ["1"]}
initial: {t: 0, x: -1}
until: 2
exact: {transition_times: ["1"]}
tolerances: [1e-6]
"""


def ramp() -> Problem:
    """x' = 1 from -1 to t = 2: one crossing of x = 0, at t = 1."""
    return parse_case(RAMP).readings[0].problem


def request(problem: Problem | None = None, **changes: object) -> Request:
    """The request for a problem whose start is on the negative side."""
    text = problem_text(problem or ramp(), (-1,))
    given = {"rtol": 1e-6, "atol": 1e-6, "step": None, "untimed": 0, "timed": 1, "seconds": 1.0}
    return Request(protocol=VERSION, problem=text, most_transitions=100, **(given | changes))


def program(code: str, name: str = "fake") -> ProgramSolver:
    """A solver whose program is this code; ``request`` is the request that it has read."""
    return ProgramSolver(name, (sys.executable, "-c", PRELUDE + code), landing="none")


def answer(**changes: object) -> str:
    """Code of a program that writes :data:`FINE` with these changes, and as many times as were wanted."""
    found = FINE | changes
    times = "" if "wall_s" in changes else "; found['wall_s'] = [1e-3] * request['timed']"
    return f"found = json.loads({json.dumps(found)!r}){times}; print(json.dumps(found))"
