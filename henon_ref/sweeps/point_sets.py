"""Points for a sweep: ``henon_ref.points``; random ones are the same for the same seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from henon_ref.errors import ArgumentError
from henon_ref.sweeps.point_files import MOST_NUMBERS, check_size
from henon_ref.sweeps.points import Points, Vector, continuation, grid, numbers, table
from henon_ref.text import listed

__all__ = ["Points", "continuation", "grid", "random", "table"]

METHODS = ("independent", "sobol")
DISTRIBUTIONS = {"uniform": "its least and largest value", "normal": "its mean and standard deviation"}
"""Distribution -> what its two numbers are."""


def random(draws: Mapping[str, Any], *, count: int, seed: int = 0, method: str = "independent") -> Points:
    """Random values of parameters and states.

    Parameters
    ----------
    draws : mapping
        Parameter or state -> ``{"uniform": [least, largest]}`` or ``{"normal": [mean, standard_deviation]}``.
    count : int
        Number of points.
    seed : int
        The same seed gives the same points.
    method : str
        ``independent`` draws (Monte Carlo), or ``sobol``: a scrambled Sobol sequence, which fills the ranges evenly
        (:class:`scipy.stats.qmc.Sobol`; its balance is best where ``count`` is a power of 2).

    Raises
    ------
    ArgumentError
        For anything that is none of these.

    Examples
    --------
    >>> points = random({"F": {"uniform": [1, 2]}, "x": {"normal": [0, 0.1]}}, count=4, seed=1)
    >>> points.names, points.values.shape, bool((points.values[:, 0] >= 1).all())
    (('F', 'x'), (4, 2), True)
    """
    if not isinstance(draws, Mapping) or not draws:
        raise ArgumentError(f"draws are {str(draws)[:60]}; wanted a mapping such as {{'x': {{'uniform': [0, 1]}}}}")
    _check_whole(count, "count", least=1, most=MOST_NUMBERS)
    _check_whole(seed, "seed", least=0, most=2**63)
    if method not in METHODS:
        raise ArgumentError(f"method is {str(method)[:60]!r}; wanted {' or '.join(METHODS)}")
    shapes = {str(name): _distribution(name, given) for name, given in draws.items()}
    check_size(count, len(shapes), "'random'")
    unit = _unit_cube(len(shapes), count, seed, method)
    values = np.column_stack([_placed(name, unit[:, k], *shape) for k, (name, shape) in enumerate(shapes.items())])
    drawn = {name: {kind: [first, second]} for name, (kind, first, second) in shapes.items()}
    written = {"random": {"draws": drawn, "count": int(count), "seed": int(seed), "method": method}}
    return Points(tuple(shapes), values, written=written)


def _check_whole(value: Any, what: str, *, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted a whole number from {least} to {most}")


def _distribution(name: Any, given: Any) -> tuple[str, float, float]:
    if not isinstance(given, Mapping) or len(given) != 1 or next(iter(given)) not in DISTRIBUTIONS:
        raise ArgumentError(f"the draw of '{name}' is {str(given)[:60]}; wanted one of {listed(list(DISTRIBUTIONS))}")
    ((kind, pair),) = given.items()
    values = numbers(pair, f"'{kind}' of '{name}'")
    if len(values) != 2 or (kind == "uniform" and values[0] > values[1]) or (kind == "normal" and values[1] < 0):
        raise ArgumentError(f"'{kind}' of '{name}' is {str(pair)[:60]}; wanted {DISTRIBUTIONS[kind]}")
    return kind, float(values[0]), float(values[1])


def _unit_cube(dimensions: int, count: int, seed: int, method: str) -> Vector:
    """Points of the open unit cube, shape (count, dimensions)."""
    generator = np.random.Generator(np.random.PCG64(seed))
    if method == "independent":
        found = generator.random((count, dimensions))
    else:
        from scipy.stats import qmc

        engine = qmc.Sobol(dimensions, scramble=True, rng=generator)
        found = engine.random_base2(max(count - 1, 0).bit_length())[:count]  # drawn whole: no word of its balance
    return np.maximum(found, 2.0**-54)


def _placed(name: str, unit: Vector, kind: str, first: float, second: float) -> Vector:
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
