"""The paper's systems with one degree of freedom in exact numbers, runs of them, and the findings of a section.

Runs of Fig. 8 use the readings of ``cases/fig8.yaml``; a test compares the systems here with these readings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.figures.motion import Motion, motion_of
from henon_ref.harness.studies.page import shipped_problem
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Run
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RTOL = 1e-13
"""Relative tolerance of all reference runs."""
X1, X2, S, Z = sp.symbols("x1 x2 s z", real=True)
M, K1, K2, MU0, VP, A, W, DELTA = sp.symbols("m k1 k2 mu0 vp A w delta", real=True)
V = X2 - VP
BASE = A * sp.sin(W * TIME)
STRIBECK = S * MU0 / (1 + DELTA * S * V)
"""T of Eq. (2), with the sign symbol for sgn(V)."""
POSITION = X1
"""Sec. 2: the coordinate on the surface is x1."""
STRETCH = X1 - BASE
"""Sec. 4: the coordinate on the surface is z, the spring's stretch."""

Values = Mapping[sp.Symbol, sp.Expr]
FIG4_VALUES: Values = {MU0: 1 / (3 * sp.sqrt(3)), VP: sp.Integer(1), DELTA: sp.Integer(1)}
FIG8_VALUES: Values = {
    M: sp.Rational(1, 10),
    K1: sp.Integer(1),
    K2: sp.Integer(1),
    MU0: sp.sqrt(3) / 9,
    VP: sp.Rational(2, 5),
    A: 4 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18),
    W: 3 * sp.pi / sp.Rational("2.4728"),
    DELTA: sp.Integer(1),
}
PERIOD = 2 * sp.pi / FIG8_VALUES[W]
"""Period T of the forcing of Fig. 8 [s]."""
INNER = 2 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18)
"""z*, the upper end of the middle stick zone: x(3) of Eq. (24)."""


@dataclass(frozen=True)
class Findings:
    """Results of the computation of a section, by their names in ``paper.yaml``."""

    holds: Mapping[str, object]
    """Whether each check holds."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """Values for the names in braces in the section's text and evidence: numbers, and tables as markdown."""
    figures: Mapping[str, Figure] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    """Complete tables: CSV text by file name."""


def printed_points() -> tuple[sp.Expr, ...]:
    """Tangent points of Eqs. (16) and (24), highest first."""
    c = sp.pi / 9
    upper = [2 / sp.sqrt(3) * v for v in (sp.cos(c), sp.cos(2 * c), sp.sin(c / 2))]
    return (*upper, *(-v for v in reversed(upper)))


def belt_oscillator(force: sp.Expr, mass: sp.Expr, values: Values) -> FilippovSystem:
    """``x1' = x2, mass x2' = force`` on the belt; the force has the friction's sign symbol ``s``."""
    return FilippovSystem((X1, X2), (S,), (V,), (X2, force / mass), values)


def section_2(values: Values) -> FilippovSystem:
    """Eqs. (4) and (5): m = k1 = k2 = 1, with the spring's force of Eq. (1)."""
    return belt_oscillator(X1 - X1**3 - STRIBECK, sp.Integer(1), values)


def section_4(values: Values) -> FilippovSystem:
    """Eq. (18), and Eq. (17) with friction opposing the sliding velocity."""
    z = X1 - BASE
    return belt_oscillator(-K1 * z + K2 * z**3 - STRIBECK, M, values)


def fig8_equations() -> Problem:
    """Reading ``equations``: Eq. (18) with Filippov's sliding, from the start of the listing."""
    return shipped_problem("fig8", "equations")


def fig8_listing_limit() -> Problem:
    """Reading ``listing_limit``: slip 3 f, and a stick that ends at the upper tangent point only."""
    return shipped_problem("fig8", "listing_limit")


def same(one: sp.Expr, other: sp.Expr) -> bool:
    """Check whether two expressions are mathematically equal for positive masses, stiffnesses and friction."""
    positive = {symbol: sp.Symbol(symbol.name, positive=True) for symbol in (M, K1, K2, MU0)}
    difference = sp.simplify((sp.sympify(one) - other).xreplace(positive))
    # SymPy proves equalities of cosines of parts of pi by the minimal polynomial.
    return bool(difference == 0 or (not difference.free_symbols and difference.equals(0)))


def same_all(found: Sequence[sp.Expr], printed: Sequence[sp.Expr]) -> bool:
    """Check whether expressions are equal one by one."""
    return len(found) == len(printed) and all(map(same, found, printed))


def same_set(found: Collection[sp.Expr], printed: Collection[sp.Expr]) -> bool:
    """Check whether two sets of expressions are equal."""
    return len(found) == len(printed) and all(any(same(a, b) for a in found) for b in printed)


def reference(problem: Problem) -> Trajectory:
    """Run a problem with the Taylor reference."""
    return HENON_SOLVER.prepare(problem, rtol=RTOL)()


def sampled(
    problem: Problem, after: float, until: float, prepare: Callable[..., Run] = HENON_SOLVER.prepare, **setting: float
) -> tuple[Trajectory, Motion]:
    """Run a problem with the Taylor reference or another solver; return the run and its motion between two times."""
    wanted = np.linspace(after, until, 800)
    run = prepare(problem, sample_times=wanted, **(setting or {"rtol": RTOL}))()
    assert run.samples is not None
    motion = motion_of(Samples(wanted, run.samples, run.sample_modes), run.transitions)
    assert motion is not None
    return run, motion


def fitted_order(steps: Sequence[float], errors: Sequence[float]) -> float:
    """Order of a method: slope of the logarithms of its errors over those of the steps."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
