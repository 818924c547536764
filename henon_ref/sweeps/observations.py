"""Observations of runs: one class for each kind, computed over all runs of a chunk at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.integrator.points import Keep
from henon_ref.integrator.run_result import KINDS
from henon_ref.simulation.system import System
from henon_ref.sweeps.table_files import Columns
from henon_ref.sweeps.work import Observation, Runs
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}
"""Direction in which a surface is reached -> sign of the side entered; 0: any."""


@dataclass(frozen=True)
class Sticks(Observation):
    """See :func:`henon_ref.sweeps.observe.sticks`."""

    after: float = 0.0
    surface: str | None = None
    each: bool = False
    kind: ClassVar[str] = "sticks"

    def check(self, system: System) -> None:
        if self.surface is not None:
            _surface(system, self.surface)

    def kept(self) -> Keep:
        return Keep(after=self.after, open_sticks=True)

    def columns(self, runs: Runs) -> Columns:
        run, duration, _, _ = self._whole(runs)
        last = np.full(len(runs), np.nan)
        last[run] = duration  # sorted by end: the last stick of each run remains
        return {"stick_count": np.bincount(run, minlength=len(runs)).astype(np.int64), "last_stick_duration": last}

    def tables(self, runs: Runs) -> dict[str, Columns]:
        if not self.each:
            return {}
        run, duration, begin, surface = self._whole(runs)
        names = np.array(runs.system.model.sign_names, dtype=object)[surface]
        return {"sticks": {"point": run, "start_s": begin, "duration_s": duration, "surface": names}}

    def _whole(self, runs: Runs) -> tuple[NDArray[Any], ...]:
        """Return run, duration, start and surface of each complete stick that ends at ``after`` or later."""
        names = runs.system.model.sign_names
        wanted = range(len(names)) if self.surface is None else [names.index(self.surface)]
        parts = [self._on_surface(runs, i) for i in wanted] or [(np.zeros(0, dtype=np.int64),) * 3]
        end = np.concatenate([p[0] for p in parts])
        order = np.argsort(end, kind="stable")
        begin, low = (np.concatenate([p[k] for p in parts])[order] for k in (1, 2))
        surface = np.repeat(np.array(wanted, dtype=np.int64), [len(p[0]) for p in parts])[order]
        end = end[order]
        last = runs.records[end]
        duration = (last["time"] - begin) + (last["time_low"] - low)
        return runs.run[end], duration, begin, surface

    def _on_surface(self, runs: Runs, surface: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the transitions that end sticks (indices), and the starts of the sticks with their rounding errors."""
        at, before, after = runs.changes(surface)
        changed = (before == 0) != (after == 0)
        at, leaves = at[changed], after[changed] != 0
        first = rank_in_run(runs.run[at]) == 0
        entered = np.roll(at, 1)  # the previous change began the stick, if it is of the same run
        begin = np.where(first, runs.times[runs.run[at], 0, 0], runs.records["time"][entered])
        low = np.where(first, 0.0, runs.records["time_low"][entered])
        kept = leaves & (runs.records["time"][at] >= self.after)
        return at[kept], begin[kept], low[kept]


@dataclass(frozen=True)
class FinalState(Observation):
    """See :func:`henon_ref.sweeps.observe.final_state`."""

    kind: ClassVar[str] = "final_state"

    def columns(self, runs: Runs) -> Columns:
        states = {f"final_{name}": runs.end_state[:, i].copy() for i, name in enumerate(runs.system.state)}
        return {**states, "final_mode": runs.mode_names(runs.end_mode)}


@dataclass(frozen=True)
class Ending(Observation):
    """See :func:`henon_ref.sweeps.observe.status`."""

    kind: ClassVar[str] = "status"

    def columns(self, runs: Runs) -> Columns:
        steps, expansions, evaluations = runs.counts.T
        return {
            "end_time": runs.end_time,
            "message": runs.message,
            "steps": steps.copy(),
            "rhs_evaluations": expansions.copy(),
            "event_evaluations": evaluations.copy(),
        }


