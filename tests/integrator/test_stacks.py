"""Bodies that fall on each other and come to rest together: closed forms and 400 digits, on every route."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest
import sympy as sp
from multiprecision import multiprecision
from problems import read_problem
from random_scenes import exact_run
from test_cascades import SOLVERS, run, told

from henon_ref.harness.score.scoring import score
from henon_ref.harness.truth.proofs import prove
from henon_ref.modes.problem import Problem


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
