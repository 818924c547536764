"""Extremes along runs: closed forms, a fine grid of the dense output, and the same bits however a sweep is cut."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sweep_rates import friction_oscillator

import henon_ref as hr

BALL = hr.System(["h", "v"], {"g": 10, "r": 0.5}, {"s": "h"}, ["v", "-g"], resets={"s": {"map": {"v": "-r*v"}}})
CLOCK = hr.System(["x", "v"], {"w": 1}, {"s": "x - 9"}, ["v", "-w^2*x"])


def extremes(system: hr.System, initial: Any, until: Any, grid: Any, of: str, **how: Any) -> tuple[Any, Any]:
    after, chunk = how.pop("after", None), how.pop("chunk", None)
    observed = [hr.observe.extremes(of, after=after, name="e")]
    table = hr.sweep(system, initial, until=until, grid=grid, observe=observed, jobs=1, chunk=chunk, **how)
    assert set(table.status) == {"ok"}
    return table["min_e"].to_numpy(), table["max_e"].to_numpy()


GRID = {"x": [-1.5, 0.3, 2.0], "v": [0.1, 1.9]}


@cache
def fine_grid() -> tuple[np.ndarray, list[np.ndarray]]:
    """Times, and the states of the friction oscillator there from each start of GRID."""
    t = np.linspace(7.3, 30, 300_001)
    starts = [{"x": x, "v": v} for x in GRID["x"] for v in GRID["v"]]
    return t, [hr.simulate(friction_oscillator(), start, until=30, rtol=1e-9).sol(t) for start in starts]


@pytest.mark.parametrize(
    "of", ["v", "x", "x*v", "v - vd", "exp(-x^2)*cos(5*t)", "sin(3*x*v)/(1 + v^2)", "sqrt(4 - t/10)"]
)
def test_extremes_are_those_of_a_fine_grid(of: str) -> None:
    """The friction oscillator: a stick ends where the velocity's derivative is zero on one side."""
    least, largest = extremes(friction_oscillator(), {"x": 0, "v": 0}, 30, GRID, of, after=7.3, rtol=1e-9)
    names = sp.symbols("t x v vd")
    expression = sp.lambdify(names, sp.sympify(of.replace("^", "**"), {str(n): n for n in names}), "numpy")
    t, runs = fine_grid()
    for k, states in enumerate(runs):
        values = expression(t, *states, 1.5)
        assert least[k] <= values.min() + 1e-14
        assert largest[k] >= values.max() - 1e-14
        assert (least[k], largest[k]) == pytest.approx((values.min(), values.max()), abs=1e-7)


def test_extremes_at_a_jump_are_of_both_sides() -> None:
    """A ball falls from h = g/2 in a second: it meets the ground at -g and leaves it at r g."""
    least, largest = extremes(BALL, {"h": 5, "v": 0}, 1.3, {"r": [0.5, 0.8]}, "v")
    assert least == pytest.approx([-10, -10], rel=1e-14)
    assert largest == pytest.approx([5, 8], rel=1e-14)


def test_extremes_include_the_state_between_two_jumps_at_one_instant() -> None:
    """x = t to 1, where a becomes p; from 4 on, that resets a to 0 at once. ``run.y`` has a = p, too."""
    resets = {"s": {"map": {"x": "0", "a": "p"}}, "u": {"map": {"a": "0"}}}
    chain = hr.System(["x", "a"], {"p": 5}, {"s": "1 - x", "u": "4 - a"}, ["1", "0"], resets=resets)
    for after in (None, 1.0, 1.25):
        least, largest = extremes(chain, {"x": 0, "a": 2}, 1.5, {"p": [5, 3]}, "a", after=after)
        assert least.tolist() == [0, 3 if after == 1.25 else 2]
        assert largest.tolist() == [0 if after == 1.25 else 5, 3]
    assert hr.simulate(chain, {"x": 0, "a": 2}, until=1.5).y[1].max() == 5


def test_the_top_of_a_parabola() -> None:
    """h = v t - g t^2/2 up to v^2/(2 g); energy is the same along a flight."""
    speeds = [1.0, 2.0, 3.0]
    _, largest = extremes(BALL, {"h": 0.25, "v": 0}, 0.5, {"v": speeds}, "h")
    assert largest == pytest.approx([0.25 + v * v / 20 for v in speeds], rel=1e-15)
    least, largest = extremes(BALL, {"h": 0.25, "v": 0}, 0.1, {"v": speeds}, "v^2/2 + g*h")
    assert least == pytest.approx(largest, rel=1e-14)