@dataclass(frozen=True)
class _AtSection(Observation):
    """Base class of observations of the points of a section."""

    of: str
    after: float = 0.0
    direction: str = "both"

    def check(self, system: System) -> None:
        self.expression(system)

    def expression(self, system: System) -> sp.Expr:
        """Return the surface with the name ``of``, or the expression."""
        model = system.model
        if self.of in model.sign_names:
            return model.surfaces[model.sign_names.index(self.of)]
        return moving_expression(system, self.of, "section")

    def sections(self, system: System) -> Sequence[sp.Expr]:
        return (self.expression(system),)

    def kept(self) -> Keep:
        return Keep(after=self.after)

    def places(self, runs: Runs) -> NDArray[np.int64]:
        """Return the indices of the transitions that are section points."""
        surface, orientation = runs.work.sections[self.expression(runs.system)]
        at, before, after = runs.changes(surface)
        came = -orientation * before  # the side that is approached
        wanted = DIRECTIONS[self.direction]
        own, run = runs.records[at], runs.run[at]
        later = (np.diff(own["time"]) > 0) | (np.diff(own["time_low"]) != 0) | (np.diff(run) > 0)
        # Of the events of one instant only the last.
        jumped = (own["kind"] == KINDS.index("reset")) & np.append(later, True)
        reached = (before != 0) & ((before != after) | jumped) & ((came == wanted) | (wanted == 0))
        at = at[reached & (own["time"] >= self.after)]
        if self.of in runs.system.model.sign_names:  # a section named after a kink omits its hidden crossings
            at = at[runs.visible[at]]
        return at


@dataclass(frozen=True)
class SectionPoints(_AtSection):
    """See :func:`henon_ref.sweeps.observe.section`."""

    most: int | None = None
    name: str = "section"
    kind: ClassVar[str] = "section"

    def check(self, system: System) -> None:
        super().check(system)
        if "point" in system.state:
            raise ArgumentError("two results have the column 'point'; rename the state")

    def tables(self, runs: Runs) -> dict[str, Columns]:
        at = self.places(runs)
        return {self.name: runs.rows(at if self.most is None else at[rank_in_run(runs.run[at]) < self.most])}


@dataclass(frozen=True)
class Period(_AtSection):
    """See :func:`henon_ref.sweeps.observe.period`."""

    direction: str = "rising"
    tolerance: float = 1e-6
    most: int = 16
    kind: ClassVar[str] = "period"

    def columns(self, runs: Runs) -> Columns:
        at = self.places(runs)
        returns, seconds = np.full(len(runs), np.nan), np.full(len(runs), np.nan)
        # The last points of each run, last first. Missing points are NaN, which is close to nothing.
        back = rank_in_run(runs.run[at][::-1])[::-1]
        length = min(2 * self.most, int(back.max(initial=0)) + 1)  # no longer than the longest run
        at, back = at[back < length], back[back < length]
        states = np.full((len(runs), length, len(runs.system.state)), np.nan)
        times = np.full((len(runs), length), np.nan)
        states[runs.run[at], back], times[runs.run[at], back] = runs.records["state"][at], runs.records["time"][at]
        size = np.max(np.abs(np.nan_to_num(states)), axis=(1, 2))
        for p in range(length // 2, 0, -1):
            apart = np.max(np.abs(states[:, :p] - states[:, p : 2 * p]), axis=(1, 2))
            closed = apart <= self.tolerance * size
            returns[closed] = p
            seconds[closed] = (times[:, 0] - times[:, p])[closed]
        return {"period": seconds, "period_returns": returns}


def moving_expression(system: System, text: str, what: str) -> sp.Expr:
    """Return an expression that changes during a run; ArgumentError if it contains neither a state nor time."""
    expression = system.expression(text, f"the {what} {text[:60]!r}")
    if not expression.free_symbols & {TIME, *system.model.states}:
        raise ArgumentError(f"the {what} {text[:60]!r} is constant: it contains neither a state nor t")
    return expression


def _surface(system: System, name: str) -> int:
    names = system.model.sign_names
    if name not in names:
        raise ArgumentError(f"'{name[:60]}' is not a surface{did_you_mean(name, names)}; surfaces: {listed(names)}")
    return names.index(name)


def rank_in_run(run: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many entries of the same run precede each entry; entries of a run must be consecutive.

    >>> rank_in_run(np.array([0, 0, 2, 2, 2])).tolist()
    [0, 1, 0, 1, 2]
    """
    if not run.size:
        return np.zeros(0, dtype=np.int64)
    begins = np.append(True, run[1:] != run[:-1])
    first = np.maximum.accumulate(np.where(begins, np.arange(run.size), 0))
    return np.arange(run.size) - first
