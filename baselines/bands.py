"""Transitions read off a smooth run afterwards, as a person would: where is the surface near zero, and for how long.

For solvers without modes or events. A surface is *in its band* while abs(h) is below a width tied to the
tolerance. Passing through the band in about the time its own speed takes is a crossing, at the root of h;
staying much longer is a stick, from entering the band to leaving it; touching it is nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.modes.callables import Scalar
from henon_ref.modes.mode import Mode, replaced, transition_kind
from henon_ref.trajectory import Transition

SUBSTEPS = 4
"""Points looked at in each step."""
LINGERS = 3.5
"""A stay in the band this many times longer than passing through it takes, by the slopes at its edges, is a stick.

A root of order p takes p times as long, and a motion passes roots of third order at most but by accident."""

Dense = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""A step's continuous output: k times -> (n, k) states."""


@dataclass(frozen=True)
class _Point:
    """A moment of one surface."""

    t: float
    x: tuple[float, ...]
    slope: float
    """dh/dt there."""


class Band:
    """One surface of a run, fed step by step.

    Parameters
    ----------
    h : Scalar
        ``h(t, *x) -> (value,)``.
    width : float
        Half-width of the band.
    t, x
        Start of the run.
    """

    def __init__(self, h: Scalar, width: float, t: float, x: Sequence[float]) -> None:
        self._h = h
        self._width = width
        value = h(t, *x)[0]
        self._region = self._side(value)
        self._last = (t, value)
        self._entered: _Point | None = None
        self._root: Callable[[], _Point] | None = None
        self.initial = self._region
        """Entry of the mode at the start: a side, or 0 (until the surface first leaves its band for a side)."""
        self._mode = self._region
        self._open = self._region == 0
        if self._open:
            self._entered = _Point(t, tuple(x), 0.0)
        self.changes: list[tuple[float, int, tuple[float, ...]]] = []
        """(time, new entry of the mode, state)."""

    def _side(self, value: float) -> int:
        return 0 if abs(value) <= self._width else 1 if value > 0 else -1

    def step(self, t_old: float, t: float, dense: Dense) -> None:
        """Look at one accepted step.

        One that begins and ends inside the band is taken by its end: with a jumping right-hand side a stick
        is hundreds of thousands of them.
        """
        end = self._h(t, *dense(np.array([t]))[:, 0].tolist())[0]
        if self._region == 0 and abs(end) <= self._width:
            self._check_crossings(t, end, dense)
            return
        times = np.linspace(t_old, t, SUBSTEPS + 1)[1:]
        states = dense(times)
        for time, state in zip(times.tolist(), states.T, strict=True):
            self._check_crossings(time, self._h(time, *state.tolist())[0], dense)

    def _check_crossings(self, t: float, value: float, dense: Dense) -> None:
        t_old, old = self._last
        slope = (value - old) / (t - t_old) if t > t_old else 0.0
        if (old < 0.0) != (value < 0.0) and old != 0.0:
            self._root = partial(self._locate, t_old, t, 0.0, slope, dense)
        for level in self._levels(old, value):
            self._pass(self._locate(t_old, t, level, slope, dense), level, 1 if slope > 0 else -1)
        self._last = (t, value)

    def _levels(self, old: float, value: float) -> list[float]:
        """Edges of the band between two values, in the order they are met."""
        met = [edge for edge in (-self._width, self._width) if min(old, value) < edge <= max(old, value)]
        return met if value > old else met[::-1]

    def _locate(self, t_old: float, t: float, level: float, slope: float, dense: Dense) -> _Point:
        def above(time: float) -> float:
            return self._h(time, *dense(np.array([time]))[:, 0].tolist())[0] - level

        low, high = above(t_old), above(t)
        time = t if low * high > 0.0 else float(brentq(above, t_old, t, xtol=1e-300, rtol=1e-15))
        return _Point(time, tuple(dense(np.array([time]))[:, 0].tolist()), slope)

    def _pass(self, point: _Point, level: float, direction: int) -> None:
        """The surface passes an edge of its band, upwards or downwards."""
        side = 1 if level > 0 else -1
        if direction == side:
            self._leave(point, side)
        else:
            self._entered, self._region = point, 0

    def _leave(self, point: _Point, side: int) -> None:
        entered, self._region = self._entered, side
        if entered is None:
            return
        passing = sum(self._width / abs(p.slope) for p in (entered, point) if p.slope)
        if self._open:
            self._open = False
            if point.t - entered.t <= LINGERS * passing:
                self.initial = self._mode = side
            else:
                self._change(point, side)
        elif point.t - entered.t > LINGERS * passing:
            self._change(entered, 0)
            self._change(point, side)
        elif side != self._mode:
            self._change(self._root() if self._root else point, side)
        self._entered = None

    def _change(self, point: _Point, entry: int) -> None:
        self._mode = entry
        self.changes.append((point.t, entry, point.x))

    def end(self, t: float) -> None:
        """The run ends at t: a surface that has long been in its band sticks."""
        entered = self._entered
        if entered is None or self._open or self._region:
            return
        passing = 2.0 * self._width / abs(entered.slope) if entered.slope else 0.0
        if t - entered.t > LINGERS * passing:
            self._change(entered, 0)


def joined(bands: Sequence[Band]) -> tuple[list[Transition], Mode]:
    """The transitions of all surfaces in order of time, with joint modes, and the last mode."""
    mode: Mode = tuple(band.initial for band in bands)
    changes = sorted((t, i, entry, x) for i, band in enumerate(bands) for t, entry, x in band.changes)
    found: list[Transition] = []
    for t, i, entry, x in changes:
        after = replaced(mode, i, entry)
        found.append(Transition(transition_kind(mode[i], entry), i, mode, after, t, x, landing="band"))
        mode = after
    return found, mode
