"""Labels right of the axes, each with a sample of its line: a figure's legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from henon_ref.figures.style import Line
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAMPLE = 22.0
"""Length of a line's sample beside its label [pt]."""
LARGE, SMALL = 8.0, 6.0
"""Sizes of a label [pt]: usual, and of one that is too long for that."""
LETTER = 0.62
"""Width of a letter, rather more than it is on average [em]."""


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


def label_ends(axes: Axes, ends: Sequence[tuple[str, float, Line]], *, x: float, gap: float) -> None:
    """Labels in a column right of the axes, each at the level at which its curve ends: they are the legend.

    A thin line leads through the margin from the edge of the axes to each label; nothing is drawn across the curves.
    Labels stand in the order of the curves' ends and within the axes' height, so that no two of these lines cross.

    Parameters
    ----------
    axes : Axes
        Its limits and scales are set.
    ends : sequence of (str, float, Line)
        Label, height at which the curve ends (in data), how it is drawn.
    x : float
        Where the column starts, as a fraction of the axes' width.
    gap : float
        Least distance of two labels, as a fraction of the axes' height.
    """
    from matplotlib.lines import Line2D

    to_axes = axes.transScale + axes.transLimits
    left = axes.get_xlim()[0]
    levels = [min(max(float(to_axes.transform((left, y))[1]), 0.0), 1.0) for _, y, _ in ends]
    gap = min(gap, 1.0 / max(len(ends), 1))
    heights = spread(levels, gap, gap / 2, 1.0 - gap / 2)
    for (label, _, line), level, height in zip(ends, levels, heights, strict=True):
        leader: dict[str, Any] = {
            "lw": 0.5,
            "alpha": 0.7,
            "color": line.colour,
            "transform": axes.transAxes,
            "clip_on": False,
        }
        axes.add_artist(Line2D([1.005, x - 2 * _point(axes)], [level, height], zorder=1, **leader))
        _label(axes, label, line, x, height)


def label_column(axes: Axes, labels: Sequence[tuple[str, Line]], *, x: float, gap: float) -> None:
    """Labels in a column right of the axes, from its top down; parameters as for :func:`label_ends`."""
    gap = min(gap, 1.0 / max(len(labels), 1))
    for k, (label, line) in enumerate(labels):
        _label(axes, label, line, x, 1.0 - (k + 0.5) * gap)


def _label(axes: Axes, label: str, line: Line, x: float, height: float) -> None:
    """A label with a sample of its line."""
    from matplotlib.lines import Line2D

    point = _point(axes)
    along = [x + part * SAMPLE * point for part in (0.0, 0.5, 1.0)]
    drawn: dict[str, Any] = {"ls": line.dashes, "lw": line.width, "marker": line.marker, "ms": 4.0}
    place: dict[str, Any] = {"transform": axes.transAxes, "clip_on": False}
    axes.add_artist(Line2D(along, [height] * 3, markevery=[1], color=line.colour, **drawn, **place))
    text, size = _fitted(axes, one_line(label), x)
    axes.text(
        x + (SAMPLE + 4) * point, height, text, parse_math=False, va="center", fontsize=size, transform=axes.transAxes
    )


def _fitted(axes: Axes, label: str, x: float) -> tuple[str, float]:
    """A label and its size [pt], so that it ends within the figure: a long one is set smaller, a longer one cut."""
    place = axes.get_position()
    room = ((1.0 - place.x0) / place.width - x) / _point(axes) - SAMPLE - 6
    most = int(room / (LETTER * SMALL))
    text = label if len(label) <= most else f"{label[: most - 1]}…"
    return text, min(LARGE, room / (LETTER * len(text)))


def _point(axes: Axes) -> float:
    """A point, as a fraction of the axes' width."""
    return axes.figure.dpi / 72.0 / axes.bbox.width
