"""The figure of a solution: phase portrait above, surfaces over time below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
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
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PORTRAIT, PANEL, GAP = 3.6, 1.3, 0.55
"""Heights of the portrait, of a surface's panel, and of what stands above each of both [in]."""


def plotted(
    system: FilippovSystem, motion: Motion, x: str | None = None, y: str | None = None, ax: Axes | None = None
) -> NDArray[Any]:
    """Axes of what is drawn: a portrait, then, in a new figure, a panel each for the first surfaces.

    See :meth:`henon_ref.simulation.solution.Solution.plot`.

    Raises
    ------
    ArgumentError
        For a name that is no state.
    """
    across, upward = _plane(system, x, y)
    if ax is not None:
        with style.report_style():
            _draw(ax, system, motion, across, upward)
        return np.array([ax])
    count = min(len(system.surfaces), MOST_SURFACES)
    height = 2 * GAP + PORTRAIT + count * PANEL + GAP
    figure = style.pyplot_figure(height)
    with style.report_style():
        bottom = GAP + count * PANEL
        top = figure.add_axes((0.11, (bottom + 1.3 * GAP) / height, 0.86, (PORTRAIT - 0.3 * GAP) / height))
        _draw(top, system, motion, across, upward)
        if not count:
            return np.array([top])
        grid = figure.add_gridspec(
            count, 1, left=0.11, right=0.97, bottom=GAP / height, top=bottom / height, hspace=0.12
        )
        panels = grid.subplots(sharex=True, squeeze=False)[:, 0]
        surfaces_over_time(panels, system, motion)
    return np.array([top, *panels])


def _plane(system: FilippovSystem, x: str | None, y: str | None) -> tuple[int | None, int]:
    """Index of the state across (None: time), and of the one upward."""
    names = system.state_names
    for what, name in (("x", x), ("y", y)):
        if name is not None and name not in names and (what, name) != ("x", TIME.name):
            known = [*names, TIME.name] if what == "x" else names
            message = f"{what} is {str(name)[:60]!r}, which is no state{did_you_mean(str(name), known)}"
            raise ArgumentError(f"{message}; wanted one of {listed(known)}")
    pair = axes_of_portrait(system)
    if x == TIME.name or pair is None:
        return None, names.index(y) if y is not None else 0
    upward = names.index(y) if y is not None else pair[1]
    if x is None:
        return next(k for k in pair if k != upward), upward
    across = names.index(x)
    return across, upward if y is not None or upward != across else pair[0]


def _draw(ax: Axes, system: FilippovSystem, motion: Motion, across: int | None, upward: int) -> None:
    if across is None:
        state_over_time(ax, system, motion, upward)
    else:
        portrait(ax, system, motion, (across, upward))
