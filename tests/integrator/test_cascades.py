"""Resets that trigger resets, and impacts that trigger impacts, at one instant: closed forms, on every route.

Several events at one instant are as SBML (Level 3, Sec. 4.11) and the Modelica language (Sec. 8.5) have them.
"""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from functools import lru_cache
from math import acosh, sqrt

import numpy as np
import pytest
import sympy as sp
from derivatives import fundamental_matrix
from multiprecision import multiprecision
from problems import read_problem
from random_scenes import exact_run

import henon_ref as hr
from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import solver
from henon_ref.harness.score.scoring import score
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.harness.truth.proofs import prove
from henon_ref.harness.truth.reference import Route
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

SOLVERS = ("henon", "scipy-dop853", "heyoka", "cvode-bdf")
Told = list[tuple[str, int]]

TEXT = """\
system:
  state: [x, a, b]
  surfaces: {{first: "1 - x", second: "{second}"}}
  field: ["1", "0", "0"]
resets:
  first: {first}
  second: {map}
initial: {{x: 0, a: 0, b: 0}}
until: {until}
"""


def case(
    first: str = "{map: {x: '0', a: a + 1}}", second: str = "1/2 - a", map: str = "{map: {a: '0', b: b + 1}}",
    until: str = "7/2",
) -> Problem:  # fmt: skip
    """x' = 1 from 0; ``first`` resets it at 1 and counts in a, which carries ``second`` through zero."""
    return read_problem(TEXT.format(first=first, second=second, map=map, until=until))


@lru_cache
def row(masses: tuple[str, ...], speeds: tuple[str, ...], restitution: str = "1") -> Problem:
    """Balls of no size in a row on a line, the inner ones touching at rest; the outer ones come from a distance 1."""
    last = len(masses) - 1
    bodies = ", ".join(f"b{i}: {{mass: {m}}}" for i, m in enumerate(masses))
    stops = "".join(
        f"    - stop: {{between: [b{i + 1}, b{i}], gap: 0, restitution: {restitution}}}\n" for i in range(last)
    )
    places = [-1 if i == 0 else 1 if i == last and speeds[i] != "0" else 0 for i in range(last + 1)]
    initial = ", ".join(f"x_b{i}: {places[i]}, v_b{i}: {v}" for i, v in enumerate(speeds))
    return read_problem(f"""\
scene:
  bodies: {{{bodies}}}
  connections:
{stops}initial: {{{initial}}}
until: 2
""")


def run(problem: Problem, name: str = "henon") -> Trajectory:
    return solver(name).prepare(problem, rtol=1e-10)()


def told(found: Trajectory | Route) -> Told:
    return [(t.kind, t.surface) for t in found.transitions]


@pytest.mark.parametrize("name", SOLVERS)
def test_a_map_that_carries_another_surface_through_zero_triggers_its_reset(name: str) -> None:
    found = run(case(), name)
    assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1)] * 3)
    assert [t.time for t in found.transitions] == pytest.approx([1, 1, 2, 2, 3, 3], abs=1e-9)
    assert [t.state for t in found.transitions[:2]] == [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    assert {(t.from_mode, t.to_mode) for t in found.transitions} == {((1, 1), (1, 1))}
    assert found.end_state == pytest.approx((0.5, 0.0, 3.0), abs=1e-9)


def test_both_routes_to_the_truth_have_the_cascade() -> None:
    for route in (multiprecision(case()), prove(case())):
        assert (route.status, route.undecided, told(route)) == ("ok", "", [("reset", 0), ("reset", 1)] * 3)
        assert [tuple(map(float, t.state)) for t in route.transitions[:2]] == [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


def test_a_surface_that_a_map_carries_to_zero_itself_is_due() -> None:
    problem = case(second="1 - a")
    for found in (run(problem), run(problem, "scipy-dop853"), multiprecision(problem)):
        assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1)] * 3)


def test_a_surface_fires_again_only_after_a_map_has_lifted_it() -> None:
    # a stays above 1/2 once it is there: second fires once.
    once = run(case(map="{map: {b: b + 1}}"))
    assert told(once) == [("reset", 0), ("reset", 1), ("reset", 0), ("reset", 0)]
    assert once.end_state == pytest.approx((0.5, 3.0, 1.0))
    # first stays at zero by its own map, and second's carries it to -2: nothing has lifted it.
    again = run(case(first="{map: {a: '1'}}", map="{map: {a: '0', x: '3'}}"))
    assert (again.status, told(again)) == ("ok", [("reset", 0), ("reset", 1)])
    assert again.end_state == pytest.approx((5.5, 0.0, 0.0))


