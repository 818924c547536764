"""Scenes in Python: bodies and their connections, with the keys of a case file's ``scene``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from henon_ref.errors import ArgumentError
from henon_ref.simulation.system import System
from henon_ref.system.python_arguments import (
    check_words,
    explained_methods,
    mapping_of,
    source_of,
    tree_of,
    written_name,
)
from henon_ref.system.scene import STATE_NAMES
from henon_ref.system.source import Source
from henon_ref.system.tree import Node, Place, mapping, sequence
from henon_ref.text import listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from henon_ref.figures.animation import SceneAnimation
    from henon_ref.simulation.solution import Solution

Value = Any
"""Number, text or SymPy expression in the parameters; if documented, also in time ``t`` and the states."""


@dataclass(frozen=True)
class SceneBody:
    """Body of a :class:`Scene`."""

    name: str
    states: tuple[str, ...] = ()
    """Names of its states: position [m] and velocity [m/s], or angle [rad] and angular velocity [rad/s]; empty if its
    motion is prescribed."""


@explained_methods
class Scene:
    """Bodies on a line or an axis, and their connections; :meth:`system` derives the equations of motion.

    The equations contain only the declared effects. Keys, units and laws are those of a case file's ``scene``.

    Parameters
    ----------
    parameters : mapping, optional
        Name -> number, or an expression in other parameters.

    Notes
    -----
    Values are text or SymPy expressions in the parameters, or numbers, which are exact (a float stands for the decimal
    number that Python prints). Between rotors read N m for N, and rad for m. v_p and v_q are the velocities of the
    first and the second body.

    Examples
    --------
    >>> scene = Scene(parameters={"k": 1, "vb": 0.2})
    >>> block = scene.body("block", mass=1)
    >>> belt = scene.prescribed("belt", velocity="vb")
    >>> scene.spring(block, scene.wall, stiffness="k")
    >>> scene.friction(block, belt, law="coulomb", force=1, static=1.4)
    >>> scene.system()
    System(x_block, v_block; s_block_belt: v_block - vb; k = 1, vb = 1/5)
    """

    def __init__(self, parameters: Mapping[Any, Any] | None = None) -> None:
        self._parameters = mapping_of({} if parameters is None else parameters, "'parameters'")
        self._bodies: dict[str, Node] = {}
        self._connections: list[Node] = []
        self._declared: list[str] = []
        """Description of each declaration, for messages; the line of a node is its declaration's number, from 1."""

    # -- bodies -----------------------------------------------------------------------------------------

    def body(self, name: str, mass: Value, states: Sequence[str] | None = None) -> SceneBody:
        """Add a mass [kg] that moves along the line.

        ``states`` gives the names of its position [m] and velocity [m/s]; by default ``x_NAME`` and ``v_NAME``.
        """
        return self._moving(name, {"mass": mass}, states, STATE_NAMES["mass"])

    def rotor(self, name: str, inertia: Value, states: Sequence[str] | None = None) -> SceneBody:
        """Add a rotor with a moment of inertia [kg m^2].

        ``states`` gives the names of its angle [rad] and angular velocity [rad/s]; by default ``phi_NAME`` and
        ``omega_NAME``.
        """
        return self._moving(name, {"inertia": inertia}, states, STATE_NAMES["rotor"])

    def prescribed(self, name: str, position: Value = None, velocity: Value = None) -> SceneBody:
        """Add a body with prescribed motion: its position [m or rad], or only its velocity [m/s or rad/s], in ``t``."""
        given = {"position": position, "velocity": velocity}
        return self._body(name, {key: value for key, value in given.items() if value is not None})

    def fixed(self, name: str, position: Value = 0) -> SceneBody:
        """Add a fixed body at a position [m or rad]."""
        return self._body(name, {"fixed": position})

    @property
    def wall(self) -> SceneBody:
        """The fixed body ``wall`` at 0."""
        return SceneBody("wall") if "wall" in self._bodies else self.fixed("wall")

    # -- connections ------------------------------------------------------------------------------------

    def spring(
        self, p: SceneBody | str, q: SceneBody | str, *, stiffness: Value = None, cubic: Value = None, name: str = ""
    ) -> None:
        """Add a spring with force -(stiffness d + cubic d^3) on the first body, d = x_p - x_q [N/m, N/m^3]."""
        self._between("spring", p, q, name, stiffness=stiffness, cubic=cubic)

    def damper(self, p: SceneBody | str, q: SceneBody | str, *, coefficient: Value, name: str = "") -> None:
        """Add a damper with force -coefficient (v_p - v_q) on the first body [N s/m]."""
        self._between("damper", p, q, name, coefficient=coefficient)

    def friction(
        self,
        p: SceneBody | str,
        q: SceneBody | str,
        *,
        law: str,
        force: Value,
        static: Value = None,
        slope: Value = None,
        velocity: Value = None,
        viscous: Value = None,
        normal: Value = None,
        name: str = "",
    ) -> None:
        """Add dry friction between two bodies; the contact sticks while its load is within the static limit.

        Parameters
        ----------
        p, q : SceneBody or str
        law : {"coulomb", "stribeck", "stribeck_exp"}
            ``force``; force/(1 + slope abs(v)), Eq. (2) of Olejnik and Awrejcewicz (2013);
            force + (static - force) exp(-abs(v)/velocity).
        force : number, str or Expr
            Kinetic friction force [N]; with ``normal``, the coefficient of kinetic friction [1].
        static : number, str or Expr, optional
            Static friction limit [N] or coefficient [1]; by default ``force``.
        slope, velocity : number, str or Expr, optional
            Parameters of the laws ``stribeck`` [s/m] and ``stribeck_exp`` [m/s].
        viscous : number, str or Expr, optional
            Coefficient of an additional viscous force [N s/m].
        normal : number, str or Expr, optional
            Normal load on the contact, in ``t`` and states [N]; negative values count as 0.
        name : str
            Symbol of the contact's sign; by default ``s_P_Q``.
        """
        keys = {"law": law, "force": force, "slope": slope, "velocity": velocity}
        self._between("friction", p, q, name, **keys, viscous=viscous, static=static, normal=normal)

    def stop(
        self,
        p: SceneBody | str,
        q: SceneBody | str,
        *,
        gap: Value,
        stiffness: Value = None,
        damping: Value = None,
        restitution: Value = None,
        name: str = "",
    ) -> None:
        """Add a stop that keeps x_p - x_q at or above ``gap`` [m].

        With ``restitution`` (speed after an impact over the speed before it, 0 to 1) the stop is rigid; otherwise it is
        elastic, with ``stiffness`` [N/m] and ``damping`` [N s/m].
        """
        self._between("stop", p, q, name, gap=gap, stiffness=stiffness, damping=damping, restitution=restitution)

    def force(self, body: SceneBody | str, value: Value, name: str = "") -> None:
        """Add an external force [N] on a mass, in ``t`` and parameters."""
        self._on("force", body, value, name)

    def torque(self, body: SceneBody | str, value: Value, name: str = "") -> None:
        """Add an external torque [N m] on a rotor, in ``t`` and parameters."""
        self._on("torque", body, value, name)

    # -- equations --------------------------------------------------------------------------------------

    def system(self) -> System:
        """Derive the equations of motion: positions and velocities are states, contacts and stops are surfaces.

        Raises
        ------
        ArgumentError
            If a declaration is invalid. The message names it and states what is wrong and what is allowed.
        """
        bodies, connections = mapping(self._bodies), sequence(self._connections)
        scene = mapping({"parameters": self._parameters, "bodies": bodies, "connections": connections})
        return System.from_source(source_of(mapping({"scene": scene})), self._declared)

    # -- pictures ---------------------------------------------------------------------------------------

    def plot(self, ax: Axes | None = None, **patch: Any) -> Axes:
        """Draw the scene as a schematic: bodies as boxes and discs, connections by symbol and name.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw into; by default a new pyplot figure.
        **patch
            Matplotlib's patch keywords for the bodies, such as ``facecolor``.

        Raises
        ------
        ArgumentError
            If the scene is invalid, or has more bodies than a schematic shows.
        """
        from matplotlib.patches import Patch

        from henon_ref.figures import style
        from henon_ref.figures.plots import keywords_of
        from henon_ref.figures.scene import schematic

        check_words("Scene.plot", patch, ("ax",), keywords_of(Patch))
        scene = self._drawable()
        with style.report_style():
            ax = self._axes(scene) if ax is None else ax
            schematic(ax, scene, **patch)
        return ax

    def animate(
        self, run: Solution, times: Sequence[float] | None = None, *, fps: float = 20, ax: Axes | None = None
    ) -> SceneAnimation:
        """Animate the scene along a run.

        Parameters
        ----------
        run : Solution
            A run of :meth:`system` with dense output.
        times : sequence of float, optional
            Times of the frames [s]; by default 100 equidistant times over the run.
        fps : float
            Frames per second.
        ax : matplotlib Axes, optional
            Axes to draw into; by default a new pyplot figure.

        Returns
        -------
        matplotlib.animation.FuncAnimation
            A notebook shows it as HTML5; ``.save("belt.gif")`` and ``.save("belt.html")`` write a file.

        Raises
        ------
        ArgumentError
            If the run is of a different system or has no dense output, and as in :meth:`plot`.
        """
        from henon_ref.figures.animation import animated

        scene = self._drawable()
        if run.system.state != self.system().state:
            raise ArgumentError(
                f"the run has the states {listed(run.system.state)}; wanted a run of this scene's system"
            )
        motion = run.motion_at(np.linspace(run.start_time, run.trajectory.end_time, 100) if times is None else times)
        return animated(self._axes(scene) if ax is None else ax, scene, run.system.model, motion, fps)

    def _drawable(self) -> Any:
        """Return the scene with its expressions parsed."""
        from henon_ref.figures.scene import MOST_BODIES
        from henon_ref.system.problem import read_scene

        if len(self._bodies) > MOST_BODIES:
            raise ArgumentError(f"the scene has {len(self._bodies)} bodies; a picture shows at most {MOST_BODIES}")
        return read_scene(Source(self.system().tree))

    @staticmethod
    def _axes(scene: Any) -> Axes:
        from henon_ref.figures import style
        from henon_ref.figures.scene import TITLE_ROOM, figure_size

        width, height = figure_size(scene)
        return style.pyplot_figure(height, width).add_axes((0.0, 0.0, 1.0, 1 - TITLE_ROOM / height))

    def _moving(
        self, name: str, given: dict[str, Value], states: Sequence[str] | None, letters: tuple[str, str]
    ) -> SceneBody:
        named = [f"{letter}_{name}" for letter in letters]
        if states is not None:
            named = [written_name(state, f"'states' of '{name}'") for state in states]
            if len(named) != 2:
                raise ArgumentError(f"'states' of '{name}' must be two names, as in ['{letters[0]}', '{letters[1]}']")
            given["states"] = named
        return SceneBody(self._body(name, given).name, (named[0], named[1]))

    def _body(self, name: str, given: Mapping[str, Value]) -> SceneBody:
        written = written_name(name, "a body's name")
        if written in self._bodies:
            raise ArgumentError(f"a body '{written}' exists already; bodies: {listed(self._bodies)}")
        self._bodies[written] = self._node(f"body '{written}'", given)
        return SceneBody(written)

    def _between(self, kind: str, p: SceneBody | str, q: SceneBody | str, name: str, **values: Value) -> None:
        between = [_name_of(p), _name_of(q)]
        what = f"{kind} between '{between[0]}' and '{between[1]}'"
        self._connect(what, kind, {"between": between, **values, "name": name or None})

    def _on(self, kind: str, body: SceneBody | str, value: Value, name: str) -> None:
        on = _name_of(body)
        self._connect(f"{kind} on '{on}'", kind, {"on": on, "value": value, "name": name or None})

    def _connect(self, what: str, kind: str, given: Mapping[str, Value]) -> None:
        self._connections.append(self._node(what, {kind: {k: v for k, v in given.items() if v is not None}}))

    def _node(self, what: str, given: Mapping[str, Value]) -> Node:
        self._declared.append(what)
        return tree_of(given, what, place=Place(len(self._declared), 0))


def _name_of(body: SceneBody | str) -> str:
    return body.name if isinstance(body, SceneBody) else written_name(body, "a body")
