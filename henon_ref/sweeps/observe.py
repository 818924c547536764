"""What a sweep may observe of its runs: ``henon_ref.observe``.

Each function makes an observation for :func:`henon_ref.sweep`; a sweep file names them, with the same arguments. A
column holds NaN (of text: None) where there is nothing to tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from henon_ref.errors import ArgumentError
from henon_ref.simulation.arguments import whole_number
from henon_ref.simulation.calls import explained
from henon_ref.simulation.solution import Solution
from henon_ref.sweeps.extremes import Extremes
from henon_ref.sweeps.observations import (
    DIRECTIONS,
    Ending,
    FinalState,
    Observation,
    Period,
    SectionPoints,
    Sticks,
)
from henon_ref.sweeps.run_by_run import VALUE, Function, Lyapunov
from henon_ref.text import listed

LONGEST_NAME = 60
"""Characters of a name: a table's is that of a folder."""
MOST_RETURNS = 10_000
"""Returns to a section that a period may have."""


@explained
def sticks(after: float = 0, surface: str | None = None, each: bool = False) -> Observation:
    """Whole sticks that do not end before a time, as ``measure: {after: T}`` of a case file counts them.

    Columns ``stick_count`` and ``last_stick_duration`` [s], that of the one that ends last.

    Parameters
    ----------
    after : float
        [s]
    surface : str, optional
        Sticks on this surface only; on all if left out.
    each : bool
        A table ``sticks`` besides: a row a stick, with ``point, start_s, duration_s, surface``.
    """
    return Sticks(_number(after, "after"), None if surface is None else _text(surface, "surface"), _flag(each, "each"))


@explained
def final_state() -> Observation:
    """Where each run ended: columns ``final_x`` for each state ``x``, and ``final_mode`` as text (``s1=-1 s2=0``)."""
    return FinalState()


@explained
def status() -> Observation:
    """How each run ended: columns ``end_time`` [s], ``message``, and the numbers of steps and evaluations.

    The column ``status`` is there in any case.
    """
    return Ending()


@explained
def section(
    of: str, after: float = 0, direction: str = "both", most: int | None = None, name: str = "section"
) -> Observation:
    """Points of a Poincaré section: a table with ``point, time_s`` and the states by name.

    Parameters
    ----------
    of : str
        The name of a surface, or an expression in time, states and parameters: the section is where it is zero. It is
        located as exactly as an event. (On a surface, a transition into sticking reaches it, and leaving does not.)
        By the name of a kink, where another branch hides it, there is none; by its expression there is.
    after : float
        Points before this time are left out [s].
    direction : str
        ``rising``, ``falling`` or ``both``.
    most : int, optional
        Points of each run, the first ones.
    name : str
        The table's.
    """
    points = None if most is None else whole_number(most, "most")
    return SectionPoints(_text(of, "of"), _number(after, "after"), _direction(direction), points, _name(name))


@explained
def period(
    of: str, after: float = 0, direction: str = "rising", tolerance: float = 1e-6, most: int = 16
) -> Observation:
    """The period by returning to a section: columns ``period`` [s] and ``period_returns``.

    The least number p of returns after which the last p section points repeat the p points before them.

    Parameters
    ----------
    of, after, direction
        As in :func:`section`.
    tolerance : float
        Largest difference of a state, relative to the largest one.
    most : int
        The largest p that is tried.
    """
    if not 0 < _number(tolerance, "tolerance") < 1:
        raise ArgumentError(f"tolerance is {tolerance}; wanted a number between 0 and 1")
    returns = whole_number(most, "most", most=MOST_RETURNS)
    return Period(_text(of, "of"), _number(after, "after"), _direction(direction), float(tolerance), returns)


@explained
def extremes(of: str, after: float | None = None, name: str | None = None) -> Observation:
    """The least and the largest value of an expression: columns ``min_NAME`` and ``max_NAME``.

    Parameters
    ----------
    of : str
        An expression in time, states and parameters.
    after : float, optional
        Only from this time on [s].
    name : str, optional
        The expression itself if left out.
    """
    since = None if after is None else _number(after, "after")
    return Extremes(_text(of, "of"), since, None if name is None else _name(name))


@explained
def lyapunov(span: float, discard: float = 0) -> Observation:
    """The largest Lyapunov exponent [1/s]: column ``lyapunov`` (see :func:`henon_ref.lyapunov_exponents`).

    Each run is simulated by itself, with its variational equations: some milliseconds a run.

    Parameters
    ----------
    span : float
        Time to average over [s].
    discard : float
        Time before that [s].
    """
    if _number(span, "span") <= 0 or _number(discard, "discard") < 0:
        raise ArgumentError("span must be larger than 0, and discard not below it")
    return Lyapunov(float(span), float(discard))


@explained
def function(of: Callable[[Solution], Any], name: str = VALUE, dense_output: bool = False) -> Observation:
    """A function on each run (a Solution), which the worker calls.

    Its columns, and whether they hold numbers or text, are those of its first values, so that it is called at the first
    point before the sweep as well. Later values have the same keys, or fewer: what is missing, and None, is NaN (of
    text: None).

    Parameters
    ----------
    of : callable
        Takes a :class:`henon_ref.simulation.solution.Solution`, and returns a number or text, the column ``name``, or a
        mapping of such, a column each.
    name : str
        The column's.
    dense_output : bool
        Whether the solution has its ``sol``.
    """
    if not callable(of):
        raise ArgumentError(f"of is {str(of)[:60]}; wanted a function of a solution")
    return Function(of, _name(name), _flag(dense_output, "dense_output"))


KINDS: dict[str, Callable[..., Observation]] = {
    "sticks": sticks,
    "final_state": final_state,
    "section": section,
    "period": period,
    "extremes": extremes,
    "lyapunov": lyapunov,
    "status": status,
}
"""Observations that a sweep file may name. (A function cannot stand in a file.)"""


def _number(value: Any, what: str) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted a finite number")
    return number


def _text(value: Any, what: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ArgumentError(f"{what} is {str(value)[:60]!r}; wanted text")
    return value


def _flag(value: Any, what: str) -> bool:
    if not isinstance(value, bool):
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted true or false")
    return value


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value.isidentifier() or len(value) > LONGEST_NAME:
        raise ArgumentError(
            f"name is {str(value)[:60]!r}; wanted letters, digits and underscores, {LONGEST_NAME} at most"
        )
    return value


def _direction(value: Any) -> str:
    if value not in DIRECTIONS:
        raise ArgumentError(f"direction is {str(value)[:60]!r}; wanted one of {listed(list(DIRECTIONS))}")
    return str(value)
