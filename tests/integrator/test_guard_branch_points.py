"""Surfaces with branch points of their own, which no power series of them leads over: crossings on both sides."""

from __future__ import annotations

import math

import numpy as np
import pytest
from often import daily
from problems import make_problem
from runs import run, times

from henon_ref.integrator.precise_modes import PreciseModes

BELT = 2 * math.asin(1 / (3 * math.sqrt(2)))
"""Where sqrt(1 - cos(u)) is 1/3."""
QUARTIC = [1 + float(u.real) for u in sorted(np.roots([1, 2, 2, 0, -2 / 9]), key=np.real) if abs(u.imag) < 1e-9]
"""Where (x - 1)^2 (1 + x^2) is 2/9: u^4 + 2 u^3 + 2 u^2 - 2/9 = 0 of u = x - 1."""
SURFACES = [
    ("sqrt(1 - cos(x - 1)) - 1/3", [1 - BELT, 1 + BELT]),
    ("sqrt(1 - cos(x - 2)) - 1/3", [2 - BELT, 2 + BELT]),
    ("sqrt(x^2 - 2*x + 1) - 1/3", [2 / 3, 4 / 3]),
    ("sqrt(x^2 - 2*x + 1) - 1/100", [0.99, 1.01]),
    ("(x^2 - 2*x + 1)^(3/2) - 1/27", [2 / 3, 4 / 3]),
    ("(x^2 - 2*x + 1)^(1/6) - 1/2", [7 / 8, 9 / 8]),
    ("sqrt(1 - sin(x)^2) - 1/5", [math.acos(0.2), math.pi - math.acos(0.2)]),
    ("acos(cos(x - 1)) - 1/4", [0.75, 1.25]),
    ("asin(sin(x)) - 1", [1, math.pi - 1]),
    ("sqrt(x^2 - 2*x + 1) + x - 5/4", [9 / 8]),
    ("sqrt((x^2 - 2*x + 1)*(1 + x^2)) - sqrt(2)/3", QUARTIC),
]
"""With their roots up to x = 5/2."""


@pytest.mark.parametrize("rtol", daily([1e-3, 1e-6, 1e-9, 1e-12], some=[1e-6, 1e-12]))
@pytest.mark.parametrize(("surface", "roots"), SURFACES)
def test_no_crossing_near_a_kink_of_a_surface_is_lost(surface: str, roots: list[float], rtol: float) -> None:
    """A square root's series, a polynomial perhaps, goes on behind its kink as if there were none."""
    for start, begin in {"-1": -1.0, "0": 0.0, "1/3": 1 / 3, "sqrt(2)/4": math.sqrt(2) / 4}.items():
        result = run(make_problem("x", ["1"], {"s": surface}, [start], f"5/2 - {start}"), rtol)
        assert result.status == "ok", (start, result.reason)
        assert begin + times(result) == pytest.approx(roots, abs=max(rtol, 1e-9)), start


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_motion_that_depends_on_the_sign_crosses_behind_the_kink_too(rtol: float) -> None:
    """x' = 2 + s: 3 outside of [2/3, 4/3], and 1 within."""
    problem = make_problem("x", ["2 + s"], {"s": "sqrt(x^2 - 2*x + 1) - 1/3"}, [0], 2)
    assert times(run(problem, rtol)) == pytest.approx([2 / 9, 8 / 9], abs=1e-9)


@pytest.mark.parametrize("rtol", [1e-3, 1e-9])
def test_a_run_may_begin_on_a_kink_of_its_surface(rtol: float) -> None:
    result = run(make_problem("x", ["1"], {"s": "sqrt(x^2 - 2*x + 1) - 1/3"}, [1], 3), rtol)
    assert result.status == "ok"
    assert times(result) == pytest.approx([1 / 3], abs=1e-9)


@pytest.mark.parametrize("rtol", [1e-3, 1e-9])
@pytest.mark.parametrize(
    ("field", "surface", "start"),
    [
        ("1", "sqrt(x^2 - 2*x + 1)", "0"),  # zero at its kink
        ("0", "sqrt(x^2 - 2*x + 1) - 1/3", "1"),  # at rest there
        ("1 + sqrt(x^2 - 2*x + 1)", "sqrt(x^2 - 2*x + 1) + 1", "0"),  # the field has the kink, too
        ("1", "(x - 1)/sqrt(x^2 - 2*x + 1) - 1/3", "0"),  # a jump
    ],
)
def test_where_something_may_happen_at_the_kink_the_run_ends_there(
    field: str, surface: str, start: str, rtol: float
) -> None:
    result = run(make_problem("x", [field], {"s": surface}, [start], 3), rtol)
    assert result.status == "failed"
    assert "the step size fell to zero" in result.reason
    assert len(result.transitions) == 0
    assert result.end_state == pytest.approx([1], abs=1e-6)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("surface", ["sqrt(x) - 1", "sqrt(x^2 - 2*x + 1) - 1/2"])
def test_a_guard_next_to_zero_is_off_by_its_rounding(surface: str, rtol: float) -> None:
    """A last step of 1e-12 s behind a crossing: the state's last place is more than a millionth of it."""
    start = "1/2" if surface.startswith("sqrt(x)") else "0"
    result = run(make_problem("x", ["1"], {"s": surface}, [start], "1/2 + 10^(-12)"), rtol)
    assert (result.status, result.end_time) == ("ok", 0.5 + 1e-12)
    assert all(abs(time - 0.5) < 1e-5 for time in times(result))


def test_guards_without_a_value_behind_are_evaluated_once_a_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    """A square root's domain ends, as at most branch points."""
    evaluated, values = [], PreciseModes.guard_values
    monkeypatch.setattr(PreciseModes, "guard_values", lambda *given: evaluated.append(1) or values(*given))
    result = run(make_problem("x", ["1"], {"s": "sqrt(1 - x) - 1/2"}, [0], 2), 1e-9)
    assert (result.status, len(evaluated)) == ("failed", 5)


def test_samples_are_filled_where_a_kink_is_passed() -> None:
    at = np.array([0.5, 1 - 1e-6, 1 - 1e-9, 1, 1 + 1e-9, 1 + 1e-6, 1 + 1e-5, 1 + 4e-5, 2])
    problem = make_problem("x", ["1"], {"s": "sqrt(x^2 - 2*x + 1) - 1/3"}, [0], 3)
    result = run(problem, 1e-9, sample_times=at)
    np.testing.assert_allclose(result.samples[:, 0], at, rtol=1e-14)
