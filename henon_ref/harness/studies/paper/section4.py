"""Section 4.1: the forced oscillator, its oscillating stick zone and the bifurcations of its tangent points."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from henon_ref.analysis.tangent import TangentAnalysis
from henon_ref.figures import style
from henon_ref.harness.report.svg import svg
from henon_ref.harness.studies.paper.claims import Claim, Section, checked, picture
from henon_ref.harness.studies.paper.exact import same, same_set
from henon_ref.harness.studies.paper.systems import (
    BASE,
    DELTA,
    FIG8_VALUES,
    K1,
    K2,
    MU0,
    PERIOD,
    STRETCH,
    VP,
    X1,
    X2,
    A,
    M,
    S,
    W,
    Z,
    belt_oscillator,
    printed_points,
    section_4,
    stribeck,
)
from henon_ref.taylor.tape import TIME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EDGE = float(2 / (3 * sp.sqrt(3)))
"""Upper boundary value of mu0 for k1 = k2 = 1."""


def section(folder: Path) -> Section:
    """Equations (17)-(24), Figs. 5-7; draws Figs. 6 and 7."""
    (folder / "fig6.svg").write_bytes(svg(draw_fig6()))
    (folder / "fig7.svg").write_bytes(svg(draw_fig7()))
    text = _TEXT.format(share=100 * moving_backward())
    text += picture(folder, "fig6.svg", "Fig. 6 again: the friction law of Eq. (2) for mu0 = sqrt 3/9 and delta = 1.")
    text += "\n" + picture(
        folder,
        "fig7.svg",
        "Fig. 7 again. a: the transition function for both boundary values of mu0. b: the stick zones of Fig. 8 move "
        "with the base. c: tangent points over mu0; m = k1 = k2 = 1 in a and c.",
    )
    analysis = TangentAnalysis(section_4(), STRETCH)
    claims = (*_equations(analysis), *_tangent_points(analysis), *_figures(analysis))
    return Section("Section 4.1: the oscillating stick zone", text, claims)


def moving_backward() -> float:
    """Share of the forcing period in which the base moves faster than the belt, so that a stick's z falls."""
    speed = float((BASE.diff(TIME)).subs(FIG8_VALUES).subs(TIME, 0))
    return float(np.arccos(float(FIG8_VALUES[VP]) / speed) / np.pi)


def _equations(analysis: TangentAnalysis) -> list[Claim]:
    printed = belt_oscillator(
        lambda z: -K1 * z + K2 * z**3, stretch=X1 - BASE, friction=lambda v: -stribeck(v), values=FIG8_VALUES
    )
    repelling = [zone.attracting for zone in TangentAnalysis(printed, STRETCH).stick_zones()] == [False] * 3
    z = X1 - BASE
    below, above = (section_4().field[1].subs({S: s, DELTA: 1}) for s in (-1, 1))
    fits = all(same(field, (K2 * z**3 - K1 * z + MU0 / (VP - X2 - s)) / M) for field, s in ((below, -1), (above, 1)))
    outer, inner = sp.sqrt(K1 / K2), sp.sqrt(K1 / (3 * K2))
    edge = 2 * K1 / 3 * inner
    return [
        Claim("Fig. 5", "drawing of the oscillator", "not reproducible", "A drawing, lost; Eq. (17) describes it."),
        checked(
            "Eq. (17)",
            "m x2' = -k1 z + k2 z^3 + T(v), T of Eq. (2)",
            repelling and fits,
            "It has to be -T(v), as Eq. (18), Secs. 2 and 3 and the listing have it. With +T friction drives "
            "the motion: both fields point away from Sigma in all three zones, and nothing could stick.",
            corrected=True,
        ),
        Claim(
            "Fig. 6", "the friction law T(v), two falling branches", "reproduced",
            "Eq. (2) drawn for the parameters of Fig. 8 (its own are not given).",
        ),
        checked("Eq. (18)", "both fields of the forced oscillator", fits, "Is Eq. (17) with -T and delta = 1."),
        checked(
            "Eq. (19)", "sigma = ((k2 z^3 - k1 z)^2 - mu0^2)/m^2",
            same(analysis.transition_function, ((K2 * Z**3 - K1 * Z) ** 2 - MU0**2) / M**2),
            "Equal. It holds for any friction law with T(0+) = mu0, and with any force K(z) in place of the cubic.",
        ),
        checked(
            "Eqs. (20), (21)", "d sigma/dz = 2 z (3 k2 z^2 - k1)(k2 z^2 - k1)/m^2",
            same(analysis.derivative, 2 * Z / M**2 * (3 * K2 * Z**2 - K1) * (K2 * Z**2 - K1)), "Equal.",
        ),
        checked(
            "Eq. (22)", "z = 0, +-sqrt(k1/k2), +-sqrt(k1/(3 k2))",
            same_set(analysis.critical_points(), [sp.Integer(0), outer, -outer, inner, -inner]), "The same five roots.",
        ),
        checked(
            "Eq. (23)", "mu0 = 0, +-(2 k1/3) sqrt(k1/(3 k2))",
            same_set(analysis.boundary_values(MU0), [sp.Integer(0), edge, -edge]), "The same three values.",
        ),
    ]  # fmt: skip


