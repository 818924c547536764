"""Sampled motion, and its phase portrait with the sticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.modes.latex import latex
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Event, Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Entry = tuple[str, str, float, str]
"""Entry of a legend: label, colour, width, dashes."""


@dataclass(frozen=True)
class Motion:
    """Sampled motion that includes the transitions of the truth, so that corners are sharp."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    modes: tuple[Mode, ...]
    """Mode from each time to the next."""


def motion_of(samples: Samples, transitions: Sequence[Event]) -> Motion | None:
    """Merge samples (NaN after an early end) and transitions; None if the samples contain no motion."""
    good = np.nonzero(np.isfinite(samples.states).all(axis=1))[0]
    times, states = samples.times[good], samples.states[good]
    if len(times) < 2 or times[0] == times[-1]:
        return None
    events = sorted({e.time: e for e in transitions if times[0] <= e.time <= times[-1]}.items())
    knots = np.array([time for time, _ in events])
    knot_states = np.array([[float(str(v)) for v in event.state] for _, event in events])
    modes = _modes(times, transitions, [samples.modes[k] for k in good.tolist()] if samples.modes else None)
    modes += [tuple(event.to_mode) for _, event in events]
    joined = np.concatenate([times, knots])
    order = np.argsort(joined, kind="stable")
    all_states = np.concatenate([states, knot_states.reshape(-1, states.shape[1])])
    return Motion(joined[order], all_states[order], tuple(modes[k] for k in order.tolist()))


def _modes(times: NDArray[np.float64], transitions: Sequence[Event], given: list[Mode] | None) -> list[Mode]:
    """Return the mode at each sample, by the transitions of the truth, or else by the solver."""
    if not transitions:
        return given or [()] * len(times)
    index = np.searchsorted(np.array([e.time for e in transitions]), times, side="right")
    modes = [tuple(transitions[0].from_mode), *(tuple(e.to_mode) for e in transitions)]
    return [modes[k] for k in index.tolist()]


def values_along(system: FilippovSystem, motion: Motion, expression: sp.Expr) -> NDArray[np.float64]:
    """Evaluate an expression in time and states at each time of a motion."""
    function = sp.lambdify([TIME, *system.states], system.numeric(expression), np)
    return np.broadcast_to(np.asarray(function(motion.times, *motion.states.T), dtype=float), motion.times.shape)


def axes_of_portrait(system: FilippovSystem) -> tuple[int, int] | None:
    """Return the states along x and y: preferably a velocity in the first surface over its position.

    Otherwise, a state of the first surface over the first state. If the only state of the surface is a later position
    (a stop), that position is along x and its velocity along y. None if there is only one state.
    """
    if len(system.states) < 2:
        return None
    used = [k for k, x in enumerate(system.states) if system.surfaces and system.surfaces[0].has(x)]
    for k in used:
        if (position := position_of(system, k)) is not None:
            return position, k
    up = next((k for k in used if k > 0), 1)
    rate = velocity_of(system, up)
    return (0, up) if used != [up] or rate is None else (up, rate)


def position_of(system: FilippovSystem, k: int) -> int | None:
    """Return the state whose rate is state ``k``; None if there is none."""
    return system.field.index(system.states[k]) if system.states[k] in system.field else None


def velocity_of(system: FilippovSystem, k: int) -> int | None:
    """Return the state that is the rate of state ``k``; None if there is none."""
    rate = system.field[k]
    return system.states.index(rate) if rate in system.states else None


@dataclass(frozen=True)
class _Plane:
    """Plane of two states, with the surfaces that are curves in it and determine the line styles."""

    x: int
    y: int
    signs: tuple[tuple[int, str], ...]
    """Index and name of the sign of each such surface; of all surfaces if there is none."""

    def line_style(self, mode: Mode) -> tuple[str, str, float]:
        """Return label, colour and width of the line in a mode."""
        if any(mode[k] == 0 for k, _ in self.signs):
            return "stick", style.VERMILLION, 3.2
        if len(self.signs) == 1:
            ((k, name),) = self.signs
            if mode[k] > 0:
                return f"slip, {name} = +1", style.BLUE, 1.2
            return f"slip, {name} = −1", style.GREEN, 1.2
        return "slip", style.BLUE, 1.1

    def pieces(self, modes: Sequence[Mode]) -> list[tuple[str, slice]]:
        """Return label and range of every piece with one line style."""
        labels = [self.line_style(mode)[0] for mode in modes]
        return [(labels[begin], slice(begin, end + 1)) for begin, end in runs_of(labels)]


