"""A start in microseconds is the exact one, to the last bit; what it cannot decide it leaves to that."""

from __future__ import annotations

import random
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest
from runs import constants_of

import henon_ref as hr
from henon_ref.simulation import launch as launching

CASES = Path(__file__).parents[2] / "cases"
BELT_FIELD = ["v", "-x - F*s/(1 + d*s*(v - vb))"]
BELT = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": "1/3"}, {"s": "v - vb"}, BELT_FIELD)


def warm(system: hr.System) -> hr.System:
    """A system that has been run once: the first run of any is an exact one."""
    values = {name: 0.77 + k for k, name in enumerate(system.state)}
    hr.simulate(system, values, until=0.01)
    return system


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Starts that are found in the exact way from here on."""
    found: list[object] = []
    real = launching.problem_of

    def counted(*given: object, **more: object) -> object:
        found.append(given)
        return real(*given, **more)

    monkeypatch.setattr(launching, "problem_of", counted)
    return found


def everything(run: hr.Solution) -> list[object]:
    return [run.t.tolist(), run.y.tolist(), run.transitions.values.tolist(), run.status, run.counts]


def test_it_is_the_exact_start_to_the_last_bit(exact: list[object]) -> None:
    draw = random.Random(5)
    warm(BELT)
    exact.clear()
    for _ in range(40):
        numbers = {name: draw.choice([round, float])(draw.uniform(0.1, 2)) for name in ("x", "v", "F", "vb", "until")}
        numbers |= {"vb": numbers["vb"] + 0.05, "until": 10 + numbers["until"]}
        text = {name: str(value) for name, value in numbers.items()}
        quick, slow = (
            hr.simulate(
                BELT,
                {"x": n["x"], "v": n["v"]},
                until=n["until"],
                start=n["F"],
                parameters={"F": n["F"], "vb": n["vb"]},
            )
            for n in (numbers, text)
        )
        assert everything(quick) == everything(slow)
        assert quick.system == slow.system
    assert len(exact) == 40


@pytest.mark.parametrize("name", ["two_blocks", "hard/two_contacts", "hard/grazing", "stribeck_belt", "rig_periodic"])
def test_it_is_that_of_a_case_with_other_values(name: str, exact: list[object]) -> None:
    """Events that go to multiprecision, several surfaces, and scenes included."""
    case = hr.System.from_case(CASES / f"{name}.yaml")
    warm(case)
    exact.clear()
    initial = {x: float(value) + 0.0371 for x, value in case.initial.items()}
    changed = {p: float(value) * 1.01 for p, value in case.parameters.items()}
    until = float(case.start) + min(20.0, float(case.until) - float(case.start))
    runs = [
        hr.simulate(
            case,
            {x: kind(value) for x, value in initial.items()},
            until=until,
            start=case.start if kind is str else float(case.start),
            parameters={p: kind(value) for p, value in changed.items()},
        )
        for kind in (float, str)
    ]
    assert everything(runs[0]) == everything(runs[1])
    assert len(exact) == 1


def test_a_decimal_start_lies_on_a_decimal_surface(exact: list[object]) -> None:
    """0.3 - 0.1 - 0.2 is zero, though not in doubles."""
    gap = warm(hr.System(["x", "v"], {"a": 0.1, "b": 0.5}, {"s": "x - a - b"}, ["v", "-s"]))
    exact.clear()
    run = hr.simulate(gap, {"x": 0.3, "v": 1}, until=0.5, parameters={"b": 0.2})
    assert run.transitions.empty
    assert run.final_mode == "s=+1"
    assert len(exact) == 0


def test_a_fraction_is_not_the_decimal_number_of_its_double() -> None:
    gap = warm(hr.System(["x", "v"], {"a": 0.1}, {"s": "x - a"}, ["v", "-s"]))
    value = Fraction(5, 3)  # below the decimal number that Python prints for it, 1.6666666666666667
    assert hr.simulate(gap, {"x": value, "v": 1}, until=0.5, parameters={"a": value}).transitions.empty
    assert len(hr.simulate(gap, {"x": value, "v": 1}, until=0.5, parameters={"a": float(value)}).transitions) == 1


@pytest.mark.parametrize("value", [0, 0.0, -1, -1e-300])
def test_values_that_a_scene_does_not_allow_are_refused(value: float) -> None:
    scene = hr.System.from_case(CASES / "stribeck_belt.yaml")
    hr.simulate(scene, {"x1": 1, "x2": 0}, until=1)
    with pytest.raises(hr.HenonRefError, match="larger than 0"):
        hr.simulate(scene, {"x1": 1, "x2": 0}, until=1, parameters={"m": value})


def test_constants_that_are_not_finite_are_refused() -> None:
    spring = hr.System(["x", "v"], {"m": 1, "k": 2}, {"s": "v"}, ["v", "-x/(m - k) - s*sqrt(k)"])
    hr.simulate(spring, {"x": 1, "v": 0.5}, until=1)
    for changed in ({"m": 2}, {"k": 1}, {"k": -1}, {"m": 2.0, "k": 2.0}):
        with pytest.raises(hr.HenonRefError):
            hr.simulate(spring, {"x": 1, "v": 0.5}, until=1, parameters=changed)


def test_parameters_that_decide_more_than_a_constant_are_left_to_the_exact_way(exact: list[object]) -> None:
    system = hr.System(["x"], {"a": 1, "b": "2*a", "n": 2, "unused": 4}, {"s": "x - 9"}, ["b*x^n"])
    warm(system)
    for changed in ({"a": 3}, {"n": 3}, {"b": 1}, {"unused": 1}):
        exact.clear()
        run = hr.simulate(system, {"x": 1.5}, until=0.01, parameters=changed)
        assert len(exact) == (1 if "n" in changed else 0)
        assert run.system.parameters == {**{"a": 1, "b": 2 * changed.get("a", 1), "n": 2, "unused": 4}, **changed}


def test_parameters_that_are_expressions_in_changed_ones_follow(exact: list[object]) -> None:
    """Expressions of expressions, of several parameters, with a root, and one that a condition of a scene looks at."""
    parameters = {"F": 1, "vb": 0.5, "a": "F/3 + vb", "d": "sqrt(a)*7/3", "c": "2*vb - d"}
    system = hr.System(["x", "v"], parameters, {"s": "v - a"}, ["v", "-x - F*s/(1 + d*s*(v - a)) + c/100"])
    warm(system)
    exact.clear()
    draw = random.Random(3)
    for _ in range(12):
        changed = {name: round(draw.uniform(0.2, 1), 3) for name in draw.sample(["F", "vb", "a"], draw.randint(1, 3))}
        given = [changed, {name: str(value) for name, value in changed.items()}]
        quick, slow = (hr.simulate(system, {"x": 0, "v": -0.1}, until=15, parameters=p) for p in given)
        assert everything(quick) == everything(slow)
        assert quick.system == slow.system
    assert len(exact) == 12
    exact.clear()
    point = {"F": 1, "vb": 0.2, "a": 0.6}
    on = [hr.simulate(system, {"x": 0, "v": 0.6}, until=5, parameters=p) for p in (point, {**point, "a": "0.6"})]
    assert everything(on[0]) == everything(on[1])
    with pytest.raises(hr.HenonRefError):
        hr.simulate(system, {"x": 0, "v": 0}, until=5, parameters={"vb": -1})


@pytest.mark.parametrize("changed", [{"q": 1}, {"F": float("nan")}, {"F": True}, {"F": None}])
def test_what_cannot_be_meant_is_refused_by_the_exact_way(changed: dict[str, object]) -> None:
    hr.simulate(BELT, {"x": 1, "v": 0}, until=1)
    with pytest.raises(hr.HenonRefError):
        hr.simulate(BELT, {"x": 1, "v": 0}, until=1, parameters=changed)


def test_surfaces_that_are_no_polynomials_have_their_signs_from_programs(exact: list[object]) -> None:
    moving = hr.System(["x", "v"], {"A": 0.3, "w": 2}, {"s": "v - A*sin(w*t)"}, ["v", "-x - s"], valid=["2 + cos(x)"])
    warm(moving)
    exact.clear()
    number = {"initial": {"x": 0.7, "v": 0.9}, "until": 9.1, "start": 0.3, "parameters": {"A": 0.37}}
    text = {"initial": {"x": "0.7", "v": "0.9"}, "until": "9.1", "start": "0.3", "parameters": {"A": "0.37"}}
    quick, slow = (hr.simulate(moving, given.pop("initial"), **given) for given in (number, text))
    assert everything(quick) == everything(slow)
    assert len(exact) == 1
    on = [hr.simulate(moving, {"x": x, "v": 0}, until=1) for x in (0.7, Decimal("0.7"))]
    assert everything(on[0]) == everything(on[1])  # on the surface at t = 0, by balls
    assert len(exact) == 2


TANGENT = {"x": "-F", "v": "vb"}


@pytest.mark.parametrize(
    ("initial", "parameters", "readings"),
    [
        ({"x": "1/3", "v": "sqrt(2)*vb - pi/7"}, None, 0),
        (TANGENT, None, 0),
        ({"x": "F/(F + d)", "v": "abs(atan2(1, -d))"}, None, 0),
        ({"x": "F/(F + d)", "v": "abs(atan2(1, -d))"}, {"vb": 0.7}, 1),  # functions of numbers only
        ({"x": "0.1", "v": 1}, {"vb": 0.7, "F": 1.3}, 0),
        (TANGENT, {"vb": 0.7}, 0),
        ({"x": "-F/7", "v": "vb"}, {"h": 0.4, "F": 1.1}, 0),  # a parameter that depends on a changed one
        ({"x": "sqrt(F)", "v": "-h/3"}, {"h": 0.4, "F": 1.1}, 0),
        ({"x": "1 - F", "v": "vb"}, {"F": 0.000101}, 0),
        (TANGENT, {"vb": Fraction(7, 10)}, 1),
        ({"x": Decimal("0.1"), "v": "vb"}, None, 1),
    ],
)
def test_text_is_read_once(
    initial: dict[str, object], parameters: dict[str, float] | None, readings: int, exact: list[object]
) -> None:
    """A system's first run reads text in the exact way."""
    first, ready = (
        hr.System(["x", "v"], {"F": 1, "d": 3, "h": "1/6", "vb": "2*h"}, {"s": "v - vb"}, BELT_FIELD) for _ in range(2)
    )
    warm(ready)
    given = {"initial": initial, "until": "2*pi", "start": "-d/8", "parameters": parameters}
    runs = [hr.simulate(first, **given)]
    exact.clear()
    runs += [hr.simulate(ready, **given)]
    assert runs[0]._pairs == runs[1]._pairs
    assert everything(runs[0]) == everything(runs[1])
    assert len(exact) == readings


