"""diffrax, diffsol and nosnoc against closed forms, each in a separate process; rows if they are not installed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
import sympy as sp
import systems
from child import child, trajectory

import henon_ref
from henon_ref.baselines.adapter import LibrarySolver
from henon_ref.baselines.diffrax_ode import DOPRI8, _message, mode_source
from henon_ref.baselines.diffsol_ode import BDF, TSIT45, mode_text, number, to_diffsl
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.nosnoc_fesd import FEWEST, GRID, NOSNOC, _control_steps
from henon_ref.baselines.scipy_ivp import RK45
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

MODULES = {"diffrax": "diffrax", "diffsol": "pydiffsol", "nosnoc": "nosnoc"}
LADDER = [
    ("diffrax-dopri8", 1e-10, 1e-8),
    ("diffrax-kvaerno5", 1e-9, 1e-6),
    ("diffsol-tsit45", 1e-11, 1e-8),
    ("diffsol-bdf", 1e-10, 1e-6),
]
EACH = pytest.mark.parametrize(("solver", "rtol", "bound"), LADDER, ids=[row[0] for row in LADDER])
QUICK = pytest.mark.parametrize(
    ("solver", "rtol", "bound"),
    [pytest.param(*row, id=row[0], marks=[pytest.mark.slow] if row[0].startswith("diffrax") else []) for row in LADDER],
)
"""Without diffrax, which compiles for half a minute each; daily: the tests of ``EACH``."""
X, V, S = sp.symbols("x v s", real=True)
Runs = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def runs() -> Iterator[Runs]:
    with child() as pool:

        def run(solver: str, *arguments: Any, **options: Any) -> dict[str, Any]:
            if find_spec(MODULES[solver.split("-")[0]]) is None:
                pytest.skip(f"{solver} is not installed")
            found: dict[str, Any] = pool.submit(trajectory, solver, *arguments, **options).result()
            return found

        yield run


@EACH
def test_free_coulomb(runs: Runs, solver: str, rtol: float, bound: float) -> None:
    found = runs(solver, "free_coulomb", rtol)
    assert found["kinds"] == ["crossing", "crossing", "crossing", "stick"]
    assert found["times"] == pytest.approx([k * math.pi for k in range(1, 5)], abs=bound)
    assert found["end"] == pytest.approx((0.5, 0.0), abs=10 * bound)
    assert found["steps"] > 10


@QUICK
def test_guards_that_have_to_rise_first(runs: Runs, solver: str, rtol: float, bound: float) -> None:
    found = runs(solver, "static_belt", rtol)
    assert found["kinds"] == ["stick", "release", "stick", "release", "stick"]
    slip = 2 * math.pi - 2 * math.atan(1.0)
    assert found["times"] == pytest.approx(np.cumsum([slip, 2.0, slip, 2.0, slip]).tolist(), abs=100 * bound)


@QUICK
def test_stribeck_belt(runs: Runs, solver: str, rtol: float, bound: float) -> None:
    found = runs(solver, "stribeck_belt", rtol)
    assert found["kinds"][:3] == ["stick", "release", "stick"]
    durations = np.diff(found["times"][:3]).tolist()
    assert durations == pytest.approx([7.705031769350, 4.295999525480], abs=100 * bound)


@QUICK
def test_a_curved_surface(runs: Runs, solver: str, rtol: float, bound: float) -> None:
    found = runs(solver, "rotating_crossing", rtol)
    assert found["kinds"] == ["crossing"]
    assert found["times"][0] == pytest.approx(1.0, abs=100 * bound)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_diffsol_says_when_it_gave_up(tolerance: float) -> None:
    """x' = x^2 from 1 has its pole at 1; the message holds the time, which is the run's end."""
    pytest.importorskip("pydiffsol")
    system = FilippovSystem((X,), (S,), (X + 1,), (X**2,))
    found = BDF.prepare(
        Problem(system, sp.Integer(0), (sp.Integer(1),), sp.Integer(2)), rtol=tolerance, atol=tolerance
    )()
    assert found.status == "failed"
    assert found.end_time == pytest.approx(1.0, abs=1000 * tolerance)


def test_diffsol_starts_where_the_state_is_nearly_zero() -> None:
    """v' = 3 from 4e-14: the first step that diffsol takes is below its own shortest one."""
    pytest.importorskip("pydiffsol")
    system = FilippovSystem((X, V), (S,), (X + 1,), (sp.Integer(1), sp.Integer(3)))
    start = sp.Integer(0), sp.Rational(4, 10**14)
    found = BDF.prepare(Problem(system, sp.Integer(0), start, sp.Integer(2)), rtol=1e-9, atol=1e-9)()
    assert found.status == "ok"
    assert found.end_state == pytest.approx((2.0, 6.0), abs=1e-8)


def test_what_a_compiled_solve_raises_is_one_sentence() -> None:
    """Not jax's traceback, which names folders of the machine."""
    words = 'INTERNAL: CpuCallback error: Traceback:\n  File "x.py"\n_EquinoxRuntimeError: The root is not there\n\n---'
    assert _message(RuntimeError(words)) == "The root is not there"
    assert _message(RuntimeError("INTERNAL: out of memory\n  File")) == "INTERNAL: out of memory"


def test_several_surfaces(runs: Runs) -> None:
    found = runs("diffsol-tsit45", "three_blocks", 1e-10)
    assert found["kinds"] == ["crossing"] * 5 + ["stick"] * 3
    assert found["times"][-1] == pytest.approx(3.927104415444, abs=1e-7)


