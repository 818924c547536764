"""The points of a sweep: values of parameters and initial values, a row a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.sweeps.point_files import Vector, check_size, read_table, written_table
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    import pandas as pd

LONGEST_AXES = 5_000
"""Values of all axes of a grid that a sweep file lists."""
DIRECTION = "direction"
"""Column of a continuation: ``up`` or ``down``."""
OWN_COLUMNS = ("point", "status", DIRECTION)
"""Columns of a sweep's table that no parameter, state or observation may be called after."""


@dataclass(frozen=True)
class Points:
    """Values of parameters and states, a row a run.

    Parameters
    ----------
    names : tuple of str
        Parameters and states, each once.
    values : ndarray, shape (N, k)
    chain : int
        Points in a row that make a chain, of which each starts where the one before it ended; 1: none does.
    labels : mapping
        Further columns of text, each of N entries.
    written : mapping
        The same in the words of a sweep file's ``points``.
    """

    names: tuple[str, ...]
    values: Vector
    chain: int = 1
    labels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    written: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.values)

    def columns(self, rows: slice) -> dict[str, NDArray[Any]]:
        """Columns of some rows, by name."""
        part = self.values[rows]
        own = {name: np.ascontiguousarray(part[:, k]) for k, name in enumerate(self.names)}
        return own | {name: column[rows] for name, column in self.labels.items()}


def grid(axes: Mapping[str, Any]) -> Points:
    """Every combination of some values; the last name changes fastest.

    Parameters
    ----------
    axes : mapping
        Parameter or state -> numbers, or ``{"from": a, "to": b, "count": n}``: n numbers from a to b, both included.

    Raises
    ------
    ArgumentError
        For no name, no value, and a value that is no finite number.

    Examples
    --------
    >>> grid({"F": [1, 2], "x": {"from": 0, "to": 1, "count": 3}}).values.tolist()
    [[1.0, 0.0], [1.0, 0.5], [1.0, 1.0], [2.0, 0.0], [2.0, 0.5], [2.0, 1.0]]
    """
    values = _axes(axes, "grid")
    sizes = [len(v) for v in values.values()]
    total = _product(sizes)
    made, inner = np.empty((total, len(sizes))), total
    for k, (axis, size) in enumerate(zip(values.values(), sizes, strict=True)):
        inner //= size
        made.reshape(-1, size, inner, len(sizes))[..., k] = axis[:, None]
    return Points(tuple(values), made, written=_written_grid(axes, values, made))


def table(source: pd.DataFrame | Mapping[str, Any] | str | Path) -> Points:
    """A row a run: a data frame, columns by name, or a CSV or Parquet file.

    Parameters
    ----------
    source : DataFrame, mapping of str to numbers, str or Path
        Its columns are parameters and states.

    Raises
    ------
    ArgumentError
        For a file that cannot be read, columns of different lengths, and a value that is no finite number.
    """
    if isinstance(source, str | Path):
        source = read_table(Path(source))
    columns = {name: numbers(source[key], f"column '{name}'") for name, key in _named(source, "a table").items()}
    if not columns or len({len(c) for c in columns.values()}) != 1 or not len(next(iter(columns.values()))):
        raise ArgumentError("a table of points needs columns of one length, with a row at least")
    check_size(len(next(iter(columns.values()))), len(columns), "a table of points")
    values = np.column_stack(list(columns.values()))
    return Points(tuple(columns), values, written=written_table(values))