def test_text_without_a_value_at_changed_parameters_is_refused() -> None:
    warm(BELT)
    hr.simulate(BELT, {"x": "sqrt(F)/d", "v": 1}, until=1, parameters={"F": 2})
    for changed in ({"F": -1}, {"d": 0}, {"F": 2, "d": 0}):
        with pytest.raises(hr.HenonRefError, match="'x'"):
            hr.simulate(BELT, {"x": "sqrt(F)/d", "v": 1}, until=1, parameters=changed)


@pytest.mark.parametrize("x", ["1/0", "F*", "q", "t", "log(-1)", "", "9" * 400])
def test_text_that_is_no_number_is_refused_at_every_run(x: str) -> None:
    warm(BELT)
    for _ in range(2):
        with pytest.raises(hr.HenonRefError, match="'x'"):
            hr.simulate(BELT, {"x": x, "v": 0}, until=1)


@pytest.mark.parametrize(
    ("initial", "parameters", "mode"),
    [
        ({"x": 0.4, "v": 0.3}, {"vb": 0.3}, "s=0"),
        ({"x": 0.9, "v": 0.3}, {"vb": 0.3, "F": 0.9}, "s=-1"),  # a tangent point
        ({"x": -0.9, "v": 0.3}, {"vb": 0.3, "F": 0.9}, "s=0"),
        ({"x": 1.7, "v": 0.3}, {"vb": 0.3}, "s=-1"),
        ({"x": -1.7, "v": 0.3}, {"vb": 0.3}, "s=+1"),
    ],
)
def test_a_start_on_a_surface_is_decided_as_in_the_exact_way(
    initial: dict[str, float], parameters: dict[str, float], mode: str, exact: list[object]
) -> None:
    warm(BELT)
    exact.clear()
    text = {name: str(value) for name, value in parameters.items()}
    quick, slow = (
        hr.simulate(BELT, {x: kind(value) for x, value in initial.items()}, until=10, parameters=given)
        for kind, given in ((float, parameters), (str, text))
    )
    assert everything(quick) == everything(slow)
    first = hr.simulate(BELT, initial, until=0.01, parameters=parameters)
    assert (first.final_mode, first.mode(0)) == (mode, quick.mode(0))
    assert len(exact) == 1


