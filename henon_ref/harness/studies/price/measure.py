"""Functions shared by the measurements of the price study: new interpreters, problems, fitted powers, drawing."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import numpy as np
import sympy as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.jit.cache_folder import VARIABLE
from henon_ref.modes.problem import Problem
from henon_ref.simulation.system import System

P = ParamSpec("P")
T = TypeVar("T")


def problem_of(system: System, initial: Mapping[str, float | str], until: float | str) -> Problem:
    """Make a problem of a system that starts at t = 0; numbers are decimals."""
    start = tuple(system.number(initial[name]) for name in system.state)
    return Problem(system.model, sp.Integer(0), start, system.number(until))


def in_fresh_process(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a function in a new interpreter, in which nothing has been imported or compiled before."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *args, **kwargs).result()


@contextmanager
def caches_in(folder: str) -> Iterator[None]:
    """Let processes that are started inside keep compiled code in ``folder``."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = folder
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        os.environ.update({} if before is None else {VARIABLE: before})


@dataclass(frozen=True)
class Fit:
    """Fitted power law y ~ x^power."""

    power: float
    """NaN if there are fewer than two points."""
    error: float
    """Standard error of the power; NaN if there are fewer than three points."""

    def __str__(self) -> str:
        if math.isnan(self.power):
            return "?"
        return f"{self.power:.2f}" + ("" if math.isnan(self.error) else f" ± {self.error:.2f}")


def power(x: Sequence[float], y: Sequence[float]) -> Fit:
    """Fit a power law to positive numbers by least squares of their logarithms with equal weights.

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
    """Fit column y ~ (column x)^power to a solver's rows with x >= ``since``."""
    own = [row for row in rows if row.solver == solver and getattr(row, x) >= since]
    return power([getattr(row, x) for row in own], [getattr(row, y) for row in own])


def draw_line(axes: Axes, look: style.Line, points: Sequence[tuple[float, float]], label: str, **more: float) -> None:
    """Draw a solver's points on logarithmic axes."""
    axes.loglog(
        [x for x, _ in points], [y for _, y in points], ls=look.dashes, marker=look.marker, color=look.colour,
        lw=look.width, label=label, **more,
    )  # fmt: skip


def finish(figure: Figure, heading: str, words: str, with_legend: Iterable[Axes]) -> None:
    """Add legends above axes, the layout, and the description of the figure."""
    for axes in with_legend:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    figure.set_layout_engine("constrained")
    describe(figure, heading, words)
