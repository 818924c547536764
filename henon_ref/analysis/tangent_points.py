"""Tangent points of a Filippov system's fields on a surface, their birth and their disappearance.

Section 2 and Sec. 4.1 of Olejnik and Awrejcewicz (2013), for any system: the transition function on the surface (Eqs.
8, 9, 19), its critical points (Eqs. 10-12, 20-22), the boundary values of a friction parameter (Eqs. 13, 23), the
tangent points (Eqs. 16, 24), and their visibility. A tangent point is visible if the tangent orbit stays on the side of
its own field (Kuznetsov, Rinaldi and Gragnani, *Int. J. Bifurcation Chaos* 13 (2003) 2157-2188): the second derivative
of h along this field has the sign of the side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import sympy as sp

from henon_ref.errors import ArgumentError, ModelError
from henon_ref.expressions.traversal import is_longer
from henon_ref.modes.equations import along as rate_along
from henon_ref.modes.system import FilippovSystem
from henon_ref.simulation.arguments import check_system
from henon_ref.simulation.system import System
from henon_ref.system.python_arguments import explained
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed, shortened

_Z = sp.Symbol("z", real=True)
Visibility = Literal["visible", "invisible", "degenerate", "depends on time"]


@dataclass(frozen=True)
class TangentPoint:
    """Point of the surface at which one of the two fields is tangent to it."""

    position: sp.Expr
    """Value of the surface coordinate."""
    side: int
    """Sign -1 or +1 of the tangent field."""
    curvature: sp.Expr
    """Second derivative of h along that field; it may depend on time."""
    visibility: Visibility


@dataclass(frozen=True)
class StickZone:
    """Interval of the surface on which the transition function is negative."""

    low: sp.Expr
    high: sp.Expr
    attracting: bool
    """Whether both fields point at the surface; if not, both point away, and the future is not unique."""


class TangentAnalysis:
    """Tangent points of one surface of a system.

    The parameters of ``system`` may be free symbols, and the field may contain undefined functions of one variable.
    ``along`` is the coordinate z along the surface in time and states, such as ``x1 - A*sin(w*t)``: the state on the
    surface is a function of z (and of time). ``surface`` is the index of the surface, ``z`` the symbol of the
    coordinate.

    ModelError if the surface and the coordinate do not determine the states on which the transition function depends.
    """

    def __init__(self, system: FilippovSystem, along: sp.Expr, surface: int = 0, z: sp.Symbol = _Z) -> None:
        self.system, self.surface, self.z = system, surface, z
        found = sp.solve([system.surfaces[surface], along - z], system.states, dict=True)
        if len(found) != 1:
            raise ModelError(f"{system.surfaces[surface]} = 0 and {z} = {along} do not determine one state")
        self._place = found[0]
        below, above = (self._normal(s) for s in (-1, 1))
        self.normals: dict[int, sp.Expr] = {-1: below, 1: above}
        """dh/dt of both fields on the surface, as functions of z."""
        left = (below.free_symbols | above.free_symbols) & {TIME, *system.states}
        if left:
            others = ", ".join(sorted(map(str, left)))
            raise ModelError(f"dh/dt on the surface depends on {others} besides the coordinate {along}")

    def on_surface(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression in terms of z and time."""
        return expression.subs(self._place, simultaneous=True)

    def _normal(self, side: int) -> sp.Expr:
        normal = self.system.normal_velocity(self.surface).xreplace({self.system.signs[self.surface]: sp.Integer(side)})
        found = self.on_surface(normal)
        return sp.simplify(found) if _is_short(found) else found

    @property
    def transition_function(self) -> sp.Expr:
        """sigma(z): product of dh/dt on both sides, Eqs. (8), (9), (19)."""
        return sp.factor(self.normals[-1] * self.normals[1])

    @property
    def derivative(self) -> sp.Expr:
        """d sigma / dz, Eqs. (11) and (21)."""
        return sp.factor(sp.diff(self.transition_function, self.z))

    def critical_points(self) -> list[sp.Expr]:
        """Real roots z of d sigma / dz, Eqs. (12) and (22)."""
        return _real_roots(self.derivative, self.z)

    def boundary_values(self, parameter: sp.Symbol) -> list[sp.Expr]:
        """Return the values of a parameter at which a critical point is also a zero of sigma, Eqs. (13) and (23).

        Tangent points meet there: stick zones merge, split, appear or disappear.
        """
        z, sigma = self.z, self.transition_function
        values = {
            sp.radsimp(sp.simplify(value))
            for point in self.critical_points()
            for value in sp.solve(sp.numer(sp.together(sigma.subs(z, point))), parameter)
        }
        return sorted(values, key=sp.default_sort_key)

    def tangent_points(self) -> list[TangentPoint]:
        """Return the tangent points, Eqs. (16) and (24), highest first; the parameters must be numbers.

        If the fields are periodic in z, each returned point represents those that differ from it by whole periods.
        """
        z = self.z
        points = []
        for side, normal in self.normals.items():
            touching, rate = self.system.numeric(normal), self.system.numeric(self._curvature(side))
            if touching.is_polynomial(z) and rate.is_polynomial(z):
                # The remainder drops terms that are zero at the tangent point (friction's slope times dh/dt), exactly.
                rate = sp.rem(rate, touching, z)
            for root in _real_roots(touching, z):
                curvature = sp.factor_terms(rate.subs(z, root))
                points.append(TangentPoint(root, side, curvature, _visibility(curvature, side)))
        return sorted(points, key=lambda p: -float(p.position))

    def _curvature(self, side: int) -> sp.Expr:
        """Second derivative of h along one field, on the surface."""
        system = self.system
        sign = {system.signs[self.surface]: sp.Integer(side)}
        field = tuple(f.xreplace(sign) for f in system.field)
        return self.on_surface(rate_along(system.normal_velocity(self.surface).xreplace(sign), system.states, field))

    def stick_zones(self) -> list[StickZone]:
        """Return the intervals between tangent points with sigma < 0, highest first; the parameters must be numbers."""
        z, system = self.z, self.system
        edges = [p.position for p in reversed(self.tangent_points())]
        zones = []
        for low, high in pairwise(edges):
            middle = {z: (sp.N(low, 30) + sp.N(high, 30)) / 2}
            below, above = (sp.N(system.numeric(self.normals[s]).subs(middle)) for s in (-1, 1))
            if below * above < 0:
                zones.append(StickZone(low, high, bool(below > 0)))
        return zones[::-1]


