"""What CVODE and IDA share: event functions, and reading scikit-sundae's results."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from math import isfinite
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from baselines.callbacks import LastSeen
from baselines.flow import Stop
from baselines.mode_functions import EPSILON
from baselines.restart import STOPPED, Watcher

# SUNDIALS' own logger writes its warnings ("t + h = t") to the standard output of the process, past Python.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)

LEAST_RTOL = 1e-15
"""scikit-sundae's documentation asks for no smaller ``rtol``."""
STEPS_BETWEEN_OUTPUTS = 1_000_000
"""``max_num_steps``: counts between outputs only, so it bounds nothing here; the deadline does."""


@dataclass(frozen=True)
class SundialsLibrary:
    """What is the same of CVODE and IDA as the driver sees them; each adds its ``flow``."""

    solver: Any
    make: Callable[..., Any]
    """The class of scikit-sundae."""
    rtol: float
    atol: float

    @property
    def landing(self) -> str:
        return str(self.solver.landing)

    @property
    def accuracy(self) -> tuple[float, float]:
        return self.rtol, self.atol

    @property
    def errors(self) -> tuple[float, float]:
        return STOPPED * self.rtol, STOPPED * self.atol

    def loosened(self) -> Self:
        return replace(self, rtol=max(self.rtol, 1e-6), atol=max(self.atol, 1e-6))

    def location_error(self, t: float) -> float:
        """SUNDIALS locates a root to ``100 eps (abs(t) + abs(h))``; the step h is not known here."""
        return 100.0 * EPSILON * abs(t)


def sundae_version() -> str:
    """scikit-sundae's version, empty where it is not installed."""
    try:
        return metadata.version("scikit-sundae")
    except metadata.PackageNotFoundError:
        return ""


def event_function(watchers: Sequence[Watcher], last: LastSeen, direction: int) -> Callable[..., None]:
    """``eventsfn(t, x, out)``: the guards, then the guard against divergence, all terminal."""
    count = len(watchers)

    def eventsfn(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        for k, watcher in enumerate(watchers):
            out[k] = watcher(t, x)
        out[count] = last.value(t, x)

    _mark(eventsfn, count, direction)
    return eventsfn


def event_function_of_dae(watchers: Sequence[Watcher], last: LastSeen, direction: int) -> Callable[..., None]:
    """``eventsfn(t, y, yp, out)``, for IDA."""
    count = len(watchers)

    def eventsfn(t: float, y: NDArray[np.float64], yp: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        for k, watcher in enumerate(watchers):
            out[k] = watcher(t, y)
        out[count] = last.value(t, y)

    _mark(eventsfn, len(watchers), direction)
    return eventsfn


def _mark(eventsfn: Callable[..., None], count: int, direction: int) -> None:
    # scikit-sundae reads both off the function.
    eventsfn.terminal = [True] * (count + 1)  # type: ignore[attr-defined]
    eventsfn.direction = [direction] * count + [-1]  # type: ignore[attr-defined]


def stopped(result: Any, states: int, until: float, said: str, last: LastSeen) -> Stop:
    """A :class:`~baselines.flow.Stop` from a result of ``solve``.

    Parameters
    ----------
    result : CVODEResult or IDAResult
    states : int
        Unknowns beyond these (IDA's algebraic ones) are left out.
    until : float
        Horizon.
    said : str
        What the library wrote while it ran.
    last : LastSeen
        The last finite point.
    """
    t, x = float(result.t[-1]), tuple(result.y[-1, :states].tolist())
    if not result.success:
        return Stop("failed", t, 0.0, x, reason=" ".join([result.message, *said.split()]))
    if not all(map(isfinite, x)):
        return Stop("failed", last.t, 0.0, last.x, reason=f"the state is not finite after t = {last.t:.17g}")
    if result.t_events is None:
        return Stop("horizon", until, 0.0, x)
    # The last row: the object is new for every run of a mode, but a reader of this line should not have to know.
    found = np.flatnonzero(result.i_events[-1])
    hits = tuple(int(k) for k in found if k < result.i_events.shape[1] - 1)
    return Stop("event" if hits else "diverged", t, 0.0, x, hits)


def sampled(solve: Callable[..., Any], wanted: NDArray[np.float64], t: float, end: float, states: int) -> NDArray[Any]:
    """States at the wanted times up to ``end``, by a second pass without events.

    Parameters
    ----------
    solve : callable
        ``solve(times)`` -> result, from the start of the mode.
    """
    times = wanted[(wanted <= end) & (wanted > t)]
    if not times.size:
        return np.empty((0, states))
    rows = solve(np.concatenate([[t], times])).y[:, :states]
    # Two times make scikit-sundae return every internal step, the last of which is the one asked for.
    found = rows[-1:] if times.size == 1 else rows[1:]
    full = np.full((times.size, states), np.nan)
    full[: len(found)] = found
    return full