def test_maps_without_end_are_named() -> None:
    problem = case(first="{map: {x: '0', a: '1'}}", map="{map: {a: '0', x: '1'}}")
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
        assert (found.status, len(found.transitions)) == ("failed", 0)
        assert "more than 1000 maps at one instant, t = " in found.reason
        assert found.reason.endswith("resets of first, second")


ROCKING = """\
system:
  state: [x, w, q]
  parameters: {p: 2, a: 1/5, e: 9/10}
  surfaces: {s: "x*q"}
  field: ["w", "p^2*(x - a*q)", "0"]
resets:
  s: {map: {w: "e*w", q: "-q"}}
initial: {x: 1/10, w: 0, q: 1}
until: 6
"""


@pytest.mark.parametrize("name", SOLVERS)
def test_a_map_that_turns_the_sign_of_its_surface_leaves_the_state_on_it(name: str) -> None:
    # A rocking block (Housner 1963, linear), angle a (1 - phi) at its turns: phi' = 1 - sqrt(1 - e^2 phi (2 - phi)).
    phi, time, times = 0.5, acosh(2) / 2, [acosh(2) / 2]
    for _ in range(8):
        phi = 1 - sqrt(1 - 0.81 * phi * (2 - phi))
        time += acosh(1 / (1 - phi))
        times.append(time)
    found = run(read_problem(ROCKING), name)
    assert (found.status, told(found)) == ("ok", [("reset", 0)] * 9)
    assert {t.to_mode for t in found.transitions} == {(1,)}
    assert [t.time for t in found.transitions] == pytest.approx(times, abs=1e-6)


def test_both_routes_to_the_truth_have_the_rocking_block() -> None:
    for route in (multiprecision(read_problem(ROCKING)), prove(read_problem(ROCKING))):
        assert (route.status, route.undecided, told(route)) == ("ok", "", [("reset", 0)] * 9)


def test_a_reset_that_another_one_causes_may_put_the_state_on_its_surface() -> None:
    # From a = 1/2 upwards with a' = 1/2: second falls to -1 by the map of first, and to 0 by its own.
    problem = read_problem("""\
system:
  state: [x, a]
  surfaces: {first: "1 - x", second: a}
  field: ["1", "1/2"]
resets:
  first: {map: {x: '0', a: '-1'}}
  second: {map: {a: '0'}}
initial: {x: 0, a: 1/2}
until: 3/2
""")
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem), prove(problem)):
        assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1)])
        assert {t.to_mode for t in found.transitions} == {(1, 1)}


TWO = """\
system:
  state: [x, a]
  surfaces: {{p: "1 - x", q: "2 - 2*x"}}
  field: ["1", "0"]
resets:
  p: {{map: {{a: "{p}"}}{priority}}}
  q: {{map: {{a: "{q}"}}}}
initial: {{x: 0, a: 3}}
until: 2
"""


@pytest.mark.parametrize(
    ("priority", "end", "order"),
    [(", priority: -1", 8.0, [0, 1]), (", priority: 1", 7.0, [1, 0]), (", priority: 0.5", 7.0, [1, 0])],
)
def test_the_lowest_priority_goes_first(priority: str, end: float, order: list[int]) -> None:
    problem = read_problem(TWO.format(p="a + 1", q="2*a", priority=priority))
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
        assert (found.status, [i for _, i in told(found)]) == ("ok", order)
        assert float(found.transitions[-1].state[1]) == end


def test_without_priorities_the_future_is_not_unique_where_the_order_matters_at_that_state() -> None:
    differs = read_problem(TWO.format(p="a + 1", q="2*a", priority=""))
    for found in (*(run(differs, name) for name in SOLVERS), multiprecision(differs)):
        assert (found.status, len(found.transitions)) == ("nonunique", 0)
        assert found.reason.endswith("resets at one instant whose order matters: p, q")
    # They do not commute, but at a = 3 they do.
    same = read_problem(TWO.format(p="a + 1", q="a*(a - 3)*(a - 4) + a", priority=""))
    for found in (*(run(same, name) for name in SOLVERS), multiprecision(same)):
        assert (found.status, [i for _, i in told(found)]) == ("ok", [0, 1])
        assert float(found.transitions[-1].state[1]) == 4.0