def test_a_start_on_two_surfaces_is_decided_as_in_the_exact_way(exact: list[object]) -> None:
    pair = warm(hr.System(["x", "y"], {"a": 1, "b": 2}, {"s": "x", "u": "y"}, ["a*t - s", "b*t - u"]))
    exact.clear()
    quick, slow = (hr.simulate(pair, {"x": 0, "y": 0}, until=3, parameters={"a": kind(0.7)}) for kind in (float, str))
    assert everything(quick) == everything(slow)
    assert quick.transitions.time_s.tolist() == [pytest.approx(0.5), pytest.approx(1 / 0.7)]
    assert len(exact) == 1


def test_a_start_that_the_fields_leave_open_is_refused_as_in_the_exact_way(exact: list[object]) -> None:
    open_start = warm(hr.System(["x"], {"a": 1}, {"s": "x - a"}, ["s"], valid=["4 - x"]))
    exact.clear()
    for x, status in ((0.3, "nonunique"), (5.0, "invalid")):
        quick, slow = (
            hr.simulate(open_start, {"x": kind(x)}, until=3, parameters={"a": kind(0.3)}) for kind in (float, str)
        )
        assert (quick.status, quick.message) == (slow.status, slow.message)
        assert (quick.status, quick.final_mode, quick.t.tolist()) == (status, "", [0.0])
    assert len(exact) == 2


