"""One style for every figure: sizes, fonts and colours, and output that is the same for the same data."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH = 7.2
"""Width of a figure [in]: full text width of a page."""

BLUE, VERMILLION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
SKY, PURPLE, BLACK, GREY = "#56B4E9", "#AA4499", "#000000", "#767676"
"""Okabe and Ito's palette, told apart by colour-blind readers (purple darkened to hold on white)."""

STICK_SHADE, PLUS_SHADE, MINUS_SHADE = "#F6C48A", "#CFE3F3", "#FFFFFF"
"""Backgrounds of stick, of slip with s = +1 and of slip with s = -1."""

_RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # the default place, said: without it matplotlib lays out every tick label once more
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "mathtext.fontset": "dejavusans",
    "path.simplify": False,  # every transition stays a corner, and every arc as smooth as its samples
    "svg.hashsalt": "henon-ref",
    "svg.fonttype": "path",
}


THIN = 1.1
"""Width of an ordinary line [pt]; what is compared with all others is drawn wider."""
SAMPLE = 22.0
"""Length of a line's sample beside its label [pt]."""


@dataclass(frozen=True)
class Line:
    """How a solver is drawn, in every figure the same."""

    colour: str
    marker: str
    dashes: str = "-"
    width: float = THIN


_LINES = {
    "henon": Line(VERMILLION, "o", width=2.2),
    "henon-newton": Line(VERMILLION, "v", "--"),
    "henon-brent": Line(VERMILLION, "^", ":"),
    "henon-rk4": Line(ORANGE, "s"),
    "henon-listing": Line(ORANGE, "X", "--"),
    "heyoka": Line(BLACK, "D", width=1.6),
    "cvode-adams": Line(GREEN, "o"),
    "cvode-bdf": Line("#004D38", "s", "--"),
    "ida": Line("#66CDAA", "^", ":"),
    "scipy-rk45": Line("#6CBFF2", "o"),
    "scipy-dop853": Line(BLUE, "D"),
    "scipy-radau": Line("#3B3F9E", "s", "--"),
    "scipy-bdf": Line("#6F8CEC", "^", "--"),
    "scipy-lsoda": Line("#12124F", "v", ":"),
    "scipy-smoothed": Line(GREY, "P", "--"),
    "scipy-sign": Line("#A6A6A6", "X", ":"),
}
"""SUNDIALS is green, SciPy blue; their solvers differ in lightness, which colour-blind readers see too."""


def line_of(solver: str) -> Line:
    """How a solver is drawn: a variant (``+numba``, ``@offset``) as its base solver, dash-dotted.

    Third parties' solvers share one line style and are told apart by their labels.
    """
    base, *variant = re.split("[+@]", solver)
    line = _LINES.get(base, Line(PURPLE, "d"))
    return replace(line, dashes="-.") if variant else line


def look() -> AbstractContextManager[None]:
    """The style of the reports, for whoever makes a figure in it."""
    import matplotlib

    return matplotlib.rc_context(_RC)


@contextmanager
def figure(height: float, *, width: float = WIDTH) -> Iterator[Figure]:
    """A figure in the style of the reports; sizes in inches."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_RC):
        yield Figure(figsize=(width, height))


def save(figure: Figure, target: Path | BinaryIO, kind: str = "svg") -> None:
    """Write a figure (SVG, or PNG for viewing) with nothing in it that changes from run to run."""
    import matplotlib

    metadata = {"Date": None, "Creator": None} if kind == "svg" else None
    with matplotlib.rc_context(_RC):
        figure.savefig(target, format=kind, metadata=metadata, dpi=150)


def spread(positions: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Move labels apart so that neighbours are at least ``gap`` apart, in their order and between two ends.

    No other way to do so moves them less (in the sum of squares): isotonic regression of what is left of each position
    once the gaps below it are taken off.

    Examples
    --------
    >>> spread([0.0, 0.1, 2.0], 1.0, 0.0, 3.0)
    [0.0, 1.0, 2.0]
    >>> spread([1.0, 1.0], 0.5, 0.0, 3.0)
    [0.75, 1.25]
    """
    from scipy.optimize import isotonic_regression

    order = np.argsort(np.asarray(positions, dtype=float), kind="stable")
    steps = gap * np.arange(len(order))
    # What each is above the ones below it, packed at the gap, may not fall: a least-squares fit under that order,
    # which bounds on both ends only clip.
    excess = isotonic_regression(np.asarray(positions, dtype=float)[order] - steps).x
    placed = np.empty(len(order))
    placed[order] = np.clip(excess, low, high - gap * (len(order) - 1)) + steps
    return [float(value) for value in placed]


def label_points(axes: Axes, points: Sequence[tuple[str, float, float, Line]], *, x: float, gap: float) -> None:
    """Labels in a column right of the axes, each with a sample of its line: they are the legend.

    A thin line leads from each point level to the edge of the axes and from there to its label. Labels stand in the
    order of their points and within the axes' height, so that no two of these lines cross.

    Parameters
    ----------
    axes : Axes
        Its limits and scales are set.
    points : sequence of (str, float, float, Line)
        Label, point, how its line is drawn.
    x : float
        Where the column starts, as a fraction of the axes' width.
    gap : float
        Least distance of two labels, as a fraction of the axes' height.
    """
    from matplotlib.lines import Line2D

    to_axes = axes.transScale + axes.transLimits
    starts = [[min(max(float(at), 0.0), 1.0) for at in to_axes.transform((px, py))] for _, px, py, _ in points]
    gap = min(gap, 1.0 / max(len(points), 1))
    heights = spread([level for _, level in starts], gap, gap / 2, 1.0 - gap / 2)
    point = axes.figure.dpi / 72.0 / axes.bbox.width
    for (text, _, _, line), (left, level), height in zip(points, starts, heights, strict=True):
        shared: dict[str, Any] = {"color": line.colour, "transform": axes.transAxes, "clip_on": False}
        leader = Line2D([left, 1.0, x - 2 * point], [level, level, height], lw=0.5, alpha=0.7, zorder=1, **shared)
        along = [x + part * SAMPLE * point for part in (0.0, 0.5, 1.0)]
        drawn: dict[str, Any] = {"ls": line.dashes, "lw": line.width, "marker": line.marker, "ms": 4.0}
        axes.add_artist(leader)
        axes.add_artist(Line2D(along, [height] * 3, markevery=[1], **drawn, **shared))
        place: dict[str, Any] = {"transform": axes.transAxes, "va": "center", "fontsize": 8.0}
        axes.text(x + (SAMPLE + 4) * point, height, one_line(text), parse_math=False, **place)


def decades(axis: Axis) -> None:
    """Plain-text labels on the decades of a log-scaled axis: at most nine, no mathtext (which is slow to set)."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = axis.get_view_interval()
    span = math.log10(high / low)
    axis.set_major_locator(LogLocator(10, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_locator(LogLocator(10, subs=range(2, 10), numticks=12) if span < 6 else NullLocator())
    axis.set_minor_formatter(NullFormatter())


def power_of_ten(value: float) -> str:
    """A decade as text.

    Examples
    --------
    >>> power_of_ten(1e-12), power_of_ten(1.0)
    ('10⁻¹²', '1')
    """
    exponent = round(math.log10(value)) if value > 0 else 0
    return "1" if exponent == 0 else "10" + str(exponent).translate(_SUPERSCRIPT)


_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
