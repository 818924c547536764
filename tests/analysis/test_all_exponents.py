"""All exponents, not the largest alone: closed forms, the divergence's sum, and what sticks and rests take."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from derivatives import fundamental_matrix

import henon_ref as hr
from henon_ref.analysis import tangent_frame
from henon_ref.analysis.saltation import Saltation
from henon_ref.analysis.variational import TangentFlow
from henon_ref.errors import UnsupportedError
from henon_ref.simulation.arguments import problem_of

PLATE = hr.System(
    state=["xb", "vb", "xp", "vp"],
    parameters={"e": 0.4, "M": 3},
    surfaces={"s": "xb - xp"},
    field=["vb", "-10", "vp", "-10 - 20*xp - vp/2"],
    resets={"s": {"map": {"vb": "vb - M/(1 + M)*(1 + e)*(vb - vp)", "vp": "vp + 1/(1 + M)*(1 + e)*(vb - vp)"}}},
)
"""A ball on a plate on a spring; it comes to rest on it."""
DROPPED = {"xb": 0.5, "vb": 0, "xp": -0.5, "vp": 0.1}


def lorenz(surface: str = "x - 1000") -> hr.System:
    return hr.System(["x", "y", "z"], {}, {"s": surface}, ["10*(y - x)", "x*(28 - z) - y", "x*y - 8*z/3"])


def blocks(count: int) -> hr.System:
    """Blocks joined by springs, each with Coulomb friction and a drive of its own."""
    states, field = [], []
    for i in range(count):
        left, right = f"x{i - 1}" if i else "0", f"x{i + 1}" if i < count - 1 else "0"
        states += [f"x{i}", f"v{i}"]
        field += [f"v{i}", f"-3*x{i} + {left} + {right} - 1.2*s{i} + cos({i + 1}*t)"]
    return hr.System(states, {}, {f"s{i}": f"v{i} - 0.1" for i in range(count)}, field)


def sliders(count: int) -> hr.System:
    """Bodies on one spring, of length y: as many contacts with few states."""
    states = [f"v{i}" for i in range(count)]
    field = [f"-{i + 1}*y - 1.2*s{i} + 1.5*cos({i + 1}*t)" for i in range(count)]
    return hr.System([*states, "y"], {}, {f"s{i}": f"v{i} - 0.1" for i in range(count)}, [*field, " + ".join(states)])


def differences(system: hr.System, initial: dict[str, float], until: float) -> np.ndarray:
    columns = []
    for name in initial:
        ends = [
            np.array(hr.simulate(system, {**initial, name: initial[name] + h}, until=until, rtol=1e-13).y[:, -1])
            for h in (1e-6, -1e-6)
        ]
        columns.append((ends[0] - ends[1]) / 2e-6)
    return np.column_stack(columns)


def derivative(system: hr.System, initial: dict[str, float], until: float) -> tuple[np.ndarray, int]:
    _, problem = problem_of(system, initial, until=until)
    return fundamental_matrix(problem, sp.Integer(0), sp.nsimplify(until), tolerance=1e-13)


@pytest.mark.parametrize(
    ("rates", "span"), [((-1, -20), 100), ((-0.001, -1, -1000), 10), ((3, -7), 20), ((300, -7), 20), ((0, -2), 1000)]
)
def test_a_linear_system_has_its_eigenvalues(rates: tuple[float, ...], span: float) -> None:
    names = ["x", "y", "z"][: len(rates)]
    field = [f"({r})*{x} + {names[0] if x != names[0] else 0}" for r, x in zip(rates, names, strict=True)]
    found = hr.lyapunov_exponents(hr.System(names, {}, {"s": "x - 5"}, field), dict.fromkeys(names, 0), span=span)
    assert found.exponents == pytest.approx(rates, rel=1e-5, abs=1e-5)
    assert sum(found.exponents) == pytest.approx(sum(rates), rel=1e-9)


@pytest.mark.parametrize("surface", ["x - 1000", "x"])
def test_exponents_of_lorenz_sum_up_to_its_divergence(surface: str) -> None:
    """Published: 0.906, 0, -14.572 (Sprott, *Chaos and Time-Series Analysis*, 2003); the divergence is constant."""
    found = hr.lyapunov_exponents(lorenz(surface), {"x": 1, "y": 1, "z": 20}, discard=20, span=200)
    assert sum(found.exponents) == pytest.approx(-41 / 3, rel=1e-9)
    for exponent, error, right in zip(found.exponents, found.standard_errors, (0.906, 0, -14.572), strict=True):
        assert exponent == pytest.approx(right, abs=4 * error + 0.01)
    assert found.kaplan_yorke() == pytest.approx(2.062, abs=0.005)


def test_a_clock_as_a_state_adds_an_exponent_of_zero() -> None:
    field = ["x - y - (x^2 + y^2)*x + A*cos({})", "x + y - (x^2 + y^2)*y"]
    values, how = {"A": 0.3, "w": 1.3}, {"span": 100, "discard": 50}
    forced = hr.System(["x", "y"], values, {"s": "x - 100"}, [f.format("w*t") for f in field])
    clock = hr.System(["x", "y", "p"], values, {"s": "x - 100"}, [*(f.format("p") for f in field), "w"])
    own = hr.lyapunov_exponents(forced, {"x": 1, "y": 0}, **how)
    with_clock = hr.lyapunov_exponents(clock, {"x": 1, "y": 0, "p": 0}, **how)
    assert sum(with_clock.exponents) == pytest.approx(sum(own.exponents), abs=1e-9)
    assert with_clock.exponents == pytest.approx((0, *own.exponents), abs=1e-3)


@pytest.mark.parametrize("clock", [False, True])
def test_a_stick_during_the_time_discarded_takes_nothing(clock: bool) -> None:
    """Two sticks end before t = 6.5, then there are crossings alone: both exponents are those of the orbit."""
    states, phase = (["x", "v", "p"], "p") if clock else (["x", "v"], "w*t")
    field = ["v", f"-x - 0.8*s + 1.3*cos({phase})", "w"]
    system = hr.System(states, {"w": 0.7}, {"s": "v"}, field[: len(states)])
    found = hr.lyapunov_exponents(system, dict.fromkeys(states, 0), discard=200, span=40 * 2 * math.pi / 0.7)
    assert found.lost == 0
    assert found.exponents[-2:] == pytest.approx((-0.2298, -0.2298), abs=3e-3)
    assert sum(found.exponents) == pytest.approx(2 * -0.22983, abs=1e-4)


@pytest.mark.parametrize("discard", [0, 5])
def test_a_ball_at_rest_has_lost_both_directions(discard: float) -> None:
    ball = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-10"], resets={"s": {"map": {"v": "-v/2"}}})
    found = hr.lyapunov_exponents(ball, {"x": 1, "v": 0}, span=10, discard=discard)
    assert (found.exponents, found.status) == ((-math.inf, -math.inf), "ok")


def test_a_ball_at_rest_on_a_plate_leaves_the_exponents_of_both_together() -> None:
    """The plate's damping, 3/2 per mass of 4, is all that they lose."""
    found = hr.lyapunov_exponents(PLATE, DROPPED, discard=2, span=20)
    assert found.lost == 2
    assert sum(found.exponents[:2]) == pytest.approx(-3 / 8, rel=1e-9)


