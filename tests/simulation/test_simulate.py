"""Runs from Python against closed forms, and how they end where they do not reach their horizon."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from fractions import Fraction
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import henon_ref as hr
from henon_ref.baselines.henon import HENON_SOLVER

CASES = Path(__file__).parents[2] / "cases"
OSCILLATOR = hr.System(["x", "v"], {"w": 1}, {"s": "x"}, ["v", "-w^2*x"])
"""x = cos(w t) from (1, 0): crosses 0 at (k + 1/2) pi / w."""
BLOCK = hr.System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
"""A block under Coulomb friction F: from v0 it slides v0^2 / (2 F) in v0 / F, and rests."""
BELT = hr.System(["x", "v"], {"F": 1, "P": 0.25, "vb": 2}, {"s": "v - vb"}, ["v", "P - F*s"])
"""A block on a belt, pulled by P < F: from v0 < vb it has the belt's speed after (vb - v0) / (P + F), and keeps it."""


@pytest.mark.parametrize(("speed", "friction"), [(1, 0.5), (Fraction(1, 3), "2/7"), (2.5, 0.1)])
def test_a_block_slides_to_rest(speed: float, friction: float) -> None:
    run = hr.simulate(BLOCK, {"x": 0, "v": speed}, until=40, parameters={"F": friction})
    v, f = float(Fraction(speed)), float(Fraction(friction))
    assert run.transitions[["kind", "from_mode", "to_mode"]].values.tolist() == [["stick", "s=+1", "s=0"]]
    assert run.transitions.time_s[0] == pytest.approx(v / f, rel=1e-12)
    assert run.y[:, -1] == pytest.approx([v * v / (2 * f), 0], abs=1e-12)
    assert (run.status, run.success, run.final_mode, len(run.sticks)) == ("ok", True, "s=0", 0)


def test_a_block_is_carried_away_by_the_belt() -> None:
    run = hr.simulate(BELT, {"x": 0, "v": -1}, until=10)
    assert run.transitions.time_s.tolist() == pytest.approx([3 / 1.25], rel=1e-12)
    gone = -2.4 + 1.25 * 2.4**2 / 2
    assert run.y[:, -1] == pytest.approx([gone + 2 * (10 - 2.4), 2], rel=1e-12)


def test_a_linear_oscillator_crosses_at_half_periods() -> None:
    run = hr.simulate(OSCILLATOR, {"x": 1, "v": 0}, until=30, parameters={"w": 2})
    assert run.transitions.time_s.to_numpy() == pytest.approx((np.arange(len(run.transitions)) + 0.5) * math.pi / 2)
    assert len(run.transitions) == int(60 / math.pi + 0.5)
    assert set(run.transitions.kind) == {"crossing"}


def test_it_is_the_reference_to_the_last_bit() -> None:
    for name in ("stribeck_belt", "free_coulomb", "two_blocks"):
        system = hr.System.from_case(CASES / f"{name}.yaml")
        run = hr.simulate(system, system.initial, until=system.until, start=system.start, mode=system.mode, rtol=1e-9)
        truth = HENON_SOLVER.prepare(hr.load_case(CASES / f"{name}.yaml").readings[0].problem, rtol=1e-9)()
        assert run.transitions.time_s.tolist() == [event.time for event in truth.transitions]
        assert run.y[:, -1].tolist() == list(truth.end_state)
        assert run.counts == truth.counts


def test_numbers_may_be_text_in_parameters() -> None:
    run = hr.simulate(BLOCK, {"x": 0, "v": "2*F"}, start="F - 1/2", until="4*F", parameters={"F": "3/4"})
    assert (run.t[0], run.t[-1]) == (0.25, 3.0)
    assert run.transitions.time_s.tolist() == [2.25]


def test_an_array_without_dimensions_is_its_number() -> None:
    one = hr.simulate(OSCILLATOR, {"x": 1, "v": 0}, start=1, until=3.5, rtol=1e-9, max_steps=100)
    start, until, rtol, most = np.array(1), np.array(3.5), np.array(1e-9), np.array(100)
    initial = {"x": np.array(1), "v": np.array(0.0)}
    other = hr.simulate(OSCILLATOR, initial, start=start, until=until, rtol=rtol, max_steps=most)
    assert np.array_equal(one.y, other.y)
    with pytest.raises(hr.ArgumentError, match=r"'until' is array\(\[3\.5\]\); wanted a number"):
        hr.simulate(OSCILLATOR, initial, until=np.array([3.5]))