def continuation(
    along: Mapping[str, Any], axes: Mapping[str, Any] | None = None, directions: Sequence[str] = ("up", "down")
) -> Points:
    """Points along a line, each starting in the state in which its neighbour ended: hysteresis shows.

    A point whose neighbour did not end ``ok`` starts at the sweep's initial values. Time begins anew at each point:
    where a system depends on time, choose a whole number of its periods as the horizon.

    Parameters
    ----------
    along : mapping
        One parameter -> its values in order, as in :func:`grid`.
    axes : mapping, optional
        A grid of other parameters and states: a chain for each of its points.
    directions : sequence of str
        ``up``, ``down``, or both: the values in their order, and then back from the last one.

    Raises
    ------
    ArgumentError
        For more or less than one parameter, and what :func:`grid` refuses.

    Examples
    --------
    >>> points = continuation({"F": [1, 2]})
    >>> points.values.ravel().tolist(), points.labels["direction"].tolist(), points.chain
    ([1.0, 2.0, 2.0, 1.0], ['up', 'up', 'down', 'down'], 4)
    """
    line = _axes(along, "along")
    if len(line) != 1:
        raise ArgumentError("a continuation goes along one parameter, as in {'vb': {'from': 0, 'to': 1, 'count': 50}}")
    if not directions or len(set(directions)) != len(directions) or not set(directions) <= {"up", "down"}:
        raise ArgumentError(f"directions are {listed(list(map(str, directions)))}; wanted 'up', 'down', or both")
    ((name, values),) = line.items()
    path = np.concatenate([values if d == "up" else values[::-1] for d in directions])
    others = grid(axes) if axes else Points((), np.empty((1, 0)))
    if name in others.names:
        raise ArgumentError(f"'{name}' stands in 'along' and in the grid")
    check_size(len(path) * len(others), len(others.names) + 1, "a continuation")
    made = np.column_stack([np.repeat(others.values, len(path), axis=0), np.tile(path, len(others))])
    label = np.array([d for d in directions for _ in values], dtype=object)
    written = {"along": {name: _written_axis(next(iter(along.values())), values)}, "directions": list(directions)}
    if axes:
        written["grid"] = others.written.get("grid", {})
    labels = {DIRECTION: np.tile(label, len(others))}
    return Points((*others.names, name), made, len(path), labels, {"continuation": written})


def points_of(given: Any) -> Points:
    """Points from what the argument ``grid`` of a sweep may be: a mapping, a data frame, a file, or points.

    Raises
    ------
    ArgumentError
        For anything else.
    """
    if isinstance(given, Points):
        _check(given)
        return given
    if isinstance(given, Mapping):
        return grid(given)
    if isinstance(given, str | Path) or type(given).__name__ == "DataFrame":
        return table(given)
    raise ArgumentError(
        f"grid is a {type(given).__name__}; wanted a mapping such as {{'vb': [0.1, 0.2]}}, a data frame, the path of a "
        "CSV or Parquet file, or points of henon_ref.points"
    )


def check_names(points: Points, parameters: Sequence[str], states: Sequence[str]) -> None:
    """Check that points are about a system.

    Raises
    ------
    ArgumentError
        For a name that is neither a parameter nor a state, and one that a table of results has for itself.
    """
    for name in points.names:
        known = [*parameters, *states]
        if name not in known:
            raise ArgumentError(
                f"'{name[:60]}' is neither a parameter nor a state{did_you_mean(name, known)}; "
                f"parameters: {listed(parameters)}; states: {listed(states)}"
            )
        if name in OWN_COLUMNS:
            raise ArgumentError(f"'{name}' is a column of the result; call the parameter or state otherwise")


def numbers(given: Any, what: str) -> Vector:
    """Finite numbers as an array of one dimension.

    Raises
    ------
    ArgumentError
        For what is none.
    """
    if isinstance(given, str | bytes | Mapping):
        raise ArgumentError(f"{what} is {str(given)[:60]!r}; wanted a list or array of numbers")
    try:
        array = np.asarray(given if hasattr(given, "__len__") else list(given))
        if array.dtype.kind == "b":
            raise TypeError
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(f"{what} is {str(given)[:60]}; wanted a list or array of numbers") from None
    if values.ndim != 1:
        raise ArgumentError(f"{what} has the shape {values.shape}; wanted a list or array of numbers")
    wrong = np.nonzero(~np.isfinite(values))[0]
    if wrong.size:
        raise ArgumentError(f"{what} holds {values[wrong[0]]} at place {wrong[0] + 1}; a number must be finite")
    return values


