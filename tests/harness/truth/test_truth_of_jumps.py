"""Truths of systems with jumps of the state: both routes against closed forms, and the conditioning of impacts."""

from __future__ import annotations

import pytest
import sympy as sp
from flint import arb
from problems import read_problem

from henon_ref.harness.registry import solver
from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.harness.truth.multiprecision.route import multiprecision
from henon_ref.harness.truth.proofs import prove
from henon_ref.harness.truth.reference import Route
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Reset
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision
from tests.support.resets import S, V, X, ball, impact_oscillator, oscillator_impacts

T = sp.sqrt(sp.Rational(1, 5))
R = sp.Rational(4, 5)


def routes(problem: Problem) -> list[Route]:
    return [multiprecision(problem), prove(problem)]


def test_both_routes_have_the_impacts_of_a_ball() -> None:
    exact = [T * (1 + 2 * sum(R**j for j in range(1, k + 1))) for k in range(10)]
    for route in routes(ball(sp.Integer(3) + sp.Rational(5, 8), R)):
        assert (route.status, route.undecided) == ("ok", "")
        assert [(t.kind, t.from_mode, t.to_mode) for t in route.transitions] == [("reset", (1,), (1,))] * 10
        with working_precision(300):
            for k, (found, time) in enumerate(zip(route.transitions, exact, strict=True)):
                assert abs(arb(found.time_digits) - arb(str(sp.N(time, 90)))) < found.radius < 1e-29
                speed = sp.N(10 * T * R ** (k + 1), 90)
                assert abs(arb(found.state[1]) - arb(str(speed))) < found.state_radius < 1e-20


def test_both_routes_have_impacts_next_to_a_graze() -> None:
    times = oscillator_impacts(1e-10, 0.5, 30.0)
    for route in routes(impact_oscillator(sp.Rational("1e-10"), sp.Rational(1, 2), 30)):
        assert (route.status, [t.kind for t in route.transitions]) == ("ok", ["reset"] * len(times))
        assert [t.time for t in route.transitions] == pytest.approx(times, abs=1e-12, rel=0)


def test_both_routes_change_the_side_of_another_surface() -> None:
    u = sp.Symbol("u", real=True)
    system = FilippovSystem((X, V), (S, u), (1 - X, V), (V, -u / 4), resets={0: Reset({V: -V})})
    for route in routes(Problem(system, sp.Integer(0), (sp.Integer(0), sp.Integer(2)), sp.Integer(1))):
        assert [(t.kind, t.surface, t.to_mode) for t in route.transitions] == [
            ("reset", 0, (1, -1)),
            ("crossing", 1, (1, -1)),
        ]


def test_conditioning_is_that_of_the_closed_form() -> None:
    # From height h with speed w a ball falls for (w + a) / 10 and arrives with the speed a = sqrt(w^2 + 20 h).
    problem = ball(sp.Integer(3), R)
    found = conditioning(problem, multiprecision(problem).transitions)
    h, w = sp.symbols("h w", real=True)
    arrival = sp.sqrt(w**2 + 20 * h)
    for k, value in enumerate(found):
        time = (w + arrival) / 10 + 2 * arrival / 10 * sum(R**j for j in range(1, k + 1))
        at = {h: 1, w: 0}
        from_start = sp.sqrt(sp.diff(time, h).subs(at) ** 2 + sp.diff(time, w).subs(at) ** 2)
        # ... or by an error just after an impact before, of which the speed is r^j v.
        later = [_after(k + 1 - j, 10 * T * R**j) for j in range(1, k + 1)]
        assert value == pytest.approx(float(max([from_start, *later], key=float)), rel=1e-3)


def _after(impacts: int, speed: sp.Expr) -> sp.Expr:
    """Derivative of the time of an impact by height and speed just after an earlier one."""
    h, w = sp.symbols("h w", real=True)
    arrival = sp.sqrt(w**2 + 20 * h)
    time = (w + arrival) / 10 + 2 * arrival / 10 * sum(R**j for j in range(1, impacts))
    at = {h: 0, w: speed}
    return sp.sqrt(sp.diff(time, h).subs(at) ** 2 + sp.diff(time, w).subs(at) ** 2)


def test_a_rest_at_the_instant_of_its_impact_moves_with_it() -> None:
    """x = 1 - 2t + 3t^2/20 is at the stop at t0 with the speed w; an error (x, v) at the start moves that (x + v t0)/w.

    Restitution 0 leaves no speed: friction sticks, and the body rests on the stop at once, by rows of that one instant.
    """
    text = """\
scene:
  bodies: {a: {mass: 1}, wall: fixed}
  connections:
    - friction: {between: [a, wall], law: coulomb, force: 0.3}
    - stop: {between: [a, wall], gap: 0, restitution: 0}
initial: {x_a: 1, v_a: -2}
until: 2
"""
    problem = read_problem(text)
    found = multiprecision(problem).transitions
    w = (4 - 0.6) ** 0.5
    t0 = (2 - w) / 0.3
    assert {t.kind for t in found} >= {"reset"}
    assert [t.time for t in found] == pytest.approx([t0] * len(found), abs=1e-15)
    assert conditioning(problem, found) == pytest.approx([(1 + t0**2) ** 0.5 / w] * len(found), rel=1e-3)


def test_the_limit_of_the_impacts_of_a_ball() -> None:
    problem = ball(sp.Integer(5), R)
    found = multiprecision(problem)
    *impacts, last = found.transitions
    assert (found.status, {t.kind for t in impacts}, last.kind, last.to_mode) == ("ok", {"reset"}, "stick", (0,))
    with working_precision(300):
        assert abs(arb(last.time_digits) - arb(str(sp.N(9 * T, 90)))) < 1e-40
    proof = prove(problem)
    assert (proof.status, len(proof.transitions)) == ("ok", len(impacts) + 1)
    assert (proof.transitions[-1].kind, proof.transitions[-1].to_mode) == ("stick", (0,))
    with working_precision(300):
        assert abs(arb(proof.transitions[-1].time_digits) - arb(str(sp.N(9 * T, 90)))) < proof.transitions[-1].radius
    assert proof.transitions[-1].radius < 1e-29
    # Most by a height h just after the last impact, at speed v: (v + s + 2 s r / (1 - r)) / 10 with s^2 = v^2 + 20 h.
    speed = float(impacts[-1].state[1])
    assert conditioning(problem, found.transitions)[-1] == pytest.approx(9 / speed, rel=1e-3)


@pytest.mark.parametrize("rests", [True, False])
def test_a_start_that_moves_into_the_surface_is_invalid_on_every_route(rests: bool) -> None:
    # A body that a wall throws back, and one whose velocity the wall sets: nothing can rest on that one.
    jump = {V: -V / 2} if rests else {V: V * V + 1}
    system = with_resting(FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(-10)), resets={0: Reset(jump)}))
    assert system.rests(0) == rests
    problem = Problem(system, sp.Integer(0), (sp.Integer(0), sp.Integer(-1)), sp.Integer(1))
    runs = [solver(name).prepare(problem, rtol=1e-9)() for name in ("henon", "henon-newton", "scipy-dop853", "heyoka")]
    for found in (*runs, *routes(problem)):
        assert (found.status, len(found.transitions)) == ("invalid", 0)
        assert found.reason.endswith(" the state is on s, which resets it, and moves into it")
