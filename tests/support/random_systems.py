"""Compare the reference with heyoka on random Filippov systems.

A system has 1-3 surfaces and 2-6 states; its field is made of linear and cubic damping, sines of states, products of
states, harmonic drives and signs (some of them times a state); cubic damping keeps it bounded. It is written as a
case file, so that what is found is a case already. As a script::

    python tests/support/random_systems.py DRAWS SEED

prints every disagreement as a case file, with what heyoka in 256 bits says of it, and what was drawn.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, field, replace
from math import inf

import sympy as sp
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from multiprecision import multiprecision

from henon_ref.casefile.case import parse_case
from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory, Transition

TOLERANCE = 1e-15
CLOSE = 1e-9
"""Times that differ by more are a disagreement [s], to be explained."""
BOUND = 1e-11
"""Error of a well-conditioned transition time [s] (and by its conditioning more)."""
NAMES = ("x", "y", "z", "p", "q", "r")
SIGNS = ("s", "u", "w")


@dataclass(frozen=True)
class Draw:
    """One random system."""

    text: str
    """The case file."""
    problem: Problem


def _number(low: float, high: float) -> st.SearchStrategy[str]:
    """A decimal with two places; never 0."""
    whole = st.integers(round(100 * low), round(100 * high)).filter(bool)
    return whole.map(lambda n: f"{n / 100:.2f}".rstrip("0").rstrip("."))


@st.composite
def _component(draw: st.DrawFn, state: str, states: list[str], signs: list[str], friction: str | None) -> str:
    others = st.sampled_from(states)
    terms = [f"-({draw(_number(0.05, 0.6))})*{state}", f"-({draw(_number(0.05, 0.5))})*{state}^3"]
    for _ in range(draw(st.integers(1, 2))):
        kind = draw(st.sampled_from(["sine", "linear", "product"]))
        factor = draw(_number(-1.5, 1.5) if kind != "product" else _number(-0.2, 0.2))
        one = draw(others)
        terms.append(f"({factor})*" + {"sine": f"sin({one})", "linear": one, "product": f"{one}*{draw(others)}"}[kind])
    if draw(st.booleans()):
        terms.append(f"({draw(_number(-2, 2))})*cos(({draw(_number(0.3, 4))})*t + ({draw(_number(-3, 3))}))")
    for sign in signs:
        if draw(st.booleans()):
            scale = f"*(1 + ({draw(_number(-0.3, 0.3))})*{draw(others)})" if draw(st.booleans()) else ""
            terms.append(f"({draw(_number(-1.5, 0.7))})*{sign}{scale}")
    if friction:  # a surface that attracts, so that there are sticks, several at once, and releases
        terms.append(f"({draw(_number(-2.5, -0.6))})*{friction}")
    return " + ".join(terms)


@st.composite
def _surface(draw: st.DrawFn, index: int, states: list[str]) -> str:
    here, other = states[index], draw(st.sampled_from(states))
    kind = draw(st.sampled_from(["plane", "plane", "moving", "curved", "circle"]))
    away = f"({draw(_number(-0.8, 0.8))})"
    return {
        "plane": f"{here} + {away}",
        "moving": f"{here} + {away}*sin(({draw(_number(0.3, 3))})*t)",
        "curved": f"{here} + ({draw(_number(-0.4, 0.4))})*{other}^2 + {away}",
        "circle": f"{here}^2 + ({draw(_number(0.3, 1.5))})*{states[index - 1]}^2 - {draw(_number(0.2, 1.5))}",
    }[kind]


@st.composite
def systems(draw: st.DrawFn) -> Draw:
    """Bounded Filippov systems with 1-3 surfaces and 2-6 states."""
    surfaces = draw(st.integers(1, 3))
    states = list(NAMES[: draw(st.integers(max(2, surfaces), 6))])
    signs = list(SIGNS[:surfaces])
    lines = ["schema: 1", "name: random_system", "title: A random system", "system:"]
    lines += [f"  state: [{', '.join(states)}]", "  surfaces:"]
    lines += [f'    {sign}: "{draw(_surface(i, states))}"' for i, sign in enumerate(signs)]
    lines += ["  field:"]
    sticky = draw(st.booleans())
    for i, state in enumerate(states):
        friction = signs[i] if sticky and i < surfaces else None
        lines.append(f'    - "{draw(_component(state, states, signs, friction))}"')
    lines += ["initial: {" + ", ".join(f"{state}: {draw(_number(-2, 2))}" for state in states) + "}", "until: 12", ""]
    text = "\n".join(lines)
    return Draw(text, parse_case(text).readings[0].problem)


def run(name: str, problem: Problem) -> Trajectory | None:
    """A solver's run; None if it does not support the system."""
    try:
        return solver(name).prepare(problem, rtol=TOLERANCE, atol=TOLERANCE, deadline=60)()
    except UnsupportedError:
        return None


