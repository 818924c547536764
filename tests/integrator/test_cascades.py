"""Resets that trigger resets, and impacts that trigger impacts, at one instant: closed forms, on every route.

Several events at one instant are as SBML (Level 3, Sec. 4.11) and the Modelica language (Sec. 8.5) have them.
"""

from __future__ import annotations

from functools import lru_cache
from math import acosh, sqrt

import numpy as np
import pytest
from derivatives import fundamental_matrix
from multiprecision import multiprecision
from problems import read_problem

import henon_ref as hr
from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import solver
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