def test_parameters_of_a_run_do_not_stay() -> None:
    before = hr.simulate(BLOCK, {"x": 0, "v": 1}, until=3)
    hr.simulate(BLOCK, {"x": 0, "v": 1}, until=3, parameters={"F": 7})
    assert hr.simulate(BLOCK, {"x": 0, "v": 1}, until=3).transitions.equals(before.transitions)
    assert BLOCK.parameters == {"F": Fraction(1, 2)}


def test_a_start_on_a_surface_sticks_where_the_fields_hold_it() -> None:
    run = hr.simulate(BELT, {"x": 0, "v": 2}, until=1)
    assert (len(run.transitions), run.final_mode, run.y[0, -1]) == (0, "s=0", 2.0)
    pulled = hr.simulate(BELT, {"x": 0, "v": 2}, until=1, parameters={"P": 3})
    assert (len(pulled.transitions), pulled.final_mode) == (0, "s=+1")
    assert pulled.y[1, -1] == pytest.approx(4)


def test_a_decimal_start_lies_on_a_decimal_surface() -> None:
    """0.1 is 1/10, not the double next to it: the start is on the surface."""
    run = hr.simulate(BELT, {"x": 0, "v": 0.1}, until=1, parameters={"vb": "1/10"})
    assert (len(run.transitions), run.final_mode) == (0, "s=0")


REPELLING = hr.System(["x"], {}, {"s": "x"}, ["s"])
"""Both fields point away from x = 0."""


def test_a_start_that_the_fields_leave_open_is_no_exception() -> None:
    run = hr.simulate(REPELLING, {"x": 0}, until=1)
    assert (run.status, run.success, run.final_mode) == ("nonunique", False, "")
    assert "not unique" in run.message
    assert (run.t.tolist(), run.y.tolist(), len(run.transitions)) == ([0.0], [[0.0]], 0)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_mode_settles_it(side: int) -> None:
    run = hr.simulate(REPELLING, {"x": 0}, until=1, mode={"s": side})
    assert (run.success, run.y[0, -1]) == (True, side)


def test_a_blow_up_is_no_exception() -> None:
    run = hr.simulate(hr.System(["x"], {}, {"s": "x"}, ["x^2"]), {"x": 1}, until=2)
    assert (run.status, run.success) == ("diverged", False)
    assert run.t[-1] == pytest.approx(1)
    assert "leaves every bound" in run.message


def test_the_end_of_the_model_is_no_exception() -> None:
    fall = hr.System(["x"], {}, {"s": "x - 5"}, ["-1"], valid=["x"])
    run = hr.simulate(fall, {"x": 1}, until=2)
    assert (run.status, run.t[-1]) == ("invalid", pytest.approx(1))
    outside = hr.simulate(fall, {"x": -1}, until=2)
    assert (outside.status, outside.t.tolist()) == ("invalid", [0.0])


def test_two_events_in_one_step_are_both_found() -> None:
    """A parabola that dips below zero for 2e-3 s."""
    dip = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "2"])
    run = hr.simulate(dip, {"x": "1 - 1e-6", "v": -2}, until=2)
    assert run.transitions.time_s.tolist() == pytest.approx([1 - 1e-3, 1 + 1e-3], rel=1e-12)


def test_a_graze_changes_no_mode() -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": "x"}, ["v", "2"]), {"x": 1, "v": -2}, until=2)
    assert run.transitions[["kind", "from_mode", "to_mode"]].values.tolist() == [["graze", "s=+1", "s=+1"]]
    assert run.transitions.time_s.tolist() == [1.0]
    assert run.y[:, -1] == pytest.approx([1, 2])


def test_an_event_at_the_horizon_counts() -> None:
    run = hr.simulate(BELT, {"x": 0, "v": 0.75}, until=1)
    assert run.transitions.time_s.tolist() == [1.0]
    assert (run.t[-1], run.final_mode) == (1.0, "s=0")