def test_from_a_time_on() -> None:
    """x = cos(w t); a time within a step, the horizon itself, and one that no run reaches are taken as they are."""
    speeds = [0.5, 1.0, 2.0]
    least, largest = extremes(CLOCK, {"x": 1, "v": 0}, 3, {"w": speeds}, "x", after=2.75)
    ends = [sorted((math.cos(2.75 * w), math.cos(3 * w))) for w in speeds]
    ends[1][0] = min(ends[1][0], math.cos(3.0))
    assert least == pytest.approx([e[0] for e in ends], abs=1e-10)
    assert largest == pytest.approx([e[1] for e in ends], abs=1e-10)
    least, _ = extremes(CLOCK, {"x": 1, "v": 0}, 3.5, {"w": [1.0]}, "x", after=2.0)
    assert least == pytest.approx([-1], abs=1e-10)


def test_an_expression_that_has_a_branch_point_where_it_is_least() -> None:
    """sqrt(h) of a ball that falls: 0 at the ground."""
    least, largest = extremes(BALL, {"h": 5, "v": 0}, 1, {"r": [0.5]}, "sqrt(h + 1/4)")
    assert (least, largest) == (pytest.approx([0.5], rel=1e-9), pytest.approx([math.sqrt(5.25)], rel=1e-14))


def test_a_peak_far_narrower_than_a_step_is_missed() -> None:
    """As the docstring of ``observe.extremes`` states; a peak that shows in the series on a step is found."""
    system = hr.System(["x", "v"], {"w": 1}, {"s": "v"}, ["v", "-w^2*x"])
    for sharpness, expected in ((10, 1.0), (1000, 0.0)):
        _, largest = extremes(system, {"x": 1, "v": 0}, 3, {"w": [1.0]}, f"exp(-({sharpness}*(x - 0.3))^2)")
        assert largest == pytest.approx([expected], abs=1e-12)


def test_a_run_whose_steps_exceed_the_memory_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its dense output would end before the run."""
    system = hr.System(["x", "v"], {"w": 1}, {}, ["v", "-w^2*x"])
    monkeypatch.setattr("henon_ref.integrator.state_view.MOST_KEPT", 10**5)
    observed = [hr.observe.extremes("x*t", name="e")]
    table = hr.sweep(system, {"x": 1, "v": 0}, until=5000, grid={"w": [1, 0.001]}, observe=observed, jobs=1)
    assert table["status"].tolist() == ["ok", "ok"]
    assert np.isnan(table["max_e"]).tolist() == [True, False]


def test_a_run_that_blows_up_has_extremes() -> None:
    """x = 1/(1 - p t): steps shrink below the last place of the time."""
    system = hr.System(["x"], {"p": 1}, {"s": "x + 5"}, ["p*x^2"])
    table = hr.sweep(system, {"x": 1}, until=5, grid={"p": [1.0, 0.5]}, observe=[hr.observe.extremes("x")], jobs=1)
    assert table["status"].tolist() == ["diverged", "diverged"]
    assert table["min_x"].tolist() == [1, 1]
    assert ((table["max_x"] > 1e100) & (table["max_x"] < 1e101)).all()


def test_the_same_bits_however_a_sweep_is_cut() -> None:
    grid = {"x": np.linspace(-2, 2, 23).tolist(), "v": [0.1, 1.1]}
    cuts = [
        extremes(friction_oscillator(), {"x": 0, "v": 0}, 25, grid, "x*v - t/50", after=3, chunk=chunk)
        for chunk in (46, 7, 1)
    ]
    for cut in cuts[1:]:
        assert [column.tobytes() for column in cut] == [column.tobytes() for column in cuts[0]]


TERMS = range(1, 25)


def test_extremes_of_two_dozen_quotients() -> None:
    """A block slides to rest: x = t - F t^2/2, v = 1 - F t; the values are those on a fine grid of t."""
    block = hr.System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    of = " + ".join(f"sin({k}*x*v)/(1 + x^{k})" for k in TERMS)
    observed = [hr.observe.extremes(of, name="sum")]
    table = hr.sweep(block, {"x": 0, "v": 1}, until=9, grid={"F": [0.5, 1]}, observe=observed, jobs=1)
    assert table.status.tolist() == ["ok", "ok"]
    for force, least, largest in zip(table.F, table.min_sum, table.max_sum, strict=True):
        t = np.linspace(0, 1 / force, 200_001)
        x, v = t - force * t**2 / 2, 1 - force * t
        values = sum(np.sin(k * x * v) / (1 + x**k) for k in TERMS)
        assert (least, largest) == pytest.approx((values.min(), values.max()), abs=1e-7)
