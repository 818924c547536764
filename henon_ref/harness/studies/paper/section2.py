"""Section 2: the transition function, tangent points and boundary values of mu0, by SymPy."""

from __future__ import annotations

from itertools import pairwise

import sympy as sp

from henon_ref.analysis.tangent import TangentAnalysis
from henon_ref.harness.studies.paper.claims import Claim, Section, checked
from henon_ref.harness.studies.paper.exact import same, same_set
from henon_ref.harness.studies.paper.systems import (
    DELTA,
    K1,
    K2,
    MU0,
    POSITION,
    VP,
    X1,
    X2,
    M,
    S,
    V,
    Z,
    section_2,
    stribeck,
)


def section() -> Section:
    """Every equation of Sec. 2, set against what the system's own normal velocities give."""
    system = section_2()
    analysis = TangentAnalysis(system, POSITION)
    return Section("Section 2: the discontinuity and the transition function", _TEXT, tuple(_claims(analysis)))


def _claims(analysis: TangentAnalysis) -> list[Claim]:
    return [*_equations_of_motion(), *_transition_function(analysis), *_degenerate_values()]


def _equations_of_motion() -> list[Claim]:
    unit = {M: 1, K1: 1, K2: 1}
    acceleration = section_2().field[1]
    from_eq_1 = ((K1 * X1 - K2 * X1**3 - stribeck(V)) / M).subs(unit)
    below, above = (acceleration.subs({S: s, DELTA: 1}) for s in (-1, 1))
    inverted = sp.simplify(sp.diff(from_eq_1, X1).subs(X1, 0)) == 1
    return [
        Claim(
            "Fig. 1",
            "drawing of the oscillator",
            "not reproducible",
            "A drawing, lost; Eq. (1) describes it.",
        ),
        checked(
            "Eq. (1)",
            "m y'' - k1 y + k2 y^3 + T = 0, the spring's response to a displacement y being k1 y - k2 y^3",
            inverted,
            "As printed the spring pushes the mass away from y = 0 (its force there has slope +k1: a double well). "
            "Eq. (17) has the opposite sign for the same words, a softening spring. Secs. 2 and 3 use the sign of "
            "Eq. (1) throughout, and so do we there.",
            corrected=True,
        ),
        Claim(
            "Eq. (2)",
            "T = sgn(v) mu_k, mu_k = mu0/(1 + delta abs(v))",
            "reproduced",
            "Used as it stands, sgn(v) being the sign symbol of the surface. The value of delta is never printed; "
            "Eqs. (5), (18) and the listing have delta = 1.",
        ),
        checked(
            "Eqs. (3), (4)",
            "the same with m = k1 = k2 = 1, and as two equations of first order",
            same(acceleration, from_eq_1),
            "Follows from Eq. (1); SymPy finds no difference.",
        ),
        checked(
            "Eq. (5)",
            "mu0/(vp - x2 + 1) for x2 < vp, mu0/(vp - x2 - 1) for x2 > vp",
            same(below, X1 - X1**3 + MU0 / (VP - X2 + 1)) and same(above, X1 - X1**3 + MU0 / (VP - X2 - 1)),
            "Is Eq. (4) with friction opposing v, delta = 1, for s = -1 and s = +1.",
        ),
        Claim(
            "Eqs. (6), (7)",
            "Sigma: x2 = vp, S1 below it, S2 above",
            "reproduced",
            "The surface h = x2 - vp and the modes s = -1 and s = +1 of this project.",
        ),
    ]


def _transition_function(analysis: TangentAnalysis) -> list[Claim]:
    normals = analysis.normals
    root, edge = 1 / sp.sqrt(3), 2 / (3 * sp.sqrt(3))
    double = sp.solve(sp.discriminant(normals[1], Z), MU0)
    shared = sp.solve(sp.resultant(normals[1], normals[-1], Z), MU0)
    boundary = analysis.boundary_values(MU0)
    return [
        checked(
            "Eq. (8)",
            "sigma = f2(1) f2(2)",
            same(analysis.transition_function, normals[-1] * normals[1]),
            "The product of dh/dt on both sides, for any surface h; here dh/dt = f2.",
        ),
        checked(
            "Eq. (9)",
            "sigma = x1^2 (x1^2 - 1)^2 - mu0^2 on Sigma",
            same(analysis.transition_function, Z**2 * (Z**2 - 1) ** 2 - MU0**2),
            "Equal as polynomials.",
        ),
        checked(
            "Eqs. (10), (11)",
            "d sigma/d x1 = 2 x1 (x1^2 - 1)(3 x1^2 - 1)",
            same(analysis.derivative, 2 * Z * (Z**2 - 1) * (3 * Z**2 - 1)),
            "Equal as polynomials. For a free spring force K it is 2 K K'/m^2, whatever the friction law.",
        ),
        checked(
            "Eq. (12)",
            "x1 = 0, +-1, +-1/sqrt 3",
            same_set(analysis.critical_points(), [sp.Integer(0), sp.Integer(1), sp.Integer(-1), root, -root]),
            "The same five roots. They are critical points of sigma; tangent points (zeros of sigma) only at the "
            "values of mu0 in Eq. (13).",
        ),
        checked(
            "Eq. (13)",
            "mu0 = 0, +-2/(3 sqrt 3)",
            same_set(boundary, [sp.Integer(0), edge, -edge]) and same_set([*double, *set(shared)], boundary),
            "The same three values, found twice: from the critical points, and as the values at which tangent points "
            "of one field coalesce (discriminant) or both fields touch at one point (resultant). A negative mu0 is "
            "friction that drives.",
        ),
    ]


def _degenerate_values() -> list[Claim]:
    none = TangentAnalysis(section_2({MU0: sp.Integer(0), VP: sp.Integer(1), DELTA: sp.Integer(1)}), POSITION)
    edge = TangentAnalysis(section_2({MU0: 2 / (3 * sp.sqrt(3)), VP: sp.Integer(1), DELTA: sp.Integer(1)}), POSITION)
    at_edge = edge.tangent_points()
    outer, inner = 2 / sp.sqrt(3), 1 / sp.sqrt(3)
    zones = edge.stick_zones()
    joined = all(same(a.low, b.high) for a, b in pairwise(zones))
    places = [p.position for p in at_edge]
    return [
        checked(
            "Sec. 2, text",
            "at mu0 = 0 the stick zone vanishes and three tangent points remain",
            not none.stick_zones() and {p.position for p in none.tangent_points()} == {0, 1, -1},
            "No interval with sigma < 0 is left; both fields touch at -1, 0 and 1, once visibly and once invisibly.",
        ),
        checked(
            "Sec. 2, text",
            "at mu0 = 2/(3 sqrt 3) one stick zone between x1 = +-2/sqrt 3, with +-1/sqrt 3 inside",
            joined and all(same(a, b) for a, b in zip(places, [outer, inner, -inner, -outer], strict=True)),
            "The three zones meet at +-1/sqrt 3, which are degenerate there (the second derivative of h is 0).",
        ),
    ]


_TEXT = """\
`henon_ref/analysis/tangent.py` derives all of this from `FilippovSystem.normal_velocity`, for any spring law,
friction law, surface and coordinate along it. The numbers below are SymPy's, not copied.

Whether a tangent point is *visible* is decided by the second derivative of h along the field that touches: on the
field's own side the orbit then stays there and a stick can be left. At both boundary values of mu0 points coalesce;
beyond 2/(3 sqrt 3) one zone with two tangent points is left, whatever mu0.
"""