def disagreement(ours: Trajectory, theirs: Trajectory, close: float = CLOSE) -> str:
    """First difference of two runs; empty if they agree. Touches are left out, since heyoka does not find them."""
    a, b = ([t for t in run.transitions if t.kind != "graze"] for run in (ours, theirs))
    for i, (t, u) in enumerate(zip(a, b, strict=False)):
        if (t.surface, t.from_mode, t.to_mode) != (u.surface, u.from_mode, u.to_mode):
            return f"transition {i}: {_shown(t)}, {_shown(u)}"
        if abs(t.time - u.time) > close:
            return f"transition {i}: {_shown(t)}, {_shown(u)}, {abs(t.time - u.time):.2g} s apart"
    if len(a) != len(b):
        longer = a if len(a) > len(b) else b
        return f"{len(a)} and {len(b)} transitions; in one only: {_shown(longer[min(len(a), len(b))])}"
    if ours.status != theirs.status:
        return f"{ours.status} ({ours.reason}) and {theirs.status} ({theirs.reason})"
    return ""


def _shown(transition: Transition) -> str:
    return f"{transition.from_mode} -> {transition.to_mode} at {transition.time!r}"


def error_beyond_conditioning(problem: Problem, ours: Trajectory, theirs: Trajectory) -> str:
    """Error of the reference up to the difference of two runs, by 256 bits; empty if it is right.

    Right is: the exact transitions with the exact modes, each with an error of at most ``BOUND`` times its
    conditioning (see :mod:`henon_ref.harness.truth.conditioning`) times the size of the state.
    """
    a, b = ([t for t in run.transitions if t.kind != "graze"] for run in (ours, theirs))
    differ = next((i for i, (t, u) in enumerate(zip(a, b, strict=False)) if disagreeing(t, u)), min(len(a), len(b)))
    last = max((run[differ].time for run in (a, b) if differ < len(run)), default=inf)
    cut = last + 1e-3 < float(problem.until)
    if cut:
        problem = replace(problem, until=sp.Rational(last + 1e-3))
    exact = multiprecision(problem)
    events = [t for t in exact.transitions if t.kind != "graze"]
    within = [t for t in a if t.time <= float(exact.end_digits)]
    for i, (t, e, c) in enumerate(zip(within, events, conditioning(problem, events), strict=False)):
        allowed = BOUND * max(1.0, c * max(1.0, *map(abs, t.state)))
        error = abs((t.time - e.time) + (t.time_low - e.time_low))
        if (t.surface, t.from_mode, t.to_mode) != (e.surface, e.from_mode, e.to_mode) or error > allowed:
            return f"transition {i} is {_shown(t)}, exactly {e.from_mode} -> {e.to_mode} at {e.time!r} (x {c:.2g})"
    if len(within) != len(events):
        return f"{len(within)} transitions, exactly {len(events)}"
    if exact.status != ours.status and not (cut and exact.status == "ok"):
        return f"{ours.status}, exactly {exact.status}: {exact.reason}{exact.undecided}"
    return ""


def disagreeing(t: Transition, u: Transition, close: float = CLOSE) -> bool:
    """Whether two transitions differ."""
    return (t.surface, t.from_mode, t.to_mode) != (u.surface, u.from_mode, u.to_mode) or abs(t.time - u.time) > close


@dataclass
class Tally:
    """Counts of the drawn systems."""

    systems: int = 0
    transitions: int = 0
    surfaces: Counter[int] = field(default_factory=Counter)
    """Number of surfaces: how many systems."""
    ends: Counter[str] = field(default_factory=Counter)
    """Status of the reference: how many systems."""
    sticks: int = 0
    """Systems in which a surface slides."""
    together: int = 0
    """Systems in which several slide at once."""
    releases: int = 0
    """Systems in which a surface is let go."""
    explained: int = 0
    """Disagreements in which 256 bits find the reference right to within its conditioning."""

    def add(self, problem: Problem, run: Trajectory) -> None:
        """Count one system."""
        modes = [t.to_mode for t in run.transitions]
        self.systems += 1
        self.transitions += len(modes)
        self.surfaces[len(problem.system.surfaces)] += 1
        self.ends[run.status] += 1
        self.sticks += any(0 in mode for mode in modes)
        self.together += any(mode.count(0) > 1 for mode in modes)
        self.releases += any(t.kind == "release" for t in run.transitions)


def compared(draws: int, base: int, other: str = "heyoka", close: float = CLOSE) -> list[str]:
    """Compare the reference with another solver on some draws; return and print the unexplained differences."""
    found: list[str] = []
    tally = Tally()
    drawn = [0]

    @seed(base)
    @settings(
        max_examples=draws,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(systems())
    def compare(draw: Draw) -> None:
        drawn[0] += 1
        ours, theirs = run("henon", draw.problem), run(other, draw.problem)
        if ours is None or theirs is None:
            return
        tally.add(draw.problem, ours)
        if text := disagreement(ours, theirs, close):
            fault = error_beyond_conditioning(draw.problem, ours, theirs)
            tally.explained += not fault
            print(
                f"--- draw {drawn[0]} of seed {base}: {text}: {fault or 'the reference is right'}\n{draw.text}",
                flush=True,
            )
            if fault:
                found.append(f"{text}: {fault}")
        if drawn[0] % 20 == 0:
            print(drawn[0], tally, flush=True)

    compare()
    print(f"{drawn[0]} draws (seed {base}), {len(found)} disagreements not explained: {tally}")
    return found


if __name__ == "__main__":
    sys.exit(1 if compared(int(sys.argv[1]), int(sys.argv[2])) else 0)