def test_a_mode_without_guards(runs: Runs) -> None:
    found = runs("diffrax-dopri8", "at_rest_for_good", 1e-6)
    assert (found["status"], found["times"][0]) == ("ok", pytest.approx(1, abs=1e-6))


@pytest.mark.slow  # daily: diffrax on a plain case; its claims are in test_causes.py
def test_two_guards_that_fall_at_once_are_both_seen(runs: Runs) -> None:
    """diffrax names one; its dense output finds the root some roundings away from where the other one says."""
    for rtol in (1e-6, 1e-9):
        found = runs("diffrax-dopri8", "same_surface_twice", rtol)
        assert found["kinds"] == ["crossing"] * 2
        assert found["times"] == pytest.approx([1.0, 1.0], abs=1e-12)


@QUICK
def test_a_switch_in_time_hides_no_later_root(runs: Runs, solver: str, rtol: float, bound: float) -> None:
    """Where it is found a rounding early, its own guard is negative: diffrax watches the least of all."""
    found = runs(solver, "switch_before_a_surface", rtol)
    assert found["kinds"] == ["crossing"] * 2
    assert found["times"] == pytest.approx([0.65, 0.66], abs=bound)


def test_nosnoc_finds_the_transitions_by_its_own_method(runs: Runs) -> None:
    found = runs("nosnoc", "free_coulomb", 1e-9)
    assert found["kinds"] == ["crossing", "crossing", "crossing", "stick"]
    assert found["times"] == pytest.approx([k * math.pi for k in range(1, 5)], abs=1e-6)
    assert runs("nosnoc", "rotating_crossing", 1e-6)["times"] == pytest.approx([1.0], abs=1e-4)


def test_nosnoc_is_not_charged_with_what_scipy_cannot_do() -> None:
    """SciPy's brentq raises at the flat root of a release; the grid is then CVODE's."""
    problem = henon_ref.load_case("odd_orders").reading("release").problem
    with pytest.raises(RuntimeError, match="Failed to converge"):
        RK45.prepare(problem, rtol=GRID, atol=GRID)()
    assert _control_steps(problem, None) >= FEWEST


def test_nosnoc_tells_a_slide_from_the_start_on(runs: Runs) -> None:
    """The state is off the surface by nothing but the complementarity's tolerance until it lets go, on the grid."""
    found = runs("nosnoc", "leaving_slide", 1e-6)
    assert found["kinds"] == ["release"]
    assert found["times"] == pytest.approx([1.0], abs=0.02)


def test_nosnoc_says_what_it_cannot_express() -> None:
    with pytest.raises(UnsupportedError, match="the case replaces it"):
        NOSNOC.prepare(systems.static_belt(), rtol=1e-6)
    with pytest.raises(UnsupportedError, match="chooses its own steps"):
        NOSNOC.prepare(systems.free_coulomb(), step=1e-3)
    ends = FilippovSystem((X,), (S,), (X,), (-S,), valid=(2 - X,))
    with pytest.raises(UnsupportedError, match="end of a model"):
        NOSNOC.prepare(Problem(ends, sp.Integer(0), (sp.Integer(1),), sp.Integer(2)), rtol=1e-6)


def test_diffsl_is_written_as_its_grammar_has_it() -> None:
    names = {X: "x0", V: "x1"}
    assert to_diffsl(X**3 - V / 2, names) in ("((x0 * x0 * x0) + ((-0.5) * x1))", "(((-0.5) * x1) + (x0 * x0 * x0))")
    assert to_diffsl(sp.tan(X), names) == "(sin(x0) / cos(x0))"
    assert to_diffsl(1 / sp.sqrt(X), names) == "(1.0 / sqrt(x0))"
    assert to_diffsl(X ** sp.Rational(1, 3) * TIME, names).count("pow(x0, 0.3333333333333333)") == 1
    assert (number(-1e-30), number(1e100)) == ("(-1e-30)", "1e+100")
    with pytest.raises(UnsupportedError, match="DiffSL has no atan"):
        to_diffsl(sp.atan(X), names)


def test_a_mode_in_diffsl_has_its_guards_as_stops() -> None:
    text = mode_text(ModeFunctions(FilippovSystem((X,), (S,), (X,), (2 - S,)), (-1,)))
    assert "u_i {\n  x0 = a0\n}" in text
    assert "w0 { heaviside(t - q0) }" in text
    assert "(1.0 - w0) + w0 * (((-1.0) * x0) + l0),\n  1e+100 - abs(x0)" in text


def test_one_source_serves_all_parameter_values_but_those_in_exponents() -> None:
    f, p = sp.symbols("F p", real=True)

    def source(force: int, power: int) -> Any:
        parameters = {f: sp.Integer(force), p: sp.Integer(power)}
        system = FilippovSystem((X, V), (S,), (V,), (V, -(X**p) - f * S), parameters=parameters)
        return mode_source(ModeFunctions(system, (1,)))

    assert source(1, 3)[0] == source(2, 3)[0]
    assert (source(1, 3)[1], source(2, 3)[1]) == ((1.0,), (2.0,))
    assert source(1, 3)[0] != source(1, 2)[0]


@pytest.mark.parametrize("solver", [DOPRI8, TSIT45, NOSNOC], ids=lambda s: s.name)
def test_a_peer_that_is_not_installed_is_unavailable_with_the_line_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, solver: LibrarySolver
) -> None:
    def absent(self: LibrarySolver) -> None:
        raise ImportError

    monkeypatch.setattr(type(solver), "load", absent)
    words = rf"^{solver.distribution} is not installed: pip install 'henon-ref\[peers\]'$"
    with pytest.raises(UnavailableError, match=words):
        solver.prepare(systems.free_coulomb(), rtol=1e-6)
