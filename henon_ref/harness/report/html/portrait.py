"""A phase portrait in a few kilobytes: points as whole numbers on a grid, so many as the eye needs."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures.curves import Curves

CELLS = 4096
"""Steps of the grid across the portrait's limits; points may lie up to seven times that far outside."""
MOST_POINTS = 1500
"""Points of a portrait: where there would be more, they are thinned further."""
THRESHOLD = 2.0
"""Steps of the grid by which a thinned curve may lie beside its points, as long as they are few enough."""


def packed(curves: Curves) -> dict[str, Any]:
    """A portrait as JSON.

    ``pieces`` are (label, points), ``surfaces`` points; points are the base64 text of little-endian 16-bit integers
    x, y, x, y, ..., of which 0 and ``CELLS`` are the limits.
    """
    threshold = THRESHOLD
    pieces, surfaces = _thinned(curves, threshold)
    while sum(len(points) for _, points in pieces) > MOST_POINTS and threshold < CELLS:
        threshold *= 2
        pieces, surfaces = _thinned(curves, threshold)
    return {
        "names": list(curves.names),
        "limits": [[float(f"{value:.6g}") for value in pair] for pair in curves.limits],
        "window": [float(f"{value:.12g}") for value in curves.window],
        "pieces": [[label, _text(points)] for label, points in pieces],
        "surfaces": [_text(points) for points in surfaces],
    }


Points = NDArray[np.float64]


def _thinned(curves: Curves, threshold: float) -> tuple[list[tuple[str, Points]], list[Points]]:
    low, high = np.array(curves.limits).T

    def on_grid(points: Points) -> Points:
        scaled = (points - low) / (high - low) * CELLS
        return _simplified(np.clip(scaled, -7 * CELLS, 7 * CELLS), threshold)

    return [(label, on_grid(p)) for label, p in curves.pieces], [on_grid(p) for p in curves.surfaces]


def _simplified(points: Points, threshold: float) -> Points:
    """A curve without the points that lie on the line between their neighbours."""
    from matplotlib.path import Path

    if len(points) < 3:
        return points
    path = Path(points)
    path.simplify_threshold = threshold
    cleaned = path.cleaned(simplify=True)
    kept = np.asarray(cleaned.vertices)[np.asarray(cleaned.codes) != Path.STOP]
    return np.vstack([points[:1], kept[1:], points[-1:]])


def _text(points: Sequence[Any] | Points) -> str:
    return b64encode(np.rint(np.asarray(points)).astype("<i2").tobytes()).decode("ascii")
