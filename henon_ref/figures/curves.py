"""The phase portrait as curves, for whoever draws it elsewhere: those that :mod:`henon_ref.figures.motion` draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import contourpy
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.figures.motion import Motion, axes_of_portrait, limits_around, plane_of, states_in
from henon_ref.modes.system import FilippovSystem

GRID = 121
"""Points a side of the grid on which a surface's curve is looked for."""


@dataclass(frozen=True)
class Curves:
    """A motion in the plane of two states; of a system with one state, that state over time."""

    names: tuple[str, str]
    """What is drawn across and upward; ``t`` is time [s]."""
    limits: tuple[tuple[float, float], tuple[float, float]]
    """(low, high) across and upward."""
    window: tuple[float, float]
    """First and last time [s]."""
    pieces: Sequence[tuple[str, NDArray[np.float64]]]
    """Label (``stick``, ``slip, s = +1``, ...) and points (k, 2) of each piece, in order of time."""
    surfaces: Sequence[NDArray[np.float64]]
    """Points (k, 2) of the surfaces that are curves in this plane."""


def curves_of(system: FilippovSystem, motion: Motion) -> Curves:
    """The curves of a motion's portrait."""
    pair = axes_of_portrait(system)
    x, y = pair or (0, 0)
    across = motion.states[:, x] if pair else motion.times
    points = np.column_stack([across, motion.states[:, y]])
    low_high = (limits_around(points[:, 0]), limits_around(points[:, 1]))
    return Curves(
        (system.states[x].name if pair else "t", system.states[y].name),
        low_high,
        (float(motion.times[0]), float(motion.times[-1])),
        [(label, points[piece]) for label, piece in plane_of(system, x, y).pieces(motion.modes)],
        _surfaces(system, pair, low_high) if pair else [],
    )


def _surfaces(
    system: FilippovSystem, pair: tuple[int, int], limits: Sequence[tuple[float, float]]
) -> list[NDArray[np.float64]]:
    """The curves h = 0 of the surfaces that depend on these two states alone."""
    states = [system.states[k] for k in pair]
    across, upward = (np.linspace(low, high, GRID) for low, high in limits)
    found: list[NDArray[np.float64]] = []
    for k, surface in enumerate(system.surfaces):
        if not states_in(system, k) or not states_in(system, k) <= set(states):
            continue
        h = sp.lambdify(states, system.numeric(surface), np)
        values = np.broadcast_to(np.asarray(h(*np.meshgrid(across, upward)), dtype=float), (GRID, GRID))
        if np.nanmin(values) < 0 < np.nanmax(values):
            generator = contourpy.contour_generator(across, upward, np.ma.masked_invalid(values), name="mpl2014")
            found += [np.asarray(line) for line in generator.lines(0.0)[0]]
    return found
