"""Section 3: the numerical method, and the phase portrait of Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from henon_ref.analysis.tangent_points import TangentAnalysis
from henon_ref.baselines.paper.rk4 import RK4
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, plane_of
from henon_ref.harness.studies.paper.audit import ORDER_STEPS, ROUNDING, order_of, rms
from henon_ref.harness.studies.paper.systems import (
    FIG4_VALUES,
    POSITION,
    VP,
    Findings,
    Z,
    fig8_equations,
    fig8_listing_limit,
    fitted_order,
    printed_points,
    reference,
    same,
    same_all,
    sampled,
    section_2,
)
from henon_ref.modes.problem import Problem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HORIZON = 60
"""Horizon of the fan's runs [s]."""


def fan_findings() -> Findings:
    """Check Eqs. (15) and (16) at the tangent points of Fig. 4, and the statements on its runs.

    The runs of Eq. (5) start below and above every tangent point and approach one orbit.
    """
    analysis = TangentAnalysis(section_2(FIG4_VALUES), POSITION)
    points = analysis.tangent_points()
    apart = sp.Rational(1, 5)  # the paper does not print its starts
    starts = [(p.position, FIG4_VALUES[VP] + offset) for p in points for offset in (-apart, apart)]
    problems = [Problem(analysis.system, sp.Integer(0), start, sp.Integer(HORIZON)) for start in starts]
    runs, motions = zip(*(sampled(problem, 0, HORIZON) for problem in problems), strict=True)
    last = runs[0].transitions[-3:]
    down, up = (t.state[0] for t in sorted(last[:2], key=lambda t: t.to_mode))
    period = last[2].time - last[0].time
    third = float(printed_points()[2])
    sticking = sum(any(t.kind == "stick" for t in run.transitions) for run in runs)
    ends = [sorted(t.state[0] for t in run.transitions[-2:]) for run in runs]
    return Findings(
        {
            "touching": all(
                same(analysis.system.numeric(analysis.normals[p.side]).subs(Z, p.position), 0) for p in points
            ),
            "eq_16": same_all([p.position for p in points], printed_points()),
            "visibility": [p.visibility for p in points] == ["visible", "invisible"] * 3,
            "sticks": sticking > 0 and np.allclose(ends, ends[0], atol=1e-4),
            "bent": abs(up - third) < 0.1 or abs(down - third) < 0.1,
        },
        {
            "count": len(runs),
            "sticking": sticking,
            "last": max(t.time for run in runs for t in run.transitions if t.kind == "release"),
            "period": period,
            "up": up,
            "down": down,
            "third": third,
            "curvatures": ", ".join(f"{float(p.curvature):+.3f} (s = {p.side:+d})" for p in points),
        },
        {"fig4": draw_fig4(analysis, motions, period)},
    )


def rk4_order(problem: Problem) -> float:
    """Order in h of the errors of the transition times of ``henon-rk4`` up to t = 12 s."""
    problem = replace(problem, until=sp.Integer(12))
    truth = np.array([t.time for t in reference(problem).transitions])
    found = []
    for step in ORDER_STEPS[2:16]:
        times = np.array([t.time for t in RK4.prepare(problem, step=step)().transitions])
        if len(times) == len(truth) and (error := rms(times - truth)) > ROUNDING:
            found.append((step, error))
    return fitted_order(*zip(*found, strict=True))


def section() -> Findings:
    """Check Eqs. (14)-(16) and Figs. 2-4."""
    orders = {
        "limit": rk4_order(fig8_listing_limit()),
        "equations": rk4_order(fig8_equations()),
        "right": order_of(()),
        "wrong": order_of(("landing_sign",)),
    }
    kept = all(abs(orders[name] - 4) < 0.3 for name in ("limit", "equations", "right"))
    found = fan_findings()
    holds = {**found.holds, "orders": kept and orders["wrong"] < 1.5}
    return replace(found, holds=holds, values={**found.values, **orders})


def draw_fig4(analysis: TangentAnalysis, motions: Sequence[Motion], period: float) -> Figure:
    """Draw the phase portrait of the fan, and its part near the belt's speed."""
    colours = (style.BLUE, style.VERMILLION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY)
    plane = plane_of(analysis.system, 0, 1)
    last = motions[0]
    orbit = last.states[last.times > HORIZON - period - 0.1]
    with style.figure(6.4) as figure:
        axes = figure.subplots(2, 1, height_ratios=(3, 2))
        for ax in axes:
            for k, motion in enumerate(motions):
                colour, drawn = colours[k // 2], motion.times < 25
                ax.plot(*motion.states[drawn].T, color=colour, lw=0.6)
                ax.plot(*motion.states[0], marker="s", ms=3, color=colour, zorder=4)
                for label, piece in plane.pieces(motion.modes):
                    if label == "stick":
                        ax.plot(*motion.states[piece].T, color=style.BLACK, lw=2.4, zorder=5)
            ax.plot(*orbit.T, color=style.BLACK, lw=1.3, label="periodic orbit")
            _mark_surface(ax, analysis)
            ax.set_ylabel(r"$x_2$ [m/s]")
        axes[1].set(xlabel=r"$x_1$ [m]", xlim=(-1.45, 1.45), ylim=(0.72, 1.28))
        axes[0].set_title("a   the fan")
        axes[1].set_title("b   near the belt's speed")
        handles, labels = axes[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        figure.set_layout_engine("constrained")
    return figure


def _mark_surface(ax: Axes, analysis: TangentAnalysis) -> None:
    belt = float(FIG4_VALUES[VP])
    ax.axhline(belt, color=style.GREY, lw=0.8, zorder=1)
    for k, zone in enumerate(analysis.stick_zones()):
        ends, label = [float(zone.low), float(zone.high)], "stick zone" if k == 0 else None
        ax.plot(ends, [belt] * 2, color=style.STICK_SHADE, lw=9, solid_capstyle="butt", zorder=2, label=label)
    ax.plot([], [], "s", ms=3, color=style.GREY, label="start")
    ax.plot([], [], color=style.BLACK, lw=2.4, label="stick")
    for kind, face in (("visible", style.BLACK), ("invisible", "white")):
        at = [float(p.position) for p in analysis.tangent_points() if p.visibility == kind]
        label = f"{kind} tangent point"
        ax.plot(at, [belt] * len(at), "o", ms=5, mfc=face, mec=style.BLACK, zorder=6, ls="", label=label)
