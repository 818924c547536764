"""Points at which there is no problem to solve: rows of a sweep that say why."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import HenonRefError
from henon_ref.modes.system import FilippovSystem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.quick_start import CLEARLY
from henon_ref.simulation.system import System
from henon_ref.sweeps.runs import Settings, Vector
from henon_ref.taylor.tape import TIME

KEPT = 256
"""Expressions that are kept as functions."""
NO_KINKS = frozenset[int]()


def refusals(
    settings: Settings, columns: Mapping[str, Vector], parameters: Mapping[str, Vector], initial: Vector, times: Vector
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Why each of K points has no run, as text (None where it has one), and its open kinks.

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

    Returns
    -------
    reasons : ndarray of str or None, shape (K,)
    open_kinks : ndarray of frozenset, shape (K,)
        See :class:`henon_ref.modes.system.FilippovSystem`.
    """
    system = settings.system
    with np.errstate(all="ignore"):
        clear = np.isfinite(initial).all(axis=1) & np.isfinite(times).all(axis=1) & (times[:, 1] > times[:, 0])
        for column in parameters.values():
            clear &= np.isfinite(column)
        for condition in system.conditions:
            clear &= _values(condition, parameters, len(initial)) > CLEARLY
        clear &= ~_has_open_kinks(system.model, parameters, initial, times)
    reasons, open_kinks = np.full(len(initial), None, dtype=object), np.full(len(initial), NO_KINKS, dtype=object)
    for k in np.flatnonzero(~clear).tolist():
        values = {name: float(column[k]) for name, column in columns.items()}
        try:
            open_kinks[k] = point_problem(settings, values).system.open_kinks
            reasons[k] = _unclear(system, parameters, initial, times, k)
        except HenonRefError as error:
            reasons[k] = str(error)
    return reasons, open_kinks


def _has_open_kinks(
    model: FilippovSystem, parameters: Mapping[str, Vector], initial: Vector, times: Vector
) -> NDArray[np.bool_]:
    """Whether a kink has no value at a start, in a mode of which it is not known that it does without."""
    found = np.zeros(len(initial), dtype=np.bool_)
    if not model.kinks:
        return found
    point = {**parameters, TIME.name: times[:, 0], **dict(zip(model.state_names, initial.T, strict=True))}
    values = np.array([_values(h, point, len(initial)) for h in model.surfaces])
    without, signs = ~np.isfinite(values), np.sign(values)
    for i in model.kinks:
        for power in model.surfaces[i].atoms(sp.Pow):
            if not power.exp.is_Integer:  # the end of the range where it has a value
                without[i] |= _values(power.base, point, len(initial)) == 0.0
    modes, places = np.unique(np.where(without, 1.0, signs)[:, without.any(axis=0)], axis=1, return_inverse=True)
    for k, mode in enumerate(modes.T.astype(int).tolist()):
        used = [i not in model.unused_kinks(tuple(mode)) for i in range(len(mode))]
        own = np.flatnonzero(without.any(axis=0))[places.ravel() == k]
        found[own] = without[:, own][used].any(axis=0)
    return found


def _values(expression: sp.Expr, point: Mapping[str, Vector], count: int) -> Vector:
    """An expression at many points: NaN where it has no value."""
    names, function = _function(expression)
    return np.broadcast_to(np.asarray(function(*(point[name] for name in names)), dtype=np.float64), count)


@lru_cache(maxsize=KEPT)
def _function(expression: sp.Expr) -> tuple[list[str], Callable[..., Any]]:
    """An expression as a function of arrays, and the names that it takes."""
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    return [s.name for s in symbols], sp.lambdify(symbols, expression, "numpy")


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
