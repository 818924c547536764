"""The sliding extension that all libraries share: modes, what follows an event, restarts, how a run ends.

A library integrates one smooth mode until a guard stops it (:class:`.library.Flow`); everything else
is here and the same for all. At an event the driver

1. adds the guards that fell through zero at the same instant (within the library's own location error);
2. puts the state on the surfaces it is on, by one Newton step along their gradients: it moves by what the
   library left there (rounding after a located event, tolerance after a long slide) and no more; the
   largest such distance is the trajectory's ``max_surface_drift``;
3. decides the next mode: by the signs of the normal velocities on the two sides where these settle it
   (:mod:`henon_ref.baselines.mode_table`), by :mod:`henon_ref.modes.selection` everywhere else;
4. starts the next mode and names the guards that start at zero: what to do about those is the library's.

A run ends at the horizon (an event at the horizon counts), or earlier with a status: ``diverged`` (the
state blows up or passes 1e100), ``nonunique``, ``invalid``, ``timeout``, and ``failed``
with the library's own words or because events accumulate.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.library import Library, Stop
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.mode_table import ModeEntry, ModeTable
from henon_ref.baselines.record import Record, ended
from henon_ref.baselines.restart import MARGIN, Fresh, behind_noise, low_flight
from henon_ref.baselines.work import DeadlinePassed, Work
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.trajectory import Trajectory

_LOG = logging.getLogger(__name__)

FALLING = 1e-6
"""A rate of a guard below minus this part of its surface's normal velocities is no rounding."""
LATE = 1e3
"""A guard below zero by so many times what the tolerances make of it has been stepped over."""


