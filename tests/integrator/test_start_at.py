"""Starts from doubles: the same as from the decimal numbers that they are printed as."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from often import daily
from problems import make_problem
from runs import constants_of
from shipped import CASES, paths, read

import henon_ref as hr
from henon_ref.casefile.case import load_case
from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import double_double
from henon_ref.integrator import precise_modes
from henon_ref.integrator.constants import LoopProgram, ModeConstants
from henon_ref.integrator.integrator import Integrator, Start
from henon_ref.integrator.run import Run
from henon_ref.kernel.library import ffi
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import contact_orders, initial_signs, mode_by_signs


def from_doubles(problem: Problem) -> tuple[Start, Problem, Integrator]:
    """A start from doubles, and the problem of the decimal numbers that they are; the system comes without values."""
    integrator = Integrator(replace(problem.system, parameters={}), 12)
    values = {symbol: sp.Rational(repr(float(value))) for symbol, value in problem.system.parameters.items()}
    start, until, *initial = (float(v) for v in (problem.start, problem.until, *problem.initial))
    exact = replace(
        problem,
        system=replace(problem.system, parameters=values),
        start=sp.Rational(repr(start)),
        until=sp.Rational(repr(until)),
        initial=tuple(sp.Rational(repr(v)) for v in initial),
    )
    own = tuple(float(values[symbol]) for symbol in integrator.parameters)
    settings = {"tolerance": 1e-9, "mode": problem.initial_mode}
    return integrator.begin(own, initial, start=start, until=until, **settings), exact, integrator


def both(problem: Problem) -> tuple[Start, Start, Integrator]:
    """The start from doubles, and that from the decimal numbers that they are."""
    fast, exact, integrator = from_doubles(problem)
    return fast, integrator.start(exact, tolerance=1e-9), integrator


def entered(start: Start, integrator: Integrator) -> tuple[Mode, tuple[int, ...]]:
    """The mode that a start enters, and the known zeros of its guards."""
    run = Run(integrator, start)
    return run.mode, tuple(run.known_zeros.tolist())


def exact_pair(number: sp.Expr) -> tuple[float, float]:
    """A constant rounded once, by SymPy; NaN for one that is none."""
    try:
        return double_double(number)
    except ModelError:
        return float("nan"), float("nan")


THIRD = [path for path in paths()[::3] if path.stem != "burridge_knopoff"]
"""Each third case, but for one with many blocks, whose equations take seconds."""


@pytest.mark.parametrize("path", daily(paths(), some=THIRD), ids=lambda path: path.stem)
def test_every_case_starts_as_sympy_says(path: Path) -> None:
    """In the mode that exact signs lead to, with its known zeros, and constants that are right to the last bit."""
    fast, exact, integrator = from_doubles(read(path).readings[0].problem)
    table, t, x = integrator.mode_table, float(exact.start), list(map(float, exact.initial))
    at = in_doubles(exact.system).at(t, x)
    surfaces, valid = initial_signs(exact)
    decision = mode_by_signs(at, surfaces, valid, exact.initial_mode)
    assert [fast.time, fast.until, *fast.x] == [double_double(v) for v in (exact.start, exact.until, *exact.initial)]
    assert (fast.refused is None) == (decision.mode is not None)
    if fast.refused is not None:
        assert fast.refused.status == decision.ending
        return
    mode, zeros = entered(fast, integrator)
    assert mode == decision.mode
    active = [i for i, sign in enumerate(surfaces) if sign == 0]
    orders = contact_orders(at, decision.mode, active) if active else []
    assert [o for o in zeros if o] == [orders[p] for p in table.places(decision.mode) if orders and orders[p]]
    numeric = exact.system.numeric
    expected = [exact_pair(numeric(e)) for e in table.constants[: table.compiled.constants]]
    fast.constants.update()
    program = integrator.programs.loop().program
    values = np.array(fast.constants.values).reshape(1, -1, 2)
    found = program.pairs(values, lambda _: fast.constants.exact())[0].reshape(-1, 2)[: len(expected)]
    assert found[:, 0].tolist() == pytest.approx([high for high, _ in expected], rel=0, abs=0, nan_ok=True)
    rest = np.array(expected)
    assert found[:, 1] == pytest.approx(rest[:, 1], abs=1e-29 * np.nanmax(np.abs(rest), initial=1), nan_ok=True)


AT_ONCE = ["stribeck_belt", "two_blocks", "bouncing_ball", "static_belt", "clutch_pair"]


@pytest.mark.parametrize("name", AT_ONCE)
def test_constants_of_a_point_are_the_same_made_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit: those of the modes and of the normal velocities, also where modes are met later."""
    system = load_case(name).readings[0].problem.system
    integrator = Integrator(replace(system, parameters={}), 12)
    first = (1,) * len(system.signs)
    for mode in (first, replaced(first, 0, -1)):
        integrator.mode_table.row(mode)
    values = tuple(float(system.parameters[symbol]) for symbol in integrator.parameters)

    def constants(*, at_once: bool) -> ModeConstants:
        with monkeypatch.context() as patch:
            if not at_once:
                patch.setattr(LoopProgram, "at", lambda *_: None)
            found = integrator._constants(values)
        assert isinstance(found.latest.memory, np.ndarray) == (not at_once)
        return found

    for _ in range(2):
        one, other = constants(at_once=False).latest, constants(at_once=True).latest
        assert constants_of(one).tobytes() == constants_of(other).tobytes()
        if integrator.mode_table.normals is not None:
            counts = 8 * (2 * len(integrator.mode_table.normals.tape.constants) + 1)
            pair = [bytes(ffi.buffer(data.tables.selection.constants, counts)) for data in (one, other)]
            assert pair[0] == pair[1]
        integrator.mode_table.row(replaced(first, 0, 0))