def test_priorities_from_python_make_another_system() -> None:
    def made(**priority: float) -> hr.System:
        resets = {"p": {"map": {"a": "a + 1"}, **priority}, "q": {"map": {"a": "2*a"}}}
        return hr.System(["x", "a"], {}, {"p": "1 - x", "q": "2 - 2*x"}, ["1", "0"], resets=resets)

    assert made() == made(priority=0) != made(priority=1)
    assert hr.simulate(made(priority=1), {"x": 0, "a": 3}, until=2).y[1, -1] == 7.0
    assert hr.simulate(made(), {"x": 0, "a": 3}, until=2).status == "nonunique"


@pytest.mark.parametrize("name", SOLVERS)
def test_newton_s_cradle(name: str) -> None:
    found = run(row(("1", "1", "1"), ("1", "0", "0")), name)
    assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1)])
    assert [t.time for t in found.transitions] == pytest.approx([1.0, 1.0], abs=1e-8)
    assert found.end_state == pytest.approx((0, 0, 0, 0, 1, 1), abs=1e-8)


def test_a_cradle_of_other_masses_goes_from_pair_to_pair_until_none_approaches() -> None:
    # 1, 1, 2: (1, 0, 0) -> (0, 1, 0) -> (0, -1/3, 2/3) -> (-1/3, 0, 2/3).
    problem = row(("1", "1", "2"), ("1", "0", "0"))
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
        assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1), ("reset", 0)])
        assert [float(found.transitions[-1].state[k]) for k in (1, 3, 5)] == pytest.approx([-1 / 3, 0, 2 / 3], abs=1e-9)


def test_two_pairs_that_share_a_body_are_unique_where_both_orders_end_alike() -> None:
    # Five equal balls struck from both ends: the outer ones turn round. A heavier one in the middle: it depends.
    alike = row(("1",) * 5, ("1", "0", "0", "0", "-1"))
    for found in (*(run(alike, name) for name in SOLVERS), multiprecision(alike)):
        assert found.status == "ok"
        assert [float(v) for v in found.transitions[-1].state[1::2]] == pytest.approx([-1, 0, 0, 0, 1], abs=1e-8)
    other = row(("1", "1", "2", "1", "1"), ("1", "0", "0", "0", "-1"))
    for found in (*(run(other, name) for name in SOLVERS), multiprecision(other)):
        assert (found.status, len(found.transitions)) == ("nonunique", 0)
        assert "impacts at one instant that share a body: g_b3_b2, g_b4_b3" in found.reason


def test_impacts_without_end_have_a_limit() -> None:
    # Without restitution the three approach a common speed in infinitely many impacts; the first of each is listed.
    problem = row(("1", "1", "1"), ("1", "0", "0"), "0")
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
        assert (found.status, told(found)) == ("ok", [("reset", 0), ("reset", 1)])
        assert [float(v) for v in found.transitions[-1].state[1::2]] == [0.5, 0.25, 0.25]
    assert run(problem).end_state == pytest.approx([1 / 3] * 6, abs=1e-14)
    assert run(row(("1", "2", "5"), ("1", "0", "0"), "0")).end_state == pytest.approx([1 / 8] * 6, abs=1e-14)


def stack(heights: tuple[str, ...], masses: tuple[str, ...], restitution: tuple[str, ...], more: str = "") -> Problem:
    """Bodies of no size above one another over the ground, with g = 10 m/s^2."""
    count = len(heights)
    bodies = ", ".join(f"b{i}: {{mass: {m}}}" for i, m in enumerate(masses))
    connections = [
        f"stop: {{between: [b{i}, {f'b{i - 1}' if i else 'ground'}], gap: 0, restitution: {restitution[i]}}}"
        for i in range(count)
    ]
    connections += [f"force: {{on: b{i}, value: -10*{m}}}" for i, m in enumerate(masses)]
    initial = ", ".join(f"x_b{i}: {h}, v_b{i}: 0" for i, h in enumerate(heights))
    return read_problem(
        f"scene:\n  bodies: {{ground: fixed, {bodies}}}\n  connections:\n"
        + "".join(f"    - {each}\n" for each in connections)
        + f"{more}initial: {{{initial}}}\nuntil: 1\n"
    )


