"""What a solver hands back, checked in the worker: what breaks the contract is its own failed row.

What passes is made of built-in types (:mod:`henon_ref.harness.campaign.contract_values`); the rest of the package
relies on.
"""

from __future__ import annotations

import math
import sys

from henon_ref.errors import ContractError
from henon_ref.harness.campaign.contract_values import Converter, shown, wrong
from henon_ref.modes.problem import Problem
from henon_ref.text import short_line
from henon_ref.trajectory import Status, Trajectory

ENDS: tuple[Status, ...] = ("ok", "diverged", "nonunique", "invalid", "timeout", "failed")
"""Statuses that a run may end with."""
ROUNDINGS = 64
"""So many roundings of the largest time of a problem are granted to times; ``time_low`` is no more than that."""
ADDED_UP = 1e-9
"""So much of the run is granted to times that a solver adds up from its steps."""


def check_prepared(run: object, *, landing: object, version: object) -> tuple[str, str]:
    """Refuse a run that cannot be called, and words that are none.

    Returns
    -------
    tuple of str
        Landing and version, each in one line.

    Raises
    ------
    ContractError
    """
    if not callable(run):
        raise ContractError(f"the solver's prepare() returned {shown(run)}, wanted a function that runs it")
    return _word("landing", landing), _word("version", version)


def _word(what: str, value: object) -> str:
    if not isinstance(value, str):
        raise ContractError(f"the solver's {what} is {shown(value)}, wanted a str")
    return short_line(value)


def check_trajectory(returned: object, problem: Problem, *, most: int) -> Trajectory:
    """What a run returned, in built-in types; samples, which no run that is scored was asked for, left out.

    Parameters
    ----------
    returned : object
    problem : Problem
        What was run.
    most : int
        Transitions that it may have.

    Raises
    ------
    ContractError
        Where it is no trajectory that can be scored.
    """
    if not isinstance(returned, Trajectory):
        raise ContractError(f"the solver returned {shown(returned)}, wanted a Trajectory")
    given, convert = Trajectory._make(returned), Converter(problem.system)
    checked = Trajectory(
        status=convert.word("status", given.status, ENDS),
        transitions=convert.transitions(given.transitions, most),
        end_time=convert.time("end_time", given.end_time),
        end_state=convert.state("end_state", given.end_state),
        end_mode=convert.mode("end_mode", given.end_mode),
        reason=convert.text("reason", given.reason),
        counts=convert.counts(given.counts),
        max_surface_drift=convert.size("max_surface_drift", given.max_surface_drift),
        undecided_after=convert.undecided_after(given.undecided_after),
    )
    _check_times(checked, problem)
    if checked.status == "ok":
        _check_finite(checked)
    return checked


def _check_times(run: Trajectory, problem: Problem) -> None:
    """Refuse times outside of the problem's, out of order, or in the wrong part of a compensated time."""
    start, until = float(problem.start), float(problem.until)
    rounding = ROUNDINGS * sys.float_info.epsilon * max(abs(start), abs(until))
    slack = max(rounding, ADDED_UP * (until - start))
    between = f"a time from {start:.17g} to {until:.17g}"
    latest = start
    for k, event in enumerate(run.transitions):
        if not start - slack <= event.time <= until + slack:
            raise wrong(f"transitions[{k}].time", event.time, between)
        if abs(event.time_low) > rounding:
            raise wrong(f"transitions[{k}].time_low", event.time_low, f"what rounding lost, at most {rounding:.1e}")
        if event.time < latest - slack:
            raise wrong(f"transitions[{k}].time", event.time, f"one not before {latest!r}, the latest so far")
        latest = max(latest, event.time)
    if not start - slack <= run.end_time <= until + slack:
        raise wrong("end_time", run.end_time, between)
    if run.status == "ok" and run.end_time < until - slack:
        raise wrong("end_time", run.end_time, f"the horizon, {until:.17g}, where the status is ok")


def _check_finite(run: Trajectory) -> None:
    """Refuse states that are not finite."""
    states = [(f"transitions[{k}].state", event.state) for k, event in enumerate(run.transitions)]
    for what, state in [*states, ("end_state", run.end_state)]:
        if not all(map(math.isfinite, state)):
            raise wrong(what, state, "finite numbers where the status is ok")