def test_a_point_whose_terms_cancel_is_not_made_at_once() -> None:
    """(a - b)/c at a = b + 1e-30 has lost its digits in pairs of doubles, and 1/c is none at c = 0."""
    system = hr.System(["x"], {"a": 1, "b": 1, "c": 1}, {}, ["-(a - b)*x/c"])
    integrator = Integrator(replace(system.model, parameters={}), 12)
    integrator.mode_table.row(())
    near = Fraction(1) + Fraction(1, 10**30)
    values = (2.0, 1.0, 3.0), (near, 1.0, 1.0), (2.0, 1.0, 0.0)
    whole, cancelled, infinite = (integrator._constants(each) for each in values)
    assert [isinstance(each.latest.memory, np.ndarray) for each in (whole, cancelled, infinite)] == [False, True, True]
    assert (cancelled.is_finite, infinite.is_finite) == (True, False)
    assert -1e-30 in constants_of(cancelled.latest)


GOES_ON = [path for path in paths(".") if path.stem != "rig_printed"]  # whose start is nonunique


@pytest.mark.parametrize("path", GOES_ON, ids=lambda path: path.stem)
def test_a_run_goes_on_from_there_as_from_exact_numbers(path: Path) -> None:
    fast, exact, integrator = both(read(path).readings[0].problem)
    assert (fast.refused, exact.refused) == (None, None)
    found, expected = Run(integrator, fast).to_horizon(), Run(integrator, exact).to_horizon()
    assert found.status == expected.status
    assert [(t.kind, t.to_mode) for t in found.transitions][:50] == [(t.kind, t.to_mode) for t in expected.transitions][
        :50
    ]


def surfaces_start(field: Sequence[str], initial: Sequence[float]) -> tuple[Start, Integrator]:
    problem = make_problem("x y", field, {"s": "x", "u": "y"}, initial, 3)
    integrator = Integrator(problem.system, 8)
    return integrator.begin((), initial, until=3.0, tolerance=1e-6), integrator


