"""Figures of the motion: the phase portrait with its sticks, and the surfaces over time with the modes shaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.casefile.case import Reading
from henon_ref.figures import style
from henon_ref.figures.description import describe
from henon_ref.filippov.latex import latex
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.size import size
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Event, Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODES_TITLE = "Distance from the surface, modes shaded"
LONGEST_LABEL = 100
"""Operations of a surface that stands beside its curve."""
MOST_SURFACES = 4
"""Surfaces that one figure shows, one panel each."""
REST = 1e-6
"""A stick that moves less than this fraction of the largest state is drawn as a point."""
BLOW_UP = 50.0
"""A curve that goes this many times further than most of itself is cut off."""


@dataclass(frozen=True)
class Motion:
    """The sampled motion with the truth's transitions put in between, so that corners are sharp."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    modes: tuple[Mode, ...]
    """Mode from each time to the next."""


def motion_of(samples: Samples, transitions: Sequence[Event]) -> Motion | None:
    """Merge samples and transitions; None where the samples hold no motion.

    Samples past an early end are NaN and are left out.
    """
    good = np.asarray(np.isfinite(samples.states).all(axis=1))
    times, states = samples.times[good], samples.states[good]
    if len(times) < 2 or times[0] == times[-1]:
        return None
    inside = [e for e in transitions if times[0] <= e.time <= times[-1]]
    events = {e.time: e for e in inside}
    knots = np.array(sorted(events))
    knot_states = np.array([[float(str(v)) for v in events[t].state] for t in knots.tolist()])
    modes = _modes(times, transitions, samples, good)
    joined = np.concatenate([times, knots])
    order = np.argsort(joined, kind="stable")
    all_states = np.concatenate([states, knot_states.reshape(-1, states.shape[1])])
    all_modes = modes + [tuple(events[t].to_mode) for t in knots.tolist()]
    return Motion(joined[order], all_states[order], tuple(all_modes[k] for k in order.tolist()))


def _modes(
    times: NDArray[np.float64], transitions: Sequence[Event], samples: Samples, good: NDArray[np.bool_]
) -> list[Mode]:
    """The mode at each sample: by the truth's transitions, or as the solver says where there are none."""
    if not transitions:
        given = samples.modes
        return [given[k] for k in np.nonzero(good)[0].tolist()] if given else [()] * len(times)
    at = np.array([e.time for e in transitions])
    index = np.searchsorted(at, times, side="right") - 1
    first = tuple(transitions[0].from_mode)
    return [first if k < 0 else tuple(transitions[k].to_mode) for k in index.tolist()]


def axes_of_portrait(system: FilippovSystem) -> tuple[int, int] | None:
    """States along x and y: the first surface's own state upward, where it is not the first state."""
    if len(system.states) < 2:
        return None
    used = [k for k, x in enumerate(system.states) if system.surfaces and system.surfaces[0].has(x)]
    up = next((k for k in used if k > 0), 1)
    return 0, up


@dataclass(frozen=True)
class _Plane:
    """Two states, and the surfaces that are curves in their plane: those decide how a piece is drawn."""

    x: int
    y: int
    signs: tuple[tuple[int, str], ...]
    """Index and name of each such surface's sign; of all surfaces where there is none."""

    def line_style(self, mode: Mode) -> tuple[str, str, float]:
        """Label, colour and width of a piece of one mode."""
        if any(mode[k] == 0 for k, _ in self.signs):
            return "stick", style.VERMILLION, 3.2
        if len(self.signs) == 1:
            ((k, name),) = self.signs
            if mode[k] > 0:
                return f"slip, {name} = +1", style.BLUE, 1.2
            return f"slip, {name} = −1", style.GREEN, 1.2
        return "slip", style.BLUE, 1.1

    def pieces(self, modes: Sequence[Mode]) -> list[tuple[str, slice]]:
        """Label and range of every piece that is drawn alike."""
        labels = [self.line_style(mode)[0] for mode in modes]
        return [(labels[begin], slice(begin, end + 1)) for begin, end in _runs(labels)]


def draw_portrait(reading: Reading, motion: Motion, pair: tuple[int, int] | None = None) -> Figure | None:
    """Phase portrait in the measured window, coloured by mode, sticks on the boundary; ``pair``: the states shown."""
    system = reading.problem.system
    pair = pair or axes_of_portrait(system)
    if pair is None:
        return None
    with style.figure(4.3, width=5.6) as figure:
        axes = figure.add_axes((0.13, 0.12, 0.84, 0.74))
        plane, boundary = portrait(axes, system, motion, pair)
        title = f"Phase portrait, {motion.times[0]:.10g} s to {motion.times[-1]:.10g} s"
        axes.set_title(title, pad=24)
        labels = [label for label, _ in plane.pieces(motion.modes)]
        pieces = "; ".join(f"{labels.count(label)} of {label}" for label in sorted(set(labels)))
        describe(
            figure,
            title,
            f"{system.states[plane.x].name} across, {system.states[plane.y].name} upward. Pieces: {pieces}."
            + (" Surfaces are dashed lines." if boundary else ""),
        )
        return figure