@pytest.mark.parametrize("e", [0, 0.4])
def test_the_derivative_over_a_limit_of_impacts_is_that_of_runs_side_by_side(e: float) -> None:
    system = PLATE.with_parameters({"e": e})
    matrix, rank = derivative(system, DROPPED, 2.0)
    assert rank == 2
    assert matrix == pytest.approx(differences(system, DROPPED, 2.0), abs=1e-7)


@pytest.mark.parametrize(
    ("system", "until"),
    [pytest.param(blocks(2), 3.0, marks=pytest.mark.slow), (sliders(4), 0.35)],  # two blocks: the next test, too
)
def test_the_derivative_through_sticks_of_many_blocks_is_that_of_runs_side_by_side(
    system: hr.System, until: float
) -> None:
    """With more than three contacts one set of equations serves all modes; tangent vectors have none of it."""
    model = system.model
    assert (model.switched is not None) == (len(model.surfaces) > 3)
    initial = {name: 0.1 * (k + 1) + 0.03 for k, name in enumerate(system.state)}
    matrix, rank = derivative(system, initial, until)
    assert rank < len(initial)
    assert matrix == pytest.approx(differences(system, initial, until), abs=1e-7)


@pytest.mark.parametrize(
    ("states", "surface", "field", "right"),
    [
        (["x", "v"], "v + x", ["v", "cos(t) - 3*s"], [-1]),  # one direction left, which is never compared with another
        (["x", "y", "z"], "x", ["1/2 - 2*s + 3*y/10", "x - 7*y/10 - s/5", "z/10"], [0.1, -0.73]),
    ],
)
def test_rounding_normal_to_the_surface_does_not_outlive_a_sliding_frame(
    states: list[str], surface: str, field: list[str], right: list[float]
) -> None:
    system = hr.System(states, {}, {"s": surface}, field)
    start = {"x": 0.1, "v": -0.1} if len(states) == 2 else {"x": 0, "y": 0.2, "z": 1}
    spectrum = hr.lyapunov_exponents(system, start, span=150)
    assert spectrum.exponents == pytest.approx([*right, -math.inf], abs=1e-8)


