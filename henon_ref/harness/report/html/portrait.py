"""Compress a phase portrait to a few kilobytes: integer points on a grid, thinned without visible change."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures.motion import Motion, axes_of_portrait, limits_around, plane_of, surface_curves
from henon_ref.modes.system import FilippovSystem

CELLS = 4096
"""Grid steps between the limits of the portrait; points may lie up to seven times this distance outside."""
MOST_POINTS = 1500
"""Number of points above which a portrait is thinned further."""
THRESHOLD = 2.0
"""Allowed distance of a thinned curve from its points [grid steps]; doubled until the points are few enough."""
Points = NDArray[np.float64]


def packed(system: FilippovSystem, motion: Motion) -> dict[str, Any]:
    """Return the portrait of a motion as JSON; for a system with one state, the state over time.

    ``pieces`` are pairs (label, points) in order of time, ``surfaces`` are points. Points are base64 text of
    little-endian 16-bit integers x, y, x, y, ...; the values 0 and ``CELLS`` are the limits.
    """
    pair = axes_of_portrait(system)
    x, y = pair or (0, 0)
    points = np.column_stack([motion.states[:, x] if pair else motion.times, motion.states[:, y]])
    limits = limits_around(points[:, 0]), limits_around(points[:, 1])
    curves = [(label, points[piece]) for label, piece in plane_of(system, x, y).pieces(motion.modes)]
    for threshold in (THRESHOLD * 2**k for k in range(12)):
        pieces = [(label, _on_grid(own, limits, threshold)) for label, own in curves]
        if sum(len(own) for _, own in pieces) <= MOST_POINTS:
            break
    surfaces = surface_curves(system, pair, limits) if pair else []
    return {
        "names": [system.state_names[x] if pair else "t", system.state_names[y]],
        "limits": [[float(f"{value:.6g}") for value in own] for own in limits],
        "window": [float(f"{value:.12g}") for value in motion.times[[0, -1]]],
        "pieces": [[label, _text(own)] for label, own in pieces],
        "surfaces": [_text(_on_grid(own, limits, threshold)) for own in surfaces],
    }


def _on_grid(points: Points, limits: tuple[tuple[float, float], tuple[float, float]], threshold: float) -> Points:
    """Convert a curve to grid steps, and remove points on the line between their neighbours."""
    from matplotlib.path import Path

    low, high = np.array(limits).T
    scaled = np.clip((points - low) / (high - low) * CELLS, -7 * CELLS, 7 * CELLS)
    if len(scaled) < 3:
        return scaled
    path = Path(scaled)
    path.simplify_threshold = threshold
    cleaned = path.cleaned(simplify=True)
    kept = np.asarray(cleaned.vertices)[np.asarray(cleaned.codes) != Path.STOP]
    return np.vstack([scaled[:1], kept[1:], scaled[-1:]])


def _text(points: Points) -> str:
    return b64encode(np.rint(points).astype("<i2").tobytes()).decode("ascii")