def portrait(axes: Axes, system: FilippovSystem, motion: Motion, pair: tuple[int, int]) -> tuple[_Plane, bool]:
    """Phase portrait in the plane of two states, with a legend above it; how it is drawn, and whether surfaces are."""
    plane = plane_of(system, *pair)
    drawn = _draw_pieces(axes, motion, plane)
    _draw_arrows(axes, motion, plane)
    for values, set_limits in (
        (motion.states[:, plane.x], axes.set_xlim),
        (motion.states[:, plane.y], axes.set_ylim),
    ):
        set_limits(*limits_around(values))
    boundary = _draw_boundary(axes, system, plane)
    axes.set_xlabel(_symbol(system, plane.x))
    axes.set_ylabel(_symbol(system, plane.y))
    _legend(axes, [*drawn, *boundary])
    return plane, bool(boundary)


def state_over_time(axes: Axes, system: FilippovSystem, motion: Motion, k: int = 0) -> None:
    """A state over time."""
    axes.plot(motion.times, motion.states[:, k], color=style.BLUE)
    axes.set(xlabel="time t [s]", ylabel=_symbol(system, k), xlim=motion.times[[0, -1]])
    axes.set_ylim(*limits_around(motion.states[:, k]))


def plane_of(system: FilippovSystem, x: int, y: int) -> _Plane:
    inside = {system.states[x], system.states[y]}
    every = [(k, sign.name) for k, sign in enumerate(system.signs)]
    curves = [(k, name) for k, name in every if states_in(system, k) <= inside]
    return _Plane(x, y, tuple(curves or every))


def states_in(system: FilippovSystem, k: int) -> set[sp.Basic]:
    """What a surface depends on, parameters apart."""
    return set(system.numeric(system.surfaces[k]).free_symbols)


def _runs(labels: Sequence[object]) -> list[tuple[int, int]]:
    """(first, last) of every run of equal labels; each but the last reaches to the next one's first."""
    starts = [0] + [k for k in range(1, len(labels)) if labels[k] != labels[k - 1]]
    return list(zip(starts, [*starts[1:], len(labels) - 1], strict=True))


def _draw_pieces(axes: Axes, motion: Motion, plane: _Plane) -> list[tuple[str, str, float, str]]:
    """The curve in pieces drawn alike; returns legend entries (label, colour, width, dashes)."""
    seen: dict[str, tuple[str, str, float, str]] = {}
    for label, piece in plane.pieces(motion.modes):
        _, colour, width = plane.line_style(motion.modes[piece.start])
        stick = label == "stick"
        points = motion.states[piece][:, [plane.x, plane.y]]
        rest = stick and bool(np.ptp(points, axis=0).max() <= REST * np.abs(motion.states).max())
        line: dict[str, Any] = (
            {"marker": "o", "ms": 5.0, "ls": "none"} if rest else {"lw": width, "solid_capstyle": "butt"}
        )
        axes.plot(*(points[-1:] if rest else points).T, color=colour, zorder=3 if stick else 2, **line)
        seen[label] = (label, colour, width, "-")
    return sorted(seen.values(), key=lambda entry: (entry[0] == "stick", entry[0]))


def _draw_arrows(axes: Axes, motion: Motion, plane: _Plane) -> None:
    """The direction of motion, in the middle of the longest piece of every kind of slip."""
    longest: dict[str, slice] = {}
    for label, piece in plane.pieces(motion.modes):
        if label != "stick" and (label not in longest or _length(piece) > _length(longest[label])):
            longest[label] = piece
    for piece in longest.values():
        if _length(piece) < 8:
            continue
        middle = (piece.start + piece.stop) // 2
        tail, tip = motion.states[middle - 2, [plane.x, plane.y]], motion.states[middle + 2, [plane.x, plane.y]]
        colour = plane.line_style(motion.modes[piece.start])[1]
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 0.0, "mutation_scale": 14}
        axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=arrow, zorder=4)


def _length(piece: slice) -> int:
    return int(piece.stop - piece.start)


def _draw_boundary(axes: Axes, system: FilippovSystem, plane: _Plane) -> list[tuple[str, str, float, str]]:
    """The surfaces that are curves in this plane, as dashed lines."""
    pair = [system.states[plane.x], system.states[plane.y]]
    drawn = False
    left, right = axes.get_xlim()
    bottom, top = axes.get_ylim()
    grid = np.meshgrid(np.linspace(left, right, 201), np.linspace(bottom, top, 201))
    for k, surface in enumerate(system.surfaces):
        if not states_in(system, k) or not states_in(system, k) <= set(pair):
            continue
        values = sp.lambdify(pair, system.numeric(surface), np)(*grid)
        values = np.broadcast_to(np.asarray(values, dtype=float), grid[0].shape)
        if not (np.nanmin(values) < 0 < np.nanmax(values)):
            continue
        axes.contour(*grid, values, levels=[0.0], colors=[style.GREY], linewidths=[0.9], linestyles=["--"], zorder=1)
        drawn = True
    return [("surface h = 0", style.GREY, 0.9, "--")] if drawn else []


