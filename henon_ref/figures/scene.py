"""Schematic of a scene: bodies as boxes and discs, connections as symbols of springs, dampers and so on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.grouping import grouped
from henon_ref.system.assembly import Body, Connection, Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_BODIES = 12
HALF = 0.24
"""Half the side of a body, relative to the distance of two bodies."""
DEPTH, TITLE_ROOM = 1.8, 0.3
"""Height below the row of bodies, in the same unit, and height for the title [in]."""
Place = NDArray[np.float64]
_Line = tuple[Connection, list[Place], float]
"""Connection, places of its ends, and sideways offset from other connections between them."""


def draw_scene(scene: Scene) -> Figure | None:
    """Return the schematic of a scene; None if it has too many bodies."""
    if len(scene.bodies) > MOST_BODIES:
        return None
    width, height = figure_size(scene)
    with style.figure(height, width=width) as figure:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1 - TITLE_ROOM / height))
        schematic(axes, scene)
        title = "Bodies and what connects them"
        axes.set_title(title, x=0.02)
        listed = "; ".join(connection.label for connection in scene.connections)
        style.describe(figure, title, f"Bodies: {', '.join(scene.bodies)}. Connections: {listed}.")
        return figure


def figure_size(scene: Scene) -> tuple[float, float]:
    """Return width and height of a figure for a scene [in]."""
    width, top = _extent(scene, places_of(scene))
    scale = min(style.WIDTH / width, 1.25)
    return max(scale * width, 2.6), scale * (DEPTH + top) + TITLE_ROOM


def _extent(scene: Scene, places: Mapping[str, Place]) -> tuple[float, float]:
    """Return the width, and the height above the row of bodies."""
    pushed = any(len(connection.ends) == 1 for connection in scene.connections)
    return 1.6 + max(p[0] for p in places.values()), 0.85 if pushed else 0.35


def blank(axes: Axes, scene: Scene, places: Mapping[str, Place]) -> None:
    """Prepare empty axes for a scene."""
    width, top = _extent(scene, places)
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(-0.8, width - 0.8)
    axes.set_ylim(-DEPTH, top)


def schematic(axes: Axes, scene: Scene, **patch: Any) -> None:
    """Draw a scene on axes; ``patch`` are keywords of matplotlib's patches, for the bodies."""
    places = places_of(scene)
    blank(axes, scene, places)
    lines = lines_of(scene, places)
    for connection, ends, shift in lines:
        draw_symbol(axes, connection, ends, shift)
    _draw_labels(axes, lines, [_half_size(scene.bodies[name]) for name in places], list(places.values()))
    for body in scene.bodies.values():
        draw_body(axes, body, places[body.name], **patch)


def lines_of(scene: Scene, places: Mapping[str, Place]) -> list[_Line]:
    """Return every connection as a line; connections of the same bodies are side by side."""
    pairs = grouped(scene.connections, lambda connection: frozenset(connection.ends))
    return [
        (connection, [places[name] for name in connection.ends], 0.13 * (2 * number - len(pair) + 1))
        for pair in pairs.values()
        for number, connection in enumerate(pair)
    ]


def places_of(scene: Scene) -> Mapping[str, Place]:
    """Return the places of bodies: free bodies in a row, the others below the bodies connected to them."""
    free = [body.name for body in scene.bodies.values() if body.inertia is not None]
    places = {name: np.array([float(k), 0.0]) for k, name in enumerate(free)}
    partners: dict[str, list[float]] = {name: [] for name in scene.bodies if name not in places}
    for connection in scene.connections:
        for name in set(connection.ends) & set(partners):
            partners[name] += [places[other][0] for other in connection.ends if other in places]
    wanted = {name: float(np.mean(found)) if found else len(free) / 2 for name, found in partners.items()}
    order = sorted(wanted, key=lambda name: wanted[name])
    at = [wanted[name] for name in order]
    for k in range(1, len(at)):
        at[k] = max(at[k], at[k - 1] + 1)
    surplus = max(0.0, at[-1] - max(len(free) - 1, 0)) / 2 if at else 0.0
    below = {name: np.array([x - surplus, -1.4]) for name, x in zip(order, at, strict=True)}
    leftmost = min((p[0] for p in (*places.values(), *below.values())), default=0.0)
    return {name: p - np.array([leftmost, 0.0]) for name, p in {**places, **below}.items()}


def _half_size(body: Body) -> Place:
    return HALF * np.array([1.0, 1.0] if body.inertia is not None else [1.6, 0.5])


def draw_body(axes: Axes, body: Body, at: Place, **own: Any) -> None:
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.patches import Circle, Rectangle

    (x, y), half, free = at, _half_size(body), body.inertia is not None
    patch = Circle((x, y), HALF) if body.kind == "rotor" else Rectangle(tuple(at - half), *(2 * half))
    patch.set(facecolor=style.PLUS_SHADE if free else style.MINUS_SHADE, edgecolor=style.BLACK if free else style.GREY)
    patch.set(hatch="////" if body.kind == "fixed" else None)
    patch.set(**{"linewidth": 1.0, "zorder": 3} | normalize_kwargs(own, Rectangle))
    axes.add_patch(patch)
    if body.kind == "prescribed":
        _arrow(axes, at + _corners(-HALF, 0, HALF, 0), style.GREY)
    axes.text(x, y if free else y - 0.25, body.name, ha="center", va="center", zorder=5)


