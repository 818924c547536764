"""A scene as a schematic: bodies as boxes and discs, what connects them as springs, dampers and the like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.casefile.assembly import Connection, Scene
from henon_ref.casefile.bodies import Body
from henon_ref.figures import style
from henon_ref.figures.description import describe

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Bodies and what connects them"
MOST_BODIES = 12
"""Bodies that one figure shows."""
HALF = 0.24
"""Half the side of a body, the distance of two being 1."""
SIDEWAYS = 0.13
"""Half the distance between connections of the same two bodies."""
LETTER, LINE = 0.047, 0.11
"""Width of a letter and height of a line of a label, the distance of two bodies being 1."""
DEPTH, TITLE_ROOM = 1.8, 0.3
"""Height below the row of bodies, likewise, and room for a title [in]."""
SYMBOL = 0.1
"""Half the side of a symbol, likewise."""
Place = NDArray[np.float64]
_Taken = tuple[Place, float]
"""A place, and half the width of what stands there."""


def draw_scene(scene: Scene) -> Figure | None:
    """The scene's schematic; None where it has too many bodies for one."""
    if len(scene.bodies) > MOST_BODIES:
        return None
    width, height = figure_size(scene)
    with style.figure(height, width=width) as figure:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1 - TITLE_ROOM / height))
        schematic(axes, scene)
        axes.set_title(TITLE, x=0.02)
        listed = "; ".join(connection.label for connection in scene.connections)
        describe(figure, TITLE, f"Bodies: {', '.join(scene.bodies)}. Connections: {listed}.")
        return figure


def figure_size(scene: Scene) -> tuple[float, float]:
    """Width and height of a figure for a scene [in]."""
    width, top = _extent(scene, places_of(scene))
    scale = min(style.WIDTH / width, 1.25)
    return max(scale * width, 2.6), scale * (DEPTH + top) + TITLE_ROOM


def _extent(scene: Scene, places: Mapping[str, Place]) -> tuple[float, float]:
    """Width, and height above the row of bodies."""
    pushed = any(len(connection.ends) == 1 for connection in scene.connections)
    return 1.6 + max(p[0] for p in places.values()), 0.85 if pushed else 0.35


def blank(axes: Axes, scene: Scene, places: Mapping[str, Place]) -> None:
    """Axes for a scene, with nothing in them."""
    width, top = _extent(scene, places)
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(-0.8, width - 0.8)
    axes.set_ylim(-DEPTH, top)


def schematic(axes: Axes, scene: Scene, **patch: Any) -> None:
    """The scene in axes of its own; ``patch`` are matplotlib's keywords of patches, for the bodies."""
    places = places_of(scene)
    blank(axes, scene, places)
    lines = lines_of(scene, places)
    taken = [(_middle(ends, shift), SYMBOL) for _, ends, shift in lines]
    for connection, ends, shift in lines:
        draw_symbol(axes, connection, ends, shift)
        _label(axes, connection, _label_places(connection, ends, shift), taken)
    for body in scene.bodies.values():
        draw_body(axes, body, places[body.name], **patch)


def lines_of(scene: Scene, places: Mapping[str, Place]) -> list[tuple[Connection, list[Place], float]]:
    """Each connection, the places that it leads to, and how far it stands aside from others between these."""
    return [
        (connection, [places[name] for name in connection.ends], SIDEWAYS * (2 * number - len(pair) + 1))
        for pair in _pairs(scene).values()
        for number, connection in enumerate(pair)
    ]


def places_of(scene: Scene) -> Mapping[str, Place]:
    """Bodies that move freely in a row, the others below what they are connected to."""
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


def _pairs(scene: Scene) -> Mapping[frozenset[str], list[Connection]]:
    """Connections by the bodies they act on."""
    found: dict[frozenset[str], list[Connection]] = {}
    for connection in scene.connections:
        found.setdefault(frozenset(connection.ends), []).append(connection)
    return found


def draw_body(axes: Axes, body: Body, at: Place, **own: Any) -> None:
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.patches import Circle, Rectangle

    x, y = at
    if body.inertia is not None:
        square = Rectangle((x - HALF, y - HALF), 2 * HALF, 2 * HALF)
        patch = Circle((x, y), HALF) if body.kind == "rotor" else square
        patch.set(facecolor=style.PLUS_SHADE, edgecolor=style.BLACK)
    else:
        patch = Rectangle((x - 1.6 * HALF, y - 0.5 * HALF), 3.2 * HALF, HALF)
        patch.set(facecolor=style.MINUS_SHADE, edgecolor=style.GREY, hatch="////" if body.kind == "fixed" else None)
    patch.set(**{"linewidth": 1.0, "zorder": 3} | normalize_kwargs(own, Rectangle))
    axes.add_patch(patch)
    if body.kind == "prescribed":
        _arrow(axes, np.array([x - HALF, y]), np.array([x + HALF, y]), style.GREY)
    axes.text(x, y if body.inertia is not None else y - 0.25, body.name, ha="center", va="center", zorder=5)


