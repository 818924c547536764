"""Compare three routes on random scenes or systems: the reference, multiprecision, and a library.

As a script::

    python tests/support/random_scenes.py [--systems] [--seed 1] [--first 1] [--count 300]

runs scenes of a seed (:mod:`scene_draws`), or systems (:mod:`system_draws`), and prints one line for each (ends,
transitions, largest error of a time), the case file of each disagreement, and counts at the end.

The multiprecision route is the reference. A run is right if it has the same transitions, each with an error within a
bound times its conditioning (:mod:`henon_ref.harness.truth.conditioning`). Otherwise the problem may be ill-conditioned
(:mod:`henon_ref.harness.score.scoring`): an error of the size of the tolerance makes a transition appear or vanish. The
library is heyoka; if it is not right, another library runs, at several tolerances.

If a run is not right, or the exact run cannot continue, the states of all transitions and of the end are searched for a
loop: contacts at rest whose relative velocities are linearly dependent, for which no mode has equations.
"""

from __future__ import annotations

import argparse
import itertools
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np
import sympy as sp
from multiprecision import multiprecision
from scene_draws import scene
from system_draws import system

from henon_ref.casefile.case import parse_case
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.harness.registry import solver
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.scoring import score
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.modes.equations import along
from henon_ref.modes.kinks import visible
from henon_ref.modes.problem import Problem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

LIBRARIES = (("heyoka", 1e-13), ("scipy-dop853", 1e-12), ("scipy-dop853", 1e-10), ("scipy-dop853", 1e-8))
"""Tried in this order until one is right; DOP853 compares signs at the ends of a step, and misses pairs of roots."""
BOUNDS = {"henon": 1e-11, "heyoka": 1e-9, "scipy-dop853": 1e-6}
"""Largest error of a transition time [s] whose conditioning times the size of the state is at most 1 s."""
DEADLINE = 60.0
"""Processor time of one route on one scene [s]."""
NO_REST = "no rest is derived"
"""Part of the reason of a run that ends at an unsupported limit of impacts (``docs/scenes.md``)."""
EXPLAINED = ("ill-conditioned", "not unique", "not judged", "loop", NO_REST)
"""Verdicts on runs that the problem itself explains, and documented limits of the package."""
AT_REST = 1e-6
"""Relative velocity [m/s or rad/s] or distance below which it counts as zero at the end of a run."""


class OutOfTimeError(Exception):
    """A route took longer than :data:`DEADLINE`."""


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise :class:`OutOfTimeError` after some processor time [s]."""

    def ring(*_: object) -> None:
        raise OutOfTimeError

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@dataclass(frozen=True)
class Exact:
    """Result of the multiprecision route for a problem."""

    status: str
    reason: str
    expected: Expected


def exact_run(problem: Problem) -> Exact:
    """Result of the multiprecision route for a problem."""
    start, until = float(problem.start), float(problem.until)
    try:
        exact = multiprecision(problem)
    except ModelError as error:  # a mode has no equations
        return Exact("failed", str(error), Expected("ok", (), start, until, start, partial=True))
    transitions = visible(problem.system, exact.transitions)
    numbers = conditioning(problem, transitions)
    expected = Expected(
        status="ok" if exact.status == "failed" else exact.status,
        transitions=[replace(t, conditioning=c) for t, c in zip(transitions, numbers, strict=True)],
        start=start,
        until=until,
        end_time=float(exact.end_digits),
        near_grazes=exact.near_grazes,
        start_size=max(abs(float(v)) for v in problem.initial),
        partial=exact.status == "failed",
    )
    return Exact(exact.status, exact.reason, expected)


class Loops:
    """Whether zero relative velocities of friction contacts and stops are linearly dependent at a state."""

    def __init__(self, problem: Problem) -> None:
        system = problem.system
        arguments = (TIME, *system.states)
        self._contacts = []
        for i, (name, surface) in enumerate(zip(system.signs, system.surfaces, strict=True)):
            stop = i in system.resets
            if stop or name.name.startswith("s_"):
                speed = along(surface, system.states, system.field) if stop else surface
                both = [e.xreplace(system.parameters) for e in (surface, speed)]
                slopes = [sp.diff(both[1], x) for x in system.states]
                self._contacts.append([sp.lambdify(arguments, e) for e in (*both, slopes)])

    def at(self, time: float, state: Sequence[object]) -> bool:
        """Contacts of the same two bodies (parallel velocities) form no loop."""
        place = (time, *(float(str(v)) for v in state))
        rows: list[np.ndarray] = []
        for surface, speed, slopes in self._contacts:
            if abs(surface(*place)) < AT_REST and abs(speed(*place)) < AT_REST:
                row = np.array(slopes(*place), dtype=float)
                if all(np.linalg.matrix_rank(np.array([row, other])) == 2 for other in rows):
                    rows.append(row)
        return bool(rows) and int(np.linalg.matrix_rank(np.array(rows))) < len(rows)


def run(name: str, problem: Problem, rtol: float) -> Trajectory | None:
    """A solver's run; None if it does not support the system."""
    try:
        return solver(name).prepare(problem, rtol=rtol, atol=rtol, deadline=DEADLINE)()
    except UnsupportedError:
        return None
    except ModelError as error:  # as a worker of the campaign has it
        start = tuple(float(v) for v in problem.initial)
        return Trajectory("failed", (), float(problem.start), start, (), str(error))


