"""Powers fitted to measurements by least squares on their logarithms, every point alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fit:
    """y ~ x^power."""

    power: float
    """NaN where there are fewer than two points."""
    error: float
    """Standard error of the power; NaN where there are fewer than three points."""

    def __str__(self) -> str:
        if math.isnan(self.power):
            return "?"
        return f"{self.power:.2f}" + ("" if math.isnan(self.error) else f" ± {self.error:.2f}")


def power(x: Sequence[float], y: Sequence[float]) -> Fit:
    """The power of positive numbers.

    Examples
    --------
    >>> print(power([1, 2, 4], [3, 12, 48]))
    2.00 ± 0.00
    """
    from scipy.stats import linregress

    if len(x) < 2:
        return Fit(math.nan, math.nan)
    found = linregress(np.log(x), np.log(y))
    return Fit(float(found.slope), float(found.stderr) if len(x) > 2 else math.nan)
