"""Points of a sweep, ``henon_ref.points``: values of parameters and initial values, one row for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.simulation.arguments import numbers, whole_number
from henon_ref.simulation.system import System
from henon_ref.sweeps.table_files import MOST_NUMBERS, Vector, check_size, read_table
from henon_ref.system.python_arguments import explained
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Points", "continuation", "grid", "random", "table"]

OWN_COLUMNS = ("point", "status", "direction")
"""Columns of the table of a sweep (the last of continuations only); no parameter, state or observation is named so."""
DISTRIBUTIONS = {"uniform": "its least and largest value", "normal": "its mean and standard deviation"}
"""Distribution -> meaning of its two numbers."""


@dataclass(frozen=True)
class Points:
    """Values of parameters and states, shape (N, names): one row for each run."""

    names: tuple[str, ...]
    """Names of parameters and states, each once."""
    values: Vector
    chain: int = 1
    """Number of consecutive points in a chain, each starting in the final state of the previous one; 1: none."""
    labels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """Additional columns of text, with N entries each."""
    written: Mapping[str, Any] = field(default_factory=dict)
    """``points`` as in a sweep file; if empty, the file refers to a table of the values."""

    def __len__(self) -> int:
        return len(self.values)

    def columns(self, rows: slice) -> dict[str, NDArray[Any]]:
        part = self.values[rows]
        own = {name: np.ascontiguousarray(part[:, k]) for k, name in enumerate(self.names)}
        return own | {name: column[rows] for name, column in self.labels.items()}


@explained
def grid(axes: Mapping[str, Any]) -> Points:
    """Every combination of values; the last name changes fastest.

    Parameters
    ----------
    axes : mapping
        Parameter or state -> numbers, or ``{"from": a, "to": b, "count": n}``: n numbers from a to b, both included.

    Raises
    ------
    ArgumentError
        If there is no name or no value, or a value is not a finite number.

    Examples
    --------
    >>> grid({"F": [1, 2], "x": {"from": 0, "to": 1, "count": 3}}).values.tolist()
    [[1.0, 0.0], [1.0, 0.5], [1.0, 1.0], [2.0, 0.0], [2.0, 0.5], [2.0, 1.0]]
    """
    values = values_of(axes, "grid")
    written = _written(axes, values)
    is_short = sum(len(own) for own in written.values() if isinstance(own, list)) <= 5_000  # else a table is written
    return Points(tuple(values), _combined(values), written={"grid": written} if is_short else {})


@explained
def table(source: pd.DataFrame | Mapping[str, Any] | str | Path) -> Points:
    """Points from a table with one row for each run: a data frame, columns by name, or a CSV or Parquet file.

    Parameters
    ----------
    source : DataFrame, mapping of str to numbers, str or Path
        Its columns are parameters and states.

    Raises
    ------
    ArgumentError
        If a file cannot be read, columns differ in length, or a value is not a finite number.
    """
    if isinstance(source, str | Path):
        source = read_table(Path(source))
    if not isinstance(source, Mapping) and not hasattr(source, "columns"):
        raise ArgumentError(f"a table is a {type(source).__name__}; wanted a data frame, columns by name, or a file")
    columns = {name: numbers(source[key], f"column '{name}'") for name, key in _named(source, "a table").items()}
    lengths = {len(column) for column in columns.values()}
    if len(lengths) != 1 or 0 in lengths:
        raise ArgumentError("a table of points needs columns of equal length, with at least one row")
    check_size(max(lengths), len(columns), "a table of points")
    return Points(tuple(columns), np.column_stack(list(columns.values())))


@explained
def continuation(
    along: Mapping[str, Any], axes: Mapping[str, Any] | None = None, directions: Sequence[str] = ("up", "down")
) -> Points:
    """Points along a line, each starting in the final state of its neighbour, so that hysteresis becomes visible.

    A contact that holds there (a stick, a rest on a stop) begins on its surface, if that is where it was. A point whose
    neighbour did not end ``ok`` starts at the sweep's initial values. Time starts anew at each point: for
    a time-dependent system, choose a whole number of periods as the horizon.

    Parameters
    ----------
    along : mapping
        One parameter -> its values in order, as in :func:`grid`.
    axes : mapping, optional
        Grid of other parameters and states, with one chain for each of its points.
    directions : sequence or array of str
        ``up``, ``down``, or both: the values in their order, then in reverse.

    Raises
    ------
    ArgumentError
        If ``along`` does not have exactly one parameter, or :func:`grid` would refuse the values.

    Examples
    --------
    >>> points = continuation({"F": [1, 2]})
    >>> points.values.ravel().tolist(), points.labels["direction"].tolist(), points.chain
    ([1.0, 2.0, 2.0, 1.0], ['up', 'up', 'down', 'down'], 4)
    """
    line = values_of(along, "along")
    if len(line) != 1:
        raise ArgumentError("'along' must have one parameter, as in {'vb': {'from': 0, 'to': 1, 'count': 50}}")
    ways = [] if isinstance(directions, str) else [str(way) for way in np.array(directions, dtype=object).ravel()]
    if not ways or len(set(ways)) != len(ways) or not set(ways) <= {"up", "down"}:
        raise ArgumentError(f"'directions' is {directions!r:.60}; wanted a list of 'up', 'down', or both")
    ((name, values),) = line.items()
    path = np.concatenate([values if way == "up" else values[::-1] for way in ways])
    across = {} if axes is None or (isinstance(axes, Mapping) and not axes) else values_of(axes, "axes")
    if name in across:
        raise ArgumentError(f"'{name}' is the parameter of 'along' and also an axis of its grid; leave one out")
    chains = prod(map(len, across.values()))
    check_size(len(path) * chains, len(across) + 1, "a continuation")
    made = np.column_stack([np.repeat(_combined(across), len(path), axis=0), np.tile(path, chains)])
    labels = {"direction": np.tile(np.array([way for way in ways for _ in values], dtype=object), chains)}
    grid = {"grid": _written(axes, across)} if axes else {}
    written = {"along": _written(along, line), "directions": ways, **grid}
    return Points((*across, name), made, len(path), labels, {"continuation": written})


@explained
def random(draws: Mapping[str, Any], *, count: int, seed: int = 0, method: str = "independent") -> Points:
    """Random values of parameters and states.

    Parameters
    ----------
    draws : mapping
        Parameter or state -> ``{"uniform": [least, largest]}`` or ``{"normal": [mean, standard_deviation]}``.
    count : int
        Number of points.
    seed : int
        Equal seeds give equal points.
    method : str
        ``independent`` draws (Monte Carlo), or ``sobol``: a scrambled Sobol sequence, which fills the ranges evenly
        (:class:`scipy.stats.qmc.Sobol`; best balanced if ``count`` is a power of 2).

    Raises
    ------
    ArgumentError
        If an argument has another form.

    Examples
    --------
    >>> points = random({"F": {"uniform": [1, 2]}, "x": {"normal": [0, 0.1]}}, count=4, seed=1)
    >>> points.names, points.values.shape, bool((points.values[:, 0] >= 1).all())
    (('F', 'x'), (4, 2), True)
    """
    if not isinstance(draws, Mapping) or not draws:
        raise ArgumentError(f"draws are {str(draws)[:60]}; wanted a mapping such as {{'x': {{'uniform': [0, 1]}}}}")
    whole_number(count, "count", most=MOST_NUMBERS)
    whole_number(seed, "seed", least=0, most=2**63)
    if method not in ("independent", "sobol"):
        raise ArgumentError(f"method is {str(method)[:60]!r}; wanted independent or sobol")
    shapes = {str(name): _distribution(name, given) for name, given in draws.items()}
    check_size(count, len(shapes), "'random'")
    unit = _unit_cube(len(shapes), count, seed, method)
    values = np.column_stack([_placed(name, unit[:, k], *shape) for k, (name, shape) in enumerate(shapes.items())])
    drawn = {name: {kind: [first, second]} for name, (kind, first, second) in shapes.items()}
    written = {"random": {"draws": drawn, "count": int(count), "seed": int(seed), "method": method}}
    return Points(tuple(shapes), values, written=written)


def points_of(given: Any) -> Points:
    """Return the points of the argument ``grid`` of a sweep: a mapping, a data frame, a file, or points."""
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


def check_names(names: Sequence[str], system: System) -> None:
    """Raise ArgumentError if a name is neither a parameter nor a state, or is a column of the result."""
    known = [*system.parameters, *system.state]
    for name in names:
        if name not in known:
            raise ArgumentError(
                f"'{name[:60]}' is neither a parameter nor a state{did_you_mean(name, known)}; "
                f"parameters: {listed(system.parameters)}; states: {listed(system.state)}"
            )
        if name in OWN_COLUMNS:
            raise ArgumentError(f"'{name}' is a column of the result; rename the parameter or state")


def values_of(axes: Mapping[str, Any], what: str) -> dict[str, Vector]:
    """Return the values of each axis by name; ArgumentError, which names the argument ``what``, if one has none."""
    if not isinstance(axes, Mapping) or not axes:
        shown = "empty" if isinstance(axes, Mapping) else f"of type {type(axes).__name__}"
        raise ArgumentError(f"'{what}' is {shown}; wanted a mapping such as {{'vb': [0.1, 0.2]}}")
    named = _named(axes, f"'{what}'")
    total = prod([_size(axes[key], f"'{name}' of '{what}'") for name, key in named.items()])
    check_size(total, len(named), f"'{what}'")
    return {name: _axis(axes[key], f"'{name}' of '{what}'") for name, key in named.items()}


def _named(given: Mapping[Any, Any], what: str) -> dict[str, Any]:
    """Return each key as text -> the key."""
    found: dict[str, Any] = {}
    for key in given:
        if str(key) in found:
            raise ArgumentError(f"{what} has '{str(key)[:60]}' twice")
        found[str(key)] = key
    return found


def _size(given: Any, what: str) -> int:
    """Return the number of values of an axis, without creating them."""
    if not isinstance(given, Mapping):
        return len(given) if hasattr(given, "__len__") else 1
    if set(given) != {"from", "to", "count"}:
        raise ArgumentError(f"{what} has the keys {listed(list(map(str, given)))}; wanted from, to and count")
    return whole_number(given["count"], f"'count' of {what}")


def _axis(given: Any, what: str) -> Vector:
    if isinstance(given, Mapping):
        first, last = numbers([given["from"], given["to"]], f"[from, to] of {what}")
        given = np.linspace(first, last, _size(given, what))
    values = numbers(given, what)
    if not values.size:
        raise ArgumentError(f"{what} is empty; wanted at least one number")
    return values


def _combined(axes: Mapping[str, Vector]) -> Vector:
    """Return every combination of the axes' values, one per row; without axes, one row of no values."""
    made = np.empty((prod(map(len, axes.values())), len(axes)))
    inner = len(made)
    for k, axis in enumerate(axes.values()):
        inner //= len(axis)
        made.reshape(-1, len(axis), inner, len(axes))[..., k] = axis[:, None]
    return made


