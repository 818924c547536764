"""Jumps of the state: where they happen and what follows, by closed forms."""

from __future__ import annotations

from math import acosh, asinh, pi, sqrt

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Reset
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory
from tests.support.resets import ball, ball_impacts, impact_oscillator, oscillator_impacts

X, V, W, Y = sp.symbols("x v w y", real=True)
S, U = sp.symbols("s u", real=True)
FOUR_FIFTHS = sp.Rational(4, 5)


def run(problem: Problem, name: str = "henon", rtol: float = 1e-13) -> Trajectory:
    return solver(name).prepare(problem, rtol=rtol)()


@pytest.mark.parametrize("name", ["henon", "henon-newton", "henon-brent"])
def test_the_first_fifty_impacts_of_a_ball(name: str) -> None:
    found = run(ball(sp.Rational(4024865, 1000000), FOUR_FIFTHS), name)
    times = ball_impacts(50, 0.8)
    assert times[-1] < 4.024865 < ball_impacts(51, 0.8)[-1]
    assert found.status == "ok"
    assert [t.kind for t in found.transitions] == ["reset"] * 50
    assert {(t.from_mode, t.to_mode) for t in found.transitions} == {((1,), (1,))}
    assert [t.time for t in found.transitions] == pytest.approx(times, abs=1e-12, rel=0)
    speeds = [10 * 0.2**0.5 * 0.8 ** (k + 1) for k in range(50)]
    assert [t.state[1] for t in found.transitions] == pytest.approx(speeds, rel=1e-10)


@pytest.mark.parametrize("depth", ["1/2", "1e-2", "1e-4", "1e-6", "1e-8", "1e-10"])
def test_an_impact_oscillator_down_to_a_graze(depth: str) -> None:
    exact = sp.Rational(depth)
    found = run(impact_oscillator(exact, sp.Rational(1, 2), 30))
    times = oscillator_impacts(float(exact), 0.5, 30.0)
    assert (found.status, [t.kind for t in found.transitions]) == ("ok", ["reset"] * len(times))
    # The speed of an impact that is next to a graze is that of a square root: so its time.
    slack = 1e-15 / float(exact) ** 0.5 * 100
    assert [t.time for t in found.transitions] == pytest.approx(times, abs=max(1e-12, slack), rel=0)


def test_a_graze_is_no_impact_and_a_miss_is_nothing() -> None:
    graze = run(impact_oscillator(sp.Integer(0), sp.Rational(1, 2), 5))
    assert [(t.kind, t.time) for t in graze.transitions] == [("graze", pytest.approx(pi / 2))]
    assert run(impact_oscillator(sp.Rational("-1e-10"), sp.Rational(1, 2), 10)).transitions == ()


def test_right_hand_sides_use_the_state_before_the_jump() -> None:
    # Two states change places, a third stays: x' = -1 from 1 falls through 0 at t = 1.
    system = FilippovSystem((X, V, W), (S,), (X,), (sp.Integer(-1),) * 3, resets={0: Reset({X: V, V: W})})
    start = (sp.Integer(1), sp.Integer(5), sp.Integer(7))
    found = run(Problem(system, sp.Integer(0), start, sp.Integer(4)))
    assert [(t.kind, t.time, t.state) for t in found.transitions] == [("reset", 1.0, (4.0, 6.0, 6.0))]
    assert found.end_state == pytest.approx((1.0, 3.0, 3.0))


def test_a_rising_surface_is_crossed_and_a_map_may_lead_to_the_other_side() -> None:
    up = FilippovSystem((X,), (S,), (X,), (sp.Integer(1),), resets={0: Reset({X: X + 5})})
    found = run(Problem(up, sp.Integer(0), (sp.Integer(-1),), sp.Integer(3)))
    assert [(t.kind, t.to_mode) for t in found.transitions] == [("crossing", (1,))]
    down = FilippovSystem((X,), (S,), (X,), (S * -1,), resets={0: Reset({X: X - 2})})
    found = run(Problem(down, sp.Integer(0), (sp.Integer(1),), sp.Rational(3, 2)))
    assert [(t.kind, t.from_mode, t.to_mode, t.state) for t in found.transitions] == [
        ("reset", (1,), (-1,), (-2.0,)),
    ]
    assert found.end_state == pytest.approx((-1.5,))


