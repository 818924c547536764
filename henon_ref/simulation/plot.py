"""The figure of a solution: phase portrait above, surfaces over time below."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.figures.motion import (
    MOST_SURFACES,
    Motion,
    axes_of_portrait,
    portrait,
    state_over_time,
    surfaces_over_time,
)
from henon_ref.filippov.system import FilippovSystem

PORTRAIT, PANEL, GAP = 3.6, 1.3, 0.55
"""Heights of the portrait, of a surface's panel, and of what stands above each of both [in]."""


def plotted(system: FilippovSystem, motion: Motion) -> NDArray[Any]:
    """Axes of a new figure: the portrait (of one state: the state over time), then a panel each for the first surfaces.

    The figure is one of pyplot's, so that a notebook shows it.
    """
    import matplotlib.pyplot as plt

    count = min(len(system.surfaces), MOST_SURFACES)
    height = 2 * GAP + PORTRAIT + count * PANEL + GAP
    with style.report_style():
        figure = plt.figure(figsize=(style.WIDTH, height))
        bottom = GAP + count * PANEL
        top = figure.add_axes((0.11, (bottom + 1.3 * GAP) / height, 0.86, (PORTRAIT - 0.3 * GAP) / height))
        grid = figure.add_gridspec(
            count, 1, left=0.11, right=0.97, bottom=GAP / height, top=bottom / height, hspace=0.12
        )
        panels = grid.subplots(sharex=True, squeeze=False)[:, 0]
        pair = axes_of_portrait(system)
        if pair is not None:
            portrait(top, system, motion, pair)
        else:
            state_over_time(top, system, motion)
        surfaces_over_time(panels, system, motion)
    return np.array([top, *panels])
