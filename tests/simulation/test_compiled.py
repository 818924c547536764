"""Compiled once a system and order; from several threads at once, with the same bits."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.simulation import launch as compiled
from henon_ref.simulation.quick_start import Number

CASES = Path(__file__).parents[2] / "cases"


def oscillator(name: str = "x") -> hr.System:
    return hr.System([name, "v"], {"w": 1, "F": 0.1}, {"s": "v"}, ["v", f"-w^2*{name} - F*s"])


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Integrators that are made from here on, with nothing kept from before."""
    found: list[object] = []
    real = compiled.Integrator

    def counted(*given: object) -> object:
        found.append(real(*given))
        return found[-1]

    monkeypatch.setattr(compiled, "Integrator", counted)
    monkeypatch.setattr(compiled, "_kept", type(compiled._kept)())
    return found


def test_an_equal_system_compiles_nothing_anew(made: list[object]) -> None:
    first = hr.simulate(oscillator(), {"x": 1, "v": 0}, until=5)
    again = hr.simulate(oscillator(), {"x": 1, "v": 0}, until=5)
    assert len(made) == 1
    assert again.transitions.equals(first.transitions)


def test_other_values_compile_nothing_anew(made: list[object]) -> None:
    hr.simulate(oscillator(), {"x": 1, "v": 0}, until=5)
    hr.simulate(oscillator(), {"x": 2, "v": 1}, until=7, parameters={"w": 3, "F": "1/7"})
    hr.simulate(oscillator().with_parameters({"w": 2}), {"x": 2, "v": 1}, until=7)
    assert len(made) == 1
    hr.simulate(oscillator(), {"x": 1, "v": 0}, until=5, rtol=1e-6)
    assert len(made) == 2


def test_an_exponent_makes_another_system(made: list[object]) -> None:
    power = hr.System(["x"], {"n": 2}, {"s": "x - 9"}, ["x^n"])
    assert hr.simulate(power, {"x": 1}, until=0.5).y[0, -1] == pytest.approx(2)
    assert hr.simulate(power, {"x": 1}, until=0.5, parameters={"n": 1}).y[0, -1] == pytest.approx(1.6487212707001282)
    assert len(made) == 2


def test_what_is_kept_is_bounded(made: list[object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "MAX_COMPILED_SYSTEMS", 2)
    for name in ("x", "y", "z", "z", "x"):
        hr.simulate(oscillator(name), {name: 1, "v": 0}, until=1)
        assert len(compiled._kept) <= 2
    assert len(made) == 4


def test_what_is_refused_is_refused_before_anything_is_compiled(made: list[object]) -> None:
    for wrong in ({"until": 0}, {"rtol": 0}, {"stop": {"q": "rising"}}, {"parameters": {"q": 1}}):
        with pytest.raises(hr.HenonRefError):
            hr.simulate(oscillator(), {"x": 1, "v": 0}, **{"until": 5, **wrong})
    with pytest.raises(hr.HenonRefError):
        hr.simulate(oscillator(), {"x": 1}, until=5)
    assert made == []


def test_threads_that_come_at_once_compile_once_and_get_the_same_bits(made: list[object]) -> None:
    barrier = Barrier(6)

    def run(_: int) -> list[list[object]]:
        barrier.wait()
        solution = hr.simulate(oscillator(), {"x": 50, "v": 0}, until=400)
        return [solution.t.tolist(), solution.y.tolist(), solution.transitions.values.tolist()]

    with ThreadPoolExecutor(6) as pool:
        runs = list(pool.map(run, range(6)))
    assert len(made) == 1
    assert all(found == runs[0] for found in runs)


@pytest.mark.parametrize("name", ["two_blocks", "hard/grazing", "hard/two_contacts", "hard/roots_at_once"])
def test_threads_with_other_starts_do_not_disturb_each_other(name: str) -> None:
    """Events that go to multiprecision, and several surfaces, included."""
    case = hr.System.from_case(CASES / f"{name}.yaml")
    starts = [{x: str(value) + f" + {k}/1000" for x, value in case.initial.items()} for k in range(6)]

    def run(initial: dict[str, str]) -> list[object]:
        solution = hr.simulate(case, initial, start=case.start, until=case.until)
        return [solution.status, solution.t.tolist(), solution.y.tolist(), solution.transitions.values.tolist()]

    alone = [run(initial) for initial in starts]
    with ThreadPoolExecutor(6) as pool:
        for _ in range(3):
            assert list(pool.map(run, starts)) == alone


def test_a_number_without_parameters_is_rounded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """When it is made, under the lock of SymPy; runs only read it."""
    third = Number(sp.Rational(1, 3))
    monkeypatch.delattr("henon_ref.simulation.quick_start.double_double")
    assert third.pair(()) == (1 / 3, float(sp.Rational(1, 3) - sp.Rational(1 / 3)))


def test_quick_starts_from_many_threads_are_those_of_one() -> None:
    system = oscillator()
    points = [{"x": 3 + k / 7, "w": 1 + k / 31} for k in range(240)]

    def run(point: dict[str, float]) -> list[object]:
        given = {"until": 30, "parameters": {"w": point["w"]}, "dense_output": False}
        solution = hr.simulate(system, {"x": point["x"], "v": 0.1}, **given)
        return [solution.t.tolist(), solution.y.tolist(), solution.final_mode, solution.counts]

    alone = [run(point) for point in points]
    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(run, points)) == alone
