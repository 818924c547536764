"""Plots of a solution: phase portrait, and states and surfaces over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist, ArtistInspector
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, axes_of_portrait, mark_transitions, portrait, position_of, velocity_of
from henon_ref.figures.time_series import MOST_SURFACES, over_time
from henon_ref.modes.system import FilippovSystem
from henon_ref.system.python_arguments import check_words
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


def keywords_of(kind: type[Artist]) -> list[str]:
    """Return matplotlib's keywords for a kind of artist, with their aliases."""
    inspector = ArtistInspector(kind)
    return sorted({*inspector.get_setters(), *(short for names in inspector.aliasd.values() for short in names)})


def plotted(
    system: FilippovSystem,
    motion: Motion,
    x: str | None,
    y: str | None,
    ax: Axes | None,
    transitions: pd.DataFrame | None,
    line: dict[str, Any],
) -> Axes:
    """Plot a portrait, or a state over time: see :meth:`henon_ref.simulation.solution.Solution.plot`."""
    check_words("plot", line, ("x", "y", "ax", "transitions"), keywords_of(Line2D))
    across, upward = _plane(system, x, y)
    if across is None:
        (ax,) = plotted_over_time(system, motion, [system.state_names[upward]], ax, line)
    elif ax is None:
        figure = style.pyplot_figure(4.3, 5.6, layout="constrained")
        with style.report_style():
            ax = figure.subplots()
    with style.report_style():
        if across is not None:
            portrait(ax, system, motion, (across, upward), **line)
        if transitions is not None and len(transitions):
            names = ["time_s" if across is None else system.state_names[across], system.state_names[upward]]
            kinds, times = transitions["kind"].tolist(), transitions["time_s"].to_numpy()
            mark_transitions(ax, transitions[names].to_numpy(), kinds, times)
    return ax


def plotted_over_time(
    system: FilippovSystem, motion: Motion, names: Sequence[str], ax: Any, line: dict[str, Any]
) -> NDArray[Any]:
    """Plot states and surfaces over time: see :meth:`henon_ref.simulation.solution.Solution.plot_time`."""
    check_words("plot_time", line, ("ax",), keywords_of(Line2D))
    known = [*system.state_names, *system.sign_names]
    for name in names:
        if name not in known:
            message = f"{str(name)[:60]!r} is no state and no surface{did_you_mean(str(name), known)}"
            raise ArgumentError(f"{message}; wanted some of {listed(known)}")
    if not names:
        shown = axes_of_portrait(system) or (0,)
        names = [*(system.state_names[k] for k in shown), *system.sign_names][:MOST_SURFACES]
    if ax is None:
        figure = style.pyplot_figure(0.85 + 1.5 * len(names), layout="constrained")
        with style.report_style():
            ax = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    panels = np.atleast_1d(np.asarray(ax, dtype=object)).ravel()
    if len(panels) != len(names):
        raise ArgumentError(f"ax holds {len(panels)} axes; wanted {len(names)}, one each for {listed(names)}")
    with style.report_style():
        over_time(panels, system, motion, names, **line)
    return panels


def _plane(system: FilippovSystem, x: str | None, y: str | None) -> tuple[int | None, int]:
    """Return the indices of the states on the horizontal axis (None: time) and on the vertical axis."""
    names = system.state_names
    for what, name in (("x", x), ("y", y)):
        if name is not None and name not in names and (what, name) != ("x", TIME.name):
            known = [*names, TIME.name] if what == "x" else names
            message = f"{what} is {str(name)[:60]!r}, which is no state{did_you_mean(str(name), known)}"
            raise ArgumentError(f"{message}; wanted one of {listed(known)}")
    pair = axes_of_portrait(system)
    if x == TIME.name or pair is None:
        return None, names.index(y) if y is not None else 0
    if x is not None and y is not None:
        return names.index(x), names.index(y)
    if x is None and y is None:
        return pair
    given = names.index(x or y or "")
    partners = (position_of(system, given), velocity_of(system, given), *pair)
    other = next(k for k in partners if k is not None and k != given)
    return (given, other) if x is not None else (other, given)