def draw_modes(reading: Reading, motion: Motion) -> Figure:
    """Every surface's h over time in the measured window, the modes shaded."""
    system = reading.problem.system
    count = min(len(system.surfaces), MOST_SURFACES)
    with style.figure(0.85 + 1.55 * count) as figure:
        panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        inch = 1 / (0.85 + 1.55 * count)
        figure.subplots_adjust(left=0.1, right=0.985, bottom=0.48 * inch, top=1 - 0.32 * inch, hspace=0.12)
        surfaces_over_time(panels, system, motion)
        panels[0].set_title(MODES_TITLE)
        describe(figure, MODES_TITLE, " ".join(_shares(system, motion, k) for k in range(count)))
        return figure


def surfaces_over_time(panels: Sequence[Axes] | NDArray[Any], system: FilippovSystem, motion: Motion) -> None:
    """The first surfaces' h over time, one below the other, with the modes shaded and a legend above them."""
    for k, axes in enumerate(panels):
        _draw_surface(axes, system, motion, k)
    panels[-1].set_xlabel("time t [s]")
    panels[-1].set_xlim(motion.times[0], motion.times[-1])
    _mode_legend(panels[0], {_entry(mode, k) for mode in motion.modes for k in range(len(panels))})


def _shares(system: FilippovSystem, motion: Motion, k: int) -> str:
    """How long one surface's modes last, in words."""
    durations = np.diff(motion.times)
    entries = np.array([_entry(mode, k) for mode in motion.modes])[:-1]
    parts = [
        f"{words} for {float(durations[entries == entry].sum()):.3g} s"
        for entry, words in ((0, "stick"), (1, "slip with sign +1"), (-1, "slip with sign −1"))
        if (entries == entry).any()
    ]
    window = f"from {motion.times[0]:.10g} to {motion.times[-1]:.10g} s"
    return f"h of surface {system.signs[k].name} over time, {window}: {', '.join(parts)}."


def _draw_surface(axes: Axes, system: FilippovSystem, motion: Motion, k: int) -> None:
    h = sp.lambdify([TIME, *system.states], system.numeric(system.surfaces[k]), np)
    values = np.broadcast_to(np.asarray(h(motion.times, *motion.states.T), dtype=float), motion.times.shape)
    entries = [_entry(mode, k) for mode in motion.modes]
    shades = {0: style.STICK_SHADE, 1: style.PLUS_SHADE}
    for begin, end in _runs(entries):
        if entries[begin] in shades:
            axes.axvspan(motion.times[begin], motion.times[end], color=shades[entries[begin]], lw=0, zorder=0)
    axes.axhline(0.0, color=style.GREY, lw=0.8, ls="--", zorder=1)
    axes.plot(motion.times, values, color=style.BLACK, lw=1.1, zorder=2)
    axes.set_ylim(*limits_around(values))
    axes.grid(visible=False)
    surface = system.surfaces[k]
    formula = f" = {latex(surface)}" if size(surface, LONGEST_LABEL) <= LONGEST_LABEL else ""
    axes.set_ylabel(f"${latex(system.signs[k])}$:  $h{formula}$")


def _entry(mode: Mode, k: int) -> int:
    return mode[k] if k < len(mode) else -1


def _mode_legend(axes: Axes, present: set[int]) -> None:
    from matplotlib.patches import Patch

    kinds = {0: ("stick", style.STICK_SHADE), 1: ("slip, s = +1", style.PLUS_SHADE), -1: ("slip, s = −1", "#FFFFFF")}
    handles = [
        Patch(facecolor=colour, edgecolor="#999999", linewidth=0.5, label=label)
        for entry, (label, colour) in kinds.items()
        if entry in present
    ]
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)


def _legend(axes: Axes, entries: list[tuple[str, str, float, str]]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=c, lw=w, ls=d, label=label) for label, c, w, d in entries]
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2)


def limits_around(values: NDArray[np.float64]) -> tuple[float, float]:
    """Limits around a curve with a little room; a curve that blows up is cut where it leaves the rest behind."""
    usual = float(np.percentile(np.abs(values), 95))
    if np.abs(values).max() > BLOW_UP * usual > 0:
        values = values[np.abs(values) <= 2 * usual]
    low, high = float(values.min()), float(values.max())
    room = 0.06 * (high - low) or 0.5
    return low - room, high + room


def _symbol(system: FilippovSystem, k: int) -> str:
    return f"${latex(system.states[k])}$"
