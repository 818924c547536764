"""Plots of a solution: phase portrait, and states and surfaces over time, with shaded modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.expressions.traversal import is_longer
from henon_ref.figures import style
from henon_ref.figures.motion import (
    Motion,
    axes_of_portrait,
    limits_around,
    mark_transitions,
    portrait,
    position_of,
    runs_of,
    symbol,
    values_along,
    velocity_of,
    widen,
)
from henon_ref.modes.latex import latex
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.system.python_arguments import check_words
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODES = {
    0: ("stick", style.STICK_SHADE),
    1: ("slip, s = +1", style.PLUS_SHADE),
    -1: ("slip, s = −1", style.MINUS_SHADE),
}
"""Entry of a mode -> label and background colour."""
MOST_SURFACES = 4
"""Largest number of surfaces in a figure, one panel each."""


def draw_modes(system: FilippovSystem, motion: Motion) -> Figure:
    """Draw h of every surface over time in the measured window, with shaded modes."""
    count = min(len(system.surfaces), MOST_SURFACES)
    height = 0.85 + 1.55 * count
    with style.figure(height) as figure:
        panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        inch = 1 / height
        figure.subplots_adjust(left=0.1, right=0.965, bottom=0.48 * inch, top=1 - 0.32 * inch, hspace=0.12)
        over_time(panels, system, motion, [sign.name for sign in system.signs[:count]])
        title = "Distance from the surface, modes shaded"
        panels[0].set_title(title)
        style.describe(figure, title, " ".join(_shares(system, motion, k) for k in range(count)))
        return figure


def over_time(
    panels: Sequence[Axes] | NDArray[Any], system: FilippovSystem, motion: Motion, names: Sequence[str], **line: Any
) -> None:
    """Draw states and surfaces' h over time by name, one panel each, with shaded modes and a legend above.

    The panel of a surface shows its own modes; the panel of a state, the sticks of surfaces with it or its rate.
    """
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.lines import Line2D

    line = {"color": style.BLACK, "linewidth": 1.1, "zorder": 2} | normalize_kwargs(line, Line2D)
    signs = [sign.name for sign in system.signs]
    window = float(motion.times[0]), float(motion.times[-1])
    shown: set[int | None] = set()
    for name, axes in zip(names, panels, strict=True):
        k = signs.index(name) if name in signs else system.state_names.index(name)
        entries: list[int | None]  # None: not shaded
        if name in signs:
            values = values_along(system, motion, system.surfaces[k])
            entries = [_entry(mode, k) for mode in motion.modes]
        else:
            own = _surfaces_about(system, k)
            values = motion.states[:, k]
            entries = [0 if any(_entry(mode, i) == 0 for i in own) else None for mode in motion.modes]
        widen(axes, window, limits_around(values))
        _shade(axes, motion, entries)
        if name in signs:
            axes.axhline(0.0, color=style.GREY, lw=0.8, ls="--", zorder=1)
        axes.plot(motion.times, values, **line)
        axes.grid(visible=False)
        axes.set_ylabel(_surface_label(system, k) if name in signs else symbol(system, k))
        shown |= set(entries) - {None}
    panels[-1].set_xlabel("time t [s]")
    if shown and "label" not in line:
        _mode_legend(panels[0], shown)


def _shares(system: FilippovSystem, motion: Motion, k: int) -> str:
    """Return the total duration of each mode of a surface, as text."""
    durations = np.diff(motion.times)
    entries = np.array([_entry(mode, k) for mode in motion.modes])[:-1]
    parts = [
        f"{words} for {float(durations[entries == entry].sum()):.3g} s"
        for entry, words in ((0, "stick"), (1, "slip with sign +1"), (-1, "slip with sign −1"))
        if (entries == entry).any()
    ]
    window = f"from {motion.times[0]:.10g} to {motion.times[-1]:.10g} s"
    return f"h of surface {system.signs[k].name} over time, {window}: {', '.join(parts)}."


def _surfaces_about(system: FilippovSystem, k: int) -> list[int]:
    """Return the surfaces that contain a state or its rate; all surfaces if there is none."""
    rate = velocity_of(system, k)
    own = [system.states[k], *([] if rate is None else [system.states[rate]])]
    every = range(len(system.surfaces))
    return [i for i in every if system.surfaces[i].has(*own)] or list(every)


def _surface_label(system: FilippovSystem, k: int) -> str:
    surface = system.surfaces[k]
    formula = "" if is_longer(surface, 100) else f" = {latex(surface)}"  # a longer one does not fit
    return f"${latex(system.signs[k])}$:  $h{formula}$"


def _shade(axes: Axes, motion: Motion, entries: Sequence[int | None]) -> None:
    """Shade sticks and slips with s = +1."""
    for begin, end in runs_of(entries):
        entry = entries[begin]
        if entry is not None and entry >= 0:
            axes.axvspan(motion.times[begin], motion.times[end], color=MODES[entry][1], lw=0, zorder=0)


def _entry(mode: Mode, k: int) -> int:
    return mode[k] if k < len(mode) else -1


def _mode_legend(axes: Axes, present: set[int | None]) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(facecolor=colour, edgecolor="#999999", linewidth=0.5, label=label)
        for entry, (label, colour) in MODES.items()
        if entry in present
    ]
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)


def keywords_of(kind: type[Artist]) -> list[str]:
    """Return matplotlib's keywords for a kind of artist, with their aliases."""
    from matplotlib.artist import ArtistInspector

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
    from matplotlib.lines import Line2D

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
    from matplotlib.lines import Line2D

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
