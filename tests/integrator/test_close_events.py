"""What double precision does not decide and double-double does, without Python."""

from __future__ import annotations

from pathlib import Path
from random import Random

import mpmath
import pytest
import sympy as sp
from often import daily
from problems import make_problem

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case
from henon_ref.integrator import mode_code
from henon_ref.integrator.mode_code import tape_program
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Decisions, Trajectory

CASES = Path(__file__).parents[2] / "cases"
HARD = CASES / "hard"
# Valleys of elementary functions of x = t: the guard, less g, and where its minimum, zero for g = 0, is.
VALLEYS = {
    "cos(x) + 1": "pi",
    "1 - sin(x)": "pi/2",
    "exp(x - 2) - x + 1": "2",
    "x - 1 - log(x)": "1",
    "x**(3/2) - 3*x/2 + 1/2": "1",
    "x - 2*sqrt(x) + 1": "1",
    "x + 1/x - 2": "1",
    "(x**2 + 1)/(x + 1) - 2*sqrt(2) + 2": "sqrt(2) - 1",
    "(x - 1)**2*(x + 3)*(x**2 + 1)": "1",
}


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("gap", ["1e-11", "1e-13", "1e-15"])
@pytest.mark.parametrize("shape", VALLEYS)
def test_a_valley_of_any_function_is_decided_without_python(shape: str, gap: str, rtol: float) -> None:
    """Its first root to 19 digits where it is below zero, nothing where it is above."""
    for side in (1, -1):
        problem = make_problem("x y", ["1", "s"], {"s": f"{shape} - ({side})*{gap}"}, ["1/10", 0], 4)
        run = HENON_SOLVER.prepare(problem, rtol=rtol)()
        assert (run.status, run.counts.decisions) == ("ok", Decisions())
        assert [each.kind for each in run.transitions] == ["crossing", "crossing"][: 1 + side]
        for first in run.transitions[:1]:
            with mpmath.workdps(60):
                off = mpmath.mpf(first.time) + mpmath.mpf(first.time_low) + mpmath.mpf("0.1") - _root(shape, gap)
            assert abs(off) < 1e-19


def _root(shape: str, gap: str) -> mpmath.mpf:
    """First root of a valley that is so far below zero."""
    x = sp.Symbol("x")
    with mpmath.workdps(60):
        guard = sp.lambdify(x, sp.sympify(f"{shape} - {gap}", rational=True), "mpmath")
        where = sp.sympify(VALLEYS[shape])
        bend = sp.N(sp.diff(sp.sympify(shape), x, 2).subs(x, where), 60)
        return mpmath.findroot(guard, mpmath.mpf(sp.N(where - sp.sqrt(2 * sp.Rational(gap) / bend), 60)))


LADDERS = (
    "grazing",
    "grazing_ballistic",
    "grazing_fourth_order",
    "grazing_sliding",
    "two_roots",
    "horizon_event",
    "quick_restick",
)


@pytest.mark.parametrize("rtol", daily([1e-6, 1e-9, 1e-12], some=[1e-9]))
@pytest.mark.parametrize("case", LADDERS)
def test_readings_of_ladders_need_no_python(case: str, rtol: float) -> None:
    """But for what double-double leaves open: an exact touch of a sine, and roots that are too close."""
    for reading in load_case(HARD / f"{case}.yaml").readings:
        close = case == "two_roots" and reading.name not in {f"d1e{k}" for k in range(1, 13)}
        if (case, reading.name) != ("grazing", "exact") and not close:
            run = HENON_SOLVER.prepare(reading.problem, rtol=rtol)()
            assert (run.status, run.counts.decisions) == ("ok", Decisions()), reading.name


