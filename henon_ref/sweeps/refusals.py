"""Points at which there is no problem to solve: rows of a sweep that say why."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import HenonRefError
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.quick_start import CLEARLY
from henon_ref.simulation.system import System
from henon_ref.sweeps.runs import Settings, Vector

KEPT = 256
"""Conditions that are kept as functions."""


def refusals(
    settings: Settings, columns: Mapping[str, Vector], parameters: Mapping[str, Vector], initial: Vector, times: Vector
) -> NDArray[Any]:
    """Why each of K points has no run, as text; None where it has one.

    What doubles do not clearly allow is read exactly, as :func:`henon_ref.simulate` reads it.

    Parameters
    ----------
    settings : Settings
    columns : mapping
        The points' own values by name, shape (K,).
    parameters : mapping
        Every parameter -> its values, shape (K,).
    initial : ndarray, shape (K, n)
    times : ndarray, shape (K, 2)
        Initial time and horizon [s].
    """
    system = settings.system
    with np.errstate(all="ignore"):
        clear = np.isfinite(initial).all(axis=1) & np.isfinite(times).all(axis=1) & (times[:, 1] > times[:, 0])
        for column in parameters.values():
            clear &= np.isfinite(column)
        for condition in system.conditions:
            names, function = _function(condition)
            clear &= np.asarray(function(*(parameters[name] for name in names))) > CLEARLY
    found = np.full(len(initial), None, dtype=object)
    for k in np.flatnonzero(~clear).tolist():
        values = {name: float(column[k]) for name, column in columns.items()}
        found[k] = exact_refusal(settings, values) or _unclear(system, parameters, initial, times, k)
    return found


@lru_cache(maxsize=KEPT)
def _function(condition: sp.Expr) -> tuple[list[str], Callable[..., Any]]:
    """A condition as a function of arrays, and the parameters that it takes."""
    symbols = sorted(condition.free_symbols, key=lambda s: s.name)
    return [s.name for s in symbols], sp.lambdify(symbols, condition, "numpy")


def exact_refusal(settings: Settings, values: Mapping[str, float]) -> str | None:
    """What is wrong at a point, in the words of a run from Python; None where nothing is."""
    try:
        point_problem(settings, values)
    except HenonRefError as error:
        return str(error)
    return None


def point_problem(settings: Settings, values: Mapping[str, float]) -> Any:
    """The initial-value problem at a point.

    Raises
    ------
    HenonRefError
        Where there is none.
    """
    system = settings.system
    states = {name: value for name, value in values.items() if name in system.state}
    swept = {name: value for name, value in values.items() if name not in states}
    _, problem = problem_of(
        system,
        {**settings.initial, **states},
        until=settings.until,
        start=settings.start,
        parameters=swept,
        mode=settings.mode,
    )
    return problem


def _unclear(system: System, parameters: Mapping[str, Vector], initial: Vector, times: Vector, k: int) -> str | None:
    """What doubles cannot hold of an exact problem; None where they hold it."""
    numbers = {name: values[k] for name, values in parameters.items()} | dict(
        zip(system.state, initial[k], strict=True)
    )
    for name, value in numbers.items():
        if not np.isfinite(value):
            return f"'{name}' is {value} in double precision; a number must be finite"
    start, until = times[k]
    if not until > start:
        return f"the horizon {until:.17g} is not later than the start {start:.17g} in double precision"
    return None