def test_sliding_of_ones_own_is_kept() -> None:
    ends = [
        {"when": "x - Fs", "direction": "rising", "to": -1},
        {"when": "x + Fs", "direction": "falling", "to": 1},
    ]
    hold = {"s": {"field": ["vb", 0], "release": ends}}
    rule = {"Fs": 1.5, "Fk": 1, "vb": 0.5}
    belt = hr.System(["x", "v"], rule, {"s": "v - vb"}, ["v", "-x - Fk*s"], sliding=hold)
    run = hr.simulate(belt, {"x": 1.5, "v": 0.5}, until=20, mode={"s": -1})
    assert run.sticks.duration_s.tolist() == pytest.approx([2.0, 2.0], rel=1e-11)  # 2 (Fs - Fk) / vb


EULER = hr.System(["x", "v"], {"e": 0.5}, {"s": "v"}, ["v", "-e*s"])
"""Without its parameter e, e would be Euler's number."""
REFUSED = {
    "nan": {"initial": {"x": math.nan, "v": 0}},
    "infinity": {"initial": {"x": 0, "v": np.inf}},
    "nan as text": {"initial": {"x": "nan", "v": 0}},
    "a missing state": {"initial": {"x": 0}},
    "an unknown state": {"initial": {"x": 0, "v": 0, "q": 1}},
    "a time among the states": {"initial": {"x": 0, "v": 0, "t": 1}},
    "a state that is None": {"initial": {"x": None, "v": 0}},
    "a truth value": {"initial": {"x": True, "v": 0}},
    "a name that is no parameter": {"initial": {"x": "q", "v": 0}},
    "an unknown parameter": {"parameters": {"G": 1}},
    "a parameter that is nan": {"parameters": {"F": math.nan}},
    "parameters that are a number": {"parameters": 3},
    "parameters in an array": {"parameters": np.array([1.0, 2.0])},
    "parameters in an empty list": {"parameters": []},
    "parameters in a row of a table": {"parameters": pd.DataFrame({"F": [0.5, 1]}).iloc[1]},
    "a parameter that is None": {"system": EULER, "parameters": {"e": None}},
    "a mode of an unknown surface": {"mode": {"q": 1}},
    "a mode that is none": {"mode": {"s": 2}},
    "a mode on the other side": {"mode": {"s": -1}},
    "a horizon at the start": {"until": 0},
    "a horizon before the start": {"until": 1, "start": 2},
    "a horizon that is nan": {"until": math.nan},
    "a horizon at infinity": {"until": math.inf},
    "a horizon that is None": {"until": None},
    "a start that is infinite": {"start": -math.inf},
    "a tolerance of 0": {"rtol": 0},
    "a negative tolerance": {"rtol": -1e-6},
    "a tolerance of 1": {"rtol": 1},
    "a tolerance that is nan": {"rtol": math.nan},
    "a tolerance that is text": {"rtol": "1e-6"},
    "a stop on an unknown surface": {"stop": {"q": "falling"}},
    "a stop in no direction": {"stop": {"s": "sideways"}},
    "a stop in a list of directions": {"stop": {"s": ["falling"]}},
    "a stop that is text": {"stop": "s"},
    "a stop in an array": {"stop": np.array(["s", "falling"])},
    "a number of steps in an array": {"max_steps": np.array([1, 2])},
    "a giant number": {"until": 10**400},
    "a giant power": {"until": "9^9^9^9"},
    "a giant tolerance": {"rtol": 10**400},
    "no system": {"system": "belt"},
}


@pytest.mark.parametrize("argument", ["initial", "parameters", "mode", "stop"])
def test_a_series_is_refused_as_no_mapping(argument: str) -> None:
    given = {"initial": {"x": 0, "v": 1}, argument: pd.Series({"x": 0.0, "v": 1.0})}
    with pytest.raises(hr.ArgumentError, match=f"'{argument}' must be a mapping, as in "):
        hr.simulate(BLOCK, given.pop("initial"), until=3, **given)


