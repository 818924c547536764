"""Powers fitted to measurements by least squares on their logarithms."""

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
    """Least squares on the logarithms, every point alike.

    Parameters
    ----------
    x, y : sequences of float
        Positive.

    Examples
    --------
    >>> print(power([1, 2, 4], [3, 12, 48]))
    2.00 ± 0.00
    """
    if len(x) < 2:
        return Fit(math.nan, math.nan)
    horizontal, vertical = np.log(x), np.log(y)
    from_middle = horizontal - horizontal.mean()
    slope = float(from_middle @ vertical / (from_middle @ from_middle))
    rest = vertical - vertical.mean() - slope * from_middle
    if len(x) < 3:
        return Fit(slope, math.nan)
    return Fit(slope, math.sqrt(float(rest @ rest) / (len(x) - 2) / float(from_middle @ from_middle)))
