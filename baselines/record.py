"""Log of one run: transitions, samples and drift; detection of accumulating events; status at the end."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import overload

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.library import LIMIT, Stop, Times, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import MARGIN
from henon_ref.modes.callables import ARITHMETIC, Scalar
from henon_ref.modes.mode import Mode, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import rows_at
from henon_ref.trajectory import Kind, Status, Trajectory, Transition

IMPACTS = 16
"""Impacts accumulate if the last 16 flights took as long as the 16 flights before them, and less than a small part of
the horizon: the restart, not the dynamics, then sets their length."""
GROUP, CHAIN = 4, 5
"""Events also accumulate if at least 5 successive groups of 4 events last at most half as long as the group before, and
the last group is shorter than 16 sqrt(absolute tolerance) times the first group."""

_Fields = tuple[Kind, int, Mode, Mode, float, tuple[float, ...], float, str]
"""Fields of a :class:`Transition` in their order."""


class Transitions(Sequence[Transition]):
    """The transitions of a run. A :class:`Transition` is built only when it is read.

    Building a transition costs as much as a step of the fastest library, and the run is timed.
    """

    def __init__(self, events: list[_Fields]) -> None:
        self._events = events

    def __len__(self) -> int:
        return len(self._events)

    @overload
    def __getitem__(self, at: int) -> Transition: ...
    @overload
    def __getitem__(self, at: slice) -> Transitions: ...
    def __getitem__(self, at: int | slice) -> Transition | Transitions:
        if isinstance(at, slice):
            return Transitions(self._events[at])
        return Transition(*self._events[at])


class Record:
    """Log of a run of a problem.

    ``blur`` is the absolute error of the library's state just after a start. With such an error, ever shorter
    excursions end as a chatter whose length is about the square root of ``blur``; they do not shrink to rounding.
    """

    def __init__(
        self, work: Work, problem: Problem, landing: str, blur: float = 0.0, sample_times: Times = None
    ) -> None:
        self.work, self.landing = work, landing
        self.events: list[_Fields] = []
        self.drift = 0.0
        self._times: list[float] = []
        self._window = 32 + 4 * len(problem.system.surfaces)
        self._horizon = float(problem.until) - float(problem.start)
        self._floor = min(1e-2, 16.0 * math.sqrt(blur))
        self._sample_times, states = sample_times, len(problem.system.states)
        self._samples = None if sample_times is None else np.full((len(sample_times), states), np.nan)
        self._sample_modes: list[Mode] = []

    def event(
        self,
        t: float,
        low: float,
        x: tuple[float, ...],
        before: Mode,
        after: Mode,
        touched: Collection[int],
        applied: Sequence[tuple[int, Sequence[float]]] = (),
        landing: str = "",
    ) -> None:
        """Log one event: a transition for each sign that changes, a graze for each surface only touched.

        ``applied`` lists the surfaces that have reset the state, in order, each with the state after its reset;
        ``landing`` is the method if it is not that of the whole run.
        """
        self._times.append(t)
        how = landing or self.landing
        if applied:
            for i, place in rows_at(before, after, [surface for surface, _ in applied]):
                kind: Kind = transition_kind(before[i], after[i]) if place is None else "reset"
                state = x if place is None else tuple(applied[place][1])
                self.events.append((kind, i, before, after, t, state, low, how))
            return
        for i, (old, new) in enumerate(zip(before, after, strict=True)):
            if old != new or i in touched:
                self.events.append((transition_kind(old, new), i, before, after, t, x, low, how))

    def accumulated(self, *, resting: bool = False) -> str:
        """Reason why the run must end here: events accumulate, or there are too many. Empty if the run may continue.

        Events are checked once per group. ``resting``: the events are impacts that end in a rest, so that flights may
        become ever shorter.
        """
        times = self._times
        count = len(times)
        if count % GROUP != 1:
            return ""
        if count > 2 * IMPACTS and all(event[0] == "reset" for event in self.events[-2 * IMPACTS :]):
            latest, earlier = times[-1] - times[-1 - IMPACTS], times[-1 - IMPACTS] - times[-1 - 2 * IMPACTS]
            if 0.999 * earlier <= latest <= 1e-5 * self._horizon:
                return (
                    f"impacts accumulate at t = {times[-1]:.17g}, and no longer grow faster: the last {IMPACTS} took "
                    f"{latest:.3g} s, as long as those before; a restart cannot tell flights that short"
                )
        if count > self._window:  # all events of the window within roundings of the time, or of the horizon
            t, latest = times[-1], times[-1] - times[-1 - self._window]
            if latest <= max(64.0 * EPSILON * abs(t), 1e-12 * self._horizon):
                return f"events accumulate at t = {t:.17g}: the last {self._window} took {latest:.3g} s"
            if count >= 10_000_000:
                return f"more than 10000000 events by t = {t:.17g}"
        if not resting and self._floor and count > GROUP * CHAIN:
            return self._shrunk()
        return ""

    def _shrunk(self) -> str:
        marks = self._times[::-GROUP]
        lengths = [later - earlier for later, earlier in pairwise(marks)]
        chain = 1
        while chain < len(lengths) and lengths[chain - 1] <= 0.5 * lengths[chain]:
            chain += 1
        if chain < CHAIN or lengths[0] > self._floor * lengths[chain - 1]:
            return ""
        return (
            f"events accumulate near t = {marks[0]:.17g}: groups of {GROUP} shrank from {lengths[chain - 1]:.3g} s "
            f"to {lengths[0]:.3g} s, the least that the tolerance can tell"
        )

    def explained(self, status: Status, reason: str) -> str:
        """Return the reason; if the run fails while events accumulate, the reason mentions the accumulation."""
        times = self._times
        if status == "failed" and len(times) > 8:
            latest, earlier = times[-1] - times[-5], times[-5] - times[-9]
            if latest < 0.5 * earlier:
                return f"events accumulate near t = {times[-1]:.17g}: the last 4 took {latest:.3g} s; there: {reason}"
        return reason

    def wanted(self, t: float, x: Sequence[float], mode: Mode) -> Times:
        """Return the sample times after t, or None if none remain. Samples up to t get the state x."""
        if self._sample_times is None or self._samples is None:
            return None
        done = int(np.searchsorted(self._sample_times, t, side="right"))
        for k in range(len(self._sample_modes), done):
            self._samples[k] = x
            self._sample_modes.append(mode)
        rest = self._sample_times[done:]
        return rest if rest.size else None

    def sampled(self, samples: NDArray[np.float64] | None, mode: Mode) -> None:
        """Store the states that a library returned at the sample times."""
        if samples is None or self._samples is None:
            return
        at = len(self._sample_modes)
        self._samples[at : at + len(samples)] = samples
        self._sample_modes += [mode] * len(samples)

    def finish(self, status: Status, t: float, x: Sequence[float], mode: Mode, reason: str = "") -> Trajectory:
        """Return the trajectory, ended at (t, x)."""
        modes = None
        if self._samples is not None:
            modes = tuple(self._sample_modes) + (mode,) * (len(self._samples) - len(self._sample_modes))
        return Trajectory(
            status, Transitions(self.events), t, tuple(x), mode, reason, self.work.counts, self.drift, self._samples,
            modes,
        )  # fmt: skip


def blown_up(field: Scalar, began: Sequence[float], t: float, x: Sequence[float]) -> bool:
    """Check whether a state at which the step size underflows blows up.

    It does if some component has grown since ``began`` and would change by a large part of itself within the
    resolution of the time. At a pole or at the end of the field's domain no component would.
    """
    try:
        rates = field(t, *x)
    except ARITHMETIC:
        return False
    instant = 1024.0 * EPSILON * abs(t)
    grown = 8.0 * max(abs(v) for v in began)
    return any(abs(v) > grown and abs(f) * instant > 1e-3 * abs(v) for v, f in zip(x, rates, strict=True))


def ended(
    record: Record, model: ModeFunctions, began: Sequence[float], stop: Stop, accuracy: tuple[float, float]
) -> Trajectory:
    """End a run at which the library stopped early: ``diverged``, ``invalid`` (the model ends) or ``failed``."""
    mode, t, x = model.mode, stop.t, stop.x
    if stop.status == "diverged" or any(abs(v) > LIMIT for v in x):
        return record.finish("diverged", t, x, mode, stop.reason or f"the state passed {LIMIT:g} at t = {t:.17g}")
    if expression := _model_ends(model, t, x, accuracy):
        return record.finish("invalid", t, x, mode, f"the model ends: {expression} fell to 0 at t = {t:.17g}")
    if blown_up(model.field, began, t, x):
        return record.finish("diverged", t, x, mode, f"the state blows up at t = {t:.17g}: {stop.reason}")
    return record.finish("failed", t, x, mode, record.explained("failed", stop.reason))


def _model_ends(model: ModeFunctions, t: float, x: Sequence[float], accuracy: tuple[float, float]) -> str:
    """Return a ``valid`` expression that is zero within the tolerances at the library's stop; empty if there is none.

    The field may have no value after the root of the expression, so that no step passes the root.
    """
    for k, guard in enumerate(model.guards):
        try:
            value = model.guard[k](t, *x)[0]
        except ARITHMETIC:
            continue
        if guard.kind == "valid" and abs(value) <= MARGIN * model.size(k, t, x, *accuracy):
            return str(model.system.valid[guard.index])
    return ""