def draw_portrait(system: FilippovSystem, motion: Motion, pair: tuple[int, int] | None = None) -> Figure | None:
    """Draw the phase portrait in the measured window, coloured by mode; ``pair``: indices of the two states."""
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
        style.describe(
            figure,
            title,
            f"{system.states[plane.x].name} across, {system.states[plane.y].name} upward. Pieces: {pieces}."
            + (" Surfaces are dashed lines." if boundary else ""),
        )
        return figure


def portrait(
    axes: Axes, system: FilippovSystem, motion: Motion, pair: tuple[int, int], **line: Any
) -> tuple[_Plane, bool]:
    """Draw the phase portrait in the plane of two states; return the plane, and whether surfaces are drawn.

    ``line`` are matplotlib's keywords of a line. A legend of the modes is added, unless they include a label, which
    is then the label of the curve in the caller's legend.
    """
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.lines import Line2D

    line = normalize_kwargs(line, Line2D)
    plane = plane_of(system, *pair)
    widen(axes, limits_around(motion.states[:, plane.x]), limits_around(motion.states[:, plane.y]))
    drawn = _draw_pieces(axes, motion, plane, line)
    _draw_arrows(axes, motion, plane, line.get("color"))
    boundary = _draw_boundary(axes, system, plane)
    axes.set_xlabel(symbol(system, plane.x))
    axes.set_ylabel(symbol(system, plane.y))
    if "label" not in line:
        _legend(axes, [*drawn, *boundary])
    return plane, bool(boundary)


def widen(axes: Axes, across: tuple[float, float], upward: tuple[float, float]) -> None:
    """Set the limits (low, high) of axes so that they include what has been drawn before."""
    if axes.has_data():
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        across = min(across[0], left), max(across[1], right)
        upward = min(upward[0], bottom), max(upward[1], top)
    axes.set_xlim(*across)
    axes.set_ylim(*upward)


def plane_of(system: FilippovSystem, x: int, y: int) -> _Plane:
    inside = {system.states[x], system.states[y]}
    every = [(k, sign.name) for k, sign in enumerate(system.signs)]
    curves = [(k, name) for k, name in every if states_in(system, k) <= inside]
    return _Plane(x, y, tuple(curves or every))


def states_in(system: FilippovSystem, k: int) -> set[sp.Basic]:
    """Return the symbols in a surface, without parameters."""
    return set(system.numeric(system.surfaces[k]).free_symbols)


def runs_of(labels: Sequence[object]) -> list[tuple[int, int]]:
    """Return (first, last) of every run of equal labels; each run ends at the start of the next."""
    starts = [0] + [k for k in range(1, len(labels)) if labels[k] != labels[k - 1]]
    return list(zip(starts, [*starts[1:], len(labels) - 1], strict=True))


def _draw_pieces(axes: Axes, motion: Motion, plane: _Plane, own: dict[str, Any]) -> list[_Entry]:
    """Draw the curve in pieces of one line style each, and return their legend entries."""
    seen: dict[str, _Entry] = {}
    named = {"label": own["label"]} if "label" in own else {}
    own = {key: value for key, value in own.items() if key != "label"}
    for label, piece in plane.pieces(motion.modes):
        _, colour, width = plane.line_style(motion.modes[piece.start])
        stick = label == "stick"
        points = motion.states[piece][:, [plane.x, plane.y]]
        # A stick of hardly any extent is drawn as a point.
        rest = stick and bool(np.ptp(points, axis=0).max() <= 1e-6 * np.abs(motion.states).max())
        line: dict[str, Any] = {"linewidth": width, "solid_capstyle": "butt"}
        line |= {"color": colour, "zorder": 3 if stick else 2} | own | named
        if rest:
            line |= {"marker": "o", "markersize": 5.0, "linestyle": "none"}
        axes.plot(*(points[-1:] if rest else points).T, **line)
        seen[label] = (label, line["color"], line["linewidth"], own.get("linestyle", "-"))
        named = {}
    return sorted(seen.values(), key=lambda entry: (entry[0] == "stick", entry[0]))