@dataclass(frozen=True)
class Judged:
    """One solver's run against the exact one."""

    status: str
    error: float = 0.0
    """Of the worst time, over what conditioning grants [s]."""
    fault: str = ""
    word: str = ""
    """The verdict; empty where the run is right to within the bound."""
    end: tuple[float, tuple[float, ...]] = (0.0, ())
    """Time and state where the run ended."""


def judged(name: str, problem: Problem, exact: Exact, rtol: float) -> Judged:
    """Comparison of a solver's run with the exact one."""
    found, expected = run(name, problem, rtol), exact.expected
    if found is None:
        return Judged("unsupported")
    scored = score(found, expected, tolerance=rtol)
    excess = [
        (abs(scored.time_errors[i]) / max(1.0, expected.transitions[i].conditioning * expected.scale), i)
        for i, _ in scored.matching.pairs
    ]
    worst, at = max(excess, default=(0.0, 0))
    if scored.verdict.word != "right":
        fault = f"{name} is {scored.status} ({found.status} {found.reason}): {scored.verdict.basis}"
        return Judged(found.status, worst, fault, scored.verdict.word, (found.end_time, found.end_state))
    if worst > BOUNDS[name]:
        event = expected.transitions[at]
        fault = f"{name}: {event.kind} at {event.time!r} is {scored.time_errors[at]:.2g} s off"
        return Judged(found.status, worst, fault, "beyond the bound", (found.end_time, found.end_state))
    return Judged(found.status, worst)


@dataclass
class Tally:
    """Counts of the drawn scenes and of the results."""

    scenes: int = 0
    transitions: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    connections: Counter[str] = field(default_factory=Counter)
    """In how many scenes each kind is."""
    ends: Counter[str] = field(default_factory=Counter)
    """Of the exact run, ``henon`` and the first library."""
    explained: Counter[str] = field(default_factory=Counter)
    """Verdict: in how many runs it explains a disagreement."""
    worst: dict[str, float] = field(default_factory=dict)
    """Solver: the worst error of a time over what its conditioning grants [s]."""
    seconds: Counter[str] = field(default_factory=Counter)
    """Processor time of each route [s]."""
    not_explained: list[str] = field(default_factory=list)


