"""Made-up solvers with a prescribed behaviour, and truths made from a list of times."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jobs import burn, send_all

from henon_ref.casefile.case import Case, parse_case
from henon_ref.errors import UnsupportedError
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.truth.reference import Truth
from henon_ref.jit.processor_time import compiling
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Counts, Trajectory, Transition

TIMES = (0.5, 1.25, 2.0, 3.5, 4.0)
CASE = """
schema: 1
name: {name}
title: A made-up system
source: none
system:
  state: [x]
  parameters: {{F: 1}}
  surfaces: {{s: x}}
  field: ["cos(t) - F*s"]
initial: {{t: 0, x: 1}}
until: 5
measure: {{after: 1}}
published: {{stick_durations: [0.75]}}
solvers: [henon, heyoka]
tolerances: [1e-3, 1e-6]
gate: {{henon: {{max_time_error: 1e-5}}}}
"""


def case(name: str = "made_up", text: str = CASE) -> Case:
    """A small case, which the tests do not integrate."""
    return parse_case(text.format(name=name))


@dataclass(frozen=True)
class Reference:
    """A transition of a made-up truth."""

    kind: str
    surface: int
    from_mode: tuple[int, ...]
    to_mode: tuple[int, ...]
    time: float
    time_low: float = 0.0
    radius: float = 1e-30
    conditioning: float = 1.0
    transversality: float = 1.0
    state: tuple[str, ...] = ("0.25",)
    proven: bool = True
    closed_form: bool = False


_CYCLE = (("stick", 1, 0), ("release", 0, -1), ("crossing", -1, 1))


def reference(times: tuple[float, ...] = TIMES) -> tuple[Reference, ...]:
    """Transitions stick, release, crossing, stick, ... at these times."""
    return tuple(
        Reference(kind, 0, (before,), (after,), t)
        for i, t in enumerate(times)
        for kind, before, after in [_CYCLE[i % len(_CYCLE)]]
    )


def expected(times: tuple[float, ...] = TIMES, **changes: object) -> Expected:
    """Reference of scoring."""
    return replace(Expected("ok", reference(times), 0.0, 5.0, 5.0), **changes)


def found(times: tuple[float, ...] = TIMES, error: float = 0.0) -> tuple[Transition, ...]:
    """The same transitions as a solver reports them, with a time error."""
    return tuple(
        Transition(e.kind, 0, e.from_mode, e.to_mode, e.time + error, (0.25,), landing="fake") for e in reference(times)
    )


def trajectory(transitions: tuple[Transition, ...], status: str = "ok", **changes: object) -> Trajectory:
    """A run with these transitions."""
    whole = Trajectory(status, transitions, 5.0, (0.0,), (1,), counts=Counts(10, 40, 20), max_surface_drift=1e-14)
    return whole._replace(**changes)


def truth(case: object = None, reading: object = None) -> Truth:
    """Takes the place of ``compute.truth_for``."""
    return truth_of(expected())


def truth_of(exact: Expected, reason: str = "", **changes: object) -> Truth:
    """The truth that is converted to this reference of scoring."""
    status, methods = "failed" if exact.partial else exact.status, (("made up", (256,), 0.1),)
    whole = Truth(
        "made_up", "default", "", status, reason, repr(exact.end_time), 0.0, exact.transitions, exact.near_grazes,
        methods, certified=True,
    )  # fmt: skip
    return replace(whole, **changes)


@dataclass(frozen=True)
class Fake:
    """A solver whose time errors equal its tolerance; it can also fail in prescribed ways."""

    name: str = "fake"
    what: str = "right"
    log: str = ""
    """A file to which each run adds a line."""
    fixed_step: bool = False
    landing: str = "fake"
    version: str = "1.0"

    def prepare(self, problem: Problem, *, rtol=None, atol=None, step=None, sample_times=None, deadline=None):
        if self.what == "unsupported":
            raise UnsupportedError("it cannot")
        if self.what == "prepares nothing":
            return None
        if self.what == "prepares forever":
            _hangs(0.0, 0.0)
        error = step if self.fixed_step else rtol

        def run() -> Trajectory:
            if self.log:
                with open(self.log, "a", encoding="utf-8") as file:
                    file.write(f"{self.name} {error:g}\n")
            return _behaviour(self.what)(error, deadline)

        return run


def _right(error: float, deadline: float) -> Trajectory:
    return trajectory(found(error=error))


def _misses(error: float, deadline: float) -> Trajectory:
    return trajectory(found(error=error)[:2] + found(error=error)[3:])


def _raises(error: float, deadline: float) -> Trajectory:
    raise ArithmeticError("the Newton iteration failed")


def _hangs(error: float, deadline: float) -> Trajectory:
    while True:
        time.sleep(1)


def _crashes(error: float, deadline: float) -> Trajectory:
    os.kill(os.getpid(), signal.SIGSEGV)
    return _right(error, deadline)


def _once(what: Callable[[float, float], Trajectory]) -> Callable[[float, float], Trajectory]:
    """Right in the first run of a worker at each setting, and different later."""
    seen: set[float] = set()

    def run(error: float, deadline: float) -> Trajectory:
        if error in seen:
            return what(error, deadline)
        seen.add(error)
        return _right(error, deadline)

    return run


def _stops(error: float, deadline: float) -> Trajectory:
    return trajectory(found(error=error)[:3], "timeout", end_time=2.5, reason="stopped after the deadline")


def _chatters(error: float, deadline: float) -> Trajectory:
    """Many spurious transitions at a loose tolerance; right at other tolerances."""
    if error < 1e-4:
        return _right(error, deadline)
    first, second = found()[:2]
    false = [replace((second, first)[k % 2], time=1.25 + 0.001 * k) for k in range(1, 9)]
    return trajectory((first, second, *false), "timeout", end_time=1.3, reason="stopped after the deadline")


def _answers(error: float, deadline: float) -> int:
    return 42


def _burns(error: float, deadline: float) -> Trajectory:
    burn(1.5 * deadline + 1.0)
    return _right(error, deadline)


def _sleeps(error: float, deadline: float) -> Trajectory:
    time.sleep(1.5 * deadline)
    return _right(error, deadline)


def _compiles(error: float, deadline: float) -> Trajectory:
    with compiling():
        burn(1.5 * deadline + 1.0)
    return _right(error, deadline)


def _sends_stray_bytes(error: float, deadline: float) -> Trajectory:
    send_all(b"\0\0\0\x04")
    return _right(error, deadline)


def _numpy(error: float, deadline: float) -> Trajectory:
    """Result with NumPy arrays and numbers."""
    events = [
        replace(
            e, surface=np.int64(0), from_mode=np.array(e.from_mode), time=np.float64(e.time), state=np.array(e.state)
        )
        for e in found(error=error)
    ]
    return trajectory(events, counts=Counts(*np.array([10, 40, 20])), end_state=np.zeros(1), end_mode=np.ones(1, int))


@cache
def _behaviour(what: str) -> Callable[[float, float], Trajectory]:
    """What a function above is named; of "raises later" the first run of a worker at each setting is right."""
    name = what.removesuffix(" later")
    act = globals()[f"_{name.replace(' ', '_')}"]
    return act if name == what else _once(act)


SOUND = Fake("sound")
