"""A system from Python: read as a case file's, equal by what it says, and refused where it cannot be meant."""

from __future__ import annotations

import math
import pickle
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"
BELT = {
    "state": ["x", "v"],
    "parameters": {"F": 1, "d": 3, "vb": 0.5},
    "surfaces": {"s": "v - vb"},
    "field": ["v", "-x - F*s/(1 + d*s*(v - vb))"],
}


def belt(**changes: object) -> hr.System:
    return hr.System(**{**BELT, **changes})


def test_sympy_with_any_assumptions_says_what_the_text_says() -> None:
    x, v, s, force, d, vb = sp.symbols("x v s F d vb", positive=True)
    written = hr.System(
        [x, v],
        {force: Fraction(1), "d": "3", vb: sp.Rational(1, 2)},
        {s: v - vb},
        [v, -x - force * s / (1 + d * s * (v - vb))],
    )
    assert written == belt()
    assert hash(written) == hash(belt())


def test_a_float_is_the_decimal_that_it_is_printed_as() -> None:
    assert belt(parameters={"F": 1, "d": 3, "vb": 0.1}) == belt(parameters={"F": "1", "d": 3.0, "vb": Fraction(1, 10)})
    assert belt(parameters={"F": 1, "d": 3, "vb": np.float64(0.1)}).parameters["vb"] == Fraction(1, 10)
    x = sp.Symbol("x")
    third = hr.System(["x"], {}, {"s": "x - 1"}, [sp.Float(0.1) * x])
    assert third == hr.System(["x"], {}, {"s": "x - 1"}, ["x/10"])


def test_constants_and_functions_of_sympy_are_those_of_a_case_file() -> None:
    x, t = sp.Symbol("x"), sp.Symbol("t", nonnegative=True)
    made = hr.System([x], {}, {"s": x - sp.E}, [sp.exp(-x) + sp.pi * sp.sqrt(x**2 + 1) + sp.E * t])
    assert made == hr.System(["x"], {}, {"s": "x - e"}, ["exp(-x) + pi*sqrt(x^2 + 1) + e*t"])


def test_other_values_or_equations_are_another_system() -> None:
    assert belt() != belt(parameters={"F": 1, "d": 3, "vb": 0.6})
    assert belt() != belt(valid=["2 - x"])
    assert belt() != 1


def test_a_system_from_a_case_is_the_one_of_its_reading() -> None:
    made = hr.System.from_case(str(CASES / "fig8.yaml"), "listing_limit")
    reading = hr.load_case(CASES / "fig8.yaml").reading("listing_limit")
    assert made.model.field == reading.problem.system.field
    assert made.model.overrides == reading.problem.system.overrides
    assert tuple(made.initial.values()) == reading.problem.initial
    assert (made.start, made.until) == (reading.problem.start, reading.problem.until)


def test_a_scene_is_a_system_too() -> None:
    made = hr.System.from_case(CASES / "stribeck_belt.yaml")
    assert made.state == ("x1", "x2")
    assert made.parameters["vp"] == Fraction(1, 5)
    assert (made.initial, made.start, made.until, made.mode) == ({"x1": 1, "x2": Fraction(1, 5)}, 0, 62, {})


def test_a_mode_at_the_start_is_kept() -> None:
    assert hr.System.from_case(CASES / "static_belt.yaml").mode == {"s": -1}


def test_parameters_in_other_parameters_follow_them() -> None:
    made = hr.System(["x"], {"a": 1, "b": "2*a"}, {"s": "x"}, ["-b*s"]).with_parameters({"a": 3})
    assert made.parameters == {"a": 3, "b": 6}


def test_a_scene_checks_the_range_of_a_new_value() -> None:
    scene = hr.System.from_case(CASES / "stribeck_belt.yaml")
    with pytest.raises(hr.HenonRefError, match="larger than 0"):
        scene.with_parameters({"m": -1})


def test_it_can_be_sent_to_another_process() -> None:
    again = pickle.loads(pickle.dumps(belt()))
    assert again == belt()
    assert again.with_parameters({"vb": 1}) == belt(parameters={"F": 1, "d": 3, "vb": 1})


