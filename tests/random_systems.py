"""Random Filippov systems, and the reference held against heyoka on them.

A system has 1-3 surfaces and 2-6 states; its field is made of linear and cubic damping, sines of states, products of
states, harmonic drives and signs (some of them times a state); cubic damping keeps it bounded. It is written as a
case file, so that what is found is a case already. As a script::

    python tests/random_systems.py DRAWS SEED

prints every disagreement as a case file, with what heyoka in multiprecision says of it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from henon_ref.errors import UnsupportedError
from henon_ref.model.case import parse_case
from henon_ref.registry import solver
from henon_ref.trajectory import Problem, Trajectory, Transition
from henon_ref.truth.simulate import simulate

TOLERANCE = 1e-15
CLOSE = 1e-9
"""Times that differ by more are a disagreement [s]; a chaotic growth of 1e6 within a run would be needed otherwise."""
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
    """A solver's run; None where it does not do such systems."""
    try:
        return solver(name).prepare(problem, rtol=TOLERANCE, atol=TOLERANCE, deadline=300)()
    except UnsupportedError:
        return None


def disagreement(ours: Trajectory, theirs: Trajectory, close: float = CLOSE) -> str:
    """What two runs differ in first; empty where they agree. Touches are left out: heyoka does not see them."""
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


def judged(problem: Problem) -> str:
    """What heyoka at 256 bits says: how it ends, and every transition."""
    truth = simulate(problem, 256)
    events = ", ".join(f"{e.before}->{e.after} {float(e.time):.17g}" for e in truth.events)
    return f"{truth.status} {truth.reason}: {events}"


def compared(draws: int, base: int, other: str = "heyoka", close: float = CLOSE) -> list[str]:
    """Hold the reference against another solver on so many draws; returns (and prints) what disagrees."""
    found: list[str] = []
    seen: list[int] = [0, 0]

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
        ours, theirs = run("henon", draw.problem), run(other, draw.problem)
        seen[0] += 1
        if ours is None or theirs is None:
            return
        seen[1] += len(ours.transitions)
        if text := disagreement(ours, theirs, close):
            found.append(text)
            print(f"--- draw {seen[0]} of seed {base}: {text}\n{draw.text}", flush=True)
            print("henon :", ours.status, [(t.kind, t.to_mode, t.time) for t in ours.transitions])
            print(f"{other}:", theirs.status, [(t.kind, t.to_mode, t.time) for t in theirs.transitions])
            print("256 bit:", judged(draw.problem), flush=True)

    compare()
    print(f"{seen[0]} systems, {seen[1]} transitions, {len(found)} disagreements (seed {base})")
    return found


if __name__ == "__main__":
    sys.exit(1 if compared(int(sys.argv[1]), int(sys.argv[2])) else 0)
