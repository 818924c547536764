"""Random scenes, and three routes held against each other on them: the reference, multiprecision, and a library.

A scene has 2 to 6 bodies (masses, a wall, a belt whose motion is given), springs, dampers and forces, 1 to 4 friction
contacts of every law, with and without static friction, viscous part and load, and up to 2 stops. It is written as a
case file, so that what is found is a case already. As a script::

    python tests/support/random_scenes.py DRAWS SEED

prints every disagreement as a case file, with its reason, and what was drawn.

The multiprecision route says what is right. A run is right where it has the same transitions, each with an error within
a bound times its conditioning (see :mod:`henon_ref.truth.conditioning`). Where it has not, the question may be to blame
(:mod:`henon_ref.score.verdict`): an error that its tolerance grants makes a transition appear or vanish.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, field, replace

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from multiprecision import multiprecision

from henon_ref.casefile.case import parse_case
from henon_ref.errors import UnsupportedError
from henon_ref.filippov.kinks import visible
from henon_ref.filippov.problem import Problem
from henon_ref.registry import solver
from henon_ref.score.errors import score
from henon_ref.score.reference import Expected
from henon_ref.trajectory import Trajectory
from henon_ref.truth.conditioning import conditioning

HARD_STOPS = False
"""Whether stops may be hard, with ``restitution``."""
COUPLED_CONTACTS = False
"""Whether two contacts may act on one mass."""
HORIZON = 4
"""[s]."""
LIBRARY = "scipy-dop853"
TOLERANCES = {"henon": (1e-13,), LIBRARY: (1e-12, 1e-10, 1e-8)}
"""Tried one after the other: a library that looks at the ends of its steps alone steps over pairs of roots at some."""
BOUNDS = {"henon": 1e-11, LIBRARY: 1e-6}
"""Error of a transition's time [s] where its conditioning times the size of the state is at most 1 s."""
DEADLINE = 120.0
"""Processor time of a run [s]."""


@dataclass(frozen=True)
class Draw:
    """One random scene."""

    text: str
    """The case file."""
    problem: Problem


def _number(low: float, high: float) -> st.SearchStrategy[str]:
    """A decimal with three places; never 0."""
    whole = st.integers(round(1000 * low), round(1000 * high)).filter(bool)
    return whole.map(lambda n: f"{n / 1000:.3f}".rstrip("0").rstrip("."))


@st.composite
def _friction(draw: st.DrawFn, p: str, q: str) -> str:
    law = draw(st.sampled_from(["coulomb", "coulomb", "stribeck", "stribeck_exp"]))
    force = draw(_number(0.2, 1))
    keys = [f"law: {law}, force: {force}"]
    if law == "stribeck":
        keys.append(f"slope: {draw(_number(0.2, 3))}")
    if law == "stribeck_exp":
        keys.append(f"velocity: {draw(_number(0.2, 2))}")
    if draw(st.booleans()):
        keys.append(f"static: {float(force) + float(draw(_number(0.05, 0.8))):.3f}")
    if draw(st.integers(0, 2)) == 0:
        keys.append(f"viscous: {draw(_number(0.01, 0.3))}")
    if draw(st.integers(0, 3)) == 0:
        keys.append(f'normal: "1 + {draw(_number(-0.9, 1.5))}*cos({draw(_number(0.5, 3))}*t)"')
    return f"friction: {{between: [{p}, {q}], {', '.join(keys)}}}"


@st.composite
def _stop(draw: st.DrawFn, mass: str) -> str:
    between = draw(st.sampled_from([f"[{mass}, wall]", f"[wall, {mass}]"]))
    if HARD_STOPS and draw(st.booleans()):
        how = f"restitution: {draw(_number(0.3, 0.9))}"
    else:
        how = f"stiffness: {draw(_number(5, 60))}"
        if draw(st.booleans()):
            how += f", damping: {draw(_number(0.1, 3))}"
    return f"stop: {{between: {between}, gap: -{draw(_number(0.3, 1.2))}, {how}}}"


@st.composite
def _contacts(draw: st.DrawFn, masses: list[str]) -> list[str]:
    """Friction contacts, of a mass with the belt, the wall, or another mass."""
    found, free = [], list(masses)
    for _ in range(draw(st.integers(1, 4))):
        if not free:
            break
        p = draw(st.sampled_from(free))
        others = [m for m in (masses if COUPLED_CONTACTS else free) if m != p]
        q = draw(st.sampled_from(["belt", "wall", *others]))
        pair = f"[{p}, {q}]"
        if any(pair in one or f"[{q}, {p}]" in one for one in found):
            continue
        found.append(draw(_friction(p, q)))
        if not COUPLED_CONTACTS:
            free = [m for m in free if m not in (p, q)]
    return found