class Driver:
    """One problem on one library, ready to run again and again.

    The library's flows count into ``work``, which holds the deadline; ``known`` are modes of the same system on another
    library.

    Raises
    ------
    UnsupportedError
        Where the initial mode has no equations, or too many contacts with static friction act on each other.
    """

    def __init__(
        self,
        problem: Problem,
        library: Library,
        work: Work,
        sample_times: NDArray[np.float64] | None = None,
        known: ModeTable | None = None,
    ) -> None:
        self.problem, self.library, self.work, self.sample_times = problem, library, work, sample_times
        self.start, self.until = float(problem.start), float(problem.until)
        self.initial = tuple(float(v) for v in problem.initial)
        self.table = ModeTable(problem.system, library, work, self.until - self.start, known)
        self.decision = initial_mode(self.table.in_doubles, problem.start, problem.initial, problem.initial_mode)
        self._first: tuple[ModeEntry, tuple[Fresh, ...]] | None = None
        if self.decision.mode is not None:
            try:
                entry = self.table[self.decision.mode]
            except ModelError as error:
                raise UnsupportedError(f"the initial mode has no equations: {error}") from error
            fresh = self.table.fresh_at(entry, self.start, self.initial, ())
            self._first = self.table.entered(self.decision.mode, self.start, self.initial, fresh)[:2]

    def compile(self) -> None:
        """Make ready the modes a run may visit: all of them for one surface, those of a loose run beyond."""
        modes: Sequence[tuple[Mode, frozenset[int]]] = [((entry,), frozenset()) for entry in (-1, 0, 1)]
        if self.decision.mode is None:
            return
        if len(self.problem.system.surfaces) > 1:
            scout = Driver(self.problem, self.library.loosened(), Work(self.work.deadline), known=self.table)
            try:
                scout.run()
            except Exception as error:  # noqa: BLE001 - it may be another library's, and no fault of this one
                _LOG.debug("the loose run ended early: %s", error)
            modes = scout.table.visited
        for mode, idle in modes:
            try:
                self.table.entry(mode, idle)
            except ModelError as error:
                _LOG.debug("mode %s has no equations: %s", mode, error)

    def run(self) -> Trajectory:
        """The whole run, afresh."""
        self.work.start()
        library = self.library
        record = Record(self.work, self.problem, library.landing, library.errors[1], self.sample_times)
        if self.decision.mode is None or self._first is None:
            nowhere = (0,) * len(self.problem.system.surfaces)
            return record.finish(self.decision.ending, self.start, self.initial, nowhere, self.decision.reason)
        return self._march(record, self.decision.mode, *self._first)

    def _march(self, record: Record, mode: Mode, entry: ModeEntry, fresh: tuple[Fresh, ...]) -> Trajectory:
        t, low, x, until = self.start, 0.0, self.initial, self.until
        falls: tuple[int, ...] = ()
        sampling, jumps = self.sample_times is not None, bool(self.problem.system.resets)
        while True:
            if until - t <= 2.0 * EPSILON * abs(until) or until <= t:
                record.wanted(until, x, mode)
                return record.finish("ok", t, x, mode)
            if jumps and fresh and (left := self._without_speed(entry, fresh, t, x)):
                (t, x), low, fresh = left, 0.0, ()
                continue
            wanted = record.wanted(t, x, mode) if sampling else None
            try:
                self.work.check()
                stop = Stop("event", t, low, x, falls) if falls else None
                stop = stop or (self._low_flight(entry, fresh, t, x) if jumps else None)
                stop = stop or entry.flow.advance(t, low, x, until, fresh, wanted)
            except DeadlinePassed:
                return record.finish("timeout", t, x, mode, f"stopped after {self.work.deadline:g} s")
            if sampling:
                record.sampled(stop.samples, mode)
            if stop.status == "failed" or stop.status == "diverged":
                return ended(record, entry.model, x, stop, self.library.accuracy)
            hits = stop.hits
            unsettled: tuple[Fresh, ...] = ()
            if entry.several or not hits:
                hits, unsettled, missed = self._together(entry, stop, fresh)
                if missed:
                    return record.finish("failed", t, x, mode, record.explained("failed", missed))
            begun, (t, low, x) = t, (stop.t, stop.low, stop.x)
            noise = self._noise(entry, hits[0], fresh, t - begun, t, x) if jumps and len(hits) == 1 else None
            if noise is not None:
                guard = entry.model.guards[hits[0]]
                x, drift = self.table.on_surface(guard.index, t, x)
                left = (
                    behind_noise(entry.model, hits[0], t, x, self.library.accuracy, until) if drift <= noise else None
                )
                if left is None:
                    reason = f"a root of {guard.expression} is found where its surface is being left"
                    return record.finish("failed", t, x, mode, reason)
                record.drift, (t, x), low = max(record.drift, drift), left, 0.0
                self.work.steps, fresh = self.work.steps + 1, tuple(item for item in fresh if item[0] != hits[0])
                continue
            if not hits:
                record.drift = max(record.drift, self.table.drift(entry, t, x))
                return record.finish("ok", t, x, mode)
            take = entry.exit(hits[0]) if len(hits) == 1 else None
            followed = take(t, x) if take is not None else None
            rest = None
            touched: Sequence[int] = ()
            applied: Sequence[tuple[int, Sequence[float]]] = ()
            if followed is None:
                after = self.table.decided(entry, hits, t, x)
                if after.mode is None:
                    return record.finish(after.status, t, x, mode, record.explained(after.status, after.reason))
                followed, touched = (after.mode, after.x, after.fresh, after.drift), after.touched
                applied, rest = after.applied, after.rest
            before, (after_mode, x, starting, drift) = entry, followed
            if drift > record.drift:
                record.drift = drift
            record.event(t, low, x, mode, after_mode, touched, applied)
            if rest is not None:
                bouncing, (after_mode, t, x), low = after_mode, rest, 0.0
                if t > until:
                    return record.finish("ok", until, x, after_mode)
                record.event(t, low, x, bouncing, after_mode, ())
            reason = record.accumulated(resting=bool(applied) and all(self.table.system.rests(i) for i, _ in applied))
            if reason:
                return record.finish("failed", t, x, after_mode, reason)
            mode = after_mode
            fresh = starting + self.table[mode].still_fresh(before, unsettled, starting) if unsettled else starting
            entry, fresh, falls = self.table.entered(mode, t, x, fresh, before.model.idle)

    def _low_flight(self, entry: ModeEntry, fresh: Sequence[Fresh], t: float, x: Sequence[float]) -> Stop | None:
        """The end of a flight too low for the library; None where it is the library's to find."""
        if len(fresh) != 1 or not entry.resets(fresh[0][0]):
            return None
        found = low_flight(entry.model, fresh[0][0], t, x, self.library.accuracy)
        if found is None or found[0] > self.until:
            return None
        self.work.steps += 1
        return Stop("event", found[0], 0.0, found[1], (fresh[0][0],))

    def _without_speed(
        self, entry: ModeEntry, fresh: Sequence[Fresh], t: float, x: Sequence[float]
    ) -> tuple[float, tuple[float, ...]] | None:
        """Where a surface that resets the state and is left by the acceleration alone can be told from zero."""
        (guard, _, rate), *others = fresh
        if others or rate != 0.0 or not entry.resets(guard):
            return None
        self.work.steps += 1
        return behind_noise(entry.model, guard, t, x, self.library.accuracy, self.until)

    def _noise(
        self, entry: ModeEntry, guard: int, fresh: Sequence[Fresh], length: float, t: float, x: Sequence[float]
    ) -> float | None:
        """What the tolerance makes of a guard whose fall is no impact though it resets the state; None where it is one.

        A body that an impact leaves no speed, or that has lifted off, leaves the surface by its acceleration alone: it
        does not come back within what the tolerance makes of its place. None hits a surface that it moves away from.
        """
        if not entry.resets(guard):
            return None
        model = entry.model
        try:
            value, rate = model.rates(t, *x)[2 * guard : 2 * guard + 2]
        except ARITHMETIC:
            return None
        noise = MARGIN * model.size(guard, t, x, *self.library.accuracy)
        tangential = any(k == guard and started == 0.0 for k, _, started in fresh)
        back = -rate * length if rate < 0.0 else -value
        return noise if rate > 0.0 or (tangential and back <= noise) else None

    def _together(
        self, entry: ModeEntry, stop: Stop, fresh: Sequence[Fresh]
    ) -> tuple[tuple[int, ...], tuple[Fresh, ...], str]:
        """What the guards say at a stop.

        Returns
        -------
        hits : tuple of int
            Guards that fell: those the library named, and those within its location error.
        unsettled : tuple of Fresh
            Guards that started at zero and have not yet been seen to leave it.
        missed : str
            A guard that is below zero by more than the tolerances explain: the library stepped over its root
            without a word, and what it has computed since belongs to no mode.
        """
        model, t, x = entry.model, stop.t, stop.x
        try:
            rates = model.rates(t, *x)
        except ARITHMETIC:
            return stop.hits, (), ""
        near = self.library.location_error(t)
        started, hits, unsettled = {item[0]: item for item in fresh}, set(stop.hits), []
        for k, guard in enumerate(model.guards):
            value, rate = rates[2 * k], rates[2 * k + 1]
            reach = -rate * near
            if k in hits or value > max(reach, 0.0) or (guard.rising_only and value < -abs(reach)):
                continue
            if value < -abs(reach) - LATE * model.size(k, t, x, *self.library.accuracy):
                return (), (), f"a root of {guard.expression} was stepped over: it is {value:.3g} at t = {t:.17g}"
            # One that started at zero and is in the noise of it, without falling, has not been seen to leave.
            settled = k not in started or rate < -FALLING * started[k][1]
            if not settled and value > -model.size(k, t, x, *self.library.errors):
                unsettled.append(started[k])
            elif rate * (self.until - self.start) <= -value:
                hits.add(k)
        return tuple(sorted(hits)), tuple(unsettled), ""