def test_an_impact_near_a_graze_needs_no_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the oscillator leaves it, and the next impacts, as multiprecision says."""
    (path,) = CASES.rglob("impact_oscillator.yaml")
    for reading in load_case(path).readings:
        own = HENON_SOLVER.prepare(reading.problem, rtol=1e-9)()
        assert (own.status, own.counts.decisions) == ("ok", Decisions()), reading.name
        with monkeypatch.context() as without:
            without.setattr(mode_code, "tape_program", lambda *_: None)
            other = HENON_SOLVER.prepare(reading.problem, rtol=1e-9)()
        assert [q[1:] for q in _told(own)] == [q[1:] for q in _told(other)]
        assert [q[0] for q in _told(own)] == pytest.approx([q[0] for q in _told(other)], rel=0, abs=1e-9)


# Guards of x = t that are flat at x = 1, and what is told there where the gap is 0.
FLAT = {
    "(x - 1)**3": "crossing",
    "(1 - x)**3*(x + 3)": "crossing",
    "(x - 1)**4*(x + 3)": "graze",
    "(1 - x)**5": "crossing",
    "(x - 1)**6": "graze",
    "-(x - 1)**4": "graze",
}


@pytest.mark.parametrize("gap", ["0", "10**(-14)", "-10**(-14)", "10**(-20)"])
@pytest.mark.parametrize("shape", FLAT)
def test_a_flat_guard_is_decided_as_in_multiprecision(shape: str, gap: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for program in (tape_program, lambda *_: None):
        monkeypatch.setattr(mode_code, "tape_program", program)
        problem = make_problem("x y", ["1", "s"], {"s": f"{shape} + {gap}"}, [0, 0], 2)
        found.append(HENON_SOLVER.prepare(problem, rtol=1e-9)())
    own, other = found
    assert (own.status, [q[1:] for q in _told(own)]) == (other.status, [q[1:] for q in _told(other)])
    assert [q[0] for q in _told(own)] == pytest.approx([q[0] for q in _told(other)], rel=0, abs=1e-14)
    if gap == "0":
        assert own.counts.decisions == Decisions()
        assert [(q.time, q.kind) for q in own.transitions] == [(1.0, FLAT[shape])]


GUARDS = (
    "x - 1",
    "sin(3*x) - 1",
    "x*y - 1/2",
    "x**2 + y**2 - 1",
    "exp(y - 1) - 1 + (x - 1)/50",
    "cos(2*t) - 1",
    "1 - x",
)
DRIVES = ("-x", "-x - s/2", "-x - s*(1 + y)/3", "-x + cos(t)/3 - s/9", "-sin(x) - s/3")


@pytest.mark.parametrize("draw", daily(range(24), some=range(12)))
def test_what_is_decided_is_what_multiprecision_decides(draw: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Grazes of circles, sines and products, in a first mode and in later ones, alone and beside another surface."""
    rng = Random(draw)
    gaps = [f"{rng.choice((-1, 1))}*{rng.randint(1, 9)}*10**(-{rng.randint(5, 15)})" for _ in "su"]
    guards = [f"{rng.choice(GUARDS)} + {gap}" for gap in gaps]
    surfaces = dict(zip("su", guards[: 1 + draw % 2], strict=False))
    field = ["y", rng.choice(DRIVES) + (" - u/5" if draw % 2 else "")]
    initial, rtol = rng.choice([[0, 1], ["1/3", 1], ["12/10", 0]]), rng.choice([1e-6, 1e-9, 1e-12])
    found = []
    for program in (tape_program, lambda *_: None):
        monkeypatch.setattr(mode_code, "tape_program", program)
        found.append(HENON_SOLVER.prepare(make_problem("x y", field, surfaces, initial, 6), rtol=rtol)())
    own, other = found
    assert own.status == other.status
    assert [q[1:] for q in _told(own)] == [q[1:] for q in _told(other)]
    assert [q[0] for q in _told(own)] == pytest.approx([q[0] for q in _told(other)], rel=0, abs=1e-15)
    assert own.end_state == pytest.approx(other.end_state, rel=0, abs=1e-13)


def _told(run: Trajectory) -> list[tuple[float, str, int, Mode]]:
    return [(q.time, q.kind, q.surface, q.to_mode) for q in run.transitions]
