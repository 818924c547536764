"""Animation of a scene during a run, by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.axes import Axes
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.figures.motion import Motion, values_along
from henon_ref.figures.scene import HALF, blank, draw_body, draw_symbol, lines_of, places_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.system.assembly import Body, Scene

Vector = NDArray[np.float64]


class SceneAnimation(FuncAnimation):
    """Animation that a notebook shows as HTML5 with buttons, and that saves as GIF without external programs."""

    def _repr_html_(self) -> str:
        return str(self.to_jshtml())

    def save(self, filename: str | Path, writer: Any = None, *more: Any, **how: Any) -> None:
        """Write a file: ``.gif``, ``.html``, or a format of matplotlib's writers, with matplotlib's arguments."""
        known = {".gif": "pillow", ".html": "html"}
        super().save(str(filename), writer or known.get(Path(filename).suffix.lower()), *more, **how)


def animated(axes: Axes, scene: Scene, system: FilippovSystem, motion: Motion, fps: float) -> SceneAnimation:
    """Return the animation of a scene along a motion; contacts are drawn with thick lines while they stick.

    All displacements have the same scale and start at the places of the schematic; rotations are drawn unscaled.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    places, moved = places_of(scene), {body.name: _displacement(body, system, motion) for body in scene.bodies.values()}
    masses = [moved[body.name] for body in scene.bodies.values() if body.kind == "mass"]
    largest = max((float(np.abs(x).max()) for x in masses), default=0.0)
    # Largest drawn displacement, relative to the distance of two bodies; several masses must not overlap.
    scale = (0.45 if len(masses) == 1 else 0.22) / largest if largest else 1.0

    def draw(frame: int) -> Sequence[Any]:
        axes.clear()
        blank(axes, scene, places)
        at = {
            name: place + np.array([scale * moved[name][frame] if scene.bodies[name].kind == "mass" else 0.0, 0.0])
            for name, place in places.items()
        }
        held = {sign.name for sign, entry in zip(system.signs, motion.modes[frame], strict=False) if entry == 0}
        for connection, ends, shift in lines_of(scene, at):
            sticks = bool(held & {sign.name for sign in connection.surfaces})
            own = {"lw": 2.6} if sticks else {"color": style.GREY} if connection.kind == "friction" else {}
            draw_symbol(axes, connection, ends, shift, elastic=connection.kind == "spring", **own)
        for body in scene.bodies.values():
            draw_body(axes, body, at[body.name])
            _draw_marks(axes, body, at[body.name], float(moved[body.name][frame]), scale)
        signs = [sign.name for sign in system.signs[:4]]
        words = [f"{name}: {'stick' if name in held else 'slip'}" for name in signs]
        axes.set_title(f"t = {motion.times[frame]:.2f} s   {'   '.join(words)}", loc="left", x=0.02)
        return ()

    def in_style(frame: int) -> Sequence[Any]:
        with style.report_style():
            return draw(frame)

    return SceneAnimation(figure, in_style, frames=len(motion.times), interval=1000 / fps, repeat=True)


def _displacement(body: Body, system: FilippovSystem, motion: Motion) -> Vector:
    """Return a body's position [m or rad] at each time; integrated from the velocity if only that is given."""
    if body.states:
        return motion.states[:, system.states.index(body.states[0])]
    given = body.velocity if body.position is None else body.position
    values = values_along(system, motion, given)
    if body.position is not None:
        return values
    steps = np.diff(motion.times) * (values[1:] + values[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(steps)])


def _draw_marks(axes: Axes, body: Body, at: Vector, moved: float, scale: float) -> None:
    """Draw marks that show the rotation of a rotor, or the movement of a body of prescribed motion."""
    x, y = at
    if body.kind == "rotor":
        axes.plot([x, x + HALF * np.cos(moved)], [y, y + HALF * np.sin(moved)], color=style.BLACK, lw=1.4, zorder=4)
    elif body.kind == "prescribed":
        way = 3.2 * HALF
        for k in range(4):
            mark = x - way / 2 + (scale * moved + k * way / 4) % way
            axes.plot([mark, mark], [y - HALF / 2, y + HALF / 2], color=style.GREY, lw=1.2, zorder=4)