class Comparison:
    """Compares the routes on one scene after another; prints and counts the results."""

    def __init__(self) -> None:
        self.tally = Tally()

    def compare(self, number: int, text: str) -> None:
        """One scene."""
        problem, tally, words = parse_case(text).readings[0].problem, self.tally, []
        tally.scenes += 1
        for what in ("restitution", "stiffness: ", "static", "normal", "sign(", "max(", "piecewise", "inertia"):
            tally.connections[what.strip("(: ")] += what in text
        try:
            with self._clock("exact"), deadline(DEADLINE):
                exact = exact_run(problem)
        except OutOfTimeError:
            tally.ends["exact timeout"] += 1
            print(f"{number}: exact out of time\n{text}", flush=True)
            return
        tally.transitions += len(exact.expected.transitions)
        tally.kinds.update(t.kind for t in exact.expected.transitions)
        tally.ends[f"exact {exact.status}"] += 1
        words.append(f"exact {exact.status}, {len(exact.expected.transitions)} transitions")
        with self._clock("henon"):
            own = judged("henon", problem, exact, 1e-13)
        tally.ends[f"henon {own.status}"] += 1
        tally.worst["henon"] = max(tally.worst.get("henon", 0), own.error)
        words.append(f"henon {own.status}, off {own.error:.1e}")
        asked = self._library(problem, exact)
        tally.ends[f"{asked[0][0]} {asked[0][1].status}"] += 1
        words += [f"{name} {found.status}, off {found.error:.1e}" for name, found in asked]
        places = [(t.time, t.state) for t in exact.expected.transitions]
        places += [found.end for found in (own, *(found for _, found in asked)) if found.word and found.end[1]]
        troubled = exact.status == "failed" or own.word or asked[-1][1].word
        excuse = NO_REST if NO_REST in exact.reason else ""
        if troubled and any(itertools.starmap(Loops(problem).at, places)):
            excuse = "loop"
        if exact.status == "failed":
            words.append(self._told("exact", excuse or "failed", f"exact run fails: {exact.reason}", number))
        for name, found in (("henon", own), asked[-1]):
            if found.word:
                words.append(self._told(name, excuse or found.word, found.fault, number))
        if len(asked) > 1 and not asked[-1][1].word:
            tally.explained[f"{asked[-1][0]} right where {asked[-2][0]} is not"] += 1
            words.append(asked[-2][1].fault)
        print(f"{number}: " + "; ".join(words), flush=True)
        if troubled:
            print(text, flush=True)

    def _library(self, problem: Problem, exact: Exact) -> list[tuple[str, Judged]]:
        """Run libraries and tolerances in order until one is right, or its disagreement is explained."""
        found: list[tuple[str, Judged]] = []
        for name, rtol in LIBRARIES:
            with self._clock(name):
                own = judged(name, problem, exact, rtol)
            found.append((f"{name} {rtol:g}", own))
            if not own.word or own.word in EXPLAINED:
                self.tally.worst[name] = max(self.tally.worst.get(name, 0), own.error)
                break
        return found

    def _told(self, who: str, word: str, fault: str, number: int) -> str:
        """Count a disagreement, and return its text for the line."""
        if word in EXPLAINED:
            self.tally.explained[f"{who}: {word}"] += 1
        else:
            self.tally.not_explained.append(f"scene {number}, {who}: {fault} [{word}]")
        return f"{fault} [{word}]"

    @contextmanager
    def _clock(self, name: str) -> Iterator[None]:
        began = process_time()
        try:
            yield
        finally:
            self.tally.seconds[name] += process_time() - began


def compared(base: int, numbers: Iterable[int], draw: Callable[[int, int], str] = scene) -> list[str]:
    """Compare the routes on some scenes (or other draws) of a seed; return the unexplained disagreements."""
    comparison = Comparison()
    for number in numbers:
        comparison.compare(number, draw(base, number))
        if number % 20 == 0:
            print(comparison.tally, flush=True)
    print(comparison.tally, flush=True)
    return comparison.tally.not_explained


def main() -> int:
    """Command line; see the docstring of the module."""
    parser = argparse.ArgumentParser(description="Random scenes, three routes held against each other.")
    parser.add_argument("--systems", action="store_const", const=system, default=scene, dest="draw")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=1, help="number of the first scene")
    parser.add_argument("--count", type=int, default=300, help="scenes from that on")
    asked = parser.parse_args()
    return 1 if compared(asked.seed, range(asked.first, asked.first + asked.count), asked.draw) else 0


if __name__ == "__main__":
    sys.exit(main())