def test_a_jump_changes_the_side_of_another_surface() -> None:
    # A mass with friction hits a wall: its velocity, and with it the sign of the friction, changes at once.
    system = FilippovSystem((X, V), (S, U), (1 - X, V), (V, -U / 4), resets={0: Reset({V: -V})})
    found = run(Problem(system, sp.Integer(0), (sp.Integer(0), sp.Integer(2)), sp.Integer(1)))
    hit = 8 - sp.sqrt(56).n()  # 2 t - t^2 / 8 = 1
    assert [(t.kind, t.surface, t.from_mode, t.to_mode) for t in found.transitions] == [
        ("reset", 0, (1, 1), (1, -1)),
        ("crossing", 1, (1, 1), (1, -1)),
    ]
    assert [t.time for t in found.transitions] == pytest.approx([float(hit)] * 2)


def corner(second: dict[sp.Symbol, sp.Expr]) -> Problem:
    system = FilippovSystem(
        (X, V, Y, W), (S, U), (X, Y), (V, sp.Integer(0), W, sp.Integer(0)),
        resets={0: Reset({V: -V / 2}), 1: Reset(second)},
    )  # fmt: skip
    one = sp.Integer(1)
    return Problem(system, sp.Integer(0), (one, -one, one, -one), sp.Integer(2))


def test_two_walls_at_one_instant() -> None:
    found = run(corner({W: -W / 2}))
    assert [(t.kind, t.surface, t.time) for t in found.transitions] == [("reset", 0, 1.0), ("reset", 1, 1.0)]
    assert found.end_state == pytest.approx((0.5, 0.5, 0.5, 0.5))
    refused = run(corner({W: -W / 2, V: V + W}))
    assert refused.status == "nonunique"
    assert refused.reason.endswith("impacts at one instant that share a body: s, u")


REST = 9 * 0.2**0.5
"""Where the impacts of the ball with restitution 4/5 come to their limit [s]."""


@pytest.mark.parametrize("name", ["henon", "scipy-dop853"])
def test_a_ball_comes_to_rest(name: str) -> None:
    found = run(ball(sp.Integer(5), FOUR_FIFTHS), name, 1e-12)
    *impacts, last = found.transitions
    assert found.status == "ok"
    assert {t.kind for t in impacts} == {"reset"}
    assert (last.kind, last.surface, last.from_mode, last.to_mode) == ("stick", 0, (1,), (0,))
    assert last.time == pytest.approx(REST, abs=1e-10, rel=0)
    assert last.state == found.end_state == pytest.approx((0.0, 0.0), abs=1e-24)  # as it is landed on
    times = ball_impacts(len(impacts) + 1, 0.8)
    # All later flights together last less than 2^-26 of the run, for the first time.
    assert REST - times[-2] < 5 * 2.0**-26 < REST - times[-3]


def test_a_body_that_loses_all_speed_rests_at_once_and_lifts_off_later() -> None:
    # x'' = t - 2 on a floor: it falls from 0.4 and stays till the acceleration is positive, then x = (t - 2)^3 / 6.
    free = FilippovSystem((X, V), (S,), (X,), (V, TIME - 2), resets={0: Reset({V: sp.Integer(0)})})
    problem = Problem(with_resting(free), sp.Integer(0), (sp.Rational(5, 6), sp.Integer(0)), sp.Integer(4))
    for name in ("henon", "heyoka", "scipy-dop853"):
        found = run(problem, name, 1e-12)
        assert [(t.kind, t.to_mode) for t in found.transitions] == [
            ("reset", (1,)),
            ("stick", (0,)),
            ("release", (1,)),
        ]
        assert [t.time for t in found.transitions] == pytest.approx([1.0, 1.0, 2.0], abs=1e-9)
        assert found.end_state == pytest.approx((8 / 6, 2.0), abs=1e-8)