def test_it_is_shown_in_a_line_and_in_a_notebook() -> None:
    assert repr(belt()) == "System(x, v; s: v - vb; F = 1, d = 3, vb = 1/2)"
    assert "<table>" in belt()._repr_html_()
    many = hr.System([f"x{k}" for k in range(40)], {}, {f"s{k}": f"x{k} - 1" for k in range(40)}, ["1"] * 40)
    assert len(repr(many)) < 300


x, v, q = sp.symbols("x v q", positive=True)
REFUSED = {
    "nan": {"parameters": {"F": float("nan"), "d": 3, "vb": 1}},
    "infinity": {"parameters": {"F": np.inf, "d": 3, "vb": 1}},
    "nan as text": {"parameters": {"F": "nan", "d": 3, "vb": 1}},
    "a truth value": {"parameters": {"F": True, "d": 3, "vb": 1}},
    "a complex number": {"parameters": {"F": 1j, "d": 3, "vb": 1}},
    "a giant number": {"parameters": {"F": 10**5000, "d": 3, "vb": 1}},
    "a division by zero": {"parameters": {"F": 1, "d": 3, "vb": "1/0"}},
    "a circle of parameters": {"parameters": {"F": "d", "d": "F", "vb": 1}},
    "a parameter that is missing": {"parameters": {"F": 1, "d": 3}},
    "parameters that are a list": {"parameters": [1, 2]},
    "no surface": {"surfaces": {}},
    "a surface that never changes": {"surfaces": {"s": "vb"}},
    "a field that is too short": {"field": ["v"]},
    "a field that is too long": {"field": ["v", "-x", "0"]},
    "a field that is text": {"field": "v"},
    "an unknown name": {"field": ["v", "-x - y"]},
    "an unknown symbol": {"field": ["v", -x - q]},
    "a symbol that is no name": {"field": ["v", sp.Symbol("x + __import__('os')")]},
    "an unknown function": {"field": ["v", sp.Function("f")(x)]},
    "a piece of a function": {"field": ["v", sp.Piecewise((1, x > 1))]},
    "an infinite field": {"field": ["v", sp.oo]},
    "a function of Python": {"field": ["v", lambda t: t]},
    "a giant power": {"field": ["v", "9**9**9**9"]},
    "a deep expression": {"field": ["v", "sin(" * 50 + "x" + ")" * 50]},
    "a long expression": {"field": ["v", "x" * 20_000]},
    "a state twice": {"state": ["x", "x"]},
    "a name that is taken": {"state": ["t", "v"]},
    "a state that is a number": {"state": ["x", 3]},
    "sliding on nothing": {"sliding": {"q": {"field": ["v", "0"], "release": []}}},
    "valid as text": {"valid": "x"},
    "long names": {"parameters": {f"{'p' * 60}{k}": 1 for k in range(50)}},
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_meant_is_refused_in_a_short_message(what: str) -> None:
    with pytest.raises(hr.HenonRefError) as refused:
        belt(**REFUSED[what])
    assert isinstance(refused.value, ValueError)
    assert 0 < len(str(refused.value)) < 400


def test_a_case_that_is_none_is_an_error_with_its_place(tmp_path: Path) -> None:
    with pytest.raises(hr.CaseError, match="no such file"):
        hr.System.from_case(tmp_path / "none.yaml")
    with pytest.raises(hr.HenonRefError, match="wanted the name of a reading"):
        hr.System.from_case("fig8", 3)
    with pytest.raises(hr.CaseError, match="no reading 'q'"):
        hr.System.from_case(CASES / "fig8.yaml", "q")


def test_expressions_and_numbers_are_read_with_its_names() -> None:
    assert belt().expression("v - 2*vb").subs({"v": 1}) is not None
    assert belt().number("vb/3") == sp.Rational(1, 6)
    with pytest.raises(hr.HenonRefError, match="unknown name 'w'"):
        belt().expression("v - w")


def test_a_case_that_comes_with_the_package_goes_by_its_name() -> None:
    assert hr.System.from_case("fig8", "equations") == hr.System.from_case(CASES / "fig8.yaml", "equations")
    assert hr.System.from_case("hard/grazing").until == hr.System.from_case(CASES / "hard" / "grazing.yaml").until


def test_its_parameters_are_a_copy() -> None:
    system = belt()
    system.parameters["vb"] = 7
    assert system == belt()


def test_kinks_of_sympy_are_those_of_a_file() -> None:
    x, v = sp.symbols("x v")
    made = sp.Piecewise((1, x > 2), (x, (x > 1) & (v <= 0)), (2, True)) + sp.Abs(x) + sp.Max(0, x - 1) - sp.Min(x, v)
    made += sp.Heaviside(x - 3) + sp.Piecewise((1, (x > 5) | (v < 1)), (0, True))
    text = (
        "piecewise(1, x > 2, piecewise(piecewise(x, v <= 0, 2), x > 1, 2)) + abs(x) + max(0, x - 1) - min(v, x)"
        " + piecewise(1, x > 3, 0) + piecewise(1, x > 5, piecewise(1, v < 1, 0))"
    )
    ours, theirs = (hr.System(["x", "v"], {}, {}, ["v", rate]).model for rate in (text, made))
    for at in ({"x": a, "v": b} for a in (-1.5, 0.5, 1.5, 2.5, 4, 7) for b in (-3, 0.25, 2)):
        point = {sp.Symbol(name, real=True): sp.nsimplify(value) for name, value in at.items()}
        found = []
        for model in (ours, theirs):
            signs = {s: sp.sign(h.xreplace(point)) for s, h in zip(model.signs, model.surfaces, strict=True)}
            found.append(model.field[1].xreplace(signs).xreplace(point))
        assert found[0] == found[1]


@pytest.mark.parametrize(
    ("rate", "says"),
    [
        (sp.Piecewise((1, sp.Symbol("x") > 2)), r"end it with \(value, True\)"),
        (sp.Piecewise((1, sp.Eq(sp.Symbol("x"), 2)), (0, True)), "compare with <, <=, > or >="),
        ("Piecewise((1, x > 0), (0, True))", r"write piecewise\(value, condition"),
        ("np.sin(x)", "write functions without a prefix"),
        ("piecewise(1, x > 0 and x < 1, 0)", "a piecewise inside another"),
        ("piecewise(1, (x > 0) & (x < 1), 0)", "a piecewise inside another"),
        ("piecewise(1, x > 0 & x < 1, 0)", "a piecewise inside another"),
        ("piecewise(1, x == 1, 0)", "compare with <, <=, > or >="),
        ("-µ*x", "write μ"),
        ("π*x", "write pi"),
    ],
)
def test_messages_say_what_can_be_written(rate: object, says: str) -> None:
    with pytest.raises(hr.HenonRefError, match=says):
        hr.System(["x"], {}, {}, [rate])


def test_the_advice_on_two_conditions_works() -> None:
    """A rate of 1 between 0 and 1, and of 2 outside."""
    both = hr.System(["x"], {}, {}, ["piecewise(piecewise(1, x < 1, 2), x > 0, 2)"])
    run = hr.simulate(both, {"x": -1}, until=2)
    assert run.transitions.time_s.tolist() == pytest.approx([0.5, 1.5], abs=1e-12)
    assert run.y[0, -1] == pytest.approx(2, abs=1e-12)


def test_names_may_be_greek() -> None:
    pendulum = hr.System(["θ", "ω"], {"μ": 0.3}, {"s": "ω"}, ["ω", "-sin(θ) - μ*s"])
    latin = hr.System(["a", "w"], {"m": 0.3}, {"s": "w"}, ["w", "-sin(a) - m*s"])
    run, other = hr.simulate(pendulum, {"θ": 1, "ω": 0}, until=5), hr.simulate(latin, {"a": 1, "w": 0}, until=5)
    assert run.y.tolist() == other.y.tolist()
    assert {"θ", "ω"} <= set(run.transitions.columns)
    assert r"\theta" in pendulum._repr_html_()


def test_parameters_and_surfaces_may_be_left_out_and_initial_values_come_in_order() -> None:
    system = hr.System(["x", "v"], field=["v", "-x"])
    starts = ([1, 0], (1.0, 0.0), np.array([1, 0]), {"x": 1, "v": 0})
    runs = [hr.simulate(system, initial, until=1) for initial in starts]
    assert all(run.y.tolist() == runs[0].y.tolist() for run in runs)
    assert runs[0].plot().lines
    for wrong in ([1], [1, 2, 3], [[1, 2]]):
        with pytest.raises(hr.HenonRefError, match="a value for each of x, v, in this order"):
            hr.simulate(system, wrong, until=1)
    with pytest.raises(hr.HenonRefError, match="'field'"):
        hr.System(["x"])


def test_a_case_runs_from_its_own_start_to_its_own_horizon() -> None:
    case = hr.System.from_case("fig8")
    run, told = hr.simulate(case), hr.simulate(case, case.initial, until=case.until, mode=case.mode)
    assert run.y.tolist() == told.y.tolist()
    assert hr.simulate(case, until=3).t[-1] == 3
    with pytest.raises(hr.HenonRefError, match="'until' is missing"):
        hr.simulate(hr.System(["x"], field=["-x"]), [1])


def test_a_narrow_stribeck_curve_is_ordinary() -> None:
    """1 mm/s is the usual width; where the block rests friction of 2 holds the spring."""
    system = hr.System(["x", "v"], {}, {"s": "v"}, ["v", "-x - s*(1 + exp(-(v/0.001)^2))"])
    run = hr.simulate(system, {"x": 5, "v": 0}, until=20)
    assert run.status == "ok"
    assert abs(run.y[0, -1]) <= 2


def test_a_tolerance_that_is_text_is_told_so() -> None:
    with pytest.raises(hr.HenonRefError, match="without quotes"):
        hr.simulate(hr.System(["x"], field=["-x"]), [1], until=1, rtol="1e-9")


def test_kinks_in_maps_are_refused_with_what_can_be_written() -> None:
    with pytest.raises(hr.HenonRefError, match=r"write -v for abs\(v\)"):
        hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-1"], resets={"s": {"map": {"v": "0.8*abs(v)"}}})
    bounce = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-1"], resets={"s": {"map": {"v": "0.8*(-v)"}}})
    assert hr.simulate(bounce, {"x": 1, "v": 0}, until=2).status == "ok"


def test_a_system_from_python_has_more_states_than_one_of_a_file() -> None:
    """Each state of 300 follows the one before; with the machine code of a long tape."""
    names = [f"x{i}" for i in range(300)]
    field = [f"x{(i - 1) % 300} - x{i}" for i in range(300)]
    system = hr.System(state=names, surfaces={"s": "x7 - x250 - 3"}, field=field)
    run = hr.simulate(system, {x: 1 + (x == "x7") for x in names}, until=1, rtol=1e-10)
    assert (run.status, run.y[7, -1]) == ("ok", pytest.approx(1 + math.exp(-1), abs=1e-12))
    assert run.y[9, -1] == pytest.approx(1 + math.exp(-1) / 2, abs=1e-12)  # a Poisson distribution


@pytest.mark.parametrize("key", ["state", "surfaces"])
def test_more_states_and_surfaces_than_that_are_refused(key: str) -> None:
    names = [f"x{i}" for i in range(4097)]
    given = {"state": names, "field": ["1"] * 4097}
    if key == "surfaces":
        given = {"state": ["x"], "surfaces": {f"s{i}": "x" for i in range(4097)}, "field": ["1"]}
    with pytest.raises(hr.HenonRefError, match=f"'{key}' in 'system': may have at most 4096 entries"):
        hr.System(**given)


def test_what_is_wrong_in_a_large_system_is_said() -> None:
    names = [f"x{i}" for i in range(300)]
    with pytest.raises(hr.HenonRefError, match="unknown name 'y'"):
        hr.System(state=names, field=["x1"] * 299 + ["y"])
    ends = {"when": "x1", "direction": "up", "to": 1}
    with pytest.raises(hr.HenonRefError, match="'direction': must be 'rising' or 'falling'"):
        hr.System(names, {}, {"s": "x0"}, ["x1"] * 300, sliding={"s": {"field": ["x1"] * 300, "release": [ends]}})
