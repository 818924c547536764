"""The paper's one-degree-of-freedom systems, in its own symbols and exact numbers.

The readings of Fig. 8 are those of ``cases/fig8.yaml``; a test holds the two together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import sympy as sp

from henon_ref.analysis.tangent import SurfaceCoordinate
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

X1, X2, S, Z = sp.symbols("x1 x2 s z", real=True)
M, K1, K2, MU0, VP, A, W, DELTA = (
    sp.Symbol(name, real=True) for name in ("m", "k1", "k2", "mu0", "vp", "A", "w", "delta")
)
V = X2 - VP
BASE = A * sp.sin(W * TIME)
POSITION = SurfaceCoordinate(Z, X1)
"""Sec. 2: the place on the surface is x1 itself."""
STRETCH = SurfaceCoordinate(Z, X1 - BASE)
"""Sec. 4: it is z, the spring's stretch."""

FIG4_VALUES: Mapping[sp.Symbol, sp.Expr] = {
    MU0: 1 / (3 * sp.sqrt(3)),
    VP: sp.Integer(1),
    DELTA: sp.Integer(1),
}
FIG8_VALUES: Mapping[sp.Symbol, sp.Expr] = {
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


def printed_points() -> tuple[sp.Expr, ...]:
    """Eqs. (16) and (24), highest first."""
    c = sp.pi / 9
    upper = [2 / sp.sqrt(3) * v for v in (sp.cos(c), sp.cos(2 * c), sp.sin(c / 2))]
    return (*upper, *(-v for v in reversed(upper)))


def stribeck(v: sp.Expr) -> sp.Expr:
    """T of Eq. (2), with the sign symbol for sgn(v)."""
    return S * MU0 / (1 + DELTA * S * v)


def belt_oscillator(
    force: Callable[[sp.Expr], sp.Expr],
    *,
    stretch: sp.Expr = X1,
    mass: sp.Expr = M,
    friction: Callable[[sp.Expr], sp.Expr] = stribeck,
    values: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> FilippovSystem:
    """``x1' = x2, m x2' = force(stretch) - T(x2 - vp)`` with any force and friction law.

    Parameters
    ----------
    force : callable
        Force on the mass as a function of the spring's stretch.
    stretch : Expr
        The stretch, in time and states.
    mass : Expr
    friction : callable
        T as a function of v = x2 - vp, with the symbol ``s`` for sgn(v).
    values : mapping, optional
        Numbers of the parameters.
    """
    field = (X2, (force(stretch) - friction(V)) / mass)
    return FilippovSystem((X1, X2), (S,), (V,), field, values or {})


def section_2(values: Mapping[sp.Symbol, sp.Expr] | None = None) -> FilippovSystem:
    """Eqs. (4) and (5): m = k1 = k2 = 1, the spring's force as Eq. (1) has it."""
    return belt_oscillator(lambda x: x - x**3, mass=sp.Integer(1), values=values)


def section_4(values: Mapping[sp.Symbol, sp.Expr] | None = None) -> FilippovSystem:
    """Eq. (18), and Eq. (17) with friction opposing the sliding velocity."""
    return belt_oscillator(lambda z: -K1 * z + K2 * z**3, stretch=X1 - BASE, values=values)


def fig8_equations() -> Problem:
    """Reading ``equations``: Eq. (18) with Filippov's sliding, from the start of the listing."""
    start = (-INNER, FIG8_VALUES[VP])
    return Problem(section_4(FIG8_VALUES), sp.Integer(0), start, sp.Integer(70))


def one_sided(factor: int) -> Problem:
    """Fig. 8 with slip ``factor`` f and a stick that ends at the upper tangent point only.

    With factor 3 it is the reading ``listing_limit``, what the appendix is a step method for.
    """
    equations = fig8_equations()
    override = SlidingOverride((VP, sp.Integer(0)), (Release(X1 - BASE - INNER, "rising", -1),))
    field = tuple(factor * f for f in equations.system.field)
    system = replace(equations.system, field=field, overrides={0: override})
    return replace(equations, system=system, initial_mode={0: 0})


def fig8_listing_limit() -> Problem:
    """Reading ``listing_limit``."""
    return one_sided(3)