def test_a_ball_rests_beside_a_block_that_sticks() -> None:
    # A ball bounces while a block, which nothing else acts on, comes to rest on the ground: neither acts on the other.
    system = FilippovSystem(
        (X, V, W), (S, U), (X, W), (V, sp.Integer(-10), -U), resets={0: Reset({V: -V / 2})}
    )  # fmt: skip
    start = (sp.Integer(1), sp.Integer(0), sp.Rational(1, 10))
    problem = Problem(with_resting(system), sp.Integer(0), start, sp.Integer(3))
    for name in ("henon", "scipy-dop853"):
        found = run(problem, name, 1e-12)
        first, *impacts, last = found.transitions
        assert found.status == "ok"
        assert (first.kind, first.surface, first.to_mode) == ("stick", 1, (1, 0))
        assert {t.kind for t in impacts} == {"reset"}
        assert (last.kind, last.surface, last.to_mode) == ("stick", 0, (0, 0))
        assert last.time == pytest.approx(3 * 0.2**0.5, abs=1e-10)


R8, HALF = sp.Rational(4, 5), sp.Rational(1, 2)
FALLS = (V, sp.Integer(-10))


@pytest.mark.parametrize(
    ("system", "start", "reason"),
    [
        (
            FilippovSystem((X, V, Y), (S,), (X,), (*FALLS, -Y), resets={0: Reset({V: -R8 * V, Y: Y / 2 + 1})}),
            (1, 0, 1),
            "y does not change in proportion to the speed of the impact",
        ),
        (
            FilippovSystem(
                (X, V), (S, U), (X, V + 3), (V + U / 1000 - sp.Rational(1, 1000), sp.Integer(-10)),
                resets={0: Reset({V: -V / 2})},
            ),
            (1, 0),
            "the speed of the impact depends on the sign of u",
        ),
        (
            # Its friction on a belt, which moves at 1e-9, turns round in flight, but not where it is highest.
            FilippovSystem(
                (X, V), (S, U), (X, V + sp.Rational(1, 10**9)), (V, -10 - U), resets={0: Reset({V: -V / 2})}
            ),
            (1, 0),
            "the force towards the surface changes with the sign of u in flight",
        ),
    ],
)  # fmt: skip
def test_where_no_rest_is_derived_the_run_ends_before_the_body_falls_through(
    system: FilippovSystem, start: tuple[int, ...], reason: str
) -> None:
    problem = Problem(with_resting(system), sp.Integer(0), tuple(map(sp.Integer, start)), sp.Integer(5))
    for name, rtol in (("henon", 1e-6), ("henon", 1e-12), ("scipy-dop853", 1e-12)):
        found = run(problem, name, rtol)
        assert (found.status, "no rest is derived: " + reason in found.reason) == ("failed", True)
        assert {t.kind for t in found.transitions} <= {"reset", "crossing"}
        assert {t.to_mode[0] for t in found.transitions} == {1}


def test_bodies_that_bounce_at_the_same_instants_come_to_rest_at_one_instant() -> None:
    resets = {0: Reset({V: -V / 2}), 1: Reset({W: -W / 2})}
    system = FilippovSystem((X, V, Y, W), (S, U), (X, Y), (*FALLS, W, sp.Integer(-10)), resets=resets)
    start = tuple(map(sp.Integer, (1, 0, 1, 0)))
    problem = Problem(with_resting(system), sp.Integer(0), start, sp.Integer(5))
    for name in ("henon", "scipy-dop853"):
        found = run(problem, name, 1e-12)
        assert (found.status, [(t.kind, t.surface, t.to_mode) for t in found.transitions[-2:]]) == (
            "ok", [("stick", 0, (0, 0)), ("stick", 1, (0, 0))]
        )  # fmt: skip
        assert [t.time for t in found.transitions[-2:]] == pytest.approx([3 * 0.2**0.5] * 2, abs=1e-10)


