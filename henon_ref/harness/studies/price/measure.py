"""What the measurements of the price list share: the orbit of Fig. 8, new interpreters, fitted powers, titles."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from henon_ref.casefile.case import parse_case
from henon_ref.jit.cache_folder import VARIABLE
from henon_ref.modes.problem import Problem

P = ParamSpec("P")
T = TypeVar("T")
FIG8 = """\
schema: 1
name: fig8_orbit
title: The motion of Fig. 8's `listing_limit`
system:
  state: [x1, x2]
  parameters: {m: 0.1, vp: 0.4, mu0: sqrt(3)/9, A: 4*sqrt(3)/3*sin(pi/18), w: 3*pi/2/1.2364, zs: 2*sqrt(3)/3*sin(pi/18)}
  surfaces: {s: x2 - vp}
  field:
    - 3*x2
    - 3*(-(x1 - A*sin(w*t)) + (x1 - A*sin(w*t))^3 - s*mu0/(1 + s*(x2 - vp)))/m
sliding:
  s:
    field: [vp, 0]
    release: [{when: x1 - A*sin(w*t) - zs, direction: rising, to: -1}]
initial: {t: 0, x1: -zs, x2: vp, mode: {s: 0}}
until: 70
"""
"""Fig. 8's `listing_limit`, independent of the cases on the command line (a test compares it with the case file)."""


def orbit_problem() -> Problem:
    """The problem whose motion is periodic: Fig. 8's `listing_limit`."""
    return parse_case(FIG8).readings[0].problem


def in_fresh_process(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """What a function returns in a new interpreter: earlier measurements have imported and compiled nothing there."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *args, **kwargs).result()


@contextmanager
def caches_in(folder: Path) -> Iterator[None]:
    """Processes begun here keep compiled code in a folder."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(folder)
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        os.environ.update({} if before is None else {VARIABLE: before})


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
    """Fit a power of positive numbers by least squares on their logarithms, every point alike.

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


def fitted(rows: Sequence[Any], solver: str, x: str, y: str, since: float) -> Fit:
    """The power in a solver's rows: column y ~ (column x)^power, from an x on."""
    own = [row for row in rows if row.solver == solver and getattr(row, x) >= since]
    return power([getattr(row, x) for row in own], [getattr(row, y) for row in own])


def title(case: str, reading: str) -> str:
    """What a reading is called."""
    return case if reading == "default" else f"{case}, {reading}"