@pytest.mark.parametrize("given", [pd.Series({"F": 1.0}), ["F"]])
@pytest.mark.parametrize("argument", ["parameters", "surfaces", "sliding", "resets"])
def test_a_system_and_a_scene_refuse_what_is_no_mapping_as_simulate_does(argument: str, given: Any) -> None:
    described: dict[str, Any] = {"state": ["x"], "surfaces": {"s": "x"}, "field": ["-s"], argument: given}
    words = rf"'{argument}' must be a mapping, as in \{{name: value\}}; here it is of type {type(given).__name__}$"
    with pytest.raises(hr.ArgumentError, match=words):
        hr.System(**described)
    if argument == "parameters":
        with pytest.raises(hr.ArgumentError, match=words):
            hr.Scene(parameters=given)


@pytest.mark.parametrize("front", [hr.simulate, hr.stream])
@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_meant_is_refused_at_once(what: str, front: object) -> None:
    given = {"system": BLOCK, "initial": {"x": 0, "v": 1}, "until": 3, **REFUSED[what]}
    with pytest.raises(hr.HenonRefError) as refused:
        front(given.pop("system"), given.pop("initial"), **given)
    assert isinstance(refused.value, ValueError)
    assert 0 < len(str(refused.value)) < 400


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: hr.simulate(BLOCK, {"x": 0, "v": 1}, untill=3), "simulate has no argument 'untill'; did you mean 'u"),
        (lambda: hr.stream(BLOCK, {"x": 0, "v": 1}, until=3, modes={}), "did you mean 'mode'?; it takes system"),
        (lambda: hr.simulate(BLOCK, {"x": 0, "v": 1}, 3), "simulate takes system, initial without a name; write what"),
        (lambda: hr.simulate(BLOCK, [0, 1], 0, 3), "as in until=..."),
        (lambda: hr.simulate(BLOCK, [0, 1], until=3, atol=1e-9), "'atol': leave it out; rtol is relative"),
        (lambda: hr.simulate(), "missing 1 required positional argument: 'system'"),
        (lambda: hr.sweep(BLOCK, [0, 1], until=3, grids={}), "did you mean 'grid'?"),
        (lambda: hr.sweep(BLOCK, [0, 1], until=3, grid={"F": [1]}, atol=1), "sweep has no argument 'atol': leave"),
        (lambda: hr.System(["x"], parameter={}), "System has no argument 'parameter'; did you mean 'parameters'?"),
        (lambda: hr.Scene(parameter={}), "Scene has no argument 'parameter'"),
        (lambda: hr.Scene().body("a", mas=1), "did you mean 'mass'?; it takes name, mass, states"),
        (lambda: hr.Scene().friction("a", "b", law="coulomb", force=1, statc=2), "did you mean 'static'?"),
        (lambda: hr.Scene().plot(axis=1), "Scene.plot has no argument 'axis'"),
        (lambda: hr.observe.sticks(afer=3), "sticks has no argument 'afer'; did you mean 'after'?"),
        (lambda: hr.points.continuation({"F": [1]}, grid={}), "continuation has no argument 'grid'; it takes along, a"),
        (lambda: hr.points.random({}, seed=1), "random() missing 1 required keyword-only argument: 'count'"),
        (lambda: hr.lyapunov_exponents(BLOCK, [0, 1], spn=3), "did you mean 'span'?"),
        (lambda: hr.periodic_orbit(BLOCK, [0, 1], untl=3), "did you mean 'until'?"),
        (lambda: hr.tangent_points(BLOCK, surfce="s"), "did you mean 'surface'?"),
        (lambda: hr.simulate(BLOCK, [0, 1], until=1).plot(transition=True), "plot has no argument 'transition'; did"),
        (lambda: hr.simulate(BLOCK, [0, 1], until=1).plot(colour="red"), "did you mean 'color'?; it takes x, y, ax"),
        (lambda: hr.simulate(BLOCK, [0, 1], until=1).plot_time("x", axe=1), "plot_time has no argument 'axe'"),
    ],
)  # fmt: skip
def test_a_call_that_does_not_fit_says_what_does(call: Callable[[], object], says: str) -> None:
    with pytest.raises(hr.ArgumentError, match=re.escape(says)) as refused:
        call()
    assert isinstance(refused.value, TypeError)
    assert refused.value.__cause__ is None


