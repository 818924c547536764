"""Driver of all libraries: it handles events, selects modes, restarts the library and ends the run.

A library integrates one smooth mode until a guard stops it (:data:`.library.Advance`). The driver does everything else,
in the same way for all libraries. At an event the driver

1. adds the guards that fell through zero at the same time (within the library's own location error);
2. projects the state onto its surfaces by one Newton step along their gradients. The step removes only the
   library's error (rounding after a located event, tolerance after a long slide); the largest such distance is the
   trajectory's ``max_surface_drift``;
3. selects the next mode: by the signs of the normal velocities on the two sides if they decide it
   (:mod:`henon_ref.baselines.mode_table`), otherwise by :mod:`henon_ref.modes.selection`;
4. starts the next mode and lists the guards that start at zero. The library treats them by its restart policy.

A run ends at the horizon (an event at the horizon counts), or earlier with a status: ``diverged`` (the state blows up
or passes 1e100), ``nonunique``, ``invalid``, ``timeout``, and ``failed`` (the library fails or events accumulate).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

from henon_ref.baselines.library import DeadlinePassed, Library, Stop, Times, Work
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.mode_table import ModeEntry, ModeTable
from henon_ref.baselines.record import Record, ended
from henon_ref.baselines.restart import MARGIN, Fresh, after_noise, low_flight
from henon_ref.baselines.surface_functions import projected
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.trajectory import Trajectory

_LOG = logging.getLogger(__name__)

MISSED_ROOT = 1e3
"""A guard whose value is below minus this multiple of its error by the tolerances has been stepped over."""


class Driver:
    """One problem prepared for repeated runs with one library.

    The library counts its evaluations in ``work``, which holds the deadline. ``known`` is a table of modes of the same
    system that was made for another library; their equations are used again. UnsupportedError if the initial mode has
    no equations, or too many contacts with static friction act on each other.
    """

    def __init__(
        self, problem: Problem, library: Library, work: Work, sample_times: Times = None, known: ModeTable | None = None
    ) -> None:
        self.problem, self.library, self.work, self.sample_times = problem, library, work, sample_times
        self.start, self.until = float(problem.start), float(problem.until)
        self.initial = tuple(float(v) for v in problem.initial)
        self.table = ModeTable(problem.system, library, work, self.until - self.start, known)
        self.decision = initial_mode(self.table.in_doubles.at_start(problem), problem)
        self._first: tuple[Mode, ModeEntry, tuple[Fresh, ...]] | None = None
        if self.decision.mode is not None:
            try:
                entry = self.table[self.decision.mode]
            except ModelError as error:
                raise UnsupportedError(f"the initial mode has no equations: {error}") from error
            fresh = self.table.fresh_at(entry, self.start, self.initial, ())
            entry, fresh, _ = self.table.entered(self.decision.mode, self.start, self.initial, fresh)
            self._first = self.decision.mode, entry, fresh

    def compile(self) -> None:
        """Prepare all modes of a system with one surface; otherwise those that a run at loose tolerances visits."""
        modes: Sequence[tuple[Mode, frozenset[int]]] = [((entry,), frozenset()) for entry in (-1, 0, 1)]
        if self.decision.mode is None:
            return
        if len(self.problem.system.surfaces) > 1:
            scout = Driver(self.problem, self.library.loosened(), Work(self.work.deadline), known=self.table)
            try:
                scout.run()
            except Exception as error:  # noqa: BLE001 - the library may raise anything; the timed run reports it
                _LOG.debug("the loose run ended early: %s", error)
            modes = scout.table.visited
        for mode, idle in modes:
            try:
                self.table.entry(mode, idle)
            except ModelError as error:
                _LOG.debug("mode %s has no equations: %s", mode, error)

    def run(self) -> Trajectory:
        """Run from the start to the horizon."""
        self.work.start()
        library = self.library
        record = Record(self.work, self.problem, library.solver.landing, library.errors[1], self.sample_times)
        if self._first is None:
            nowhere = (0,) * len(self.problem.system.surfaces)
            return record.finish(self.decision.ending, self.start, self.initial, nowhere, self.decision.reason)
        return self._march(record, *self._first)

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
                stop = stop or entry.advance(t, low, x, until, fresh, wanted)
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
                x, drift = projected(self.problem.system, [guard.index], t, x)
                left = after_noise(entry.model, hits[0], t, x, self.library.accuracy, until) if drift <= noise else None
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
            after = None if take is None else take(t, x)
            if after is None:
                after = self.table.decided(entry, hits, t, x)
            if after.mode is None:
                return record.finish(after.status, t, x, mode, record.explained(after.status, after.reason))
            if after.drift > record.drift:
                record.drift = after.drift
            record.event(t, low, after.x, mode, after.mode, after.touched, after.applied)
            mode, x, applied = after.mode, after.x, after.applied
            for rest in after.rests:
                bouncing, (mode, t, x), low = mode, rest, 0.0
                if t > until:
                    return record.finish("ok", until, x, mode)
                record.event(t, low, x, bouncing, mode, ())
            reason = record.accumulated(resting=bool(applied) and all(self.table.system.rests(i) for i, _ in applied))
            if reason:
                return record.finish("failed", t, x, mode, reason)
            fresh = after.fresh
            if unsettled:
                fresh += self.table[mode].still_fresh(entry, unsettled, fresh)
            entry, fresh, falls = self.table.entered(mode, t, x, fresh, entry.model.idle)

    def _low_flight(self, entry: ModeEntry, fresh: Sequence[Fresh], t: float, x: Sequence[float]) -> Stop | None:
        """End of a flight that is too low for the library; None if the library is to find the end."""
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
        """Time [s] and state at which the state has left a resetting surface that it leaves with zero normal velocity.

        None if the state does not start on one such surface.
        """
        (guard, _, rate), *others = fresh
        if others or rate != 0.0 or not entry.resets(guard):
            return None
        self.work.steps += 1
        return after_noise(entry.model, guard, t, x, self.library.accuracy, self.until)

    def _noise(
        self, entry: ModeEntry, guard: int, fresh: Sequence[Fresh], length: float, t: float, x: Sequence[float]
    ) -> float | None:
        """Error of a resetting guard by the tolerances if its root is no impact; None if it is an impact.

        A body that an impact stops, or that has lifted off, leaves the surface by its acceleration alone. Its guard
        cannot fall again while its distance is within the tolerance. A body that moves away from a surface does not
        hit the surface.
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
        """Find all guards that fall at a stop of the library.

        Returns the guards that fell (those that the library reported, and those within its location error); those that
        started at zero and are still within its rounding; and a message about a guard that is below zero by more than
        the tolerances explain, empty if there is none: the library stepped over the root, so that its later states
        belong to no mode.
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
            if value < -abs(reach) - MISSED_ROOT * model.size(k, t, x, *self.library.accuracy):
                return (), (), f"a root of {guard.expression} was stepped over: it is {value:.3g} at t = {t:.17g}"
            # A guard that started at zero, is within its noise and does not fall has not left zero yet. It falls if its
            # rate is more than a small part of its surface's normal velocities; a smaller one is rounding.
            settled = k not in started or rate < -1e-6 * started[k][1]
            if not settled and value > -model.size(k, t, x, *self.library.errors):
                unsettled.append(started[k])
            elif rate * (self.until - self.start) <= -value:
                hits.add(k)
        return tuple(sorted(hits)), tuple(unsettled), ""