@pytest.mark.parametrize("masses", [("1", "1"), ("1", "1000"), ("1000", "1")])
def test_a_body_that_falls_on_one_at_rest_comes_to_rest_with_it_at_once(masses: tuple[str, str]) -> None:
    for restitution in (("0", "0"), ("0", "1/2"))[: 1 if masses[0] > masses[1] else 2]:
        problem = stack(("0", "1/5"), masses, restitution)
        for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
            assert (found.status, found.transitions[-1].to_mode) == ("ok", (0, 0))
            assert told(found) == [("reset", 1), ("reset", 0), ("stick", 0), ("stick", 1)]
            assert [float(t.time) for t in found.transitions] == pytest.approx([0.2] * 4, abs=1e-8)
        assert run(problem).end_state == pytest.approx((0, 0, 0, 0), abs=1e-15)


def test_several_bodies_come_to_rest_on_one_another() -> None:
    # They fall for sqrt(h/5): the lowest first.
    problem = stack(("1/20", "1/5", "9/20", "4/5"), ("1", "2", "1", "3"), ("0", "0", "0", "0"))
    sticks = [[("stick", i) for i in range(k + 1)] for k in range(4)]
    listed = [own for k in range(4) for own in (*(("reset", i) for i in range(k, -1, -1)), *sticks[k])]
    for found in (run(problem), run(problem, "scipy-dop853"), multiprecision(problem)):
        assert (found.status, told(found), found.transitions[-1].to_mode) == ("ok", listed, (0, 0, 0, 0))
        times = sorted({round(float(t.time), 9) for t in found.transitions})
        assert times == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=1e-8)


def test_whether_impacts_without_end_have_a_limit_is_not_proven() -> None:
    proof = prove(stack(("0", "1/5"), ("1", "1"), ("0", "0")))
    assert (proof.status, proof.undecided) == ("failed", proof.reason)
    assert "more than 1000 maps at one instant" in proof.undecided


def test_bodies_on_several_stops_come_to_rest_together() -> None:
    # The upper body falls at -V = -2 on the lower one, which lies. A heavy one stays there: the light one bounces with
    # r = 499/1001 of its speed, and rests after 2 V/g r/(1 - r). Equal masses meet twice at one instant; then the upper
    # one has r = 7/32 of its speed, and falls on the lower one when that lies again.
    for masses, restitution, r, count in (
        (("1000", "1"), ("0", "1/2"), 499 / 1001, 79),
        (("1", "1"), ("1/2",) * 2, 7 / 32, 181),
    ):
        problem = stack(("0", "1/5"), masses, restitution)
        for found in (*(run(problem, name) for name in SOLVERS[:3]), multiprecision(problem)):
            assert (found.status, len(found.transitions), found.transitions[-1].to_mode) == ("ok", count, (0, 0))
            assert float(found.transitions[-1].time) == pytest.approx(0.2 + 0.4 * r / (1 - r), abs=1e-13)
        assert run(problem).end_state == pytest.approx((0, 0, 0, 0), abs=1e-15)


def test_a_light_body_that_a_heavy_one_presses_on_the_ground_comes_to_rest_with_it_while_both_are_fast() -> None:
    # The gaps close long before the speeds have vanished. Digits of 200 impacts in arithmetic with 400 digits.
    for heights, masses, restitution, time, count in (
        (("1/20", "3/20"), ("1/5", "3"), ("4/5", "1/10"), "0.17470445124869776321", 16),
        (("1/4", "7/20"), ("1", "10"), ("3/10", "1/10"), "0.26541684584350278246387853646173843479", 13),
    ):
        problem = stack(heights, masses, restitution)
        truth = multiprecision(problem)
        assert abs(float(Decimal(truth.transitions[-1].time_digits) - Decimal(time))) < 1e-20
        for found in (*(run(problem, name) for name in SOLVERS[:3]), truth):
            assert (found.status, len(found.transitions), found.transitions[-1].to_mode) == ("ok", count, (0, 0))
            assert float(found.transitions[-1].time) == pytest.approx(float(time), abs=1e-13)
        assert run(problem).end_state == pytest.approx((0, 0, 0, 0), abs=1e-15)


