"""Legend of a figure: labels to the right of the axes, each with a sample of its line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from henon_ref.figures.style import Line
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAMPLE = 22.0
"""Length of the sample of a line [pt]."""
LARGE, SMALL = 8.0, 6.0
"""Largest and smallest font size of a label [pt]."""
LETTER = 0.62
"""Assumed width of a letter, slightly above the average [em]."""


def label_column(
    axes: Axes, labels: Sequence[tuple[str, Line]], *, x: float, gap: float, ends: Sequence[float] = ()
) -> None:
    """Draw a column of labels to the right of the axes, from top to bottom.

    The column begins at ``x``, as a fraction of the width of the axes. The distance of two labels is ``gap``, as a
    fraction of the height, or less if there are many labels. ``ends`` are the final values of the curves in data
    coordinates; limits and scales must be set before. With ``ends``, labels are ordered by these values and placed as
    near to them as possible, and a thin line in the margin connects each label with the end of its curve. These lines
    cross neither the curves nor each other.
    """
    from matplotlib.lines import Line2D

    point, gap = _point(axes), min(gap, 1.0 / max(len(labels), 1))
    along = [x + part * SAMPLE * point for part in (0.0, 0.5, 1.0)]
    place: dict[str, Any] = {"transform": axes.transAxes, "clip_on": False}
    order = sorted(range(len(labels)), key=lambda k: -ends[k]) if ends else range(len(labels))
    level, height = 1.0, 1.0 + gap / 2
    for row, k in enumerate(order):
        label, line = labels[k]
        if ends:
            place_of_end = (axes.transScale + axes.transLimits).transform((axes.get_xlim()[0], ends[k]))
            level = min(max(float(place_of_end[1]), 0.0), 1.0)
        height = max(min(level, height - gap), (len(labels) - row - 0.5) * gap)  # leaves room for the labels below
        if ends:
            way = [1.005, x - 2 * point], [level, height]
            axes.add_artist(Line2D(*way, lw=0.5, alpha=0.7, color=line.colour, zorder=1, **place))
        drawn: dict[str, Any] = {"ls": line.dashes, "lw": line.width, "marker": line.marker, "ms": 4.0}
        axes.add_artist(Line2D(along, [height] * 3, markevery=[1], color=line.colour, **drawn, **place))
        text, size = _fitted(axes, one_line(label), x)
        at = x + (SAMPLE + 4) * point
        axes.text(at, height, text, parse_math=False, va="center", fontsize=size, transform=axes.transAxes)


def _fitted(axes: Axes, label: str, x: float) -> tuple[str, float]:
    """Fit a label into the figure by a smaller font, and by truncation if necessary; return text and size [pt]."""
    place = axes.get_position()
    room = ((1.0 - place.x0) / place.width - x) / _point(axes) - SAMPLE - 6
    most = int(room / (LETTER * SMALL))
    text = label if len(label) <= most else f"{label[: most - 1]}…"
    return text, min(LARGE, room / (LETTER * len(text)))


def _point(axes: Axes) -> float:
    """Return one point (1/72 inch) as a fraction of the width of the axes."""
    return axes.figure.dpi / 72.0 / axes.bbox.width
