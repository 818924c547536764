"""Result of a simulation."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.integrator.records import TRANSITION_PLACES
from henon_ref.integrator.run_result import DenseOutput, TransitionArray, checked_times
from henon_ref.kernel.library import kernel
from henon_ref.modes.mode import Mode
from henon_ref.simulation.launch import Outcome
from henon_ref.simulation.system import System
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed
from henon_ref.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from henon_ref.figures.motion import Motion

_NO_DENSE = "requires dense output: simulate with dense_output=True"


class Solution(Outcome):
    """Result of one run: its solution, its transitions, and how it ended.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Times of the start, the ends of the steps, every transition (at least twice, for the states before and after
        it), and the end of the run [s]. Without dense output the ends of the steps are left out.
    y : ndarray, shape (n, k)
        States at ``t``. At a jump the state before each map comes first, then the state after it; without dense output
        only the state after it.
    sol : DenseOutput or None
        Dense output from the Taylor polynomials of the steps: ``sol(t)`` has shape (n,) for a number and (n, m) for m
        times. None without dense output.
    start_time : float
        Initial time [s].
    system, trajectory, status, success, message, counts, undecided_after, final_mode
        As in :class:`henon_ref.simulation.launch.Outcome`.
    """

    def __init__(
        self,
        base: System,
        parameters: Mapping[Any, Any] | None,
        start: float,
        pairs: Sequence[tuple[float, float]],
        trajectory: Trajectory,
        steps: NDArray[Any] | None,
    ) -> None:
        super().__init__(base, parameters, trajectory)
        self.start_time, self._pairs, self._steps = start, pairs, steps

    @cached_property
    def sol(self) -> DenseOutput | None:
        return None if self._steps is None else DenseOutput(self._steps, self.start_time, self.trajectory)

    @cached_property
    def t(self) -> NDArray[np.float64]:
        return self._nodes[0]

    @cached_property
    def y(self) -> NDArray[np.float64]:
        return self._nodes[1]

    @cached_property
    def _nodes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times, shape (k,), and states, shape (n, k)."""
        end, changes = self.trajectory, self._changes
        times, states = changes["time"], changes["state"]
        if self.sol is not None:
            begin, values = self.sol.begin, self.sol.coefficients[:, :, 0]
            at = np.maximum(np.searchsorted(begin, times), 1)  # the start precedes a transition at the same time
            jumps = changes["kind"] == kernel.RESET
            states = states.copy()
            states[jumps] = self.sol.before(times[jumps]).T
            # Of several maps at one instant each starts from the result of the previous map.
            follows = jumps[1:] & jumps[:-1] & (times[1:] == times[:-1])
            states[1:][follows] = changes["state"][:-1][follows]
            return np.insert(begin, at, times), np.ascontiguousarray(np.insert(values, at, states, axis=0).T)
        moved = end.end_time > self.start_time or len(changes) > 0
        last = ([end.end_time], [end.end_state]) if moved else ([], np.zeros((0, len(self._pairs))))
        together = np.concatenate([[[high for high, _ in self._pairs]], np.repeat(states, 2, axis=0), last[1]])
        return np.concatenate([[self.start_time], np.repeat(times, 2), last[0]]), np.ascontiguousarray(together.T)

    @property
    def _changes(self) -> NDArray[Any]:
        return self._transitions.records

    @cached_property
    def _transitions(self) -> TransitionArray:
        found = self.trajectory.transitions
        if isinstance(found, TransitionArray):
            return found
        return TransitionArray(np.zeros((0, TRANSITION_PLACES + len(self._pairs))), ())  # no transitions

    def _modes(self, times: NDArray[np.float64]) -> list[Mode]:
        """Mode at each time, after any transitions at that time."""
        return self._modes_after(np.searchsorted(self._changes["time"], times, side="right"))

    def _modes_after(self, counts: NDArray[np.intp]) -> list[Mode]:
        """Mode after each of the given numbers of transitions."""
        changes = self._transitions
        if not len(changes):
            return [self.trajectory.end_mode] * counts.size
        rows = np.concatenate([changes.records["from_mode"][:1], changes.records["to_mode"]])
        return [changes.modes[row] for row in rows[counts].tolist()]

    def mode(self, t: ArrayLike) -> dict[str, int] | list[dict[str, int]]:
        """Return the mode at a time: surface -> -1 or +1 (the sign, in slip) or 0 (sliding), such as ``{"s": 0}``.

        At a transition this is the mode after it. For several times, return a list of modes.

        Raises
        ------
        ArgumentError
            Also a ValueError, if a time lies outside the run.
        """
        times = checked_times(t, self.start_time, self.trajectory.end_time)
        names = self._base.model.sign_names
        modes = [dict(zip(names, mode, strict=False)) for mode in self._modes(np.atleast_1d(times))]
        return modes if times.ndim else modes[0]

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """Table of transitions: ``time_s, kind, surface, from_mode, to_mode``, then the states by name."""
        from henon_ref.simulation.tables import transition_table

        return transition_table(self._base.model, self._transitions)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """Table of sticks: ``start_s, duration_s, surface``; a stick that has not ended by the end of the run is left
        out."""
        from henon_ref.simulation.tables import stick_table

        return stick_table(self._base.model, self.trajectory.transitions, self.start_time)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a state by name at the times ``run.t``, shape (k,); ``run["t"]`` returns the times."""
        if name == TIME.name:
            return self.t
        names = self._base.state
        if name not in names:
            known = [*names, TIME.name]
            message = f"{str(name)[:60]!r} is no state{did_you_mean(str(name), known)}"
            raise ArgumentError(f"{message}; wanted one of {listed(known)}")
        state: NDArray[np.float64] = self.y[names.index(name)]
        return state

    def to_dataframe(self, times: ArrayLike | None = None) -> pd.DataFrame:
        """Return times, states and signs as a data frame.

        Parameters
        ----------
        times : array_like, shape (m,), optional
            Times within the run [s]; by default ``run.t``, with the states before and after every transition.

        Returns
        -------
        DataFrame
            One row per time: ``t``, the states by name, and for each surface -1, +1 (its sign) or 0 (sliding).

        Raises
        ------
        ArgumentError
            If a time lies outside the run, or times are given and there is no dense output.
        """
        from henon_ref.simulation.tables import state_table

        if times is None:
            at, states = self.t, self.y.T
            first = np.concatenate([[True], at[1:] != at[:-1]])  # the first row at a time is before its transitions
            sides = (np.searchsorted(self._changes["time"], at, side=side) for side in ("left", "right"))
            modes = self._modes_after(np.where(first, *sides))
        else:
            if self.sol is None:
                raise ArgumentError(f"times {_NO_DENSE}")
            at = np.atleast_1d(checked_times(times, self.start_time, self.trajectory.end_time))
            states, modes = self.sol(at).T, self._modes(at)
        return state_table(self._base.model, at, states, modes)

    def save(self, path: str | Path) -> None:
        """Write the run to a file that NumPy can read; :func:`henon_ref.load_run` reads the run back.

        Parameters
        ----------
        path : str or Path
            An existing file is replaced.

        Raises
        ------
        ArgumentError
            If the file cannot be written.

        Notes
        -----
        The file is an archive of arrays for ``numpy.load``, without pickled objects:

        ``about``
            JSON text: ``format`` (1), ``system`` (with the keys of a case file), ``start`` and ``end`` [s], ``status``,
            ``reason``, ``counts``, ``max_surface_drift``, ``undecided_after``.
        ``states``, ``signs``
            Names of the n states and m surfaces.
        ``initial``, ``end_state``, ``end_mode``
            State at the start as a pair of doubles whose sum it is, shape (2, n); state and mode at the end.
        ``transition_time``, ``_time_low``, ``_kind``, ``_surface``, ``_from``, ``_to``, ``_state``, ``_landing``
            (Each name begins with ``transition``.) One row per transition: time as a pair of doubles whose sum it is,
            kind, index of the surface, modes before and after as rows of ``modes``, state, and the landing method.
        ``modes``
            Modes as rows of m entries: -1, 0, +1.
        ``step_time``, ``step_time_low``, ``step_unit``, ``step_coefficients``
            With dense output, one row per step: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k.
        """
        from henon_ref.simulation.run_file import write_run

        trajectory = self.trajectory._replace(transitions=self._transitions)
        write_run(Path(path), (self.system, self.start_time, self._pairs, trajectory, self._steps))

    def plot(
        self,
        x: str | None = None,
        y: str | None = None,
        ax: Axes | None = None,
        transitions: bool = False,
        **line: Any,
    ) -> Axes:
        """Plot a phase portrait coloured by mode, or with ``x="t"`` a state over time.

        Parameters
        ----------
        x : str, optional
            Horizontal axis: a state, or ``"t"``. By default the position whose velocity is ``y`` (``"t"`` for a system
            with one state).
        y : str, optional
            Vertical axis: a state. By default the velocity that belongs to ``x``. If neither is given, velocity over
            position of the body in the first surface.
        ax : matplotlib Axes, optional
            Axes to draw into; by default a new pyplot figure.
        transitions : bool
            Mark each transition with a dot, and, if there are few, with its kind and time.
        **line
            Matplotlib's line keywords, such as ``color`` and ``linewidth``. If ``label`` is given, the legend of modes
            is left out, so that ``ax.legend()`` can list several runs.

        Returns
        -------
        matplotlib Axes
            ``axes.figure`` is the figure.

        Raises
        ------
        ArgumentError
            If there is no dense output, the run has not left its start, or a name is not a state.
        """
        from henon_ref.figures.plots import plotted

        marked = self.transitions if transitions else None
        return plotted(self.system.model, self._drawn(), x, y, ax, marked, line)

    def plot_time(self, *names: str, ax: Any = None, **line: Any) -> NDArray[Any]:
        """Plot states and surfaces over time, one panel each, with the sticks shaded.

        Parameters
        ----------
        *names : str
            States, and signs of surfaces, whose expressions h(t, x) are drawn. By default the states of the phase
            portrait and the first surfaces.
        ax : matplotlib Axes, or a sequence with one Axes per name, optional
            Axes to draw into; by default a new pyplot figure.
        **line
            As in :meth:`plot`.

        Returns
        -------
        ndarray of matplotlib Axes
            One per name.

        Raises
        ------
        ArgumentError
            As in :meth:`plot`.
        """
        from henon_ref.figures.plots import plotted_over_time

        return plotted_over_time(self.system.model, self._drawn(), names, ax, line)

    def _drawn(self) -> Motion:
        """Return the motion that a plot shows, at 4000 times in addition to the ends of the steps."""
        if self.sol is None or self.sol.end <= self.sol.start:
            raise ArgumentError("nothing to plot: a plot requires dense output and a run that has left its start")
        return self.motion(4000, self.t)

    def motion(self, count: int, more: ArrayLike = ()) -> Motion:
        """Return states and modes at equidistant times, at each transition, and just before each jump, for drawing."""
        changes = self._changes["time"]
        jumps = np.nextafter(changes[self._changes["kind"] == kernel.RESET], -np.inf)
        grid = np.linspace(self.start_time, self.trajectory.end_time, count)
        return self.motion_at(np.unique(np.concatenate([grid, changes, jumps, more])))

    def motion_at(self, times: ArrayLike) -> Motion:
        if self.sol is None:
            raise ArgumentError(f"a motion {_NO_DENSE}")
        from henon_ref.figures.motion import Motion

        at = np.atleast_1d(checked_times(times, self.start_time, self.trajectory.end_time))
        return Motion(at, self.sol(at).T, tuple(self._modes(at)))

    def __repr__(self) -> str:
        end, changes = self.trajectory, len(self.trajectory.transitions)
        why = "" if self.success else f": {self.message}"
        since = self.undecided_after.values()
        why += f", decided until t = {min(since):.10g}" if since else ""
        return (
            f"Solution({end.status}{why}; t = {self.start_time:.10g} to {end.end_time:.10g}, "
            f"{changes} transition{'s' if changes != 1 else ''}, {end.counts.steps} steps)"
        )

    def _repr_html_(self) -> str:
        changes = self.transitions
        shown = changes.head(10).to_html(index=False, float_format=lambda value: f"{value:.10g}")
        more = f"<p>and {len(changes) - 10} more</p>" if len(changes) > 10 else ""
        return f"<p>{html.escape(repr(self))}</p>{shown if len(changes) else ''}{more}"
