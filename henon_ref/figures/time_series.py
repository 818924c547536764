"""Surfaces and states over time, with shaded modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.expressions.traversal import size
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, limits_around, runs_of, symbol, values_along, velocity_of, widen
from henon_ref.modes.latex import latex
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

if TYPE_CHECKING:
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
    formula = f" = {latex(surface)}" if size(surface, 100) <= 100 else ""  # a longer one does not fit
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