def test_terms_that_cancel_are_worked_out_in_exact_numbers(exact: list[object]) -> None:
    """0.3 - 0.1 - 0.2 is zero, though not in doubles: the block rests where the load is the friction's difference."""
    load = warm(hr.System(["x", "v"], {"a": 1, "b": 2, "c": 3}, {"s": "v - 1"}, ["v", "(a - b - c)*x - (a - b)*v"]))
    exact.clear()
    given = {"a": 0.3, "b": 0.1, "c": 0.2}
    quick, slow = (
        hr.simulate(load, {"x": 1, "v": 0.5}, until=3, parameters={p: kind(v) for p, v in given.items()})
        for kind in (float, str)
    )
    assert everything(quick) == everything(slow)
    assert quick.y[1, -1] == pytest.approx(0.5 * 2.718281828459045 ** (-0.2 * 3), rel=1e-13)
    assert len(exact) == 1


def test_constants_have_all_digits_where_terms_cancel() -> None:
    """Of a + b, 1e-14 of a, pairs of doubles have 18 digits, the exact numbers all."""
    decay = warm(hr.System(["x", "v"], {"a": 2, "b": 1}, {"s": "v - 9"}, ["(a + b)*x", "0"]))
    ready, given = decay.prepared[1e-10], {"a": 0.30000000000000457, "b": -0.3}
    quick = ready({"x": 1, "v": 0}, 1, 0, given, None)
    _, problem = launching.problem_of(decay, {"x": 1, "v": 0}, until=1, parameters=given)
    exact = ready.integrator.start(problem, tolerance=1e-11)
    unchanged = ready({"x": 1, "v": 0}, 1, 0, None, None)
    found, wanted, other = (constants_of(start.constants.latest) for start in (quick, exact, unchanged))
    assert (found == wanted).all()
    assert not (found == other).all()


HELD = {
    "state": ["x", "v"],
    "parameters": {"Fs": 1.5, "Fk": 1, "vb": 0.5},
    "surfaces": {"s": "v - vb"},
    "field": ["v", "-x - Fk*s"],
    "sliding": {
        "s": {
            "field": ["vb", 0],
            "release": [
                {"when": "x - Fs", "direction": "rising", "to": -1},
                {"when": "x + Fs", "direction": "falling", "to": 1},
            ],
        }
    },
}


@pytest.mark.parametrize("entry", [-1, 0])
def test_a_mode_that_is_given_is_taken_as_in_the_exact_way(entry: int, exact: list[object]) -> None:
    held = warm(hr.System(**HELD))
    exact.clear()
    quick, slow = (
        hr.simulate(held, {"x": kind(1.5), "v": 0.3}, until=9, parameters={"vb": kind(0.3)}, mode={"s": entry})
        for kind in (float, str)
    )
    assert everything(quick) == everything(slow)
    assert quick.mode(0) == {"s": entry}
    assert len(exact) == 1


@pytest.mark.parametrize("mode", [{"s": 1}, {"q": 0}, {"s": 2}, {"s": True}, {"s": "0"}, {"s": None}, {0: 1}, 3])
def test_a_mode_that_cannot_be_is_refused(mode: object) -> None:
    held = warm(hr.System(**HELD))
    with pytest.raises(hr.HenonRefError):
        hr.simulate(held, {"x": 1.5, "v": 0.2}, until=9, mode=mode)


def test_a_surface_with_a_pole_at_the_start_is_left_to_the_exact_way(exact: list[object]) -> None:
    pole = warm(hr.System(["x"], {"a": 2}, {"s": "1/x - a"}, ["1 + 0*s"]))
    exact.clear()
    for kind in (float, str):
        with pytest.raises(hr.HenonRefError, match="no finite real value at the start"):
            hr.simulate(pole, {"x": kind(0)}, until=1, parameters={"a": 3.0})
    assert len(exact) == 2
