"""Dense output: the Taylor polynomials of a run's own steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.trajectory import Trajectory

Vector = NDArray[np.float64]


STEPS = 256
"""Steps that are kept in one block of memory."""


@dataclass(frozen=True, eq=False)
class DenseOutput:
    """The solution between the start and the end of a run; a function of time.

    Parameters
    ----------
    begin, begin_low : ndarray, shape (k,)
        Time at which each step begins [s], and what rounding it lost; the end of the run comes last.
    unit : ndarray, shape (k,)
        Unit of time of each step's polynomial [s].
    coefficients : ndarray, shape (k, n, order + 1)
        Taylor coefficients of the states on each step, in its unit.
    start, end : float
        Times between which the solution is known [s].
    """

    begin: Vector
    begin_low: Vector
    unit: Vector
    coefficients: Vector
    start: float
    end: float

    @classmethod
    def of(cls, steps: NDArray[Any], start: float, end: Trajectory) -> DenseOutput:
        """That of a run, from its steps (:func:`henon_ref.integrator.records.step_dtype`), initial time [s] and end.

        Where it ended early, the state is constant from there on.
        """
        rest = np.zeros((1, *steps["coefficients"].shape[1:]))
        rest[0, :, 0] = end.end_state
        return cls(
            begin=np.append(steps["time"], end.end_time),
            begin_low=np.append(steps["time_low"], 0.0),
            unit=np.append(steps["unit"], 1.0),
            coefficients=np.concatenate([steps["coefficients"], rest]),
            start=start,
            end=end.end_time,
        )

    def __call__(self, t: ArrayLike) -> Vector:
        """The state at a time, shape (n,), or at m times, shape (n, m); the one after, where it jumps.

        Raises
        ------
        ArgumentError
            Also a ValueError: for a time outside the run, and for what is no number.
        """
        times = checked_times(t, self.start, self.end)
        flat = np.atleast_1d(times)
        value = self._on(np.maximum(np.searchsorted(self.begin, flat, side="right") - 1, 0), flat)
        return np.ascontiguousarray(value.T) if times.ndim else value[0]

    def before(self, times: Vector) -> Vector:
        """The state just before each of m times at which it jumps, shape (n, m)."""
        return np.ascontiguousarray(self._on(np.maximum(np.searchsorted(self.begin, times) - 1, 0), times).T)

    def _on(self, step: NDArray[np.intp], times: Vector) -> Vector:
        """The states that some steps' polynomials have at some times, shape (m, n)."""
        part = ((times - self.begin[step]) - self.begin_low[step]) / self.unit[step]
        rows = self.coefficients[step]
        value: Vector = rows[:, :, -1]
        for k in range(rows.shape[2] - 2, -1, -1):
            value = value * part[:, None] + rows[:, :, k]
        return value


def checked_times(t: ArrayLike, start: float, end: float) -> Vector:
    """Times of a run as an array of no or one dimension; an ArgumentError for what is none between start and end."""
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