@pytest.mark.parametrize("part", ["d/2", "d*0.9"])
def test_a_run_does_not_pass_a_surface_to_which_its_maps_have_come(part: str) -> None:
    # v rises by d between two maps: the sum of all d is 2, or 10.
    resets = {"s": {"when": "falling", "map": {"v": "1 - d", "d": part}}}
    system = hr.System(["v", "d"], {}, {"s": "1 - v"}, ["1", "0"], resets=resets)
    run = hr.simulate(system, {"v": 0, "d": 1}, until=20)
    assert (run.status, run.message.endswith("the state is on s, which resets it, and moves into it")) == (
        "invalid",
        True,
    )
    assert run.t[-1] == pytest.approx(1 + {"d/2": 2, "d*0.9": 10}[part], abs=1e-10)


@pytest.mark.parametrize("unit", [1, 1e-13, 1e-20, 1e14])
def test_a_ball_that_leaves_the_floor_bounces_in_any_unit_of_time(unit: float) -> None:
    # Thrown with 1 under 10 it flies 0.2, 0.16, ...: it rests at 1. Its speed was held against its acceleration.
    floor = hr.System(["x", "v"], {"g": 10 / unit**2}, {"s": "x"}, ["v", "-g"], resets={"s": {"map": {"v": "-4/5*v"}}})
    found = hr.simulate(floor, {"x": 0, "v": 1 / unit}, until=12 * unit).transitions
    assert (found["time_s"].iloc[[0, 1, -1]] / unit).tolist() == pytest.approx([0.2, 0.36, 1], rel=1e-9)
    assert found["kind"].tolist() == ["reset"] * 70 + ["stick"]


@pytest.mark.parametrize("unit", [1, 1e-13, 1e-20])
def test_a_block_rocks_until_its_impacts_accumulate(unit: float) -> None:
    # Housner (1963), linear: angle 1 - phi at its turns, phi' = 1 - sqrt(1 - e^2 phi (2 - phi)), a swing lasts
    # 2 acosh(1/(1 - phi)). Below 1e-13 its speed counted as zero, and the block fell over with status ok.
    phi, end = 0.5, acosh(2)
    while (phi := phi * 0.49 * (2 - phi) / (1 + sqrt(1 - 0.49 * phi * (2 - phi)))) > 1e-40:
        end += 2 * asinh(sqrt(phi * (2 - phi)) / (1 - phi))
    lose = {"map": {"w": "7/10*w"}}
    surfaces, resets = {"s": "x", "r": "-x"}, {"s": lose, "r": lose}
    block = hr.System(["x", "w"], {"p": 1 / unit**2}, surfaces, ["w", "p*(x - s)"], resets=resets)
    run = hr.simulate(block, {"x": 0.5, "w": 0}, until=12 * unit)
    assert (run.status, "transitions accumulate" in run.message) == ("failed", True)
    assert run.t[-1] / unit == pytest.approx(end, rel=1e-10)
    # Each impact on one surface is the crossing of the other, and the impacts are in turn.
    kinds = run.transitions[["kind", "surface"]].to_numpy().tolist()
    assert kinds[:4] == [["reset", "s"], ["crossing", "r"], ["crossing", "s"], ["reset", "r"]]
    assert kinds == (kinds[:4] * len(kinds))[: len(kinds)]


@pytest.mark.parametrize("speed", [1e-13, 1e-20])
def test_the_least_speed_on_the_floor_is_no_rest(speed: float) -> None:
    floor = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-10"], resets={"s": {"map": {"v": "-4/5*v"}}})
    run = hr.simulate(floor, {"x": 0, "v": speed}, until=12)
    assert (run.transitions["kind"].tolist(), run.y[1, -1]) == (["reset", "stick"], 0.0)
    assert abs(run.y[0, -1]) < speed**2
    down = hr.simulate(floor, {"x": 0, "v": -speed}, until=12)
    assert (down.status, down.message) == ("invalid", "at t = 0 the state is on s, which resets it, and moves into it")


