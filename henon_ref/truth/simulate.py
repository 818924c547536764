"""One run in multiprecision: heyoka's steps, the guards' roots, the modes decided in ball arithmetic."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from flint import arb, ctx

from henon_ref.model.modes import Mode
from henon_ref.model.switching import Decision
from henon_ref.model.system import Guard
from henon_ref.trajectory import Problem, Status
from henon_ref.truth.decide import Decider, Point
from henon_ref.truth.numbers import GUARD_BITS, exact_ball, to_ball
from henon_ref.truth.roots import isolate
from henon_ref.truth.stepper import Step, Stepper

HUGE = 1e100
"""A state beyond this has blown up."""
COLLAPSED = 2.0**-64
"""A step shorter than this part of the run has met a singularity."""
RESOLUTION = 2.0**-53
"""Events closer together than this part of the run are crowded."""
CROWD = 16
"""Crowded events in a row before transitions count as accumulating."""
MEMORY = 24
"""Steps looked back on to tell a blow-up (increments last) from a singular field (they fade)."""
MAX_STEPS = 1_000_000

Progress = Callable[[float], None]
"""Told the part of the run that is done, 0 to 1."""


@dataclass(frozen=True)
class Event:
    """One instant at which modes change (or a surface is touched)."""

    time: arb
    state: tuple[arb, ...]
    before: Mode
    after: Mode
    surfaces: tuple[int, ...]
    """Surfaces that change, or that are touched where none changes."""
    transversality: float
    """Smallest speed with which a guard that ends the mode falls through zero [unit of the guard / s]."""


@dataclass(frozen=True)
class NearGraze:
    """A surface nearly touched: its h has an extremum that nearly reaches zero."""

    time: float
    surface: int
    distance: float
    """abs(h) there."""


@dataclass
class Run:
    """What one run in one precision found."""

    bits: int
    status: Status = "ok"
    reason: str = ""
    events: list[Event] = field(default_factory=list)
    near_grazes: list[NearGraze] = field(default_factory=list)
    end_time: arb = field(default_factory=arb)


@dataclass(frozen=True)
class _Hit:
    at: arb
    """In units of the step."""
    guard: int
    transversality: float


class _OverError(Exception):
    """The run is over before its horizon."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


def simulate(problem: Problem, bits: int, *, progress: Progress | None = None) -> Run:
    """Run a problem at one precision.

    Parameters
    ----------
    problem : Problem
    bits : int
        heyoka's precision; a tie or a tangency within ``2**(-3/4 bits)`` (relative) counts as exact.
    progress : callable, optional

    Returns
    -------
    Run
        Every event up to the horizon, or up to where the run has to end.
    """
    with ctx.workprec(bits + GUARD_BITS):
        return _Simulation(problem, bits, progress).run()