def _tangent_points(analysis: TangentAnalysis) -> list[Claim]:
    fig8 = TangentAnalysis(section_4(FIG8_VALUES), STRETCH)
    points = fig8.tangent_points()
    share = moving_backward()
    return [
        Claim(
            "Sec. 4.1",
            "m = 0.1, vp = 0.4, mu0 = sqrt 3/9, k1 = k2 = 1, A = (4 sqrt 3/3) sin pi/18",
            "reproduced",
            "Used as they stand, in exact numbers; the listing has the same.",
        ),
        checked(
            "Sec. 4.1",
            "omega = 3 pi/2.4728; the listing has 3 pi/2/1.2364",
            same(FIG8_VALUES[W], 3 * sp.pi / 2 / sp.Rational("1.2364")),
            f"The same number; the forcing's period is T = {float(PERIOD):.10f} s.",
        ),
        checked(
            "Eq. (24)",
            "tangent points (2 sqrt 3/3) times +-cos pi/9, +-cos 2 pi/9, +-sin pi/18",
            all(same(p.position, q) for p, q in zip(points, printed_points(), strict=True)),
            "Equal, all six. They are values of z; in x1 they are these plus A sin(w t).",
        ),
        checked(
            "Sec. 4.1 and 4.2",
            "loss of stick occurs at visible tangent points",
            {p.visibility for p in points} == {"depends on time"},
            "Which points are visible changes twice a period: the second derivative of h is K'(z)(vp - y')/m, and "
            f"y' > vp for {100 * share:.1f} % of the time. Then z falls in a stick, and it is the lower ends of the "
            "zones that are visible.",
            corrected=True,
        ),
        Claim(
            "Sec. 4.1",
            "the set (24) allows us to compute exactly the length and duration of the stick modes",
            "corrected",
            "Not by itself: it gives where a stick can end. Where and when it begins comes from the slip before, which "
            "has no closed form.",
        ),
        checked(
            "Sec. 4.2",
            "the stick zone oscillates along +-x2",
            same(sp.diff(BASE, X2), 0) and same(analysis.on_surface(X1), Z + BASE),
            "Along x1: its ends are x(k) + A sin(w t), as the paper's own formula for them says; x2 = vp stays.",
            corrected=True,
        ),
    ]


def _figures(analysis: TangentAnalysis) -> list[Claim]:
    unit = {M: sp.Integer(1), K1: sp.Integer(1), K2: sp.Integer(1), DELTA: sp.Integer(1)}
    edge, root = 2 / (3 * sp.sqrt(3)), 1 / sp.sqrt(3)
    sigma = analysis.transition_function.subs(unit)
    flat = same(sigma.subs(MU0, 0), (Z**3 - Z) ** 2)
    touches = same(sigma.subs({MU0: edge, Z: root}), 0) and sp.diff(sigma, Z, 2).subs({MU0: edge, Z: root}) < 0
    counts = [
        len(TangentAnalysis(section_4({**unit, MU0: mu0}), STRETCH).tangent_points())
        for mu0 in (edge / 2, edge, edge * sp.Rational(3, 2), 4 * sp.sqrt(3) / 9)
    ]
    end = TangentAnalysis(section_4({**unit, MU0: 4 * sp.sqrt(3) / 9}), STRETCH).tangent_points()[0].position
    return [
        checked(
            "Fig. 7a",
            "sigma over z: no stick at the lower boundary value (dashed), tangent from below at the upper one (solid)",
            flat and touches,
            "At mu0 = 0 sigma is a square; at 2 sqrt 3/9 it has maxima of height 0 at z = +-1/sqrt 3.",
        ),
        checked(
            "Fig. 7b",
            "the stick zone oscillates with y(t)",
            same(FIG8_VALUES[A], 2 * 2 / sp.sqrt(3) * sp.sin(sp.pi / 18)),
            f"Drawn for Fig. 8. The amplitude A = {float(FIG8_VALUES[A]):.6f} m is the width of the middle zone.",
        ),
        checked(
            "Fig. 7c",
            "tangent points over mu0 in [0, 4 sqrt 3/9], m = k1 = k2 = v = 1",
            counts == [6, 4, 2, 2],
            f"Six below mu0 = 2 sqrt 3/9 = {EDGE:.6f}, four at it, two beyond, at +-{float(end):.6f} at the right "
            "edge.",
        ),
    ]


