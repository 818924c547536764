"""What a simulation returns."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.integrator.records import RESET, TRANSITION_PLACES
from henon_ref.integrator.transition_array import TransitionArray
from henon_ref.modes.mode import Mode
from henon_ref.simulation.dense_output import DenseOutput, checked_times
from henon_ref.simulation.launch import Outcome
from henon_ref.simulation.system import System
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed
from henon_ref.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from henon_ref.figures.motion import Motion

PLOTTED = 4000
"""Times at which a plotted solution is looked at, besides the ends of its steps."""
SHOWN = 10
"""Transitions that a notebook shows."""
_NO_DENSE = "can be had with dense output alone: simulate with dense_output=True"


class Solution(Outcome):
    """One run: where it went, what happened on the way, and how it ended.

    Attributes
    ----------
    t : ndarray, shape (k,)
        The start, the ends of the steps, both sides of every transition (its time stands there at least twice), and
        where the run ended [s]. Without dense output no ends of steps.
    y : ndarray, shape (n, k)
        The state there; where it jumps, first the one before each map and then the one after (without dense output that
        alone).
    sol : DenseOutput or None
        The solution between, by the steps' own Taylor polynomials: ``sol(t)`` has shape (n,) for a number, (n, m) for
        m times. None without dense output.
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
        return None if self._steps is None else DenseOutput.of(self._steps, self.start_time, self.trajectory)

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
            at = np.maximum(np.searchsorted(begin, times), 1)  # the start comes before what happens there
            jumps = changes["kind"] == RESET
            states = states.copy()
            states[jumps] = self.sol.before(times[jumps]).T
            follows = jumps[1:] & jumps[:-1] & (times[1:] == times[:-1])  # before it is what the last map has left
            states[1:][follows] = changes["state"][:-1][follows]
            return np.insert(begin, at, times), np.ascontiguousarray(np.insert(values, at, states, axis=0).T)
        moved = end.end_time > self.start_time or len(changes) > 0
        last = ([end.end_time], [end.end_state]) if moved else ([], np.zeros((0, len(self._pairs))))
        together = np.concatenate([[[high for high, _ in self._pairs]], np.repeat(states, 2, axis=0), last[1]])
        return np.concatenate([[self.start_time], np.repeat(times, 2), last[0]]), np.ascontiguousarray(together.T)

    @property
    def _changes(self) -> NDArray[Any]:
        """Records of the transitions."""
        return self._transitions.records

    @cached_property
    def _transitions(self) -> TransitionArray:
        found = self.trajectory.transitions
        if isinstance(found, TransitionArray):
            return found
        return TransitionArray(np.zeros((0, TRANSITION_PLACES + len(self._pairs))), ())  # there are none

    def _modes(self, times: NDArray[np.float64]) -> list[Mode]:
        """The mode at each time, after the transitions there."""
        return self._modes_after(np.searchsorted(self._changes["time"], times, side="right"))

    def _modes_after(self, counts: NDArray[np.intp]) -> list[Mode]:
        """The modes after so many transitions each."""
        changes = self._transitions
        if not len(changes):
            return [self.trajectory.end_mode] * counts.size
        rows = np.concatenate([changes.records["from_mode"][:1], changes.records["to_mode"]])
        return [changes.modes[row] for row in rows[counts].tolist()]

    def mode(self, t: ArrayLike) -> dict[str, int] | list[dict[str, int]]:
        """The mode at a time: -1 or +1 (the sign, in slip) or 0 (sliding) by surface, such as ``{"s": 0}``.

        At a transition it is the mode after it. For several times it is a list of these.

        Raises
        ------
        ArgumentError
            Also a ValueError: for a time outside the run, and without dense output.
        """
        if self.sol is None:
            raise ArgumentError(f"the mode at a time {_NO_DENSE}")
        times = checked_times(t, self.start_time, self.trajectory.end_time)
        names = self._base.model.sign_names
        modes = [dict(zip(names, mode, strict=False)) for mode in self._modes(np.atleast_1d(times))]
        return modes if times.ndim else modes[0]

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """A row a transition: ``time_s, kind, surface, from_mode, to_mode``, then the states by name."""
        from henon_ref.simulation.tables import transition_table

        return transition_table(self._base.model, self._transitions)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """A row a whole stick: ``start_s, duration_s, surface``; one that the end of the run cuts off is left out."""
        from henon_ref.simulation.tables import stick_table

        return stick_table(self._base.model, self.trajectory.transitions, self.start_time)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A state by name at the times ``run.t``, shape (k,); ``run["t"]`` are these."""
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
        """Times, states and signs as a data frame.

        Parameters
        ----------
        times : array_like, shape (m,), optional
            Times within the run [s]; the times ``run.t``, with both sides of every transition, if left out.

        Returns
        -------
        DataFrame
            A row a time: ``t``, the states by name, and by surface its sign: -1, +1, or 0 for sliding.

        Raises
        ------
        ArgumentError
            For a time outside the run, and for times without dense output.
        """
        from henon_ref.simulation.tables import state_table

        if times is None:
            at, states = self.t, self.y.T
            first = np.concatenate([[True], at[1:] != at[:-1]])  # before what happens there; what follows is after it
            sides = (np.searchsorted(self._changes["time"], at, side=side) for side in ("left", "right"))
            modes = self._modes_after(np.where(first, *sides))
        else:
            if self.sol is None:
                raise ArgumentError(f"times {_NO_DENSE}")
            at = np.atleast_1d(checked_times(times, self.start_time, self.trajectory.end_time))
            states, modes = self.sol(at).T, self._modes(at)
        return state_table(self._base.model, at, states, modes)

    def save(self, path: str | Path) -> None:
        """Write the run to a file that NumPy reads; :func:`henon_ref.load_run` makes a run of it again.

        Parameters
        ----------
        path : str or Path
            What is there is replaced.

        Raises
        ------
        ArgumentError
            Where it cannot be written.

        Notes
        -----
        The file is an archive of arrays (``numpy.load``, nothing pickled), by these names:

        ``about``
            JSON as text: ``format`` (1), ``system`` (in the words of a case file), ``start`` and ``end`` [s],
            ``status``, ``reason``, ``counts``, and what else the run says.
        ``states``, ``signs``
            Names of the n states and m surfaces.
        ``initial``, ``end_state``, ``end_mode``
            The state at the start, shape (2, n), with what rounding lost of it; state and mode at the end.
        ``transition_time``, ``_time_low``, ``_kind``, ``_surface``, ``_from``, ``_to``, ``_state``, ``_landing``
            (Each begins with ``transition``.) A row a transition: its time and what rounding lost of it, kind, index of
            the surface, modes before and after as rows of ``modes``, state, and how it was landed on.
        ``modes``
            Modes as rows of m entries: -1, 0, +1.
        ``step_time``, ``step_time_low``, ``step_unit``, ``step_coefficients``
            With dense output a row a step: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k.
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
        """Phase portrait, coloured by mode, or with ``x="t"`` a state over time.

        Parameters
        ----------
        x : str, optional
            What is across: a state, or ``"t"``. If left out a position, of which ``y`` is the velocity (of a system
            with one state: t).
        y : str, optional
            The state upward; if left out the velocity of ``x``. If both are, a body's velocity over its position: of
            the body that the first surface is about.
        ax : matplotlib Axes, optional
            Where it is drawn; a new figure of pyplot's if left out.
        transitions : bool
            Mark each transition with a dot, and, where they are few, with its kind and time.
        **line
            Matplotlib's keywords of lines, such as ``color`` and ``linewidth``. With a ``label`` there is no legend of
            modes: ``ax.legend()`` makes one of several runs.

        Returns
        -------
        matplotlib Axes
            ``axes.figure`` is the figure.

        Raises
        ------
        ArgumentError
            Without dense output, where the run has not left its start, and for a name that is no state.
        """
        from henon_ref.simulation.plot import plotted

        marked = self.transitions if transitions else None
        return plotted(self.system.model, self._drawn(), x, y, ax, marked, line)

    def plot_time(self, *names: str, ax: Any = None, **line: Any) -> NDArray[Any]:
        """States and surfaces over time, a panel each, with the sticks shaded.

        Parameters
        ----------
        *names : str
            States, and surfaces by their signs (of a scene: contacts by name), whose expressions are drawn; if left
            out the states of the phase portrait and the first surfaces.
        ax : matplotlib Axes, or a sequence of as many as names, optional
            Where they are drawn; a new figure of pyplot's if left out.
        **line
            As in :meth:`plot`.

        Returns
        -------
        ndarray of matplotlib Axes
            One each.

        Raises
        ------
        ArgumentError
            As :meth:`plot`.
        """
        from henon_ref.simulation.plot import plotted_over_time

        return plotted_over_time(self.system.model, self._drawn(), names, ax, line)

    def _drawn(self) -> Motion:
        """What a plot shows."""
        if self.sol is None or self.sol.end <= self.sol.start:
            raise ArgumentError("nothing to plot: it takes dense output, and a run that has left its start")
        return self.motion(PLOTTED, self.t)

    def motion(self, count: int, more: ArrayLike = ()) -> Motion:
        """States and modes to be drawn: at a number of times, at each transition, and just before each jump."""
        changes = self._changes["time"]
        jumps = np.nextafter(changes[self._changes["kind"] == RESET], -np.inf)
        grid = np.linspace(self.start_time, self.trajectory.end_time, count)
        return self.motion_at(np.unique(np.concatenate([grid, changes, jumps, more])))

    def motion_at(self, times: ArrayLike) -> Motion:
        """States and modes to be drawn at some times."""
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
        shown = changes.head(SHOWN).to_html(index=False, float_format=lambda value: f"{value:.10g}")
        more = f"<p>and {len(changes) - SHOWN} more</p>" if len(changes) > SHOWN else ""
        return f"<p>{html.escape(repr(self))}</p>{shown if len(changes) else ''}{more}"