def _written(axes: Mapping[Any, Any], values: Mapping[str, Vector]) -> dict[str, Any]:
    """Return axes as in a sweep file."""
    return {
        name: {"from": float(given["from"]), "to": float(given["to"]), "count": int(given["count"])}
        if isinstance(given, Mapping)
        else own.tolist()
        for given, (name, own) in zip(axes.values(), values.items(), strict=True)
    }


def _check(points: Points) -> None:
    """Check points that were constructed directly."""
    values, names = points.values, points.names
    if not isinstance(values, np.ndarray) or values.dtype != np.float64 or values.ndim != 2 or not len(values):
        raise ArgumentError("the values of points must be an array of doubles, of shape (points, names)")
    if values.shape[1] != len(names) or len(set(names)) != len(names):
        raise ArgumentError(f"points have {values.shape[1]} columns and the names {listed(names)}; wanted one each")
    if points.chain < 1 or len(values) % points.chain or any(len(own) != len(values) for own in points.labels.values()):
        raise ArgumentError("chains must divide the number of points, and labels must be as many as the points")
    check_size(len(values), len(names), "'points'")
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        k, i = wrong[0].tolist()
        raise ArgumentError(f"'{names[i]}' is {values[k, i]} at point {k}; a number must be finite")


def _distribution(name: Any, given: Any) -> tuple[str, float, float]:
    if not isinstance(given, Mapping) or len(given) != 1 or next(iter(given)) not in DISTRIBUTIONS:
        raise ArgumentError(f"the draw of '{name}' is {str(given)[:60]}; wanted one of {listed(list(DISTRIBUTIONS))}")
    ((kind, pair),) = given.items()
    values = numbers(pair, f"'{kind}' of '{name}'")
    if len(values) != 2 or (kind == "uniform" and values[0] > values[1]) or (kind == "normal" and values[1] < 0):
        raise ArgumentError(f"'{kind}' of '{name}' is {str(pair)[:60]}; wanted {DISTRIBUTIONS[kind]}")
    return kind, float(values[0]), float(values[1])