@pytest.mark.parametrize(
    ("rate", "mode", "zeros"), [("1/2 - s", 0, 0), ("2 - s", 1, 1), ("-2 - s", -1, 1)], ids=["slides", "up", "down"]
)
def test_a_start_on_one_surface_is_decided_without_sympy(
    rate: str, mode: int, zeros: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, integrator = surfaces_start([rate, "1 - u/2"], [0.0, 1.0])
    monkeypatch.setattr("henon_ref.modes.selection.mode_by_signs", None)
    for y in (1.0, -1.0):
        start = integrator.begin((), [0.0, y], until=3.0, tolerance=1e-6)
        found, known = entered(start, integrator)
        assert found == (mode, int(np.sign(y)))
        guards = integrator.mode_table.guards(found)
        assert [z for z, g in zip(known, guards, strict=False) if g.index == 0 and g.kind == "surface"] == (
            [zeros] if mode else []
        )
        assert sum(known) == zeros
    again = integrator.begin((), [0.0, 1.0], until=3.0, tolerance=1e-6)
    assert again.block == first.block


@pytest.mark.parametrize(
    ("field", "initial", "status"),
    [
        (["s", "1"], [0.0, 1.0], "nonunique"),  # both slips lead away
        (["1 - s", "1"], [0.0, 1.0], None),  # above, the field is along the surface
        (["1/2 - s", "1/2 - u"], [0.0, 0.0], None),  # two surfaces
    ],
)
def test_what_is_not_clear_is_decided_as_exact_numbers_are(
    field: Sequence[str], initial: Sequence[float], status: str | None
) -> None:
    start, integrator = surfaces_start(field, initial)
    exact = make_problem("x y", field, {"s": "x", "u": "y"}, [int(v) for v in initial], 3)
    expected = integrator.start(exact, tolerance=1e-6)
    assert entered(start, integrator) == entered(expected, integrator)
    assert (start.refused.status if start.refused else None) == status


def test_a_start_that_is_off_by_one_bit_is_on_no_surface() -> None:
    problem = make_problem("x", ["1/2 - s"], {"s": "x - a"}, [0], 3)
    x, a = problem.system.states[0], sp.Symbol("a", real=True)
    integrator = Integrator(replace(problem.system, surfaces=(x - a,)), 8)

    def mode(value: float) -> tuple[int, ...]:
        start = integrator.begin((0.1,), [value], until=3.0, tolerance=1e-6)
        return entered(start, integrator)[0]

    assert [mode(v) for v in (np.nextafter(0.1, 0), 0.1, np.nextafter(0.1, 1))] == [(-1,), (0,), (1,)]


def test_a_model_that_does_not_hold_at_the_start_is_refused() -> None:
    problem = make_problem("x", ["-1 - s/2"], {"s": "x"}, [1], 3, valid=["1 - x"])
    integrator = Integrator(problem.system, 8)

    def refused(x: float) -> str | None:
        start = integrator.begin((), [x], until=3.0, tolerance=1e-6)
        return start.refused.status if start.refused else None

    assert [refused(x) for x in (0.5, 1.0, 1.5)] == [None, None, "invalid"]


def test_an_integrator_of_a_system_with_values_refuses_others() -> None:
    problem = load_case(CASES / "stribeck_belt.yaml").readings[0].problem
    with pytest.raises(ModelError, match="values of its parameters"):
        Integrator(problem.system, 8).begin((1.0,), [1.0, 0.0], until=1.0, tolerance=1e-6)


@pytest.mark.parametrize("unit", [1.0, 1e-13, 1e-20])
def test_a_start_on_surfaces_is_the_same_in_any_unit_of_time(unit: float) -> None:
    # Drives grow until their contacts let go. In a unit of 1e-13 s their growth seemed larger than the friction: both
    # slid backwards from the start, with status ok.
    for field, times in ((["t/T - s", "t/(2*T) - u"], [1, 2]), (["t/T - 2*s", "3*s - 2*u"], [4 / 3, 2])):
        system = hr.System(["x", "y"], {"T": unit}, {"s": "x", "u": "y"}, [f"({rate})/T" for rate in field])
        run = hr.simulate(system, {"x": 0, "y": 0}, until=3 * unit)
        assert (run.status, run.mode(0.0), run.final_mode) == ("ok", {"s": 0, "u": 0}, "s=+1 u=+1")
        assert run.transitions["kind"].tolist() == ["release", "release"]
        assert (run.transitions["time_s"] / unit).tolist() == pytest.approx(times, rel=1e-12)


@pytest.mark.parametrize("unit", [1.0, 1e-13, 1e-20])
def test_contacts_after_a_jump_hold_in_any_unit_of_time(unit: float) -> None:
    # A jump at t = 1 puts both on their surfaces; in a unit of 1e-13 s they were in slip for no time.
    field = ["((t - T)/T - s)/T", "((t - T)/(2*T) - u)/T", "-1/T"]
    landing = {"r": {"map": {"x": "0", "y": "0", "z": "10"}}}
    system = hr.System(["x", "y", "z"], {"T": unit}, {"s": "x", "u": "y", "r": "z"}, field, resets=landing)
    run = hr.simulate(system, {"x": 5, "y": 5, "z": 1}, until=4 * unit)
    assert run.transitions["kind"].tolist() == ["stick", "stick", "reset", "release", "release"]
    assert (run.transitions["time_s"] / unit).tolist() == pytest.approx([1, 1, 1, 2, 3], rel=1e-12)


@pytest.mark.parametrize("unit", [1.0, 1e-13, 1e-20])
def test_surfaces_that_act_on_each_other_are_crossed_in_any_unit_of_time(unit: float) -> None:
    # The ends of their slide are signs, not velocities: a sign of -2 counted as zero beside velocities of 1e13, and the
    # slide was possible, too.
    field = [f"(3 + u)/2/{unit!r}", f"((3 + s)/2 + y - x)/{unit!r}"]
    run = hr.simulate(hr.System(["x", "y"], {}, {"s": "x", "u": "y"}, field), {"x": -1, "y": -1}, until=2 * unit)
    assert (run.status, run.final_mode) == ("ok", "s=+1 u=+1")
    assert run.transitions["kind"].tolist() == ["crossing", "crossing"]


@pytest.mark.parametrize("unit", [1.0, 1e12, 1e20])
def test_a_block_at_the_end_of_its_stick_slides_at_once_in_any_unit_of_time(unit: float) -> None:
    # The spring's force is the friction and grows: in units of 1e12 s it seemed to stay, and a release was listed.
    own = {"k": 1 / unit**2, "F": 1 / unit**2, "vb": 0.5 / unit}
    belt = hr.System(["x", "v"], own, {"s": "v - vb"}, ["v", "-k*x - F*s"])
    run = hr.simulate(belt, {"x": 1, "v": 0.5 / unit}, until=5 * unit)
    assert (run.mode(0.0), run.transitions["kind"].tolist()) == ({"s": -1}, [])
    time = 5.0  # x = 1 + (x0 - 1) cos t + v0 sin t around 1
    assert run.y[:, -1] == pytest.approx([1 + 0.5 * math.sin(time), 0.5 * math.cos(time) / unit], rel=1e-8)


def test_a_start_on_surfaces_is_decided_once(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = hr.System(["x", "y"], {"a": 1, "b": 2}, {"s": "x", "u": "y"}, ["a*t - s", "b*t - u"])
    real, decided = precise_modes.mode_at_start, list[object]()
    monkeypatch.setattr(precise_modes, "mode_at_start", lambda at, *given: decided.append(given) or real(at, *given))
    hr.simulate(pair, {"x": 1, "y": 1}, until=0.1)  # the first run of a system prepares the starts of later ones
    starts: list[dict[str, Any]] = [
        {"start": 0},
        {"start": 0, "until": 2},
        {"start": 2},
        {"start": 0, "parameters": {"a": 3}},
    ]
    counts, ends = [], []
    for given in (*starts, *starts):
        run = hr.simulate(pair, {"x": 0, "y": 0}, **{"until": 4, **given})
        counts.append(len(decided))
        ends.append(run.y.tolist())
    assert counts[4:] == [counts[3]] * 4
    assert counts[3] == 3
    assert ends[:4] == ends[4:]