def draw_fig6() -> Figure:
    """The friction law."""
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
    """Transition function, oscillating stick zones, tangent points over mu0."""
    with style.figure(6.6) as figure:
        grid = figure.add_gridspec(2, 2)
        _draw_sigma(figure.add_subplot(grid[0, 0]))
        _draw_bifurcation(figure.add_subplot(grid[0, 1]))
        _draw_zones(figure.add_subplot(grid[1, :]))
        figure.set_layout_engine("constrained")
    return figure


def _draw_sigma(ax: Axes) -> None:
    z = np.linspace(-1.3, 1.3, 521)
    root, outer = 1 / np.sqrt(3), 2 / np.sqrt(3)
    for mu0, dashes, label in ((0.0, "--", r"$\mu_0 = 0$"), (EDGE, "-", r"$\mu_0 = 2\sqrt{3}/9$")):
        ax.plot(z, (z**3 - z) ** 2 - mu0**2, dashes, color=style.BLUE, label=label)
    ax.plot([-1, 0, 1], [0, 0, 0], "o", mfc="white", mec=style.BLACK, zorder=4)
    ax.plot([-outer, -root, root, outer], [0] * 4, "o", color=style.BLACK, zorder=4, label="tangent points")
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
    for place in points:
        ax.plot(t, place + base, color=style.BLACK, lw=0.8, label="tangent point" if place == points[0] else None)
    ax.plot(t, base, "--", color=style.BLUE, label=r"base $y = A\,\sin\,\omega t$")
    for k, place in enumerate(points, 1):
        ax.annotate(
            f"$x^{{({k})}}$", (t[-1], place), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8
        )
    ax.set(xlabel="$t$ [s]", ylabel="$x_1$ [m]", xlim=(0, t[-1]))
    ax.set_title("b   the stick zones of Fig. 8 over two periods of the forcing", pad=16)
    ax.legend(loc="lower center", bbox_to_anchor=(0.62, 0.985), ncols=3)


def _draw_bifurcation(ax: Axes) -> None:
    # On a tangent point mu0 = abs(K(z)): the curve needs no root finding.
    z = np.linspace(-1.35, 1.35, 2001)
    mu0 = np.abs(z**3 - z)
    shown = mu0 <= 2 * EDGE
    for sign, label in ((1, "of the field above"), (-1, "of the field below")):
        own = shown & (np.sign(z**3 - z) == sign)
        ax.plot(np.where(own, mu0, np.nan), z, color=style.VERMILLION if sign > 0 else style.BLUE, label=label)
    ax.axvline(EDGE, color=style.GREY, lw=0.8, ls=":")
    root, outer = 1 / np.sqrt(3), 2 / np.sqrt(3)
    ax.plot([0] * 3 + [EDGE] * 4, [-1, 0, 1, -outer, -root, root, outer], "o", color=style.BLACK, zorder=4)
    ax.set(xlabel=r"$\mu_0$ [N]", ylabel=r"$z_v$ [m]", xlim=(-0.02, 2 * EDGE))
    ax.set_title(r"c   tangent points over $\mu_0$")
    ax.legend(loc="center right", bbox_to_anchor=(1.04, 0.5), handlelength=1.4)


_TEXT = """\
The same derivation with the spring's stretch z = x1 - A sin(w t) as the coordinate along the surface. New against
Sec. 2 is that the zones move: y' exceeds the belt's speed during {share:.1f} % of a period, z then falls in a stick,
and the stick can end at the *lower* end of its zone. The paper's text and listing know the upper ends only.

"""