def _unit_cube(dimensions: int, count: int, seed: int, method: str) -> Vector:
    """Return points of the open unit cube, shape (count, dimensions)."""
    generator = np.random.Generator(np.random.PCG64(seed))
    if method == "independent":
        found = generator.random((count, dimensions))
    else:
        from scipy.stats import qmc

        engine = qmc.Sobol(dimensions, scramble=True, rng=generator)
        found = engine.random_base2(max(count - 1, 0).bit_length())[:count]  # SciPy warns if not a power of 2
    return np.maximum(found, 2.0**-54)


def _placed(name: str, unit: Vector, kind: str, first: float, second: float) -> Vector:
    """Transform numbers from 0 to 1 to a distribution; ArgumentError if a result is not finite."""
    if kind == "uniform":
        if not np.isfinite(second - first):  # the range is longer than the largest double
            return 2 * np.minimum(first / 2 + (second / 2 - first / 2) * unit, second / 2)
        return np.minimum(first + (second - first) * unit, second)
    from scipy.special import ndtri

    with np.errstate(over="ignore"):
        drawn = first + second * np.asarray(ndtri(unit))
    if not np.isfinite(drawn).all():
        raise ArgumentError(f"'normal' of '{name}' is [{first}, {second}]; numbers drawn from it are not finite")
    return drawn
