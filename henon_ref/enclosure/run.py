"""Certified runs: every transition of a problem with a proven enclosure of its time and state."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, log2
from typing import Literal

from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.fallen_guard import Hit
from henon_ref.enclosure.flow import Precision, ValidatedFlow
from henon_ref.enclosure.lohner import PointSet
from henon_ref.enclosure.mode_selection import initial_entry
from henon_ref.enclosure.model import SystemModel
from henon_ref.modes.mode import Mode, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import rows_at
from henon_ref.precision import working_precision
from henon_ref.trajectory import Kind

SPARE_BITS = 40
"""Working precision beyond the requested radius at the first attempt, for the error growth along the run."""
ATTEMPTS = 4
"""Largest number of attempts with rising precision."""
MAX_TRANSITIONS = 20_000
MAX_STEPS = 400_000
SHORTEST = 2.0**-100
"""Shortest step as a part of the run; a shorter step indicates a singularity or accumulating events."""
EARLY, FAR = 0.1, 0.01
"""A proof is stopped if after the part ``EARLY`` of its time it has covered less than the part ``FAR`` of the run."""

CROWD, CROWDED = 16, 1e-9
"""Events count as accumulating if ``CROWD`` of them are within the part ``CROWDED`` of the run."""

Ended = Literal["horizon", "invalid", "nonunique", "none", "undecided", "budget"]
Progress = Callable[[float, int], None]


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
    order: int
    steps: int
    seconds: float
    """Wall time of all attempts."""

    @property
    def radius(self) -> float:
        """Largest radius of a transition time [s] (0 without transitions)."""
        return max((float(t.time.rad()) for t in self.transitions), default=0.0)


def certify(
    problem: Problem,
    *,
    radius: float = 1e-30,
    bits: int | None = None,
    progress: Progress | None = None,
    deadline: float | None = None,
    max_transitions: int = MAX_TRANSITIONS,
) -> CertifiedRun:
    """Prove every transition of a problem, with enclosures of its time and state.

    The precision is raised until every time is enclosed to ``radius``, or until the same transition stays undecided
    at two precisions; ``reason`` then names the undecided question.

    Parameters
    ----------
    problem : Problem
    radius : float
        Required radius of every transition time [s].
    bits : int, optional
        Initial working precision; by default chosen from the radius.
    progress : callable, optional
        Called with (time reached, transitions so far) after every step.
    deadline : float, optional
        Time limit [s of wall time], after which the run stops with ``ended = "budget"`` and the part proven so far.
    max_transitions : int
        Number of transitions at which the run stops with ``ended = "budget"``.

    Returns
    -------
    CertifiedRun

    Raises
    ------
    UnsupportedError
        If too many contacts with static friction act on each other at once.
    """
    begun = clock.monotonic()
    until = None if deadline is None else begun + deadline
    model = SystemModel(problem.system)
    horizon = max(1.0, *(abs(float(problem.system.numeric(e))) for e in (problem.start, problem.until)))
    bits = bits if bits is not None else ceil(log2(horizon / radius)) + SPARE_BITS
    last: CertifiedRun | None = None
    for attempt in range(ATTEMPTS):
        with working_precision(bits):
            run = _Attempt(model, problem, bits, progress, until, max_transitions).run()
        final = attempt == ATTEMPTS - 1 or run.ended == "budget"
        stuck = last is not None and run.ended == last.ended == "undecided"
        stuck = stuck and last is not None and len(run.transitions) == len(last.transitions)
        if run.radius <= radius and (run.ended != "undecided" or stuck or final):
            return replace(run, seconds=clock.monotonic() - begun)
        if final:
            return replace(_trimmed(run, radius), seconds=clock.monotonic() - begun)
        lost = log2(max(run.radius, 2.0**-bits) / radius)
        bits += max(ceil(lost) + 8, bits // 2 if run.ended == "undecided" else 8)
        last = run
    raise AssertionError("the last attempt returns")


def _trimmed(run: CertifiedRun, radius: float) -> CertifiedRun:
    """Return the part of a run that meets the radius, as not provable beyond it."""
    good = 0
    while good < len(run.transitions) and float(run.transitions[good].time.rad()) <= radius:
        good += 1
    if good == len(run.transitions):
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
        self,
        model: SystemModel,
        problem: Problem,
        bits: int,
        progress: Progress | None,
        until: float | None,
        max_transitions: int,
    ) -> None:
        self.model, self.problem, self.progress, self.until = model, problem, progress, until
        self.allowed = 0.0 if until is None else until - clock.monotonic()
        self.max_transitions = max_transitions
        self.precision = Precision.of(bits)
        self.transitions: list[EnclosedTransition] = []
        numeric = problem.system.numeric
        self.horizon = enclose(numeric(problem.until))
        self.start = [enclose(numeric(e)) for e in (problem.start, *problem.initial)]
        self.flow: ValidatedFlow | None = None

    def run(self) -> CertifiedRun:
        try:
            entry, _ = initial_entry(self.model, self.problem)
            unit = 2.0 ** max(
                -1000, min(1000, round(log2(max(float(abs(self.horizon - self.start[0]).upper()), 1e-300))))
            )
            span = float(abs(self.horizon - self.start[0]).mid())
            self.flow = ValidatedFlow(self.model, PointSet.box(self.start), entry, self.precision, min(unit, 1.0), span)
            reason = self._advance(self.flow)
        except UndecidedError as stop:
            # If events accumulate, a higher precision only proves a few more of them.
            crowded = self._crowded()
            return self._result("not provable", "budget" if crowded else "undecided", crowded + stop.reason)
        except EndedError as stop:
            certified = stop.ended == "invalid" and self.flow is not None
            return self._result("certified" if certified else "not provable", stop.ended, stop.reason)
        return self._result("not provable", "budget", reason) if reason else self._result("certified", "horizon", "")

    def _advance(self, flow: ValidatedFlow) -> str:
        """Propagate to the horizon; return why it was not reached, or an empty text."""
        begin = float(self.start[0].mid())
        while not flow.done:
            before = flow.points.centre[0]
            hit = flow.step(self.horizon)
            if hit is not None:
                self._record(hit)
            now = flow.points.centre[0]
            if self.progress is not None:
                self.progress(float(now), len(self.transitions))
            if len(self.transitions) >= self.max_transitions:
                return f"stopped after {self.max_transitions} transitions, at t = {now.str(17, radius=False)}"
            stalled = float(now - before) < SHORTEST * max(float(now) - begin, float(self.horizon) - begin)
            if flow.steps >= MAX_STEPS or (stalled and not flow.done):
                return (
                    f"steps become too short at t = {now.str(17, radius=False)}: the solution runs into a singularity"
                )
            if self.until is not None and (left := self.until - clock.monotonic()) < (1 - EARLY) * self.allowed:
                if left < 0:
                    return f"the deadline passed at t = {now.str(17, radius=False)}"
                if float(now) - begin < FAR * (float(self.horizon) - begin):
                    return f"the deadline would pass before the end, at the pace up to t = {now.str(17, radius=False)}"
        return ""

    def _crowded(self) -> str:
        """Prefix of the reason if the last events accumulate, else an empty text."""
        if len(self.transitions) < CROWD:
            return ""
        spread = self.transitions[-1].time - self.transitions[-CROWD].time
        if not spread < CROWDED * abs(self.horizon - self.start[0]):
            return ""
        return f"events accumulate at t = {self.transitions[-1].time.str(12, radius=False)}: "

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
        applied: tuple[tuple[int, tuple[arb, ...]], ...] = (),
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

    def _result(self, status: Literal["certified", "not provable"], ended: Ended, reason: str) -> CertifiedRun:
        box = self.flow.points.hull() if self.flow is not None else self.start
        return CertifiedRun(
            status,
            ended,
            reason,
            tuple(self.transitions),
            box[0],
            tuple(box[1:]),
            self.flow.mode if self.flow is not None else None,
            self.precision.bits,
            self.precision.order,
            self.flow.steps if self.flow is not None else 0,
            0.0,
        )
