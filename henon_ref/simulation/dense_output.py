"""Dense output from the Taylor polynomials of a run's steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.trajectory import Trajectory

Vector = NDArray[np.float64]


class DenseOutput:
    """Solution of a run as a function of time.

    Attributes
    ----------
    begin, begin_low : ndarray, shape (k,)
        Start time of each step [s], a pair of doubles whose sum it is; the last entry is the end of the run.
    unit : ndarray, shape (k,)
        Unit of time of each step's polynomial [s].
    coefficients : ndarray, shape (k, n, order + 1)
        Taylor coefficients of the states on each step, in this unit.
    start, end : float
        Interval of the solution [s].
    """

    def __init__(self, steps: NDArray[Any], start: float, end: Trajectory) -> None:
        """``steps``: as :func:`henon_ref.integrator.records.step_dtype`; ``start``: initial time [s]."""
        rest = np.zeros((1, *steps["coefficients"].shape[1:]))
        rest[0, :, 0] = end.end_state  # constant after an early end
        self.begin, self.begin_low = np.append(steps["time"], end.end_time), np.append(steps["time_low"], 0.0)
        self.unit = np.append(steps["unit"], 1.0)
        self.coefficients = np.concatenate([steps["coefficients"], rest])
        self.start, self.end = start, end.end_time

    def __call__(self, t: ArrayLike) -> Vector:
        """Return the state at a time, shape (n,), or at m times, shape (n, m); at a jump, the state after it.

        Raises
        ------
        ArgumentError
            Also a ValueError, if a time lies outside the run or is not a number.
        """
        times = checked_times(t, self.start, self.end)
        flat = np.atleast_1d(times)
        value = self._on(np.maximum(np.searchsorted(self.begin, flat, side="right") - 1, 0), flat)
        return np.ascontiguousarray(value.T) if times.ndim else value[0]

    def before(self, times: Vector) -> Vector:
        """Return the state just before each of m jumps, at their times, shape (n, m)."""
        return np.ascontiguousarray(self._on(np.maximum(np.searchsorted(self.begin, times) - 1, 0), times).T)

    def _on(self, step: NDArray[np.intp], times: Vector) -> Vector:
        """Evaluate the polynomial of ``step[i]`` at ``times[i]``, shape (m, n)."""
        part = ((times - self.begin[step]) - self.begin_low[step]) / self.unit[step]
        rows = self.coefficients[step]
        value: Vector = rows[:, :, -1]
        for k in range(rows.shape[2] - 2, -1, -1):
            value = value * part[:, None] + rows[:, :, k]
        return value


def checked_times(t: ArrayLike, start: float, end: float) -> Vector:
    """Return times as an array of zero or one dimension; ArgumentError unless all lie between start and end."""
    try:
        times = np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"t is {str(t)[:60]}; wanted a time, or a list or array of times") from None
    if times.ndim > 1:
        raise ArgumentError(f"t has the shape {times.shape}; wanted a time, or a list or array of times")
    outside = times[~((times >= start) & (times <= end))]
    if outside.size:
        raise ArgumentError(
            f"t = {outside.flat[0]:.17g} is not between the ends of the run, {start:.17g} and {end:.17g}"
        )
    return times
