"""Functions shared by the measurements of the price study: new interpreters, problems, fitted powers, drawing."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

import numpy as np
import sympy as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.jit.cache_folder import VARIABLE
from henon_ref.modes.problem import Problem
from henon_ref.simulation.system import System

T = TypeVar("T")


def problem_of(system: System, initial: Mapping[str, float | str], until: float | str) -> Problem:
    """Make a problem of a system that starts at t = 0; numbers are decimals."""
    start = tuple(system.number(initial[name]) for name in system.state)
    return Problem(system.model, sp.Integer(0), start, system.number(until))


def in_fresh_process(function: Callable[..., T], *args: Any, cache: str | None = None) -> T:
    """Call a function in a new interpreter, in which nothing has been imported or compiled before.

    ``cache`` is the folder of its compiled code, by default that of this process.
    """
    with ProcessPoolExecutor(1, get_context("spawn"), _keep_code_in, (cache,)) as pool:
        return pool.submit(function, *args).result()


def _keep_code_in(folder: str | None) -> None:
    if folder is not None:
        os.environ[VARIABLE] = folder


def fitted(rows: Sequence[Any], solver: str, x: str, y: str, since: float) -> str:
    """Fit column y ~ (column x)^power to a solver's rows with x >= ``since``; return the power with its standard error.

    The fit is by least squares of logarithms with equal weights. Two points have no error, and one has no power ("?").
    """
    from scipy.stats import linregress

    own = [row for row in rows if row.solver == solver and getattr(row, x) >= since]
    if len(own) < 2:
        return "?"
    found = linregress(*(np.log([getattr(row, column) for row in own]) for column in (x, y)))
    return f"{found.slope:.2f}" + (f" ± {found.stderr:.2f}" if len(own) > 2 else "")


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