def draw_symbol(
    axes: Axes, connection: Connection, ends: Sequence[Place], shift: float, *, elastic: bool = False, **own: Any
) -> None:
    """The symbol of a connection; an elastic one is as long as the way between its ends."""
    if len(ends) == 1:
        _arrow(axes, *_force_arrow(ends[0], shift), style.VERMILLION)
        return
    p, q = ends
    length, along, across = _direction(p, q)
    pieces, colour = SYMBOLS.get(connection.kind, SYMBOLS[""])
    line: dict[str, Any] = {"color": colour, "lw": 1.1, "zorder": 2, "solid_capstyle": "round"}
    for piece in pieces:
        way = piece[:, 0] * length if elastic else _stretched(piece[:, 0], length)
        points = p + shift * across + np.outer(way, along) + np.outer(piece[:, 1], across)
        axes.plot(*points.T, **line | own)


def _direction(p: Place, q: Place) -> tuple[float, Place, Place]:
    """Distance of two places, and the unit vectors along and across their line."""
    length = float(np.linalg.norm(q - p))
    along = (q - p) / length
    return length, along, np.array([-along[1], along[0]])


def _force_arrow(at: Place, shift: float) -> tuple[Place, Place]:
    return at + np.array([shift - 0.3, 0.55]), at + np.array([shift + 0.3, 0.55])


def _label_places(connection: Connection, ends: Sequence[Place], shift: float) -> list[Place]:
    """Where the label of a connection may stand, the best place first."""
    if len(ends) == 1:
        tail, tip = _force_arrow(ends[0], shift)
        return [(tail + tip) / 2 + np.array([0.0, 0.14])]
    p, q = ends
    length, along, across = _direction(p, q)
    start = p + shift * across
    room = 0.18 - 0.06 * abs(across[0]) + abs(across[0]) * LETTER * len(_text(connection)) / 2
    return [start + part * length * along + side * room * across for part in (0.5, 0.33, 0.67) for side in (1, -1)]


def _stretched(along: Place, length: float) -> Place:
    """Places along a symbol of length 1: its middle keeps its size, its ends reach to the bodies."""
    return np.where(
        along < 0.25, along * 4 * (length / 2 - 0.25), np.where(along > 0.75, length, along - 0.5 + length / 2)
    )


def _middle(ends: Sequence[Place], shift: float) -> Place:
    """Where the symbol of a connection stands."""
    if len(ends) == 1:
        return ends[0] + np.array([shift, 0.55])
    p, q = ends
    return (p + q) / 2 + shift * _direction(p, q)[2]


def _text(connection: Connection) -> str:
    signs = [surface.sign.name for surface in connection.surfaces]
    return " ".join([connection.kind, *(signs or ([connection.name] if connection.name else []))])


def _label(axes: Axes, connection: Connection, tries: Sequence[Place], taken: list[_Taken]) -> None:
    """A label at the first of some places that is free."""
    text = _text(connection)
    half = LETTER * len(text) / 2
    left, right = axes.get_xlim()
    free = (
        at
        for at in tries
        if left + half < at[0] < right - half
        and all(abs(at[0] - x) > half + wide or abs(at[1] - y) > LINE for (x, y), wide in taken)
    )
    at = next(free, tries[0])
    taken.append((at, half))
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8}
    axes.text(float(at[0]), float(at[1]), text, fontsize=7, ha="center", va="center", zorder=4, bbox=box)


def _arrow(axes: Axes, tail: Place, tip: Place, colour: str) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=arrow, zorder=4)


def _zigzag() -> Place:
    x = np.linspace(0.3, 0.7, 9)
    y = 0.07 * np.array([0, 1, -1, 1, -1, 1, -1, 1, 0])
    return np.array([(0.0, 0.0), *zip(x, y, strict=True), (1.0, 0.0)])


_STRAIGHT = np.array([(0.0, 0.0), (1.0, 0.0)])
SYMBOLS: Mapping[str, tuple[Sequence[Place], str]] = {
    "": ([_STRAIGHT], style.BLACK),
    "spring": ([_zigzag()], style.BLUE),
    "damper": (
        [
            np.array([(0.0, 0.0), (0.42, 0.0)]),
            np.array([(0.6, 0.08), (0.42, 0.08), (0.42, -0.08), (0.6, -0.08)]),
            np.array([(0.54, 0.05), (0.54, -0.05)]),
            np.array([(0.54, 0.0), (1.0, 0.0)]),
        ],
        style.GREEN,
    ),
    "friction": (
        [
            np.array([(0.0, 0.0), (0.47, 0.0)]),
            np.array([(0.47, 0.1), (0.47, -0.1)]),
            np.array([(0.53, 0.1), (0.53, -0.1)]),
            np.array([(0.53, 0.0), (1.0, 0.0)]),
        ],
        style.VERMILLION,
    ),
    "stop": (
        [
            np.array([(0.0, 0.0), (0.4, 0.0)]),
            np.array([(0.4, 0.1), (0.4, -0.1)]),
            np.array([(0.6, 0.1), (0.6, -0.1)]),
            np.array([(0.6, 0.0), (1.0, 0.0)]),
        ],
        style.PURPLE,
    ),
}
"""Kind of connection -> pieces of its symbol, along and across the line between two bodies, and its colour."""
