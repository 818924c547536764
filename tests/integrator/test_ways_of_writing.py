"""However a system is written, a run does not leave the compiled loop where signs and normal velocities decide."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
import sympy as sp
from often import daily
from scipy.integrate import solve_ivp

import henon_ref as hr
from henon_ref.trajectory import Decisions

LAW = "-x - F*s/(1 + d*s*(v - vb))"
X, V, S, B = sp.symbols("x v s vb", real=True)


def belt(rate: object = LAW, **changed: Any) -> hr.System:
    """A block on a belt, which sticks and slips."""
    return hr.System(
        **{
            "state": ["x", "v"],
            "parameters": {"F": 1, "d": 3, "vb": 0.5},
            "surfaces": {"s": "v - vb"},
            "field": ["v", rate],
            **changed,
        }
    )


def static(rate: str, load: str = "x", **changed: Any) -> hr.System:
    """The same with static friction."""
    ends = [
        {"when": f"-({load}) - Fs", "direction": "rising", "to": 1},
        {"when": f"-({load}) + Fs", "direction": "falling", "to": -1},
    ]
    own = {"field": ["vb", "0"], "release": ends, "entry": "inside"}
    return belt(rate, parameters={"F": 0.6, "Fs": 1, "vb": 0.5}, sliding={"s": own}, **changed)


def by_hand(rate: str, load: str, *kinks: str, surfaces: dict[str, str] | None = None) -> hr.System:
    """Static friction and a force with kinks, where a load holds no function that has one: by the signs of surfaces."""
    named = {f"k{i}": kink for i, kink in enumerate(kinks)}
    for name, h in named.items():
        parts = {f"max(0, {h})": f"(1 + {name})/2*({h})", f"abs({h})": f"{name}*({h})", f"sign({h})": name}
        for form, written in parts.items():
            rate, load = rate.replace(form, written), load.replace(form, written)
    return static(rate, load, surfaces={"s": "v - vb", **named, **(surfaces or {})})


def bouncing(rate: str, **changed: Any) -> hr.System:
    """A ball on a floor."""
    given = {"parameters": {"r": 0.9, "F": 0.1}, "surfaces": {"w": "x"}, "resets": {"w": {"map": {"v": "-r*v"}}}}
    return hr.System(**{"state": ["x", "v"], "field": ["v", rate], **given, **changed})


TWO = {
    "state": ["x1", "v1", "x2", "v2"],
    "parameters": {"F": 1, "vb": 0.5, "k": 0.7},
    "surfaces": {"s1": "v1 - vb", "s2": "v2 - vb"},
}


def two(first: str = "s1*(v1 - vb)", second: str = "s2*(v2 - vb)", more: str = "0") -> hr.System:
    """Two blocks on a belt, with a spring between them."""
    rates = [f"-x1 - k*(x1 - x2) - F*s1/(1 + 3*{first}) - {more}", f"-x2 - k*(x2 - x1) - 0.8*F*s2/(1 + 3*{second})"]
    return hr.System(**TWO, field=["v1", rates[0], "v2", rates[1]])


MANY = " + ".join(f"abs(x - {k}/10)" for k in range(-7, 8, 2))
WAYS = {
    "the belt": belt(),
    "abs of the surface": belt("-x - F*s/(1 + d*abs(v - vb))"),
    "sign and abs of the surface": belt("-x - F*sign(v - vb)/(1 + d*abs(vb - v))"),
    "no surface": belt("-x - F*sign(v - vb)/(1 + d*abs(v - vb))", surfaces={}),
    "SymPy": belt(-X - S / (1 + 3 * sp.Abs(V - B))),
    "a root of a square": belt("-x - F*s/(1 + d*sqrt((v - vb)^2))"),
    "a one-sided spring": belt(f"{LAW} - 2*max(0, x - 0.8)"),
    "a one-sided damper": belt(f"{LAW} - 0.3*max(0, v - 0.8)"),
    "a spring in pieces": belt("piecewise(-x, x < 0.2, 0.2 - 2*x) - F*s/(1 + d*s*(v - vb))"),
    "a limited spring": belt("-max(-0.9, min(0.9, x)) - F*s/(2 + d*s*(v - vb))"),
    "a rectified force": belt(f"{LAW} + 0.2*abs(sin(t))"),
    "a square wave": belt(f"{LAW} + 0.2*sign(sin(2*t))"),
    "kinks of all kinds": belt(f"{LAW} - 2*max(0, x - 0.8) - max(0, -0.9 - x) + 0.1*abs(x - 0.1) + abs(sin(2*t))/20"),
    "more kinks than a table of all modes holds": belt(f"{LAW} + 0.05*({MANY} + abs(sin(t)))"),
    "a section": belt(surfaces={"s": "v - vb", "p": "x - 0.3"}),
    "a section of all states": belt(surfaces={"s": "v - vb", "p": "x + v - 0.7"}),
    "a surface with a kink": hr.System(["x", "v"], {"F": 0.3}, {"s": "abs(x) - 0.5"}, ["v", "-x - F*s"]),
    "where the model holds": belt(valid=["30 - x", "2 + cos(v)", "9 - t/3"]),
    "expressions in parameters": belt(parameters={"F": "2*vb", "d": "3*F + vb - vb", "vb": 0.5}),
    "static friction": static("-x - F*s"),
    "static friction, a kink": static("-x - F*s - 0.1*max(0, x - 0.7)", "x + 0.1*(x - 0.7)"),
    "static friction, a section": static("-x - F*s", surfaces={"s": "v - vb", "p": "x + v - 0.9"}),
    "a reset": bouncing("-1"),
    "a reset and a kink": bouncing("-1 - abs(x - 0.3)"),
    "a reset and friction": bouncing("-1 - F*f", surfaces={"w": "x", "f": "v"}),
    "a reset that goes on falling": bouncing("-x", resets={"w": {"map": {"v": "0.95*v"}}}),
    "a reset to another place": bouncing("-1", resets={"w": {"map": {"x": "x + 1"}}}),
    "a reset beside a belt": bouncing(
        "-x - s/(1 + 3*s*(v - 0.5))", surfaces={"w": "1.2 + x", "s": "v - 0.5"}, parameters={"r": 0.8}
    ),
    "two blocks": two(),
    "two blocks, abs and a kink": two("abs(v1 - vb)", "abs(vb - v2)", "max(0, x1 - 0.6)"),
    "two blocks, one pushes the other": two(more="5*max(0, x1 - x2)"),
    "a kink at the release": belt(f"{LAW} - 2*max(0, x - 1)"),
    "a kink at which a release does not come": belt("-x - F*s + 2*max(0, x - 1)"),
    "two kinks at a release": belt(f"{LAW} - 2*max(0, x - 1) - max(0, (x - 1)*(x + 3))"),
    "many kinks, one at the release": belt(f"{LAW} + 0.1*abs(x - 1) + 0.02*({MANY})"),
    "a section at the release": belt(surfaces={"s": "v - vb", "p": "3*x - 3"}),
    "preload": belt("-max(0, x - 0.4) + max(0, -x - 0.4) - F*s/3"),
    "a dead zone": belt("-piecewise(x - 0.4, x > 0.4, x + 0.4, x < -0.4, 0) - 0.3*F*s - 0.1*x"),
    "a kink of a kink": belt(f"{LAW} + 0.3*abs(abs(x) - 0.5)"),
    "a kink of a kink of a kink": belt(f"{LAW} + 0.3*abs(abs(abs(x) - 0.5) - 0.2)"),
    "kinks in each other": belt(f"{LAW} - max(0.2*x, max(0.5*x - 0.1, x - 0.6)) - min(max(x - 0.5, 0), 0.3)"),
    "two kinks at one instant": belt(
        f"{LAW} - max(0, x - 0.3) + 0.1*abs((x - 0.3)*(x + 2)) + abs(sin(t))*abs(sin(2*t))/5"
    ),
    "sections beside kinks": belt(
        f"{LAW} - 2*max(0, x - 0.8)", surfaces={"s": "v - vb", "p": "x + v - 0.7", "q": "x - 0.8"}
    ),
    "a load with kinks": belt("-x - F*s*max(0.2, 0.3 + 0.3*x)/(1 + d*s*(v - vb))"),
    "static friction, abs of the speed": static(
        "-x - F*sign(v - vb)/(1 + abs(v - vb)) - 0.1*abs(v)*v", "x + 0.1*vb*vb"
    ),
    "static friction, a kink at the release": by_hand("-x - F*s - 2*max(0, x - 1)", "x + 2*max(0, x - 1)", "x - 1"),
    "static friction, a load that turns": by_hand("-x - F*s + 2*max(0, x - 1)", "x - 2*max(0, x - 1)", "x - 1"),
    "static friction, a square wave": by_hand("-x - F*s - sign(sin(3*t))/5", "x + sign(sin(3*t))/5", "sin(3*t)"),
    "static friction, a spring stop": by_hand("-x - F*s - 5*max(0, x - 0.8)", "x + 5*max(0, x - 0.8)", "x - 0.8"),
    "static friction, a kink of both states": by_hand(
        "-x - F*s - abs(x + v - 0.9)/5", "x + abs(x + v - 0.9)/5", "x + v - 0.9"
    ),
    "static friction, two kinks at one instant": by_hand(
        "-x - F*s + abs(sin(t))/9 + abs(sin(2*t))/9", "x - abs(sin(t))/9 - abs(sin(2*t))/9", "sin(t)", "sin(2*t)"
    ),
    "static friction, a section at a kink": by_hand(
        "-x - F*s - max(0, x - 0.7)", "x + max(0, x - 0.7)", "x - 0.7", surfaces={"p": "2*x - 1.4", "q": "x - 1"}
    ),
    "static friction, backlash": by_hand(
        "-2*(max(0, x - 0.4) - max(0, -x - 0.4)) - F*s", "2*(max(0, x - 0.4) - max(0, -x - 0.4))", "x - 0.4", "-x - 0.4"
    ),
    "static friction, many kinks": by_hand(
        f"-x - F*s/2 + 0.02*({MANY})", f"x - 0.02*({MANY})", *(f"x - {k}/10" for k in range(-7, 8, 2))
    ),
    "a reset and drag": bouncing("-1 - 0.1*v*abs(v) - 0.1*abs(x - 0.01)"),
    "a reset and a kink where it turns": bouncing("-1 - 0.5*max(0, v)"),
    "a reset onto a belt": bouncing(
        "-x - f/(1 + 3*f*(v - 0.5))", surfaces={"w": "0.8 - x", "f": "v - 0.5"}, parameters={"r": 0.8}
    ),
}


def initial_of(system: hr.System) -> dict[str, float]:
    return dict(zip(system.state, (1.2, 0.1, 0.3, 0.0), strict=False))


@pytest.mark.parametrize("way", WAYS)
def test_a_run_whose_modes_are_compiled_stays_in_the_compiled_loop(way: str) -> None:
    system = WAYS[way]
    until = 4 if "reset and" in way else 20  # before impacts come to their limit
    first, again = (hr.simulate(system, initial_of(system), until=until) for _ in range(2))
    assert first.status == "ok"
    assert len(first.trajectory.transitions) > 1
    assert again.counts.decisions == Decisions()
    assert first.counts == again.counts
    assert first.transitions.equals(again.transitions)


@pytest.mark.parametrize("name", ["stribeck_belt", "two_blocks", "elastic_stop", "bouncing_ball", "bowed_string"])
def test_so_does_that_of_a_scene(name: str) -> None:
    system = hr.System.from_case(name)
    for _ in range(2):
        run = hr.simulate(system)
    assert run.counts.decisions == Decisions()


def test_what_it_is_left_for_is_counted() -> None:
    """A touch of numbers that no pair of doubles holds; nothing else here."""
    graze = hr.simulate(hr.System.from_case("hard/grazing", reading="exact"))
    assert "graze" in graze.transitions["kind"].tolist()
    assert graze.counts.decisions.event_locations > 0
    ball = bouncing("-1", parameters={"r": 0.5})
    rest = hr.simulate(ball, {"x": 1, "v": 0}, until=20)
    assert rest.final_mode == "w=0"
    assert rest.counts.decisions == Decisions()
    assert hr.simulate(belt(), {"x": 0.9, "v": 0.1}, until=1).counts.decisions == Decisions()
    assert hr.simulate(ball, {"x": 1, "v": 0}, until=1).counts.decisions == Decisions()


@pytest.mark.parametrize("seed", daily(range(12), some=range(4)))
def test_random_kinks_have_the_motion_of_their_formula(seed: int) -> None:
    """Beside SciPy on the formula, whose kinks are continuous; with a surface at one of them as well."""
    draw = random.Random(seed)

    def number() -> float:
        return round(draw.uniform(-1, 1), 2)

    lines = [f"({number()}*x + {number()}*v + {number()})" for _ in range(5)]
    a, b, c, d, e = lines
    form = draw.choice([f"abs({a})", f"sqrt({a}^2)", f"max({a}, -{a})", f"sign({a})*{a}"])
    rate = f"-2*x + {form} + max(0, {b})/2 - min({c}, {d}*{number()}) + piecewise({e}, {e} > 0, {number()}*{e})"
    functions = {"abs": abs, "max": max, "min": min, "sqrt": math.sqrt, "sign": lambda u: (u > 0) - (u < 0)}
    before, _, after = rate.partition("piecewise(")
    value, condition, otherwise = after[:-1].split(", ")
    plain = compile(f"{before}(({value}) if {condition} else ({otherwise}))".replace("^", "**"), "rate", "eval")
    with_surface = hr.System(["x", "v"], {}, {"s": f"-3*{a}"}, ["v", rate])
    alone = hr.System(["x", "v"], {}, {}, ["v", rate])
    assert len(with_surface.model.signs) == len(alone.model.signs)
    start = {"x": 0.9, "v": 0.3}
    runs = [hr.simulate(system, start, until=6, rtol=1e-12) for system in (with_surface, alone)]
    found = solve_ivp(
        lambda t, y: [y[1], eval(plain, functions, {"x": y[0], "v": y[1]})],
        (0, 6), list(start.values()), method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.02,
    )  # fmt: skip
    for run in runs:
        assert run.status == "ok"
        assert run.y[:, -1] == pytest.approx(found.y[:, -1], abs=2e-7)
        assert run.counts.decisions._replace(new_modes=0) == Decisions()
    assert sorted(runs[0].transitions["time_s"]) == pytest.approx(sorted(runs[1].transitions["time_s"]), abs=1e-9)


@pytest.mark.parametrize("force", ["abs(x)", "max(0, x)", "sign(x)*v", "-min(0, -2*x)/2"])
def test_a_ball_rests_on_a_floor_at_which_a_force_has_its_kink(force: str) -> None:
    """As with the force above the floor written by hand; a kink of its own kept the rest from being derived."""
    hand = {"abs(x)": "x", "max(0, x)": "x", "sign(x)*v": "v", "-min(0, -2*x)/2": "x"}[force]
    runs = [
        hr.simulate(bouncing(f"-1 - F*({each})", parameters={"r": 0.5, "F": 0.1}), {"x": 1, "v": 0}, until=9)
        for each in (force, hand)
    ]
    assert [run.final_mode for run in runs] == ["w=0", "w=0"]
    assert runs[0].transitions["kind"].tolist() == runs[1].transitions["kind"].tolist()
    times = [run.transitions["time_s"].to_numpy() for run in runs]
    assert times[0] == pytest.approx(times[1], abs=1e-9)


def test_static_friction_whose_law_is_written_by_kinks_is_that_of_its_surface() -> None:
    hand, kinks = static("-x - F*s - s*(v - vb)/5"), static("-x - F*sign(v - vb) - max(v - vb, vb - v)/5")
    runs = [hr.simulate(system, {"x": 1.5, "v": 0}, until=20) for system in (hand, kinks)]
    assert runs[0].transitions.equals(runs[1].transitions)
    assert len(runs[0].transitions) == 5


@pytest.mark.parametrize("resets", [{}, {"w": {"map": {"y": "1"}}}])
@pytest.mark.parametrize(("force", "release"), [("1 + max(0, t - 1)", 1), ("1 - max(0, t - 1) + 3*max(0, t - 2)", 2.5)])
def test_a_load_at_its_limit_may_grow_or_fall_from_a_kink_on(
    force: str, release: float, resets: dict[str, Any]
) -> None:
    """Friction that is as large as the load up to t = 1; a reset elsewhere changes nothing of it."""
    system = hr.System(["v", "y"], {"F": 1}, {"s": "v", "w": "y"}, [f"{force} - F*s", "-0.3"], resets=resets)
    run = hr.simulate(system, {"v": -0.5, "y": 0.5}, until=3)
    found = [(t.kind, t.time) for t in run.trajectory.transitions if t.surface == 0]
    assert found == [("stick", pytest.approx(0.25)), ("release", pytest.approx(release))]


PULLED = {"x": 0, "v": 0.5}
"""On the belt, which it sticks to: x = t / 2."""


@pytest.mark.parametrize(
    ("system", "release", "to"),
    [
        (belt("-x - F*s - 2*max(0, x - 1)"), 2, -1),
        (belt("-x - F*s + 2*max(0, x - 1)"), 6, 1),  # the force is x - 2 from x = 1 on
        (belt("-x - F*s/2 - sign(x - 0.4)/5"), 0.8, -1),  # it jumps from 0.4 - 0.2 to 0.6
        (by_hand("-x - F*s - 2*max(0, x - 1)", "x + 2*max(0, x - 1)", "x - 1"), 2, -1),
        (by_hand("-x - F*s - sign(x - 0.9)/5", "x + sign(x - 0.9)/5", "x - 0.9"), 1.8, -1),
        (by_hand("-x - F*s - max(0, x - 0.5)", "x + max(0, x - 0.5)", "x - 0.5", surfaces={"p": "4*x - 3"}), 1.5, -1),
    ],
)
def test_a_slide_ends_at_kinks_where_the_force_says(system: hr.System, release: float, to: int) -> None:
    runs = [hr.simulate(system, PULLED, until=release + 0.1) for _ in range(2)]
    for run in runs:
        found = [(t.time, t.kind, t.to_mode[0]) for t in run.trajectory.transitions if t.surface == 0]
        assert found == [(pytest.approx(release, abs=1e-14), "release", to)]  # it lets go, and does not stick again
    assert runs[1].counts.decisions == Decisions()


def test_a_load_that_turns_at_its_limit_is_held() -> None:
    """The load of the slide rises to its limit at the kink, x = 1, and falls from there on; it is -1 at x = 3."""
    system = by_hand("-x - F*s + 2*max(0, x - 1)", "x - 2*max(0, x - 1)", "x - 1")
    run = hr.simulate(system, PULLED, until=7)
    found = [(t.time, t.kind, t.to_mode[0]) for t in run.trajectory.transitions if t.surface == 0]
    assert found[0] == (pytest.approx(6, abs=1e-14), "release", 1)


@pytest.mark.parametrize(
    ("force", "lifts_off"),
    [("t - 1", 1), ("t - 1 + max(0, t - 1)", 1), ("-1 + max(0, t - 1)", 2), ("sign(t - 3)", 3)],
)
def test_a_body_at_rest_lifts_off(force: str, lifts_off: float) -> None:
    """With the third derivative of its height, or with the second where the force jumps."""
    system = bouncing(force, parameters={"r": 0.5})
    runs = [hr.simulate(system, {"x": 0, "v": 0}, until=lifts_off + 0.5) for _ in range(2)]
    for run in runs:
        found = [t.time for t in run.trajectory.transitions if t.surface == 0]
        assert found == [pytest.approx(lifts_off, abs=1e-14)]
    assert runs[1].counts.decisions == Decisions()


def test_a_model_may_have_more_conditions_than_surfaces() -> None:
    run = hr.simulate(belt(valid=["3 - x", "3 + x", "10 - t"]), {"x": 0, "v": 0}, until=20)
    assert run.status == "invalid"
    assert run.trajectory.end_time == pytest.approx(10)