@explained
def tangent_points(
    system: System,
    *,
    surface: str | None = None,
    along: str | sp.Expr | None = None,
    parameters: Mapping[Any, Any] | None = None,
) -> list[TangentPoint]:
    """Return the points at which one of the two fields at a surface is tangent to it (ends of sliding), in closed form.

    A point is visible if the tangent orbit stays on the side of its own field (Kuznetsov, Rinaldi and Gragnani, *Int.
    J. Bifurcation Chaos* 13 (2003) 2157-2188). Closed forms as in Eqs. (16) and (24) of Olejnik and Awrejcewicz (2013).
    If the fields are periodic in the coordinate (a force sin(x)), each returned point represents those that differ from
    it by whole periods.

    Parameters
    ----------
    system : System
    surface : str, optional
        Name of its sign; optional if there is only one surface.
    along : str or Expr, optional
        Coordinate along the surface, in states and time; by default the one state that the surface leaves free.
    parameters : mapping, optional
        Values that replace the system's.

    Returns
    -------
    list of TangentPoint
        Highest position first; ``position`` and ``curvature`` are exact SymPy numbers.

    Raises
    ------
    HenonRefError
        For an unknown name, if surface and coordinate do not determine the states, or if no closed form is found.

    Examples
    --------
    On a belt the block sticks between the two points at which the spring force equals the friction:

    >>> import henon_ref as hr
    >>> belt = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
    >>> [(point.position, point.side, point.visibility) for point in hr.tangent_points(belt)]
    [(1, -1, 'visible'), (-1, 1, 'invisible')]
    """
    check_system(system)
    if parameters is not None:
        system = system.with_parameters(parameters)
    model, names = system.model, system.model.sign_names
    if surface is None:
        if len(names) != 1:
            many = f"has several surfaces: name one, as in surface={names[0]!r}" if names else "has no surface"
            raise ArgumentError(f"the system {many}")
        surface = names[0]
    if surface not in names:
        raise ArgumentError(f"{str(surface)[:60]!r} is no surface; surfaces: {listed(names)}")
    index = names.index(surface)
    free = [x for x in model.states if not model.surfaces[index].has(x)]
    if along is None and len(free) != 1:
        left = f"leaves {len(free)} states free" if free else "leaves no state free"
        raise ArgumentError(f"the surface '{surface}' {left}: give the coordinate along it, as in along='x'")
    coordinate = free[0] if along is None else system.expression(along, "along")
    try:
        return TangentAnalysis(model, coordinate, index, sp.Dummy("z", real=True)).tangent_points()
    except NotImplementedError as error:
        raise ModelError(f"no closed form of the tangent points is found: {shortened(str(error))}") from None


