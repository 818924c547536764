"""Figures of sweeps: bifurcation diagram, basins, histogram, an observation over a plane.

Each function takes the table of a sweep, draws on the given axes or on those of a new pyplot figure (which a notebook
shows), and returns the axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from henon_ref.errors import ArgumentError
from henon_ref.figures import style
from henon_ref.text import did_you_mean, listed, one_line

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

HEIGHT = 4.4
"""Height of a figure [in]."""
MOST_BASINS = 12
"""Largest number of basins, which differ by colour."""
_COLOURS = (
    style.BLUE, style.ORANGE, style.GREEN, style.VERMILLION, style.SKY, style.PURPLE,
    "#F0E442", style.BLACK, style.GREY, "#8C4A2F", "#3B3F9E", "#66CDAA",
)  # fmt: skip


def bifurcation(table: pd.DataFrame, along: str, of: str, frame: str = "section", axes: Axes | None = None) -> Axes:
    """Draw a bifurcation diagram: section points over a parameter.

    Parameters
    ----------
    table : SweepTable
    along : str
        Column of the parameter.
    of : str
        Column of the section's table: a state.
    frame : str
        Name of the section's table.
    axes : Axes, optional
    """
    frames = getattr(table, "frames", {})
    if frame not in frames:
        raise ArgumentError(f"the sweep has no table '{frame[:60]}'; it has: {listed(list(frames)) or 'none'}")
    points = frames[frame]
    _known(table, along)
    _known(points, of)
    with _drawing(axes) as axes:
        x, y = table[along].to_numpy()[points["point"].to_numpy()], points[of].to_numpy()
        size = float(np.clip(2e5 / max(len(x), 1), 0.15, 6.0))
        axes.plot(x, y, ls="", marker=".", ms=2 * size**0.5, mew=0, color=style.BLACK, alpha=0.6, rasterized=True)
        axes.set(xlabel=one_line(along), ylabel=f"{one_line(of)} at the section")
        axes.set_title(f"Bifurcation diagram: {len(x):,} section points")
    return axes


def basins(table: pd.DataFrame, x: str, y: str, of: str, axes: Axes | None = None) -> Axes:
    """Draw a map of an observation with few values (a mode, a status, a period), one colour for each.

    Parameters
    ----------
    table : DataFrame
        Points of a grid in two columns, or scattered points in the plane.
    x, y : str
        Columns across and upward.
    of : str
        Column to draw.
    axes : Axes, optional
    """
    import pandas as pd
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    for name in (x, y, of):
        _known(table, name)
    codes, values = pd.factorize(table[of], sort=True, use_na_sentinel=True)
    if len(values) > MOST_BASINS:
        raise ArgumentError(f"'{of}' has {len(values)} different values; at most {MOST_BASINS} basins can be drawn")
    with _drawing(axes) as axes:
        colours = ListedColormap(_COLOURS[: max(len(values), 1)])
        norm = BoundaryNorm(np.arange(len(values) + 1) - 0.5, max(len(values), 1)) if len(values) > 1 else None
        _painted(axes, table, x, y, np.where(codes < 0, np.nan, codes), cmap=colours, norm=norm)
        shares = np.bincount(codes[codes >= 0], minlength=len(values)) / max(len(codes), 1)
        handles = [
            Patch(color=_COLOURS[k], label=f"{_value(value)}: {share:.2%}")
            for k, (value, share) in enumerate(zip(values, shares, strict=True))
        ]
        if (missing := np.mean(codes < 0)) > 0:
            handles.append(Patch(facecolor="none", edgecolor=style.GREY, label=f"no value: {missing:.2%}"))
        axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
        axes.set_title(f"{one_line(of)}, and its share of {len(table):,} points")
    return axes


def histogram(table: pd.DataFrame, of: str, axes: Axes | None = None) -> Axes:
    """Draw a histogram of an observation.

    Parameters
    ----------
    table : DataFrame
    of : str
        Column of numbers; missing values are omitted, and counted in the title.
    axes : Axes, optional
    """
    values = _numbers(table, of)
    there = values[np.isfinite(values)]
    with _drawing(axes) as axes:
        axes.hist(there, bins=min(60, max(len(np.unique(there)), 1)), color=style.BLUE, lw=0)
        axes.set(xlabel=one_line(of), ylabel="points")
        axes.set_title(f"{one_line(of)}: {len(there):,} points{_left_out(values)}")
    return axes


def plane(table: pd.DataFrame, x: str, y: str, of: str, axes: Axes | None = None) -> Axes:
    """Draw an observation over a plane of two parameters or initial values, by colour.

    Parameters
    ----------
    table : DataFrame
        Points of a grid in two columns, or scattered points in the plane.
    x, y : str
        Columns across and upward.
    of : str
        Column of numbers; nothing is drawn for a missing value.
    axes : Axes, optional
    """
    for name in (x, y):
        _known(table, name)
    values = _numbers(table, of)
    with _drawing(axes) as axes:
        drawn = _painted(axes, table, x, y, values, cmap="viridis", norm=None)
        bar = axes.figure.colorbar(drawn, ax=axes, pad=0.02)
        bar.set_label(one_line(of))
        axes.set_title(f"{one_line(of)} at {len(table):,} points{_left_out(values)}")
    return axes


def _painted(axes: Axes, table: pd.DataFrame, x: str, y: str, values: Any, **how: Any) -> Any:
    """Draw a grid as cells, other points as dots."""
    across, column = np.unique(table[x].to_numpy(dtype=float), return_inverse=True)
    upward, row = np.unique(table[y].to_numpy(dtype=float), return_inverse=True)
    axes.set(xlabel=one_line(x), ylabel=one_line(y))
    axes.grid(visible=False)
    if len(across) * len(upward) == len(table) and min(len(across), len(upward)) > 1:
        cells = np.full((len(upward), len(across)), np.nan)
        cells[row.ravel(), column.ravel()] = values
        return axes.pcolormesh(across, upward, cells, shading="nearest", rasterized=True, **how)
    return axes.scatter(table[x], table[y], c=values, s=4, lw=0, rasterized=True, **how)


@contextmanager
def _drawing(axes: Axes | None) -> Iterator[Axes]:
    """Yield the given axes, or those of a new figure, in the style of the reports."""
    figure = style.pyplot_figure(HEIGHT, layout="constrained") if axes is None else None
    with style.report_style():
        yield axes if figure is None else figure.subplots()  # type: ignore[misc]


def _known(table: pd.DataFrame, name: str) -> None:
    names = [str(n) for n in table.columns]
    if name not in names:
        raise ArgumentError(f"there is no column '{name[:60]}'{did_you_mean(name, names)}; columns: {listed(names)}")


def _numbers(table: pd.DataFrame, name: str) -> Any:
    _known(table, name)
    if table[name].dtype.kind not in "iuf":
        raise ArgumentError(f"the column '{name[:60]}' has no numbers; 'basins' draws columns of text")
    return table[name].to_numpy(dtype=float)


def _left_out(values: Any) -> str:
    """Return the number of missing values, as the end of a title."""
    missing = int(np.sum(~np.isfinite(values)))
    return f", {missing:,} without a value left out" if missing else ""


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | np.floating) else one_line(str(value))
