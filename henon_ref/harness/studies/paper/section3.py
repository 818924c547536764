"""Section 3: the numerical method, and the phase portrait of Fig. 4."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from henon_ref.analysis.tangent import TangentAnalysis, TangentPoint
from henon_ref.baselines.paper.rk4 import RK4
from henon_ref.figures import style
from henon_ref.harness.report.svg import svg
from henon_ref.harness.studies.paper.audit import ORDER_STEPS, ROUNDING, order_of
from henon_ref.harness.studies.paper.claims import Claim, Section, checked, picture
from henon_ref.harness.studies.paper.curves import Curve, curve, reference
from henon_ref.harness.studies.paper.exact import same
from henon_ref.harness.studies.paper.systems import (
    FIG4_VALUES,
    POSITION,
    VP,
    Z,
    fig8_equations,
    fig8_listing_limit,
    printed_points,
    section_2,
)
from henon_ref.modes.problem import Problem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BELT = float(FIG4_VALUES[VP])
OFFSETS = (sp.Rational(-1, 5), sp.Rational(1, 5))
"""How far from the belt's speed each start lies; the paper's starts are lost."""
HORIZON = 60
"""The fan is run this long [s]."""
DRAWN = 25
"""Its runs are drawn this long [s], and then the orbit they end on."""


@dataclass(frozen=True)
class Fan:
    """Runs from starts around every tangent point."""

    points: tuple[TangentPoint, ...]
    starts: tuple[tuple[float, float], ...]
    curves: tuple[Curve, ...]

    def sticking(self) -> int:
        """Runs that stick at least once."""
        return sum(any(t.kind == "stick" for t in c.transitions) for c in self.curves)

    def last_stick(self) -> float:
        """When the last stick of any run ends [s]."""
        return max(t.time for c in self.curves for t in c.transitions if t.kind == "release")

    def orbit(self) -> tuple[float, float, float]:
        """Period of the orbit all runs end on [s], and the positions at which it crosses down and up."""
        last = self.curves[0].transitions[-3:]
        down, up = sorted(last[:2], key=lambda t: t.to_mode)
        return last[2].time - last[0].time, down.state[0], up.state[0]

    def one_orbit(self) -> bool:
        """Whether all runs end on the same orbit."""
        ends = [sorted(t.state[0] for t in c.transitions[-2:]) for c in self.curves]
        return bool(np.allclose(ends, ends[0], atol=1e-4))


def fan() -> Fan:
    """The fan of Fig. 4: a start below and one above every tangent point."""
    system = section_2(FIG4_VALUES)
    points = tuple(TangentAnalysis(system, POSITION).tangent_points())
    starts = [(p.position, FIG4_VALUES[VP] + offset) for p in points for offset in OFFSETS]
    curves = [
        curve(Problem(system, sp.Integer(0), start, sp.Integer(HORIZON)), after=0, until=HORIZON) for start in starts
    ]
    return Fan(points, tuple((float(a), float(b)) for a, b in starts), tuple(curves))


def rk4_order(problem: Problem) -> float:
    """Order in h of the transition times of ``henon-rk4`` up to t = 12 s, against the Taylor reference."""
    problem = replace(problem, until=sp.Integer(12))
    truth = np.array([t.time for t in reference(problem).transitions])
    found = []
    for step in ORDER_STEPS[2:16]:
        times = np.array([t.time for t in RK4.prepare(problem, step=step)().transitions])
        if len(times) == len(truth) and (rms := float(np.sqrt(np.mean((times - truth) ** 2)))) > ROUNDING:
            found.append((step, rms))
    steps, errors = zip(*found, strict=True)
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def section(folder: Path) -> Section:
    """Equations (14)-(16), Figs. 2-4; draws Fig. 4."""
    made = fan()
    (folder / "fig4.svg").write_bytes(svg(draw_fig4(made)))
    period, down, up = made.orbit()
    text = _TEXT.format(
        count=len(made.curves), sticking=made.sticking(), last=made.last_stick(), period=period, down=down, up=up
    )
    caption = (
        "Fig. 4 again: phase portrait of Eq. (5) for mu0 = 1/(3 sqrt 3), vp = 1, from a start 0.2 below and one "
        "0.2 above every tangent point, and the orbit all of them end on. Below, what happens near the belt's speed."
    )
    return Section(
        "Section 3: the method, and Fig. 4",
        text + picture(folder, "fig4.svg", caption),
        (_method_claim(), *fan_claims(made)),
    )


def fan_claims(made: Fan) -> tuple[Claim, ...]:
    """Eqs. (15) and (16) at the tangent points of the fan, and what Fig. 4 says."""
    analysis = TangentAnalysis(section_2(FIG4_VALUES), POSITION)
    touching = all(same(analysis.system.numeric(analysis.normals[p.side]).subs(Z, p.position), 0) for p in made.points)
    period, down, up = made.orbit()
    third = float(printed_points()[2])
    return (
        checked(
            "Eq. (15)",
            "the release as a swap to x1: d tau/d x1 = 1/f2, d x2/d x1 = 0",
            touching,
            "It has to be d tau/d x1 = 1/f1 = 1/vp, as the listing does (`h/x[2]`). As printed it divides by zero "
            "where it is used: a tangent point is where f2 = 0. Where the tangent points move (Sec. 4) the "
            "variable to swap to is z, d tau/dz = 1/(vp - y'); `henon-rk4` swaps to the guard itself, which is both.",
            corrected=True,
        ),
        checked(
            "Eq. (16)",
            "tangent points 2/sqrt 3 times cos c, cos 2c, sin c/2 and their negatives, c = pi/9, at mu0 = 1/(3 sqrt 3)",
            all(same(p.position, q) for p, q in zip(made.points, printed_points(), strict=True)),
            "Equal, all six: the roots of sigma by Viete's cosines.",
        ),
        Claim(
            "Figs. 2, 3",
            "block diagrams of the program",
            "not reproducible",
            "Drawings, lost with the figures; nothing is computed in them. The listing stands for them.",
        ),
        checked(
            "Fig. 4, caption",
            "tangent points 1, 3, 5 visible, 2, 4, 6 invisible",
            [p.visibility for p in made.points] == ["visible", "invisible"] * 3,
            "By the second derivative of h along the touching field: "
            + ", ".join(f"{float(p.curvature):+.3f} (s = {p.side:+d})" for p in made.points)
            + ".",
        ),
        checked(
            "Fig. 4 and text",
            "any stick mode does not occur",
            made.sticking() > 0 and made.one_orbit(),
            f"Holds for the periodic orbit only. {made.sticking()} of {len(made.curves)} starts stick on their way to "
            f"it, the last until t = {made.last_stick():.2f} s. The paper's own starts (where its dashed lines cross) "
            "are lost; these are ours.",
            corrected=True,
        ),
        checked(
            "Fig. 4 and text",
            "the orbit is bent near the third tangent point, where it crosses Sigma",
            abs(up - third) < 0.1 or abs(down - third) < 0.1,
            f"All runs end on one orbit of period {period:.4f} s that crosses upward at x1 = {up:.4f} and downward at "
            f"x1 = {down:.4f}; x(3) = {third:.4f}.",
        ),
    )


def _method_claim() -> Claim:
    limit, equations = rk4_order(fig8_listing_limit()), rk4_order(fig8_equations())
    right, wrong = order_of(()), order_of(("landing_sign",))
    return checked(
        "Eq. (14)",
        "the landing as a swap to x2: d x1/d x2 = x2/f2, d tau/d x2 = 1/f2, by a step vp - x2 or x2 - vp",
        abs(limit - 4) < 0.3 and abs(equations - 4) < 0.3 and abs(right - 4) < 0.3 and wrong < 1.5,
        f"The swap keeps the order of Runge-Kutta: transition times of `henon-rk4` converge with order {limit:.2f} "
        f"(listing_limit) and {equations:.2f} (equations), those of the paper's program with its mistakes put right "
        f"with {right:.2f}. The step is vp - x2 on either side; with x2 - vp, as printed for one of them, order "
        f"{wrong:.2f} is left.",
        corrected=True,
    )


def draw_fig4(made: Fan) -> Figure:
    """Phase portrait of the fan, and its part near the belt's speed."""
    colours = (style.BLUE, style.VERMILLION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY)
    with style.figure(6.4) as figure:
        axes = figure.subplots(2, 1, height_ratios=(3, 2))
        for k, (start, drawn) in enumerate(zip(made.starts, made.curves, strict=True)):
            colour = colours[k // 2]
            early = drawn.states[drawn.times < DRAWN]
            for ax in axes:
                ax.plot(early[:, 0], early[:, 1], color=colour, lw=0.6)
                ax.plot(*start, marker="s", ms=3, color=colour, zorder=4)
                for stick in drawn.sticks():
                    ax.plot(drawn.states[stick, 0], drawn.states[stick, 1], color=style.BLACK, lw=2.4, zorder=5)
        last = made.curves[0]
        orbit = last.states[last.times > HORIZON - made.orbit()[0] - 0.1]
        for ax in axes:
            ax.plot(orbit[:, 0], orbit[:, 1], color=style.BLACK, lw=1.3, label="periodic orbit")
            _mark_surface(ax, made.points)
            ax.set_ylabel(r"$x_2$ [m/s]")
        axes[1].set(xlabel=r"$x_1$ [m]", xlim=(-1.45, 1.45), ylim=(0.72, 1.28))
        axes[0].set_title("a   the fan")
        axes[1].set_title("b   near the belt's speed")
        handles, labels = axes[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        figure.set_layout_engine("constrained")
    return figure


def _mark_surface(ax: Axes, points: tuple[TangentPoint, ...]) -> None:
    ax.axhline(BELT, color=style.GREY, lw=0.8, zorder=1)
    places = [float(p.position) for p in points]
    for k, (high, low) in enumerate(zip(places[::2], places[1::2], strict=True)):
        label = "stick zone" if k == 0 else None
        ax.plot([low, high], [BELT, BELT], color=style.STICK_SHADE, lw=9, solid_capstyle="butt", zorder=2, label=label)
    ax.plot([], [], "s", ms=3, color=style.GREY, label="start")
    ax.plot([], [], color=style.BLACK, lw=2.4, label="stick")
    for kind, face in (("visible", style.BLACK), ("invisible", "white")):
        at = [float(p.position) for p in points if p.visibility == kind]
        ax.plot(
            at, [BELT] * len(at), "o", ms=5, mfc=face, mec=style.BLACK, zorder=6, ls="", label=f"{kind} tangent point"
        )


_TEXT = """\
`henon-rk4` is the method of this section done right for any Filippov system: time is a state, Eqs. (14) and (15)
are swaps to the guard that the step has crossed, and a bracketed root takes over where the guard's rate vanishes.

**Do sticks occur in Fig. 4?** Yes. {sticking} of {count} runs from around the tangent points stick on
their way, the last until t = {last:.2f} s. All runs then settle on one periodic orbit (period {period:.4f} s)
that only crosses: upward at x1 = {up:.4f}, downward at x1 = {down:.4f}. The paper's sentence holds for that orbit,
not for the system.

"""