def test_a_type_error_within_is_the_users_own() -> None:
    def wrong(run: hr.Solution) -> float:
        return run + 1

    observed = [hr.observe.function(wrong)]
    with pytest.raises(TypeError, match="unsupported operand") as raised:
        hr.sweep(BLOCK, [0, 1], until=3, grid={"F": [1]}, observe=observed, jobs=1)
    assert not isinstance(raised.value, hr.HenonRefError)


def test_names_may_be_symbols() -> None:
    x, v = sp.symbols("x v")
    assert hr.simulate(BLOCK, {x: 0, v: 1}, until=3).transitions.time_s.tolist() == [2.0]


@pytest.mark.parametrize(("surface", "x"), [("1/x - 2", 0), ("log(x)", 0), ("sqrt(x) - 1", -1), ("tan(pi*x)", "1/2")])
def test_a_surface_without_a_value_at_the_start_is_refused(surface: str, x: object) -> None:
    with pytest.raises(hr.HenonRefError, match="the surface of 's' has no finite real value at the start"):
        hr.simulate(hr.System(["x"], {}, {"s": surface}, ["1"]), {"x": x}, until=1)


@pytest.mark.parametrize("function", [hr.simulate, hr.stream])
def test_arguments_of_scipy_are_refused_with_what_to_write(function: Callable[..., object]) -> None:
    system = hr.System(["x"], {}, {}, ["-x"])
    names = [name for name in signature(solve_ivp).parameters if name not in ("fun", "dense_output", "options")]
    for name in (*names, "atol"):
        given = {"until": 1, name: 1e-6}
        with pytest.raises(ValueError, match=f"{function.__name__} has no argument '{name}': "):
            function(system, {"x": 1}, **given)
    with pytest.raises(ValueError, match=r"write run\.sol\(times\), or run\.to_dataframe\(times\)"):
        function(system, {"x": 1}, until=1, t_eval=[0, 1])
    with pytest.raises(ValueError, match="the field as text, not a function"):
        function(lambda t, y: -y, (0, 10))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((OSCILLATOR, {"x": 1, "v": 0}), "'until' is missing: only a system from a case has a horizon of its own"),
        ((hr.Scene(), {}), "wanted a System: write scene.system()"),
    ],
)
def test_what_is_missing_is_named(arguments, words) -> None:
    with pytest.raises(hr.ArgumentError, match=re.escape(words)):
        hr.simulate(*arguments)


def test_a_masked_value_is_no_initial_value() -> None:
    with pytest.raises(hr.ArgumentError, match=r"'initial' is \[1.0 --\]; wanted a number for each of x, v"):
        hr.simulate(OSCILLATOR, np.ma.array([1.0, 0.0], mask=[False, True]), until=1)


def test_a_law_of_exponentials_is_the_same_in_any_unit() -> None:
    """A belt and a block in metres and in a unit of which a metre is 1e12: the same times."""
    times = []
    for unit in ("1", "1e-12"):
        system = hr.System(["x", "v"], {"u": unit}, {"s": "v - u/5"}, ["v", "-x - s*u*exp(-abs(v - u/5)/(u/2))"])
        run = hr.simulate(system, {"x": "3*u/2", "v": 0}, until=40, rtol=1e-10)
        assert run.success
        times.append(run.transitions["time_s"])
    assert len(times[0]) == len(times[1]) > 5
    assert abs(times[0] - times[1]).max() < 1e-12


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-7, 1e-10])
@pytest.mark.parametrize("load", ["max(0, sin(t))", "sin(t)*(1 + n)/2"])
def test_a_contact_whose_load_returns_from_zero_holds_again(load: str, rtol: float) -> None:
    """The block stops in the second half wave of the load, where 0.3 (3 - cos t) = 1; then no force acts on it."""
    block = hr.System(["x", "v"], {}, {"s": "v", "n": "sin(t)"}, ["v", f"-0.3*s*{load}"])
    run = hr.simulate(block, {"x": 0, "v": 1}, until=40, rtol=rtol)
    assert run.success, run.message
    changes = run.transitions[run.transitions["surface"] == "s"]
    assert changes["kind"].tolist() == ["stick"]
    assert changes["time_s"].iloc[0] == pytest.approx(2 * math.pi + math.acos(-1 / 3), abs=10 * rtol)
