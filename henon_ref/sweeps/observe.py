"""Observations of the runs of a sweep: ``henon_ref.observe``.

Each function returns an observation for :func:`henon_ref.sweep`; a sweep file uses the same names and arguments. A
column has NaN (text: None) for a run without a value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from henon_ref.errors import ArgumentError
from henon_ref.simulation.arguments import whole_number
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
from henon_ref.system.python_arguments import explained
from henon_ref.text import listed


@explained
def sticks(after: float = 0, surface: str | None = None, each: bool = False) -> Observation:
    """Complete sticks that do not end before a time, counted as by ``measure: {after: T}`` of a case file.

    Columns: ``stick_count``, and ``last_stick_duration`` [s] of the stick that ends last.

    Parameters
    ----------
    after : float
        Earliest end of a stick [s].
    surface : str, optional
        Surface of the sticks; None: all surfaces.
    each : bool
        Whether to add a table ``sticks`` with one row for each stick: ``point, start_s, duration_s, surface``.
    """
    return Sticks(_number(after, "after"), None if surface is None else _text(surface, "surface"), _flag(each, "each"))


@explained
def final_state() -> Observation:
    """Final state of a run: columns ``final_x`` for each state ``x``, and ``final_mode`` as text (``s1=-1 s2=0``)."""
    return FinalState()


@explained
def status() -> Observation:
    """End of each run: columns ``end_time`` [s], ``message``, and the numbers of steps and evaluations.

    The column ``status`` is part of every sweep.
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
        Name of a surface, or an expression in time, states and parameters; the section is its zero set, located as
        exactly as an event. On a surface, a transition into sticking is a section point, leaving it is not, and a jump
        of the state is one, with the state after it. A section given by the name of a kink omits the crossings hidden
        by another branch; one given by its expression has them.
    after : float
        Earliest time of a point [s].
    direction : str
        ``rising``, ``falling`` or ``both``.
    most : int, optional
        Largest number of points of a run; the first ones are kept.
    name : str
        Name of the table.
    """
    points = None if most is None else whole_number(most, "most")
    return SectionPoints(_text(of, "of"), _number(after, "after"), _direction(direction), points, _name(name))


@explained
def period(
    of: str, after: float = 0, direction: str = "rising", tolerance: float = 1e-6, most: int = 16
) -> Observation:
    """Period of the motion by its returns to a section: columns ``period`` [s] and ``period_returns``.

    ``period_returns`` is the least number p for which the last p section points repeat the p points before them.

    Parameters
    ----------
    of, after, direction
        As in :func:`section`.
    tolerance : float
        Largest difference of a state, relative to the largest state.
    most : int
        Largest p that is tried, up to 10,000.
    """
    if not 0 < _number(tolerance, "tolerance") < 1:
        raise ArgumentError(f"tolerance is {tolerance}; wanted a number between 0 and 1")
    returns = whole_number(most, "most", most=10_000)
    return Period(_text(of, "of"), _number(after, "after"), _direction(direction), float(tolerance), returns)


@explained
def extremes(of: str, after: float | None = None, name: str | None = None) -> Observation:
    """Minimum and maximum of an expression: columns ``min_NAME`` and ``max_NAME``; NaN if the steps take over 2 GiB.

    Both are values of the expression on the run's dense output, or at a state between two jumps at one instant. On a
    step the expression is represented by its Taylor polynomial, which is exact if the expression is linear in time and
    states. Otherwise its error is estimated, from its last two terms and from the values at the middle and the end of
    the step, and steps with a large error are halved. A peak much narrower than a step that shows in none of these is
    missed: with x moving from 1 to -1, the maximum 1 of ``exp(-(1000*(x - 0.3))^2)``.

    Parameters
    ----------
    of : str
        Expression in time, states and parameters.
    after : float, optional
        Start of the time interval [s]; None: start of the run.
    name : str, optional
        NAME in the columns; None: the expression.
    """
    since = None if after is None else _number(after, "after")
    return Extremes(_text(of, "of"), since, None if name is None else _name(name))


@explained
def lyapunov(span: float, discard: float = 0) -> Observation:
    """Largest Lyapunov exponent [1/s]: column ``lyapunov`` (see :func:`henon_ref.lyapunov_exponents`).

    Each run is simulated by itself with its variational equations, which takes some milliseconds.

    Parameters
    ----------
    span : float
        Averaging time [s].
    discard : float
        Time before the averaging [s].
    """
    if _number(span, "span") <= 0 or _number(discard, "discard") < 0:
        raise ArgumentError("span must be larger than 0, and discard 0 or larger")
    return Lyapunov(float(span), float(discard))


@explained
def function(of: Callable[[Solution], Any], name: str = VALUE, dense_output: bool = False) -> Observation:
    """Function of each run (a Solution), which the worker calls.

    Its columns, and whether they hold numbers or text, follow from its first values; the function is therefore also
    called at the first point before the sweep. Later values have the same keys or fewer: a missing key and None become
    NaN (text: None).

    Parameters
    ----------
    of : callable
        Takes a :class:`henon_ref.simulation.solution.Solution`; returns a number or text (column ``name``), or a
        mapping of numbers and texts (one column for each key).
    name : str
        Name of the column.
    dense_output : bool
        Whether the solution has ``sol``.
    """
    if not callable(of):
        raise ArgumentError(f"of is {str(of)[:60]}; wanted a function of a solution")
    return Function(of, _name(name), _flag(dense_output, "dense_output"))


KINDS: dict[str, Callable[..., Observation]] = {
    make.__name__: make for make in (sticks, final_state, section, period, extremes, lyapunov, status)
}
"""Name in a sweep file -> function that makes the observation. (Functions of the user cannot be in a file.)"""


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
    if not isinstance(value, str) or not value.isidentifier() or len(value) > 60:  # a table's name is that of a folder
        raise ArgumentError(f"name is {str(value)[:60]!r}; wanted letters, digits and underscores, 60 at most")
    return value


def _direction(value: Any) -> str:
    if not isinstance(value, str) or value not in DIRECTIONS:
        raise ArgumentError(f"direction is {str(value)[:60]!r}; wanted one of {listed(list(DIRECTIONS))}")
    return str(value)