def _draw_arrows(axes: Axes, motion: Motion, plane: _Plane, own_colour: Any) -> None:
    """Draw the direction of motion in the middle of the longest piece of every kind of slip."""
    longest: dict[str, slice] = {}
    for label, piece in plane.pieces(motion.modes):
        if label != "stick" and _length(piece) > _length(longest.get(label, slice(0, 0))):
            longest[label] = piece
    for piece in longest.values():
        if _length(piece) < 8:
            continue
        middle = (piece.start + piece.stop) // 2
        tail, tip = motion.states[middle - 2, [plane.x, plane.y]], motion.states[middle + 2, [plane.x, plane.y]]
        colour = own_colour or plane.line_style(motion.modes[piece.start])[1]
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 0.0, "mutation_scale": 14}
        axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=arrow, zorder=4)


def _length(piece: slice) -> int:
    return int(piece.stop - piece.start)


def _draw_boundary(axes: Axes, system: FilippovSystem, plane: _Plane) -> list[_Entry]:
    """Draw the surfaces that are curves in this plane as dashed lines."""
    curves = surface_curves(system, (plane.x, plane.y), (axes.get_xlim(), axes.get_ylim()))
    for points in curves:
        axes.plot(*points.T, color=style.GREY, lw=0.9, ls="--", zorder=1)
    return [("surface h = 0", style.GREY, 0.9, "--")] if curves else []


def surface_curves(
    system: FilippovSystem, pair: tuple[int, int], limits: Sequence[tuple[float, float]]
) -> list[NDArray[np.float64]]:
    """Return the curves h = 0, points (k, 2), within limits, of the surfaces that depend on two states alone."""
    import contourpy

    states = [system.states[k] for k in pair]
    across, upward = (np.linspace(low, high, 121) for low, high in limits)
    plane = np.meshgrid(across, upward)
    found: list[NDArray[np.float64]] = []
    for k, surface in enumerate(system.surfaces):
        if not states_in(system, k) or not states_in(system, k) <= set(states):
            continue
        h = sp.lambdify(states, system.numeric(surface), np)
        values = np.broadcast_to(np.asarray(h(*plane), dtype=float), plane[0].shape)
        if np.nanmin(values) < 0 < np.nanmax(values):
            generator = contourpy.contour_generator(across, upward, np.ma.masked_invalid(values), name="mpl2014")
            found += [np.asarray(line) for line in generator.lines(0.0)[0]]
    return found


def _legend(axes: Axes, entries: Sequence[_Entry]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=c, lw=w, ls=d, label=label) for label, c, w, d in entries]
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2)


def limits_around(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return limits around a curve with some margin; a curve far beyond its 95 % quantile is cut off."""
    usual = float(np.percentile(np.abs(values), 95))
    if np.abs(values).max() > 50 * usual > 0:
        values = values[np.abs(values) <= 2 * usual]
    low, high = float(values.min()), float(values.max())
    room = 0.06 * (high - low) or 0.5
    return low - room, high + room


def symbol(system: FilippovSystem, k: int) -> str:
    return f"${latex(system.states[k])}$"


LABEL = 0.04
"""Distance below which transitions of one kind share a label, since two would overlap, as a fraction of the axes."""


def mark_transitions(axes: Axes, points: NDArray[np.float64], kinds: Sequence[str], times: NDArray[np.float64]) -> None:
    """Mark transitions at points, shape (k, 2), on axes whose limits are set."""
    from matplotlib.patheffects import Normal, Stroke

    axes.plot(*points.T, marker="o", markersize=3.5, linestyle="none", color=style.BLACK, zorder=5)
    size = np.abs([np.diff(axes.get_xlim())[0], np.diff(axes.get_ylim())[0]])
    places: list[tuple[str, NDArray[np.float64], list[float]]] = []
    for kind, point, time in zip(kinds, points, times.tolist(), strict=True):
        near = [own for own in places if own[0] == kind and (np.abs(own[1] - point) <= LABEL * size).all()]
        if near:
            near[0][2].append(time)
        else:
            places.append((kind, point, [time]))
    if len(places) > 8:  # labels would overlap
        return
    centre = np.mean([axes.get_xlim(), axes.get_ylim()], axis=1)
    halo = [Stroke(linewidth=2.0, foreground="white"), Normal()]
    for kind, point, own in places:
        shown = ", ".join(f"{time:.4g}" for time in own[:2]) + (", ..." if len(own) > 2 else "")
        right, above = point > centre  # labels extend towards the centre, where there is space
        axes.annotate(
            f"{kind} {shown} s", tuple(point), xytext=(-3 if right else 3, -4 if above else 4),
            textcoords="offset points", rotation=50 if right == above else -50, rotation_mode="anchor",
            ha="right" if right else "left", va="top" if above else "bottom", fontsize=7, zorder=6, path_effects=halo,
        )  # fmt: skip