def test_two_bodies_come_to_rest_and_the_third_still_bounces_on_them() -> None:
    # The third falls at V = 4 on a body at rest of ten times its mass, and leaves it with r = 2/11 of its speed; the
    # lower ones rest again before it returns, above the second one when they do.
    problem, r = stack(("1/5", "3/10", "4/5"), ("10", "10", "1"), ("1/2", "1/10", "3/10")), 2 / 11
    for found in (run(problem), run(problem, "scipy-dop853")):
        assert (found.status, found.transitions[-1].to_mode) == ("ok", (0, 0, 0))
        assert found.transitions[-1].time == pytest.approx(0.4 + 0.8 * r / (1 - r), abs=1e-13)
        assert found.end_state == pytest.approx((0,) * 6, abs=1e-15)
        gaps = [t.state[4] - t.state[2] for t in found.transitions if t.to_mode == (0, 0, 1)]
        assert len(gaps) > 10
        assert min(gaps) > 0


def test_impacts_without_end_leave_a_body_that_has_flown_off_alone() -> None:
    # Two lie on the ground, a heavy body on a light one: a blow of the third sets them in impacts without end.
    problem = stack(("1/20", "1/10", "3/20"), ("1/5", "10", "1/2"), ("3/10", "1/10", "1/2"))
    r = (10 * 0.5 - 0.5) / 10.5  # the third's speed after the blow, as a part of that before it
    for found in (run(problem), run(problem, "scipy-dop853")):
        assert (found.status, found.transitions[-1].to_mode) == ("ok", (0, 0, 0))
        struck = [t for t in found.transitions if t.time == pytest.approx(0.03**0.5, abs=1e-12)]
        assert [(t.kind, t.surface) for t in struck] == [("reset", i) for i in (2, 1, 0)] + [("stick", 0), ("stick", 1)]
        assert struck[-1].state == pytest.approx((0, 0, 0, 0, 0, r * 3**0.5), abs=1e-9)
        assert found.transitions[-1].time == pytest.approx(0.03**0.5 * (1 + 2 * r / (1 - r)), abs=1e-9)


def test_speeds_that_vanish_up_to_rounding_are_a_rest() -> None:
    # 10 * 3/10 = 3: the third blow leaves both bodies without speed.
    problem = stack(("0", "1/4"), ("10", "3"), ("3/10", "0"))
    for found in (*(run(problem, name) for name in SOLVERS[:3]), multiprecision(problem)):
        assert (found.status, found.transitions[-1].to_mode) == ("ok", (0, 0))
        assert told(found) == [("reset", i) for i in (1, 0, 1)] + [("stick", 0), ("stick", 1)]


def test_a_body_does_not_rest_while_another_is_about_to_fall_on_it() -> None:
    # Seen from the lower body in flight the upper one does not come closer.
    found, other = (run(stack(("1/20", "3/10"), ("10", "1"), ("4/5", "4/5")), name) for name in SOLVERS[:2])
    assert (found.status, told(found)) == (other.status, told(other))
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in other.transitions], abs=1e-9)


@pytest.mark.parametrize(("pulled", "time", "mode"), [(0, 2 / 3, (1, 0)), (1, 1 / 3, (0, 1))])
def test_a_body_rests_on_one_at_rest(pulled: int, time: float, mode: tuple[int, int]) -> None:
    # Nothing presses the upper body while the lower one falls. A force 30 t lifts both at 20 N, or the upper at 10 N.
    for more in ("", f"    - force: {{on: b{pulled}, value: 30*t}}\n"):
        problem = stack(("0", "0"), ("1", "1"), ("1/2", "1/2"), more)
        for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem)):
            assert (found.status, told(found)) == ("ok", [("release", pulled)] if more else [])
            assert [float(t.time) for t in found.transitions] == pytest.approx([time] if more else [], abs=1e-8)
            assert not more or found.transitions[-1].to_mode == mode
    # One body falls freely after the force on it has passed its weight: x = 5 (t - t0)^3, or half of it for both.
    way = 5 * (1 - time) ** 3
    assert run(problem).end_state[2] == pytest.approx(way if pulled else way / 2, abs=1e-12)