class _Simulation:
    """The state of one run."""

    def __init__(self, problem: Problem, bits: int, progress: Progress | None) -> None:
        self.problem = problem
        self.bits = bits
        self.zero = arb(2) ** (-(3 * bits) // 4)
        self.progress = progress
        self.decider = Decider(problem.system, bits)
        self.start, self.until = exact_ball(problem.start, bits).mid(), exact_ball(problem.until, bits).mid()
        self.span = float(self.until - self.start)
        self.result = Run(bits)
        self.steppers: dict[frozenset[int], Stepper] = {}
        self.point = Point(self.start, tuple(exact_ball(v, bits) for v in problem.initial))
        self.mode: Mode = ()
        self.signs: list[int] = []
        """Sign of each guard since the last root (0: it stays zero and is not watched)."""
        self.skipped: list[int] = []
        """Leading coefficients of each guard that are zero at the start of the next step."""
        self.increments: deque[float] = deque(maxlen=MEMORY)
        self.crowded = 0

    def run(self) -> Run:
        try:
            self._begin()
            for _ in range(MAX_STEPS):
                if self._advance():
                    self.result.end_time = self.until
                    return self.result
            raise _OverError("failed", f"stopped after {MAX_STEPS} Taylor steps")
        except _OverError as over:
            self.result.status, self.result.reason = over.status, over.reason
            return self.result

    def _begin(self) -> None:
        problem = self.problem
        self.result.end_time = self.start
        decision = self.decider.initial_mode(problem.start, problem.initial, problem.initial_mode)
        mode = self._decided(decision)
        sides = self.decider.sides(problem.start, problem.initial, problem.system.surfaces)
        self._enter(mode, frozenset(i for i, side in enumerate(sides) if side == 0))

    def _decided(self, decision: Decision) -> Mode:
        if decision.mode is not None:
            return decision.mode
        status: dict[str, Status] = {"nonunique": "nonunique", "invalid": "invalid"}
        raise _OverError(status.get(decision.status, "failed"), decision.reason)

    def _enter(self, mode: Mode, active: frozenset[int]) -> None:
        """Go on in a mode from the present point; what fails at once is the next event."""
        self.mode = mode
        heads = self.decider.heads(self.point, mode, active)
        if heads is None:
            raise _OverError("failed", f"the field is not finite at t = {self._now()}")
        guards = self.problem.system.equations(mode).guards
        self.signs = [0 if head is None else head[1] for head in heads]
        self.skipped = [0 if head is None else head[0] for head in heads]
        failing = [g for g, s in zip(guards, self.signs, strict=True) if s < 0 and not g.rising_only]
        if failing:
            self._settle(failing, 0.0)
            return
        values = self.decider.values(self.point, mode)
        self.stepper.start(mode, self.point.time, self.point.state, values)

    @property
    def stepper(self) -> Stepper:
        sliding = frozenset(i for i, s in enumerate(self.mode) if s == 0)
        if sliding not in self.steppers:
            self.steppers[sliding] = Stepper(self.problem.system, sliding, self.bits)
        return self.steppers[sliding]

    def _advance(self) -> bool:
        """One Taylor step and the event on it, if any; True at the horizon."""
        stepper = self.stepper
        step = stepper.step(self.until)
        if not step.finite or not np.isfinite(step.rough[:, :2]).all():
            raise _OverError("failed", f"the field is not finite after t = {self._now()}")
        hits = self._first_hits(step)
        if hits:
            self._land(step, hits)
            return self.point.time >= self.until
        time, state = stepper.end()
        self.point = self._blurred(time, state, step)
        self.skipped = [0] * len(self.skipped)
        self.result.end_time = time
        self._check_growth(step)
        if self.progress:
            self.progress(float(time - self.start) / self.span)
        return bool(time >= self.until)

    def _first_hits(self, step: Step) -> list[_Hit]:
        """The guards that end the mode first on a step; several where they tie."""
        hits = [hit for i in range(len(self.signs)) if self.signs[i] and (hit := self._hit(step, i))]
        length, begin = to_ball(step.length), to_ball(step.time)
        tie = self.zero * max(arb(1), abs(begin / length), key=float)
        room = (self.until - begin) / length + tie
        hits = [hit for hit in hits if hit.at <= room]
        first = min((hit.at for hit in hits), default=arb(0), key=float)
        for hit in hits:  # doubles order them but for ties
            if hit.at < first:
                first = hit.at
        return [hit for hit in hits if hit.at - first <= tie]

    def _hit(self, step: Step, index: int) -> _Hit | None:
        """Where a guard first falls from positive to zero on a step, or touches it; keeps its sign up to date."""
        stepper, guard = self.stepper, self.stepper.guards[index]
        skipped = self.skipped[index]
        if stepper.clear_of_zero(step, index, skipped):
            return None
        polynomial = stepper.guard_polynomial(step, index)[skipped:]
        if (polynomial[0] > 0) != (self.signs[index] > 0):
            raise _OverError("failed", f"a root of {guard.expression} near t = {self._now()} was not resolved")
        found = isolate(polynomial, self.zero * max((abs(c) for c in polynomial), key=float))
        sign = self.signs[index]
        for root in found.roots:
            touch = not root.odd and guard.kind != "release"
            if sign > 0 and (root.odd or touch):
                return _Hit(root.at.mid(), index, self._slope(step, index, root.at, skipped, polynomial, root.odd))
            if root.odd:
                sign = -sign
        self.signs[index] = sign
        if guard.kind == "surface":
            length, begin = float(step.length), float(step.time)
            for miss in found.near_misses:
                value = abs(float(miss.value)) * float(miss.at) ** skipped
                self.result.near_grazes.append(NearGraze(begin + float(miss.at) * length, guard.index, value))
        return None

    def _slope(self, step: Step, index: int, at: arb, skipped: int, polynomial: Sequence[arb], odd: bool) -> float:
        """Speed with which a guard falls at a root [unit of the guard / s]; 0 at a touch."""
        if not odd:
            return 0.0
        slope = sum((k * c * at ** (k - 1) for k, c in enumerate(polynomial) if k), arb(0))
        return abs(float(slope * at**skipped / to_ball(step.length)))

    def _land(self, step: Step, hits: Sequence[_Hit]) -> None:
        time = (to_ball(step.time) + hits[0].at * to_ball(step.length)).mid()
        self.point = self._blurred(time, self.stepper.state_at(time), step)
        guards = self.problem.system.equations(self.mode).guards
        self._settle([guards[hit.guard] for hit in hits], min(hit.transversality for hit in hits))

    def _settle(self, hits: Sequence[Guard], transversality: float) -> None:
        """Decide the mode after an event, note the event, and go on."""
        before, point = self.mode, self.point
        self.result.end_time = point.time.mid()
        self._check_crowd(point)
        after = self._decided(self.decider.after_event(point, before, hits))
        active = frozenset({g.index for g in hits} | {i for i, s in enumerate(before) if s == 0})
        changed = tuple(i for i in sorted(active) if after[i] != before[i])
        touched = tuple(sorted({g.index for g in hits}))
        state = tuple(v.mid() for v in point.state)
        self.result.events.append(Event(point.time.mid(), state, before, after, changed or touched, transversality))
        self.increments.clear()
        self._enter(after, active)

    def _blurred(self, time: arb, state: Sequence[arb], step: Step) -> Point:
        """A point with the radii within which it counts as known."""
        scale = max(abs(float(time)), float(step.length))
        sizes = self.stepper.sizes(step)
        return Point(
            arb(time, self.zero * scale), tuple(arb(v, self.zero * s) for v, s in zip(state, sizes, strict=True))
        )

    def _check_crowd(self, point: Point) -> None:
        """Stop where events accumulate (Zeno), and say where."""
        times = [e.time for e in self.result.events[-2:]] + [point.time]
        if len(times) < 3 or float(times[2] - times[1]) > RESOLUTION * max(abs(float(point.time)), self.span):
            self.crowded = 0
            return
        self.crowded += 1
        if self.crowded < CROWD:
            return
        first, second = times[1] - times[0], times[2] - times[1]
        limit = times[2] + second**2 / (first - second) if second < first else times[2]
        del self.result.events[-CROWD + 1 :]
        self.result.end_time = limit.mid()
        raise _OverError("failed", f"transitions accumulate at t = {limit.mid().str(17, radius=False)}")

    def _check_growth(self, step: Step) -> None:
        """Stop where the solution ends: a blow-up in finite time, or a singular field."""
        states = step.rough[: len(self.point.state)]
        if np.abs(states).max() > HUGE:
            raise _OverError("diverged", f"the state leaves every bound at t = {self._now()}")
        self.increments.append(float(np.abs(states[:, 1:].sum(axis=1)).max()))
        if float(step.length) > COLLAPSED * self.span or self.until - self.point.time < COLLAPSED * self.span:
            return
        row = states[np.abs(states[:, -1]).argmax()]
        limit = to_ball(step.time) + arb(float(row[-2] / row[-1])) * to_ball(step.length)
        self.result.end_time = limit.mid()
        at = limit.mid().str(17, radius=False)
        if len(self.increments) == MEMORY and self.increments[-1] > 0.5 * self.increments[0]:
            raise _OverError("diverged", f"the state leaves every bound at t = {at}")
        raise _OverError("failed", f"the field is singular at t = {at}: the solution ends there")

    def _now(self) -> str:
        return self.point.time.mid().str(17, radius=False)
