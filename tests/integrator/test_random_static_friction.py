"""Static friction where something else happens at the same instant: runs beside SciPy, whose driver has its own events.

Numbers are round on purpose: a load reaches its limit at a kink, two contacts let go together.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from often import daily

import henon_ref as hr
from henon_ref.harness.registry import solver
from henon_ref.simulation.arguments import problem_of

Draw = Callable[[random.Random], tuple[hr.System, dict[str, float]]]
FORCE, STATIC, VELOCITY = 0.6, 1.0, 0.5


def pulled(draw: random.Random) -> tuple[hr.System, dict[str, float]]:
    """A block held by a belt, pulled by a spring whose stiffness changes at a kink."""
    place, change = draw.choice([0.5, 0.9, 1]), draw.choice([-2, -1, 1, 2])
    bent = f"(1 + k)/2*({change})*(x - {place})"
    ends = [
        {"when": f"-x + {bent} - Fs", "direction": "rising", "to": 1},
        {"when": f"-x + {bent} + Fs", "direction": "falling", "to": -1},
    ]
    system = hr.System(
        ["x", "v"], {"F": FORCE, "Fs": STATIC, "vb": VELOCITY}, {"s": "v - vb", "k": f"x - {place}"},
        ["v", f"-x - F*s + {bent}"],
        sliding={"s": {"field": ["vb", "0"], "release": ends, "entry": "inside"}},
    )  # fmt: skip
    return system, {"x": draw.choice([0.0, 0.5, round(draw.uniform(-1, 1), 2)]), "v": VELOCITY}


def stacked(draw: random.Random) -> tuple[hr.System, dict[str, float]]:
    """A block on another one, which lies on a belt."""
    scene = hr.Scene()
    belt = scene.prescribed("belt", velocity=VELOCITY)
    lower, upper = scene.body("lower", mass=1), scene.body("upper", mass=draw.choice([1, 2]))
    scene.spring(lower, scene.wall, stiffness=1)
    scene.spring(upper, scene.wall, stiffness=draw.choice([0.5, 1]))
    scene.friction(lower, belt, law="coulomb", force=FORCE, static=STATIC)
    scene.friction(upper, lower, law="coulomb", force=FORCE / 2, static=STATIC / 2)
    start = {name: round(draw.uniform(-1, 1), 2) for name in ("x_lower", "x_upper")}
    return scene.system(), start | {"v_lower": VELOCITY, "v_upper": VELOCITY}


@pytest.mark.parametrize("made", [pulled, stacked])
@pytest.mark.parametrize("seed", daily(range(24), some=range(6)))
def test_transitions_are_those_of_scipy(made: Draw, seed: int) -> None:
    system, start = made(random.Random(seed))
    _, problem = problem_of(system, start, until=12)
    theirs = solver("scipy-dop853").prepare(problem, rtol=1e-11)()
    runs = [hr.simulate(system, start, until=12) for _ in range(2)]  # the second one has all modes compiled
    for run in runs:
        assert run.status == theirs.status == "ok"
        own = [(t.kind, t.surface, t.from_mode, t.to_mode) for t in run.trajectory.transitions]
        assert own == [(t.kind, t.surface, t.from_mode, t.to_mode) for t in theirs.transitions]
        assert [t.time for t in run.trajectory.transitions] == pytest.approx(
            [t.time for t in theirs.transitions], abs=1e-7
        )