@st.composite
def scenes(draw: st.DrawFn) -> Draw:
    """Scenes of 1 to 4 masses before a wall and on a belt."""
    masses = list("abcd"[: draw(st.integers(1, 4))])
    lines = ["schema: 1", "name: random_scene", "title: A random scene", "scene:", "  bodies:"]
    lines += [f"    {m}: {{mass: {draw(_number(0.5, 2))}}}" for m in masses]
    belt = draw(st.sampled_from(["steady", "shaken"]))
    moved = f"{draw(_number(0.1, 0.8))}*sin({draw(_number(0.5, 4))}*t)"
    lines += [
        f"    belt: {{velocity: {draw(_number(-0.8, 0.8))}}}"
        if belt == "steady"
        else f"    belt: {{position: {moved}}}"
    ]
    lines += ["    wall: fixed", "  connections:"]
    connections = []
    for i, m in enumerate(masses):
        cubic = f", cubic: {draw(_number(0.05, 0.5))}" if draw(st.booleans()) else ""
        connections.append(f"spring: {{between: [{m}, wall], stiffness: {draw(_number(0.3, 3))}{cubic}}}")
        if i and draw(st.booleans()):
            connections.append(f"spring: {{between: [{m}, {masses[i - 1]}], stiffness: {draw(_number(0.2, 2))}}}")
        if draw(st.integers(0, 2)) == 0:
            connections.append(f"damper: {{between: [{m}, wall], coefficient: {draw(_number(0.02, 0.4))}}}")
        if draw(st.booleans()):
            wave = f"{draw(_number(0.3, 2))}*cos({draw(_number(0.4, 4))}*t + {draw(_number(0.1, 3))})"
            connections.append(f'force: {{on: {m}, value: "{wave}"}}')
    connections += draw(_contacts(masses))
    stopped = draw(st.lists(st.sampled_from(masses), max_size=2, unique=True))
    connections += [draw(_stop(m)) for m in stopped]
    lines += [f"    - {one}" for one in connections]
    states = [f"x_{m}: {draw(_number(-1.5, 1.5))}, v_{m}: {draw(_number(-2, 2))}" for m in masses]
    lines += [f"initial: {{{', '.join(states)}}}", f"until: {HORIZON}", ""]
    text = "\n".join(lines)
    return Draw(text, parse_case(text).readings[0].problem)


def expected_of(problem: Problem) -> Expected:
    """What the multiprecision route says of a problem."""
    exact = multiprecision(problem)
    transitions = visible(problem.system, exact.transitions)
    numbers = conditioning(problem, transitions)
    return Expected(
        status="ok" if exact.status == "failed" else exact.status,
        transitions=[replace(t, conditioning=c) for t, c in zip(transitions, numbers, strict=True)],
        start=float(problem.start),
        until=float(problem.until),
        end_time=float(exact.end_digits),
        near_grazes=exact.near_grazes,
        start_size=max(abs(float(v)) for v in problem.initial),
        partial=exact.status == "failed",
    )


def run(name: str, problem: Problem, rtol: float) -> Trajectory | None:
    """A solver's run; None where it does not do such systems."""
    try:
        return solver(name).prepare(problem, rtol=rtol, atol=rtol, deadline=DEADLINE)()
    except UnsupportedError:
        return None


def fault(name: str, found: Trajectory, expected: Expected, rtol: float) -> tuple[str, str]:
    """What a run has wrong, and its verdict; both empty where it is right to within the bound."""
    scored = score(found, expected, tolerance=rtol)
    if scored.verdict.word != "right":
        return f"{name} is {scored.status} ({found.status} {found.reason}): {scored.verdict.basis}", scored.verdict.word
    for i, _ in scored.matching.pairs:
        event = expected.transitions[i]
        allowed = BOUNDS[name] * max(1.0, event.conditioning * expected.scale)
        if abs(scored.time_errors[i]) > allowed:
            return f"{name}: {event.kind} at {event.time!r} is {scored.time_errors[i]:.2g} s off", "beyond the bound"
    return "", ""


@dataclass
class Tally:
    """What the draws were like."""

    scenes: int = 0
    transitions: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    surfaces: Counter[int] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    """Of the exact run; ``partial``: multiprecision could not go on."""
    unsupported: Counter[str] = field(default_factory=Counter)
    explained: Counter[str] = field(default_factory=Counter)
    """Verdict: in how many runs it explains a disagreement."""


def compared(draws: int, base: int | None = None) -> list[str]:
    """Hold the three routes against each other on so many draws; returns (and prints) what is not explained.

    Parameters
    ----------
    draws : int
    base : int, optional
        The seed; without one the draws are always the same ones (``derandomize``).
    """
    found: list[str] = []
    tally = Tally()

    def compare(draw: Draw) -> None:
        expected = expected_of(draw.problem)
        tally.scenes += 1
        tally.transitions += len(expected.transitions)
        tally.kinds.update(t.kind for t in expected.transitions)
        tally.surfaces[len(draw.problem.system.surfaces)] += 1
        tally.ends["partial" if expected.partial else expected.status] += 1
        for name in TOLERANCES:
            what, word = "", ""
            for rtol in TOLERANCES[name]:
                own = run(name, draw.problem, rtol)
                if own is None:
                    tally.unsupported[name] += 1
                    break
                what, word = fault(name, own, expected, rtol)
                if not word:
                    tally.explained.update([f"{name}: right at {rtol:g} alone"] if rtol != TOLERANCES[name][0] else [])
                    break
            if word in ("ill-conditioned", "not unique", "not judged"):
                tally.explained[f"{name}: {word}"] += 1
            elif word:
                found.append(f"{what} [{word}]")
            if word:
                print(f"--- scene {tally.scenes} of seed {base}: {what} [{word}]\n{draw.text}", flush=True)
        if tally.scenes % 20 == 0:
            print(tally, flush=True)

    limits = settings(
        max_examples=draws,
        deadline=None,
        database=None,
        derandomize=base is None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    test = limits(given(scenes())(compare))
    (test if base is None else seed(base)(test))()
    print(f"{tally.scenes} scenes (seed {base}), {len(found)} disagreements not explained: {tally}")
    return found


if __name__ == "__main__":
    sys.exit(1 if compared(int(sys.argv[1]), int(sys.argv[2])) else 0)
