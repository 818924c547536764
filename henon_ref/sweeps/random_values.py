"""Random values of a sweep: points of the unit cube, and their transformation to distributions."""

from __future__ import annotations

import numpy as np

from henon_ref.errors import ArgumentError
from henon_ref.sweeps.table_files import Vector


def unit_cube(dimensions: int, count: int, seed: int, method: str) -> Vector:
    """Return points of the open unit cube, shape (count, dimensions)."""
    generator = np.random.Generator(np.random.PCG64(seed))
    if method == "independent":
        found = generator.random((count, dimensions))
    else:
        from scipy.stats import qmc

        engine = qmc.Sobol(dimensions, scramble=True, rng=generator)
        drawn = engine.random_base2(max(count - 1, 0).bit_length())  # a power of 2: SciPy warns for other numbers
        found = drawn[:count]
    return np.maximum(found, 2.0**-54)


def placed(name: str, unit: Vector, kind: str, first: float, second: float) -> Vector:
    """Transform numbers from 0 to 1 to a distribution with two numbers, ``uniform`` or ``normal``.

    Raises
    ------
    ArgumentError
        If a result is not finite; the message contains ``name``.
    """
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
