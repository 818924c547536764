"""Equations of the paper by SymPy: Sections 2 and 4.1 with Figs. 6 and 7 (transition function and tangent points), and
Eqs. (27) and (28) of Section 5."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.analysis.tangent_points import TangentAnalysis
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.figures import style
from henon_ref.harness.studies.page import shipped_problem
from henon_ref.harness.studies.paper import systems
from henon_ref.harness.studies.paper.systems import (
    BASE,
    DELTA,
    FIG8_VALUES,
    K1,
    K2,
    MU0,
    PERIOD,
    POSITION,
    STRETCH,
    STRIBECK,
    VP,
    X1,
    X2,
    A,
    Findings,
    M,
    S,
    W,
    Z,
    belt_oscillator,
    printed_points,
    same,
    same_all,
    same_set,
)
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ONE = sp.Integer(1)
EDGE = 2 / (3 * sp.sqrt(3))
"""Upper boundary value of mu0 for k1 = k2 = 1."""
INNER, OUTER = 1 / sp.sqrt(3), 2 / sp.sqrt(3)
"""Positions at which the stick zones meet and end if mu0 is the boundary value."""
RIGHT_EDGE = 4 * sp.sqrt(3) / 9
"""Right edge of Fig. 7c."""


def section_2() -> Findings:
    """Compare every equation of Sec. 2 with the normal velocities of the system."""
    analysis = TangentAnalysis(systems.section_2({}), POSITION)
    normals, boundary = analysis.normals, analysis.boundary_values(MU0)
    acceleration = analysis.system.field[1]
    from_eq_1 = ((K1 * X1 - K2 * X1**3 - STRIBECK) / M).subs({M: 1, K1: 1, K2: 1})
    double = sp.solve(sp.discriminant(normals[1], Z), MU0)
    shared = sp.solve(sp.resultant(normals[1], normals[-1], Z), MU0)
    none, edge = (
        TangentAnalysis(systems.section_2({MU0: mu0, VP: ONE, DELTA: ONE}), POSITION) for mu0 in (sp.Integer(0), EDGE)
    )
    return Findings(
        {
            "spring_sign": sp.simplify(sp.diff(from_eq_1, X1).subs(X1, 0)) == 1,
            "eq_3": same(acceleration, from_eq_1),
            "eq_5": all(same(acceleration.subs({S: s, DELTA: 1}), X1 - X1**3 + MU0 / (VP - X2 - s)) for s in (-1, 1)),
            "eq_8": same(analysis.transition_function, normals[-1] * normals[1]),
            "eq_9": same(analysis.transition_function, Z**2 * (Z**2 - 1) ** 2 - MU0**2),
            "eq_11": same(analysis.derivative, 2 * Z * (Z**2 - 1) * (3 * Z**2 - 1)),
            "eq_12": same_set(analysis.critical_points(), [sp.Integer(0), ONE, -ONE, INNER, -INNER]),
            "eq_13": same_set(boundary, [sp.Integer(0), EDGE, -EDGE]) and same_set([*double, *set(shared)], boundary),
            "without_friction": not none.stick_zones() and {p.position for p in none.tangent_points()} == {0, 1, -1},
            "zones_meet": all(same(a.low, b.high) for a, b in pairwise(edge.stick_zones()))
            and same_all([p.position for p in edge.tangent_points()], [OUTER, INNER, -INNER, -OUTER]),
        }
    )


def section_4() -> Findings:
    """Check Eqs. (17)-(24), Figs. 6 and 7."""
    analysis = TangentAnalysis(systems.section_4({}), STRETCH)
    z = X1 - BASE
    fields = (analysis.system.field[1].subs({S: s, DELTA: 1}) - MU0 / (VP - X2 - s) / M for s in (-1, 1))
    fits = all(same(field, (K2 * z**3 - K1 * z) / M) for field in fields)
    printed = TangentAnalysis(belt_oscillator(-K1 * z + K2 * z**3 + STRIBECK, M, FIG8_VALUES), STRETCH)
    outer, inner = sp.sqrt(K1 / K2), sp.sqrt(K1 / (3 * K2))
    edge = 2 * K1 / 3 * inner
    points = TangentAnalysis(systems.section_4(FIG8_VALUES), STRETCH).tangent_points()
    unit = {M: ONE, K1: ONE, K2: ONE, DELTA: ONE}
    sigma = analysis.transition_function.subs(unit)
    at_edge = {MU0: EDGE, Z: INNER}
    beyond = [
        TangentAnalysis(systems.section_4({**unit, MU0: mu0}), STRETCH).tangent_points()
        for mu0 in (EDGE / 2, EDGE, EDGE * sp.Rational(3, 2), RIGHT_EDGE)
    ]
    return Findings(
        {
            "eq_17": fits and [zone.attracting for zone in printed.stick_zones()] == [False] * 3,
            "eq_18": fits,
            "eq_19": same(analysis.transition_function, ((K2 * Z**3 - K1 * Z) ** 2 - MU0**2) / M**2),
            "eq_21": same(analysis.derivative, 2 * Z / M**2 * (3 * K2 * Z**2 - K1) * (K2 * Z**2 - K1)),
            "eq_22": same_set(analysis.critical_points(), [sp.Integer(0), outer, -outer, inner, -inner]),
            "eq_23": same_set(analysis.boundary_values(MU0), [sp.Integer(0), edge, -edge]),
            "omega": same(FIG8_VALUES[W], 3 * sp.pi / 2 / sp.Rational("1.2364")),
            "eq_24": same_all([p.position for p in points], printed_points()),
            "visibility": {p.visibility for p in points} == {"depends on time"},
            "zones_move": same(sp.diff(BASE, X2), 0) and same(analysis.on_surface(X1), Z + BASE),
            "fig_7a": same(sigma.subs(MU0, 0), (Z**3 - Z) ** 2)
            and same(sigma.subs(at_edge), 0)
            and sp.diff(sigma, Z, 2).subs(at_edge) < 0,
            "fig_7b": same(FIG8_VALUES[A], 2 * OUTER * sp.sin(sp.pi / 18)),
            "fig_7c": list(map(len, beyond)) == [6, 4, 2, 2],
        },
        {
            "share": 100 * moving_backward(),
            "period": float(PERIOD),
            "amplitude": float(FIG8_VALUES[A]),
            "edge": float(EDGE),
            "end": float(beyond[-1][0].position),
        },
        {"fig6": draw_fig6(), "fig7": draw_fig7()},
    )


def moving_backward() -> float:
    """Part of the forcing period in which the base moves faster than the belt, so that z falls in a stick."""
    speed = float((BASE.diff(TIME)).subs(FIG8_VALUES).subs(TIME, 0))
    return float(np.arccos(float(FIG8_VALUES[VP]) / speed) / np.pi)


def rig_equations() -> Findings:
    """Check Eqs. (27) and (28), and the motion of the rig with the signs as printed from a block at rest."""
    at_rest = shipped_problem("rig_printed", "at_rest")
    printed, corrected = at_rest.system, shipped_problem("rig_periodic").system
    both = all(
        same_all([*map(system.numeric, system.field)], eq27(system, printed=flag))
        for system, flag in ((printed, True), (corrected, False))
    )
    flutter, damped = (float(frictionless_eigenvalues(system)[0].real) for system in (printed, corrected))
    run = HENON_SOLVER.prepare(at_rest, rtol=1e-13)()
    return Findings(
        {"eq_27": both and flutter > 0 > damped and run.status == "invalid", "terms": both},
        {"flutter": flutter, "damped": damped, "lost": run.end_time},
    )


def eq27(system: FilippovSystem, *, printed: bool) -> tuple[sp.Expr, ...]:
    """Eq. (27) with the friction of Eq. (28) in slip, written explicitly in the states and the sign of a rig.

    xi1 ... xi7 are those of the paper, in the rig's parameters. ``printed``: whether to use the signs as printed, or
    ``x2' = -x1 - xi1 (xi2 (x2 + x4) + x3 + T)``.
    """
    m, k1, k2, k3, c1, c2, mu0, delta, a, b, r, vp = sp.symbols("m k1 k2 k3 c1 c2 mu0 delta a b r vp", real=True)
    (x1, x2, x3, x4), (s,) = system.states, system.signs
    omega = sp.sqrt((k1 + k2) / m)
    inertia = m * (a**2 + b**2) / 3
    xi1, xi2, xi3 = k2 / (omega**2 * m), c1 * omega / k2, k2 * r**2 / (omega**2 * inertia)
    xi4, xi5, xi6, xi7 = (k2 + k3) / k2, omega * (c1 + c2) / k2, mu0 * k3 / k2, omega * c2 * mu0 / k2
    friction = s * (1 - xi6 * x3 - xi7 * x4) * mu0 / (1 + delta * s * (x2 - vp))
    coupling = -x3 - friction if printed else x3 + friction
    field = (
        x2,
        -x1 - xi1 * (xi2 * (x2 + x4) + coupling),
        x4,
        xi3 * (-x1 - xi2 * x2 - xi4 * x3 - xi5 * x4),
    )
    return tuple(map(system.numeric, field))


def frictionless_eigenvalues(system: FilippovSystem) -> NDArray[np.complex128]:
    """Eigenvalues of the rig without friction, largest growth rate first."""
    quiet = {system.signs[0]: sp.Integer(0)}
    linear = sp.Matrix([system.numeric(f.xreplace(quiet)) for f in system.field]).jacobian(system.states)
    values = np.linalg.eigvals(np.array(linear.evalf(30), dtype=float)).astype(complex)
    return values[np.argsort(-values.real, kind="stable")]


def draw_fig6() -> Figure:
    """Draw the friction law."""
    mu0 = float(FIG8_VALUES[MU0])
    v = np.linspace(0, 2, 200)
    with style.figure(2.2) as figure:
        ax = figure.subplots()
        for side in (-1, 1):
            ax.plot(side * v, side * mu0 / (1 + v), color=style.BLUE)
        ax.plot([0, 0], [-mu0, mu0], color=style.BLUE, lw=2.4, solid_capstyle="butt")
        ax.set(xlabel=r"$v = x_2 - v_p$ [m/s]", ylabel=r"$T$ [N]", xlim=(-2, 2))
        ax.annotate("stick", (0, 0), xytext=(0.12, -0.04), fontsize=8)
        figure.set_layout_engine("constrained")
    return figure


def draw_fig7() -> Figure:
    """Draw the transition function, the oscillating stick zones, and the tangent points over mu0."""
    with style.figure(6.6) as figure:
        grid = figure.add_gridspec(2, 2)
        _draw_sigma(figure.add_subplot(grid[0, 0]))
        _draw_bifurcation(figure.add_subplot(grid[0, 1]))
        _draw_zones(figure.add_subplot(grid[1, :]))
        figure.set_layout_engine("constrained")
    return figure


def _draw_sigma(ax: Axes) -> None:
    z, edge, inner, outer = np.linspace(-1.3, 1.3, 521), float(EDGE), float(INNER), float(OUTER)
    for mu0, dashes, label in ((0.0, "--", r"$\mu_0 = 0$"), (edge, "-", r"$\mu_0 = 2\sqrt{3}/9$")):
        ax.plot(z, (z**3 - z) ** 2 - mu0**2, dashes, color=style.BLUE, label=label)
    ax.plot([-1, 0, 1], [0, 0, 0], "o", mfc="white", mec=style.BLACK, zorder=4)
    ax.plot([-outer, -inner, inner, outer], [0] * 4, "o", color=style.BLACK, zorder=4, label="tangent points")
    ax.axhline(0, color=style.GREY, lw=0.8)
    ax.set(xlabel=r"$z_v$ [m]", ylabel=r"$\sigma$ [m$^2$/s$^4$]", ylim=(-0.2, 0.35))
    ax.set_title("a   transition function")
    ax.legend(loc="upper center")


def _draw_zones(ax: Axes) -> None:
    t = np.linspace(0, 2 * float(PERIOD), 400)
    base = float(FIG8_VALUES[A]) * np.sin(float(FIG8_VALUES[W]) * t)
    points = [float(p) for p in printed_points()]
    for k, (high, low) in enumerate(zip(points[::2], points[1::2], strict=True)):
        ax.fill_between(t, low + base, high + base, color=style.STICK_SHADE, label="stick zone" if k == 0 else None)
    for k, place in enumerate(points, 1):
        ax.plot(t, place + base, color=style.BLACK, lw=0.8, label="tangent point" if k == 1 else None)
        ax.annotate(
            f"$x^{{({k})}}$", (t[-1], place), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8
        )
    ax.plot(t, base, "--", color=style.BLUE, label=r"base $y = A\,\sin\,\omega t$")
    ax.set(xlabel="$t$ [s]", ylabel="$x_1$ [m]", xlim=(0, t[-1]))
    ax.set_title("b   the stick zones of Fig. 8 over two periods of the forcing", pad=16)
    ax.legend(loc="lower center", bbox_to_anchor=(0.62, 0.985), ncols=3)


def _draw_bifurcation(ax: Axes) -> None:
    # At a tangent point mu0 = abs(K(z)), so that the curve requires no root finding.
    z, edge, inner, outer = np.linspace(-1.35, 1.35, 2001), float(EDGE), float(INNER), float(OUTER)
    mu0 = np.abs(z**3 - z)
    for sign, colour, label in (
        (1, style.VERMILLION, "of the field above"),
        (-1, style.BLUE, "of the field below"),
    ):
        own = (mu0 <= 2 * edge) & (np.sign(z**3 - z) == sign)
        ax.plot(np.where(own, mu0, np.nan), z, color=colour, label=label)
    ax.axvline(edge, color=style.GREY, lw=0.8, ls=":")
    ax.plot([0] * 3 + [edge] * 4, [-1, 0, 1, -outer, -inner, inner, outer], "o", color=style.BLACK, zorder=4)
    ax.set(xlabel=r"$\mu_0$ [N]", ylabel=r"$z_v$ [m]", xlim=(-0.02, 2 * edge))
    ax.set_title(r"c   tangent points over $\mu_0$")
    ax.legend(loc="center right", bbox_to_anchor=(1.04, 0.5), handlelength=1.4)
