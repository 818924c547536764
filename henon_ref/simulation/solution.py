"""What a simulation returns."""

from __future__ import annotations

import html
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from henon_ref.errors import ArgumentError
from henon_ref.filippov.modes import Mode
from henon_ref.henon.records import RESET, transition_dtype
from henon_ref.henon.transition_array import TransitionArray
from henon_ref.simulation.dense_output import DenseOutput, checked_times
from henon_ref.simulation.launch import Launch
from henon_ref.simulation.outcome import Outcome
from henon_ref.simulation.tables import stick_table, transition_table
from henon_ref.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from henon_ref.figures.motion import Motion

PLOTTED = 4000
"""Times at which a plotted solution is looked at, besides the ends of its steps."""
SHOWN = 10
"""Transitions that a notebook shows."""


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
    system, trajectory, status, success, message, counts, undecided_after, final_mode
        As in :class:`henon_ref.simulation.outcome.Outcome`.
    """

    def __init__(
        self,
        made: Launch,
        trajectory: Trajectory,
        steps: NDArray[Any] | None,
    ) -> None:
        super().__init__(made, trajectory)
        (self._start, _), self._pairs, self._steps = made.start.time, made.start.x, steps

    @property
    def _initial(self) -> list[float]:
        """Initial state."""
        return [high for high, _ in self._pairs]

    @cached_property
    def sol(self) -> DenseOutput | None:
        return None if self._steps is None else DenseOutput.of(self._steps, self._start, self.trajectory)

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
        moved = end.end_time > self._start or len(changes) > 0
        last = ([end.end_time], [end.end_state]) if moved else ([], np.zeros((0, len(self._initial))))
        together = np.concatenate([[self._initial], np.repeat(states, 2, axis=0), last[1]])
        return np.concatenate([[self._start], np.repeat(times, 2), last[0]]), np.ascontiguousarray(together.T)

    @property
    def _changes(self) -> NDArray[Any]:
        """Records of the transitions."""
        changes = self.trajectory.transitions
        empty = np.zeros(0, dtype=transition_dtype(len(self._initial)))
        return changes.records if isinstance(changes, TransitionArray) else empty

    def _modes(self, times: NDArray[np.float64]) -> list[Mode]:
        """The mode at each time, after the transitions there."""
        changes = self.trajectory.transitions
        if not isinstance(changes, TransitionArray):
            return [self.trajectory.end_mode] * times.size
        records = changes.records
        rows = np.concatenate([records["from_mode"][:1], records["to_mode"]])
        found = rows[np.searchsorted(records["time"], times, side="right")]
        return [changes.modes[row] for row in found.tolist()]

    def mode(self, t: ArrayLike) -> dict[str, int] | list[dict[str, int]]:
        """The mode at a time: -1 or +1 (the sign, in slip) or 0 (sliding) by surface, such as ``{"s": 0}``.

        At a transition it is the mode after it. For several times it is a list of these.

        Raises
        ------
        ArgumentError
            Also a ValueError: for a time outside the run, and without dense output.
        """
        if self.sol is None:
            raise ArgumentError("without dense output no mode is kept: simulate with dense_output=True")
        times = checked_times(t, self._start, self.trajectory.end_time)
        names = self._base.model.sign_names
        modes = [dict(zip(names, mode, strict=False)) for mode in self._modes(np.atleast_1d(times))]
        return modes if times.ndim else modes[0]

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """A row a transition: ``time_s, kind, surface, from_mode, to_mode``, then the states by name."""
        return transition_table(self._base.model, self.trajectory.transitions)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """A row a whole stick: ``start_s, duration_s, surface``; one that the end of the run cuts off is left out."""
        return stick_table(self._base.model, self.trajectory.transitions, self._start)

    def plot(self, x: str | None = None, y: str | None = None, ax: Axes | None = None) -> NDArray[Any]:
        """Phase portrait, or a state over time, and below it surfaces over time.

        Parameters
        ----------
        x : str, optional
            What is across: a state, or ``"t"``; the first state if left out (of a system with one: t).
        y : str, optional
            The state upward; if left out the first surface's own, or another one than ``x``.
        ax : matplotlib Axes, optional
            Where the portrait is drawn, alone; a new figure of pyplot's if left out.

        Returns
        -------
        ndarray of matplotlib Axes
            The portrait's, then one for each of the first four surfaces; ``axes[0].figure`` is the figure.

        Raises
        ------
        ArgumentError
            Without dense output, where the run has not left its start, and for a name that is no state.
        """
        if self.sol is None or self.sol.end <= self.sol.start:
            raise ArgumentError("nothing to plot: it takes dense output, and a run that has left its start")
        from henon_ref.simulation.plot import plotted

        return plotted(self.system.model, self.motion(PLOTTED, self.t), x, y, ax)

    def motion(self, count: int, more: ArrayLike = ()) -> Motion:
        """States and modes to be drawn: at a number of times, at each transition, and just before each jump.

        Raises
        ------
        ArgumentError
            Without dense output.
        """
        if self.sol is None:
            raise ArgumentError("without dense output there is nothing to draw: simulate with dense_output=True")
        from henon_ref.figures.motion import Motion

        changes = self._changes["time"]
        jumps = np.nextafter(changes[self._changes["kind"] == RESET], -np.inf)
        times = np.unique(np.concatenate([np.linspace(self.sol.start, self.sol.end, count), changes, jumps, more]))
        return Motion(times, self.sol(times).T, tuple(self._modes(times)))

    def __repr__(self) -> str:
        end, changes = self.trajectory, len(self.trajectory.transitions)
        why = "" if self.success else f": {self.message}"
        since = self.undecided_after.values()
        why += f", decided until t = {min(since):.10g}" if since else ""
        return (
            f"Solution({end.status}{why}; t = {self._start:.10g} to {end.end_time:.10g}, "
            f"{changes} transition{'s' if changes != 1 else ''}, {end.counts.steps} steps)"
        )

    def _repr_html_(self) -> str:
        changes = self.transitions
        shown = changes.head(SHOWN).to_html(index=False, float_format=lambda value: f"{value:.10g}")
        more = f"<p>and {len(changes) - SHOWN} more</p>" if len(changes) > SHOWN else ""
        return f"<p>{html.escape(repr(self))}</p>{shown if len(changes) else ''}{more}"