def test_chaotic_impacts_are_ill_conditioned_and_no_defect_of_a_run() -> None:
    # An error in the state grows by ten orders in 84 impacts. Runs from starts that differ by the error of a tolerance.
    def dropped(height: str) -> Problem:
        problem = stack(("1/10", height), ("5", "3"), ("4/5", "4/5"))
        return replace(problem, until=sp.Rational(13612, 10000))

    truth = exact_run(dropped("2/5")).expected
    assert truth.transitions[-1].conditioning > 1e8
    verdicts = set()
    for error in (1e-12, -1e-12, 1e-10, -1e-10, 1e-8, -1e-8):
        found = score(run(dropped(f"2/5 + {error!r}")), truth, tolerance=abs(error) / truth.scale)
        verdicts.add(found.verdict.word)
    assert "ill-conditioned" in verdicts <= {"ill-conditioned", "right"}
    assert score(run(dropped("2/5")), truth, tolerance=1e-10).verdict.word == "right"


DROP = """\
scene:
  bodies: {ground: fixed, lo: {mass: 1}, up: {mass: 2}}
  connections:
    - stop: {between: [lo, ground], gap: 0, restitution: 1}
    - stop: {between: [up, lo], gap: 1, restitution: 1}
    - force: {on: lo, value: -10}
    - force: {on: up, value: -20}
initial: {x_lo: 0, v_lo: 0, x_up: 2, v_up: 0}
until: 0.9
"""


def test_a_body_that_falls_on_one_at_rest_on_the_ground_presses_it_on_and_is_proven_to() -> None:
    # At s = -sqrt(20): (lo, up) = (0, 1) s -> (4/3, 1/3) s -> ground (-4/3, 1/3) s -> ... in five impacts, elastic.
    problem = read_problem(DROP)
    v, lo, up = 20**0.5, 0.0, -1.0
    ends = []
    for pair in (1, 0, 1, 0, 1):
        lo, up = (lo + 4 / 3 * (up - lo), up - 2 / 3 * (up - lo)) if pair else (-lo, up)
        ends.append((0.0, lo * v, 1.0, up * v))
    for found in (*(run(problem, name) for name in SOLVERS), multiprecision(problem), prove(problem)):
        assert (found.status, told(found)) == ("ok", [("reset", i) for i in (1, 0, 1, 0, 1)])
        assert found.transitions[0].from_mode == (0, 1)
        states = [[float(value) for value in t.state] for t in found.transitions]
        assert np.array(states) == pytest.approx(np.array(ends), abs=1e-7)


def test_what_is_not_proven_is_refused() -> None:
    proof = prove(read_problem(TWO.format(p="a + 1", q="2*a", priority="")))
    assert (proof.status, len(proof.transitions)) == ("failed", 0)
    assert "cannot be told apart: a tie" in proof.undecided
    both = case(first="{map: {x: '0', a: a + 1, b: b + 1}}", second="1/2 - a", map="{map: {a: '0', b: b + 1}}")
    assert prove(both).undecided == ""


def test_derivatives_lead_through_a_cascade_and_not_through_surfaces_met_at_once() -> None:
    # x' = 1 + a: at x = 1 first's map leaves (x/4, a + 1), second's carries that to (x + a/8, a^2/9).
    text = TEXT.format(
        first="{map: {x: x/4, a: a + 1}}", second="1/2 - a", map="{map: {x: x + a/8, a: a^2/9}}", until=1
    )
    found, step = [], 1e-5
    for change in (-step, step):
        moved = read_problem(text.replace('["1"', '["1 + a"').replace("a: 0, b: 0}", f"a: {0.1 + change!r}, b: 0}}"))
        found.append(run(moved).end_state)
    problem = read_problem(text.replace('["1"', '["1 + a"').replace("a: 0, b: 0}", "a: 0.1, b: 0}"))
    assert told(run(problem)) == [("reset", 0), ("reset", 1)]
    matrix, _ = fundamental_matrix(problem, problem.start, problem.until, tolerance=1e-12)
    assert matrix[:, 1] == pytest.approx((np.array(found[1]) - np.array(found[0])) / (2 * step), abs=1e-7)
    assert all(0 < c < 2 for c in conditioning(problem, multiprecision(problem).transitions))
    balls = row(("1", "1", "1"), ("1", "0", "0"))
    with pytest.raises(UnsupportedError, match="2 surfaces reset the state"):
        fundamental_matrix(balls, balls.start, balls.until, tolerance=1e-10)