def _axes(axes: Mapping[str, Any], what: str) -> dict[str, Vector]:
    if not isinstance(axes, Mapping) or not axes:
        raise ArgumentError(f"'{what}' is {str(axes)[:60]}; wanted a mapping such as {{'vb': [0.1, 0.2]}}")
    named = _named(axes, f"'{what}'")
    total = _product([_size(axes[key], f"'{name}' of '{what}'") for name, key in named.items()])
    check_size(total, len(named), f"'{what}'")
    return {name: _axis(axes[key], f"'{name}' of '{what}'") for name, key in named.items()}


def _named(given: Mapping[Any, Any], what: str) -> dict[str, Any]:
    """Each key as text -> the key."""
    found: dict[str, Any] = {}
    for key in given:
        if str(key) in found:
            raise ArgumentError(f"{what} has '{str(key)[:60]}' twice")
        found[str(key)] = key
    return found


def _size(given: Any, what: str) -> int:
    """How many values an axis has, before any of a range is made."""
    if isinstance(given, Mapping):
        return _count(given, what)
    return len(given) if hasattr(given, "__len__") else 1


def _axis(given: Any, what: str) -> Vector:
    if isinstance(given, Mapping):
        given = _range(given, what)
    values = numbers(given, what)
    if not values.size:
        raise ArgumentError(f"{what} is empty; wanted a number at least")
    return values


def _range(given: Mapping[str, Any], what: str) -> Vector:
    count = _count(given, what)
    first, last = numbers([given["from"], given["to"]], what)
    return np.linspace(first, last, count)


def _count(given: Mapping[str, Any], what: str) -> int:
    if set(given) != {"from", "to", "count"}:
        raise ArgumentError(f"{what} has the keys {listed(list(map(str, given)))}; wanted from, to and count")
    count = given["count"]
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise ArgumentError(f"'count' of {what} is {str(count)[:60]}; wanted a whole number from 1 on")
    return int(count)


def _product(sizes: Sequence[int]) -> int:
    total = 1
    for size in sizes:
        total *= size
    return total


def _written_grid(axes: Mapping[Any, Any], values: Mapping[str, Vector], made: Vector) -> dict[str, Any]:
    given = dict(zip(values, axes.values(), strict=True))
    if sum(len(v) for name, v in values.items() if not isinstance(given[name], Mapping)) > LONGEST_AXES:
        return written_table(made)
    return {"grid": {name: _written_axis(given[name], values[name]) for name in values}}


def _written_axis(given: Any, values: Vector) -> Any:
    if isinstance(given, Mapping):
        return {**{key: float(given[key]) for key in ("from", "to")}, "count": int(given["count"])}
    return values.tolist()


def _check(points: Points) -> None:
    """Check points that somebody has put together.

    Raises
    ------
    ArgumentError
        For what does not fit together, and numbers that are not finite.
    """
    values, names = points.values, points.names
    if not isinstance(values, np.ndarray) or values.dtype != np.float64 or values.ndim != 2 or not len(values):
        raise ArgumentError("the values of points must be an array of doubles, of shape (points, names)")
    if values.shape[1] != len(names) or len(set(names)) != len(names):
        raise ArgumentError(f"points have {values.shape[1]} columns and the names {listed(names)}; wanted one each")
    if points.chain < 1 or len(values) % points.chain or any(len(own) != len(values) for own in points.labels.values()):
        raise ArgumentError("chains and labels of points must be as long as the points are")
    check_size(len(values), len(names), "'points'")
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        k, i = wrong[0].tolist()
        raise ArgumentError(f"'{names[i]}' is {values[k, i]} at point {k}; a number must be finite")
