"""Rootfinding of SUNDIALS' CVODE and IDA, called by scikit-sundae."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import cause, holds

shows = partial(cause, "scikit-sundae")
# SUNDIALS' logger writes its warnings directly to the standard output of the process.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)
ISSUES = "https://github.com/llnl/sundials/issues"


def cvode(rates: Callable[[Any], list[float]], event: Callable[[Any], float], method: str = "BDF") -> Any:
    """Make a CVODE solver at 1e-9 that stops at an event of either direction."""
    from sksundae.cvode import CVODE

    def field(t: float, x: Any, rate: Any) -> None:
        rate[:] = rates(x)

    def events(t: float, x: Any, out: Any) -> None:
        out[0] = event(x)

    return CVODE(field, method=method, rtol=1e-9, atol=1e-9, eventsfn=terminal(events), num_events=1)


def terminal(function: Callable[..., None]) -> Callable[..., None]:
    """Mark an event function as terminal."""
    function.terminal, function.direction = [True], [0]  # type: ignore[attr-defined]
    return function


def ball() -> Any:
    """Make a solver of x'' = -1 that stops at x = 0."""
    return cvode(lambda x: [x[1], -1.0], lambda x: float(x[0]))


@shows("cvode-pair", "CVODE: two roots within one step are not found", f"{ISSUES}/881")
def cvode_pair() -> str:
    """Rootfinding compares signs at the two ends of an internal step. An even number of roots in between leaves no
    trace.
    """
    for method in ("Adams", "BDF"):
        found = cvode(lambda x: [1.0], lambda x: x[0] ** 2 - 0.0025, method).solve([0, 2], np.array([-1.0]))
        holds(found.t_events is None, f"{method} reports a root at {found.t_events}")
        holds(np.abs(found.y[:, 0]).min() > 0.05, f"a step of {method} ends between the roots")
    return "roots at t = 0.95 and 1.05 are reported neither by Adams nor by BDF; the run ends at 2"


@shows("ida-pair", "IDA: two roots within one step are not found", f"{ISSUES}/881")
def ida_pair() -> str:
    """IDA's rootfinding is CVODE's: it compares signs at the two ends of an internal step."""
    from sksundae.ida import IDA

    def residual(t: float, x: Any, rate: Any, out: Any) -> None:
        out[0] = rate[0] - 1.0

    def events(t: float, x: Any, rate: Any, out: Any) -> None:
        out[0] = x[0] ** 2 - 2.5e-7

    solver = IDA(residual, rtol=1e-9, atol=1e-9, eventsfn=terminal(events), num_events=1)
    found = solver.solve([0, 2], np.array([-1.0]), np.array([1.0]))
    holds(found.t_events is None, f"a root is reported at {found.t_events}")
    return "roots at t = 0.9995 and 1.0005 are not reported; the run ends at 2"


@shows("sundials-inactive-zero", "An event function that starts at zero is ignored", f"{ISSUES}/722")
def zero_at_the_start_is_ignored() -> str:
    """An event function that is exactly zero at the start is ignored until it has left zero, so that a restart at a
    root does not find the same root again. A function that is one rounding off zero has its sign.
    """
    end = ball().solve([0, 3], np.array([0.0, 1.0])).t[-1]
    holds(abs(end - 2) < 1e-6, f"it stops at t = {end}")
    return f"thrown up from its surface, a ball comes down at t = {end:.6f}: the zero at the start does not count"


@shows("sundae-stale-events", "Events of earlier runs stay")
def events_of_earlier_runs_stay() -> str:
    """`t_events` of an object keeps the events of earlier runs; only the last row is from the current run. The adapters
    make a new object for every run of a mode.
    """
    solver = ball()
    solver.solve([0, 3], np.array([0.0, 1.0]))
    times = np.ravel(solver.solve([0, 5], np.array([0.0, 2.0])).t_events)
    holds(times.size == 2 and abs(times[0] - 2) < 1e-6 and abs(times[1] - 4) < 1e-6, f"t_events = {times}")
    return f"the second run of one object, which stops at 4, reports t_events = [{times[0]:.6f}, {times[1]:.6f}]"