def draw_symbol(
    axes: Axes, connection: Connection, ends: Sequence[Place], shift: float, *, elastic: bool = False, **own: Any
) -> None:
    """Draw the symbol of a connection; an elastic one extends over the whole distance between its ends."""
    strokes = _strokes(connection, ends, shift, elastic=elastic)
    if len(ends) == 1:
        _arrow(axes, strokes[0], style.VERMILLION)
        return
    line: dict[str, Any] = {
        "color": SYMBOLS.get(connection.kind, SYMBOLS[""])[1],
        "lw": 1.1,
        "zorder": 2,
        "solid_capstyle": "round",
    }
    for points in strokes:
        axes.plot(*points.T, **line | own)


def _strokes(connection: Connection, ends: Sequence[Place], shift: float, *, elastic: bool = False) -> Sequence[Place]:
    """Return the corners of the lines of a connection's symbol; for an external force, of its arrow."""
    if len(ends) == 1:
        return [ends[0] + _corners(shift - 0.3, 0.55, shift + 0.3, 0.55)]
    length, along, across = _direction(*ends)
    start = ends[0] + shift * across
    return [
        start
        + np.outer(piece[:, 0] * length if elastic else _stretched(piece[:, 0], length), along)
        + np.outer(piece[:, 1], across)
        for piece in SYMBOLS.get(connection.kind, SYMBOLS[""])[0]
    ]


def _direction(p: Place, q: Place) -> tuple[float, Place, Place]:
    """Return the distance of two places, and the unit vectors along and across their line."""
    length = float(np.linalg.norm(q - p))
    along = (q - p) / length
    return length, along, np.array([-along[1], along[0]])


def _stretched(along: Place, length: float) -> Place:
    """Return places along a symbol of length 1; its middle keeps its size, its ends reach the bodies."""
    return np.interp(along, [0.0, 0.25, 0.75, 1.0], [0.0, length / 2 - 0.25, length / 2 + 0.25, length])


def _draw_labels(axes: Axes, lines: Sequence[_Line], halves: list[Place], centres: list[Place]) -> None:
    """Draw a label for each connection, clear of symbols, bodies (centres and half sizes) and other labels."""
    strokes = [_dense(stroke) for line in lines for stroke in _strokes(*line)]
    drawn = np.concatenate(strokes) if strokes else np.empty((0, 2))
    left, right = axes.get_xlim()

    def covered(tried: tuple[str, Place, Place]) -> int:
        """Return how much a label would cover, or extend beyond the edge."""
        _, at, half = tried
        others = sum(bool((np.abs(c - at) < own + half).all()) for c, own in zip(centres, halves, strict=True))
        beyond = not left + half[0] < at[0] < right - half[0]
        return int((np.abs(drawn - at) < half).all(axis=1).sum()) + len(drawn) * (others + beyond)

    for connection, ends, shift in lines:
        tries = [own for text in _texts(connection) for own in _label_places(text, ends, shift)]
        text, at, half = min(tries, key=covered)  # the first one among equals
        centres.append(at)
        halves.append(half)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8}
        axes.text(at[0], at[1], text, fontsize=7, ha="center", va="center", zorder=4, bbox=box)


def _dense(corners: Place) -> Place:
    """Return points along a line through corners."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.append(np.arange(0.0, way[-1], 0.02), way[-1])
    return np.column_stack([np.interp(at, way, corners[:, k]) for k in (0, 1)])


def _texts(connection: Connection) -> list[str]:
    """Return a connection's kind and name on one line, and on two lines, which is narrower."""
    signs = [sign.name for sign in connection.surfaces]
    words = [connection.kind, *(signs or ([connection.name] if connection.name else []))]
    return [" ".join(words), "\n".join(words)]


def _label_places(text: str, ends: Sequence[Place], shift: float) -> list[tuple[str, Place, Place]]:
    """Return a label with its possible places, in order of preference, and half of its width and height."""
    rows = text.split("\n")
    half = np.array([0.047 * max(map(len, rows)), 0.11 * len(rows)]) / 2  # width of a letter, height of a line
    if len(ends) == 1:
        return [(text, ends[0] + np.array([shift, 0.69]), half)]
    length, along, across = _direction(*ends)
    start = ends[0] + shift * across
    room = 0.12 + float(np.abs(across) @ half)
    parts = (0.5, 0.42, 0.58, 0.33, 0.67, 0.25, 0.75)
    return [(text, start + part * length * along + side * room * across, half) for part in parts for side in (1, -1)]


def _arrow(axes: Axes, ends: Place, colour: str) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), arrowprops=arrow, zorder=4)


def _corners(*values: float) -> Place:
    return np.reshape(values, (-1, 2))


def _plates(gap: float) -> list[Place]:
    """Return two plates at a distance from the middle."""
    p, q = 0.5 - gap, 0.5 + gap
    return [_corners(0, 0, p, 0), _corners(p, 0.1, p, -0.1), _corners(q, 0.1, q, -0.1), _corners(q, 0, 1, 0)]


_ZIGZAG = np.column_stack([np.linspace(0.3, 0.7, 9), 0.07 * np.array([0, 1, -1, 1, -1, 1, -1, 1, 0])])
SYMBOLS: Mapping[str, tuple[Sequence[Place], str]] = {
    "": ([_corners(0, 0, 1, 0)], style.BLACK),
    "spring": ([np.vstack([[0, 0], _ZIGZAG, [1, 0]])], style.BLUE),
    "damper": (
        [
            _corners(0, 0, 0.42, 0),
            _corners(0.6, 0.08, 0.42, 0.08, 0.42, -0.08, 0.6, -0.08),
            _corners(0.54, 0.05, 0.54, -0.05),
            _corners(0.54, 0, 1, 0),
        ],
        style.GREEN,
    ),
    "friction": (_plates(0.03), style.VERMILLION),
    "stop": (_plates(0.1), style.PURPLE),
}
"""Kind of connection -> lines of its symbol (along and across the line between two bodies), and its colour."""