def _visibility(curvature: sp.Expr, side: int) -> Visibility:
    if curvature.has(TIME):
        return "depends on time"
    value = sp.N(curvature, 30)
    if abs(value) < sp.Float("1e-25"):
        return "degenerate"
    return "visible" if side * value > 0 else "invisible"


def _real_roots(expression: sp.Expr, z: sp.Symbol) -> list[sp.Expr]:
    """Return the real roots, without multiplicity; cubics in trigonometric form, without complex numbers.

    ModelError if the expression is too long for a closed form.
    """
    roots: list[sp.Expr] = []
    for factor, _ in sp.factor_list(_numerator(expression, z))[1]:
        if not factor.has(z):
            continue
        poly = sp.Poly(factor, z) if factor.is_polynomial(z) else None
        if poly is not None and poly.degree() == 3:
            found: Iterable[sp.Expr] = _cubic_roots(poly)
        elif poly is not None and poly.degree() > 4 and poly.domain in (sp.ZZ, sp.QQ):  # no radicals
            found = [root for root, _ in poly.real_roots(multiple=False)]
        elif poly is not None or _is_short(factor):
            found = sp.solve(factor, z)
        else:
            raise _too_long(factor)
        roots += [r for r in found if r.is_real is not False and r not in roots]
    return roots


def _numerator(expression: sp.Expr, z: sp.Symbol) -> sp.Expr:
    if _is_short(expression) or expression.is_polynomial(z):
        return sp.numer(sp.together(expression))
    rational = expression.free_symbols == {z} and expression.is_rational_function(z)
    if rational and _degrees(expression, z) <= 400:  # else a common denominator takes too long
        with suppress(sp.CoercionFailed, ValueError):  # raised if its numbers are not rational
            return sp.QQ.frac_field(z).from_sympy(expression).numer.as_expr()
    raise _too_long(expression)


def _degrees(expression: sp.Expr, z: sp.Symbol) -> int:
    """Return an upper bound of the numerator's degree: the sum of the degrees of all terms and factors."""
    if not expression.has(z):
        return 0
    if expression.is_Pow:
        return abs(int(expression.exp)) * _degrees(expression.base, z)
    return sum(_degrees(a, z) for a in expression.args) if expression.args else 1


def _is_short(expression: sp.Expr) -> bool:
    """Check whether SymPy's heuristics end soon: few operations, no nested functions, small numbers in exponents.

    (To SymPy ``exp(100*z/37)`` is the power 100 of ``exp(z/37)``; its roots of such expressions are not all right.)
    """
    functions = expression.atoms(sp.Function)
    powers = [f.args[0] for f in functions if f.func == sp.exp]
    return (
        not is_longer(expression, 100)
        and len(functions) <= 4
        and not any(a.has(sp.Function) for f in functions for a in f.args)
        and all(max(abs(number.p), 10 * number.q) <= 100 for power in powers for number in power.atoms(sp.Rational))
    )


def _too_long(expression: sp.Expr) -> ModelError:
    reason = "it is too long, or has large numbers in exponents"
    return ModelError(f"no closed form of the tangent points of {shortened(str(expression))}: {reason}")


def _cubic_roots(poly: sp.Poly) -> list[sp.Expr]:
    """Return the real roots of a cubic: Viète's cosines if there are three, Cardano's real radicals if there is one."""
    a, b, c, d = poly.all_coeffs()
    p = sp.simplify((3 * a * c - b**2) / (3 * a**2))
    q = sp.simplify((2 * b**3 - 9 * a * b * c + 27 * a**2 * d) / (27 * a**3))
    centre = -b / (3 * a)
    inside = sp.simplify(q**2 / 4 + p**3 / 27)
    if p == 0 and q == 0:
        return [centre]
    if inside == 0:
        return [3 * q / p + centre, -3 * q / (2 * p) + centre]
    if inside.is_positive:
        halves = (sp.real_root(-q / 2 + sign * sp.sqrt(inside), 3) for sign in (1, -1))
        return [sp.Add(*halves) + centre]
    angle = sp.acos(sp.simplify(3 * q / (2 * p) * sp.sqrt(-3 / p))) / 3
    return [2 * sp.sqrt(-p / 3) * sp.cos(angle - 2 * sp.pi * k / 3) + centre for k in range(3)]
