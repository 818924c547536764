"""Transitions in a phase portrait: a dot each, with its kind and time beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_NAMED = 8
"""Places of transitions that are named; where there are more, all are dots alone."""
MOST_TIMES = 2
"""Times that are told of one place."""
SLOPE = 50
"""Of the text beside a dot [degrees]."""
SAME = 0.01
"""Transitions of a kind that are no further apart, in parts of the axes, share a name."""


def mark_transitions(axes: Axes, points: NDArray[np.float64], kinds: Sequence[str], times: NDArray[np.float64]) -> None:
    """Mark transitions at points, shape (k, 2), whose limits the axes have already."""
    from matplotlib.patheffects import Normal, Stroke

    axes.plot(*points.T, marker="o", markersize=3.5, linestyle="none", color=style.BLACK, zorder=5)
    size = np.abs([np.diff(axes.get_xlim())[0], np.diff(axes.get_ylim())[0]])
    places: list[tuple[str, NDArray[np.float64], list[float]]] = []
    for kind, point, time in zip(kinds, points, times.tolist(), strict=True):
        near = [own for own in places if own[0] == kind and (np.abs(own[1] - point) <= SAME * size).all()]
        if near:
            near[0][2].append(time)
        else:
            places.append((kind, point, [time]))
    if len(places) > MOST_NAMED:
        return
    centre = np.mean([axes.get_xlim(), axes.get_ylim()], axis=1)
    halo = [Stroke(linewidth=2.0, foreground="white"), Normal()]
    for kind, point, own in places:
        told = ", ".join(f"{time:.4g}" for time in own[:MOST_TIMES]) + (", ..." if len(own) > MOST_TIMES else "")
        right, above = point > centre  # the text goes towards the centre, where there is room
        axes.annotate(
            f"{kind} {told} s", tuple(point), xytext=(-3 if right else 3, -4 if above else 4),
            textcoords="offset points", rotation=SLOPE if right == above else -SLOPE, rotation_mode="anchor",
            ha="right" if right else "left", va="top" if above else "bottom", fontsize=7, zorder=6, path_effects=halo,
        )  # fmt: skip