def test_contacts_that_do_not_act_on_each_other_lose_a_direction_each() -> None:
    friction = "-x{0} - s{0}*{1}/(1 + 3*s{0}*(v{0} - 0.2))"
    field = [rate for k, limit in (("a", 1), ("b", 1.5)) for rate in (f"v{k}", friction.format(k, limit))]
    system = hr.System(["xa", "va", "xb", "vb"], {}, {"sa": "va - 0.2", "sb": "vb - 0.2"}, field)
    found = hr.lyapunov_exponents(system, {"xa": 1.5, "va": 0, "xb": 2, "vb": 0.1}, span=150, discard=60)
    assert found.lost == 2
    assert found.exponents[:2] == pytest.approx((0, 0), abs=0.03)


def test_a_surface_written_twice_changes_nothing() -> None:
    once = hr.System(["x", "v"], {}, {"s": "v - 0.2"}, ["v", "-x - 0.8*s + cos(1.1*t)"])
    twice = hr.System(["x", "v"], {}, {"s": "v - 0.2", "r": "0.4 - 2*v"}, ["v", "-x - 0.5*s + 0.3*r + cos(1.1*t)"])
    how = {"span": 100, "discard": 50}
    own, both = (hr.lyapunov_exponents(system, {"x": 0, "v": 0}, **how) for system in (once, twice))
    assert (own.lost, both.lost) == (1, 1)
    assert both.exponents == pytest.approx(own.exponents, rel=1e-6)


def test_vectors_that_are_parallel_to_the_last_bit_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CONDITION", "MAX_CONDITION"):
        monkeypatch.setattr(tangent_frame, name, 1e300)
    monkeypatch.setattr(tangent_frame, "FIRST_STRETCH", 1.0)
    system = hr.System(["x", "y"], {}, {"s": "x - 5"}, ["-x", "-20*y + x"])
    with pytest.raises(UnsupportedError, match="lost in rounding"):
        hr.lyapunov_exponents(system, {"x": 1, "y": 1}, span=10)


def test_a_wrong_saltation_or_divergence_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    belt = hr.System(["x", "v"], {"vb": 0.2}, {"s": "v - vb"}, ["v", "-x - s/(1 + 3*s*(v - vb))"])
    right = TangentFlow.log_volume.fget
    monkeypatch.setattr(TangentFlow, "log_volume", property(lambda flow: right(flow) * (1 + 1e-6)))
    with pytest.raises(UnsupportedError, match="integrated divergence"):
        hr.lyapunov_exponents(belt, {"x": 1.5, "v": 0}, span=30)
    monkeypatch.undo()
    shaken = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-x - 0.2*v - 0.1*s + 0.3*cos(t)"])
    own = Saltation.matrix
    # A map into a plane that sliding does not keep: vectors leave the tangent space.
    monkeypatch.setattr(
        Saltation, "matrix", lambda self, transition: own(self, transition) + np.array([[0, 0], [0, 1e-3]])
    )
    hr.lyapunov_exponents(shaken, {"x": 1, "v": 0}, span=5)  # full rank: consistent with itself, whatever the matrix
    with pytest.raises(UnsupportedError, match="integrated divergence"):
        hr.lyapunov_exponents(belt, {"x": 1.5, "v": 0}, span=30)


def test_a_start_with_no_unique_future_has_no_exponents() -> None:
    system = hr.System(["x", "y"], {}, {"s": "x", "r": "y"}, ["s", "r"])
    found = hr.lyapunov_exponents(system, {"x": 0, "y": 0}, span=5)
    assert found.status == "nonunique"
    assert all(map(math.isnan, (*found.exponents, *found.standard_errors, found.kaplan_yorke())))


def test_a_coarse_tolerance_costs_no_exponent() -> None:
    fine, coarse = (
        hr.lyapunov_exponents(lorenz(), {"x": 1, "y": 1, "z": 20}, span=5, rtol=rtol) for rtol in (1e-10, 1e-3)
    )
    assert coarse.exponents == fine.exponents
    assert replace(fine, exponents=(math.nan,) * 3).kaplan_yorke() != fine.kaplan_yorke()
