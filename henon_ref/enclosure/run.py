"""Certified runs: every transition of a problem with a proven enclosure of its time and state."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, log2
from typing import Literal

from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import PointSet, UndecidedError
from henon_ref.enclosure.event import Hit
from henon_ref.enclosure.flow import ValidatedFlow
from henon_ref.enclosure.mode_selection import initial_entry
from henon_ref.enclosure.model import SystemModel
from henon_ref.modes.mode import Mode, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import rows_at
from henon_ref.precision import working_precision
from henon_ref.trajectory import Kind

ATTEMPTS = 4
"""Largest number of attempts with rising precision."""
MAX_TRANSITIONS = 20_000
MAX_STEPS = 400_000
TRIAL_TIME, LEAST_COVERED = 0.1, 0.02
"""A proof is stopped early if its steps after the first take the part ``TRIAL_TIME`` of the time left then and cover
less than the part ``LEAST_COVERED`` of the run: a fifth of the necessary pace. The steps' time is processor time, which
other work on the machine does not change; what precedes the end of the first step (preparation of the equations) does
not count."""

CROWD, CROWDED = 16, 1e-9
"""Events count as accumulating if ``CROWD`` of them are within the part ``CROWDED`` of the run."""

Ended = Literal["horizon", "invalid", "nonunique", "none", "undecided", "budget"]
Progress = Callable[[float], None]
"""Called with the part of the run that is done, 0 to 1."""


@dataclass(frozen=True)
class EnclosedTransition:
    """One proven change of mode at one instant, enclosed in balls; no transition is missed before it."""

    kind: Kind
    surface: int
    from_mode: Mode
    to_mode: Mode
    time: arb
    """Encloses the time [s]."""
    state: tuple[arb, ...]
    rate: arb
    """Encloses the slope of the guard that fell [guard's unit/s], a measure of transversality."""


@dataclass(frozen=True)
class CertifiedRun:
    """The proven part of a problem's run."""

    status: Literal["certified", "not provable"]
    """``certified``: proven to the horizon, or to the end of the model (``ended`` is ``invalid``)."""
    ended: Ended
    """``nonunique`` and ``none`` are proven too: the future is not unique, or does not exist."""
    reason: str
    """Why the run ended before the horizon; empty if it reached the horizon."""
    transitions: tuple[EnclosedTransition, ...]
    """All proven transitions, each to the requested radius."""
    time: arb
    """End of the proven part [s]."""
    state: tuple[arb, ...]
    mode: Mode | None
    bits: int

    @property
    def radius(self) -> float:
        """Largest radius of a transition time [s] (0 without transitions)."""
        return max((float(t.time.rad()) for t in self.transitions), default=0.0)


def certify(
    problem: Problem, *, radius: float = 1e-30, progress: Progress | None = None, deadline: float | None = None
) -> CertifiedRun:
    """Prove every transition of a problem, with enclosures of its time and state.

    The precision is raised until every time is enclosed to ``radius`` [s], or until the same transition stays undecided
    at two precisions; ``reason`` then names the undecided question. After ``deadline`` (wall time [s]) the run stops
    with ``ended = "budget"`` and the part proven so far. It also stops so if its pace is far too low: the part of the
    run covered by the steps after the first, for their processor time (:data:`LEAST_COVERED`).

    UnsupportedError if too many contacts with static friction act on each other at once.
    """
    until = None if deadline is None else clock.monotonic() + deadline
    model = SystemModel(problem.system)
    horizon = max(1.0, *(abs(float(problem.system.numeric(e))) for e in (problem.start, problem.until)))
    bits = ceil(log2(horizon / radius)) + 40  # for the growth of errors along the run
    last: CertifiedRun | None = None
    for attempt in range(ATTEMPTS):
        with working_precision(bits):
            run = _Attempt(model, problem, bits, progress, until).run()
        again = last is not None and run.ended == last.ended and len(run.transitions) == len(last.transitions)
        decided = run.ended != "undecided" or again
        if run.ended == "budget" or attempt == ATTEMPTS - 1 or (run.radius <= radius and decided):
            return _trimmed(run, radius)
        lost = log2(max(run.radius, 2.0**-bits) / radius)
        bits += max(ceil(lost) + 8, bits // 2 if run.ended == "undecided" else 8)
        last = run
    raise AssertionError("the last attempt returns")


def _trimmed(run: CertifiedRun, radius: float) -> CertifiedRun:
    """Return the part of a run that meets the radius, as not provable beyond it."""
    good = next((k for k, t in enumerate(run.transitions) if float(t.time.rad()) > radius), None)
    if good is None:
        return run
    reason = f"the radius {radius:.3g} is not met from transition {good} on at {run.bits} bits"
    reached = run.transitions[good - 1].time if good else run.time
    ended: Ended = "undecided"
    if run.ended == "budget":
        ended, reason = run.ended, f"{run.reason}; {reason}"
    kept = run.transitions[:good]
    return replace(run, status="not provable", ended=ended, reason=reason, transitions=kept, time=reached)


class _Attempt:
    """One run at one precision, which must be the working precision."""

    def __init__(
        self, model: SystemModel, problem: Problem, bits: int, progress: Progress | None, until: float | None
    ) -> None:
        self.model, self.problem, self.bits, self.progress, self.until = model, problem, bits, progress, until
        self.transitions: list[EnclosedTransition] = []
        numeric = problem.system.numeric
        self.horizon = enclose(numeric(problem.until))
        self.start = [enclose(numeric(e)) for e in (problem.start, *problem.initial)]
        self.flow: ValidatedFlow | None = None

    def run(self) -> CertifiedRun:
        try:
            entry = initial_entry(self.model, self.problem)
            length = abs(self.horizon - self.start[0])
            unit = 2.0 ** max(-1000, min(0, round(log2(max(float(length.upper()), 1e-300)))))
            points, span = PointSet.box(self.start), float(length.mid())
            self.flow = ValidatedFlow(self.model, points, entry, self.bits, unit=unit, span=span)
            reason = self._advance(self.flow)
        except UndecidedError as stop:
            # If events accumulate, a higher precision only proves a few more of them.
            crowded = self._crowded()
            return self._result("budget" if crowded else "undecided", crowded + stop.reason)
        except EndedError as stop:
            return self._result(stop.ended, stop.reason)
        return self._result("budget" if reason else "horizon", reason)

    def _advance(self, flow: ValidatedFlow) -> str:
        """Propagate to the horizon; return why it was not reached, or an empty text."""
        begin = self.start[0].mid()
        length = float(self.horizon - begin)
        first: tuple[float, float, float] | None = None
        """Wall time left, processor time, and time covered at the end of the first step [s]."""
        while True:
            before = flow.points.centre[0]
            hit = flow.step(self.horizon)
            if hit is not None:
                self._record(hit)
            if flow.done:
                return ""
            now = flow.points.centre[0]
            passed, at = float(now - begin), f"t = {now.str(17, radius=False)}"
            if self.progress is not None:
                self.progress(passed / length)
            if len(self.transitions) >= MAX_TRANSITIONS:
                return f"stopped after {MAX_TRANSITIONS} transitions, at {at}"
            if flow.steps >= MAX_STEPS or float(now - before) < 2.0**-100 * max(passed, length):
                return f"steps become too short at {at}: the solution runs into a singularity"
            if self.until is not None:
                left = self.until - clock.monotonic()
                if left < 0:
                    return f"the deadline passed at {at}"
                first = first or (left, clock.thread_time(), passed)
                tried = clock.thread_time() - first[1] > TRIAL_TIME * first[0]
                if tried and passed - first[2] < LEAST_COVERED * length:
                    return f"the deadline would pass before the end, at the pace up to {at}"

    def _crowded(self) -> str:
        """Prefix of the reason if the last events accumulate, else an empty text."""
        if len(self.transitions) < CROWD:
            return ""
        last = self.transitions[-1].time
        crowded = last - self.transitions[-CROWD].time < CROWDED * abs(self.horizon - self.start[0])
        return f"events accumulate at t = {last.str(12, radius=False)}: " if crowded else ""

    def _record(self, hit: Hit) -> None:
        """Record one transition for every surface whose entry changes, in the order of the surfaces."""
        if hit.recorded:
            self._note(hit, hit.before, hit.after, hit.box, hit.applied)
        if hit.rest is not None:
            self._note(hit, hit.after, hit.rest.mode, hit.rest.box)

    def _note(
        self,
        hit: Hit,
        before: Mode,
        after: Mode,
        box: tuple[arb, ...],
        applied: Sequence[tuple[int, tuple[arb, ...]]] = (),
    ) -> None:
        rows: list[tuple[int, int | None]]
        if applied:
            rows = rows_at(before, after, [i for i, _ in applied])
        else:
            rows = [(i, None) for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]
        for i, place in rows:
            kind: Kind = transition_kind(before[i], after[i]) if place is None else "reset"
            own = box if place is None else applied[place][1]
            self.transitions.append(EnclosedTransition(kind, i, before, after, box[0], own[1:], hit.rate))

    def _result(self, ended: Ended, reason: str) -> CertifiedRun:
        flow = self.flow
        certified = ended == "horizon" or (ended == "invalid" and flow is not None)
        box = self.start if flow is None else flow.points.hull()
        return CertifiedRun(
            status="certified" if certified else "not provable",
            ended=ended,
            reason=reason,
            transitions=tuple(self.transitions),
            time=box[0],
            state=tuple(box[1:]),
            mode=None if flow is None else flow.mode,
            bits=self.bits,
        )