def test_a_map_may_put_the_state_on_its_surface() -> None:
    written = FilippovSystem((X, V), (S,), (X,), FALLS, resets={0: Reset({X: sp.Integer(0), V: -R8 * V})})
    found = run(Problem(with_resting(written), sp.Integer(0), (sp.Integer(1), sp.Integer(0)), sp.Integer(5)))
    assert (found.status, found.transitions[-1].kind, found.end_state) == ("ok", "stick", (0.0, 0.0))
    assert found.transitions[-1].time == pytest.approx(REST, abs=1e-10)


@pytest.mark.parametrize("name", ["henon", "scipy-dop853", "heyoka"])
def test_a_body_that_falls_on_one_that_rests_presses_it_on_pair_by_pair(name: str) -> None:
    # Two equal masses on a floor, the lower one at rest: speeds (V, W) in units of the impact's, restitution 1/2.
    system = FilippovSystem(
        (X, V, Y, W), (S, U), (X, Y - X - 1), (V, sp.Integer(-10), W, sp.Integer(-10)),
        resets={0: Reset({V: -V / 2}), 1: Reset({V: V / 4 + 3 * W / 4, W: 3 * V / 4 + W / 4})},
    )  # fmt: skip
    start = tuple(map(sp.Integer, (0, 0, 2, 0)))
    found = run(Problem(with_resting(system), sp.Integer(0), start, sp.Rational(12, 25)), name, 1e-12)
    told = [(t.kind, t.surface, t.from_mode, t.to_mode) for t in found.transitions]
    assert (found.status, told) == ("ok", [("reset", i, (0, 1), (1, 1)) for i in (1, 0, 1, 0)])
    parts = [(-3 / 4, -1 / 4), (3 / 8, -1 / 4), (-3 / 32, 7 / 32), (3 / 64, 7 / 32)]
    assert [(t.state[1], t.state[3]) for t in found.transitions] == [
        pytest.approx((20**0.5 * v, 20**0.5 * w), abs=1e-9) for v, w in parts
    ]


def test_a_start_at_rest_on_the_surface_rests() -> None:
    system = with_resting(FilippovSystem((X, V), (S,), (X,), FALLS, resets={0: Reset({V: -HALF * V})}))
    lying = run(Problem(system, sp.Integer(0), (sp.Integer(0), sp.Integer(0)), sp.Integer(1)))
    assert (lying.status, lying.transitions, lying.end_mode, lying.end_state) == ("ok", (), (0,), (0.0, 0.0))


@pytest.mark.parametrize("name", ["henon", "scipy-dop853", "heyoka"])
def test_a_body_without_restitution_follows_a_moving_table_until_it_is_thrown_off(name: str) -> None:
    # x'' = -1 above a table at sin(2 t) / 2, which is left where its acceleration is -1.
    table = sp.sin(2 * TIME) / 2
    system = FilippovSystem(
        (X, V), (S,), (X - table,), (V, sp.Integer(-1)), resets={0: Reset({V: sp.diff(table, TIME)})}
    )
    start = (sp.Rational(3, 2), sp.Integer(0))
    found = run(Problem(with_resting(system), sp.Integer(0), start, sp.Rational(19, 5)), name, 1e-12)
    kinds = [(t.kind, t.to_mode) for t in found.transitions]
    assert kinds[:3] == [("reset", (1,)), ("stick", (0,)), ("release", (1,))]
    first, second, left = (t.time for t in found.transitions[:3])
    assert first == second
    assert 1.5 - first**2 / 2 == pytest.approx(0.5 * sp.sin(2 * first), abs=1e-9)
    assert left == pytest.approx(pi + pi / 12, abs=1e-9)  # 2 sin(2 t) = 1
