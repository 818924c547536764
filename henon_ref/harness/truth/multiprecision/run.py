"""One run in multiprecision: heyoka's steps, isolation of the guards' roots, mode decisions in ball arithmetic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from flint import arb

from henon_ref.enclosure.run import EnclosedTransition, Progress
from henon_ref.harness.truth.multiprecision.heyoka import to_real
from henon_ref.harness.truth.multiprecision.points import Point, SeriesEvaluation
from henon_ref.harness.truth.multiprecision.stepper import Step, Stepper
from henon_ref.harness.truth.multiprecision.termination import CROWD, Approaches, EndedError, Termination, written
from henon_ref.harness.truth.reference import GUARD_BITS, OUT_OF_TIME, NearGraze, exact_ball, to_ball
from henon_ref.harness.truth.roots import isolate
from henon_ref.modes.after_jump import AfterJump, Rest, after_jump
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import REMAINING, resetting, rows_at, turning_in_flight
from henon_ref.modes.selection import after_event, initial_mode, initial_signs
from henon_ref.precision import working_precision
from henon_ref.trajectory import Kind, Status

MAX_STEPS = 1_000_000
"""Largest number of Taylor steps; the time limit of a truth ends nearly all runs earlier."""
SILENT = 2.0**-80
"""Duration of all later impacts, as a part of the run, below which their limit is used: its error is about the square
of this. Above it, impacts that the reference replaces by rest (:data:`REMAINING`) are followed, but not recorded."""

Instant = tuple[EnclosedTransition, ...]
"""The transitions at one time, in balls without radius: one for each surface that changes or is touched.

The rate is the smallest rate of the guards that end the mode. The state is that after the surface's map, or after all
maps if the surface has none; a surface whose map is applied twice has two transitions.
"""


_States = Sequence[tuple[int, Sequence[arb]]]
"""Surfaces, each with the state that its transition reports."""


@dataclass
class Run:
    """Result of one run at one precision."""

    bits: int
    status: Status = "ok"
    reason: str = ""
    instants: list[Instant] = field(default_factory=list)
    near_grazes: list[NearGraze] = field(default_factory=list)
    end_time: arb = field(default_factory=arb)
    accumulates: bool = False
    """Whether infinitely many events accumulate before ``end_time``."""
    out_of_time: bool = False
    """Whether the time limit ended the run."""
    seconds: float = 0.0
    """Processor time [s]."""


@dataclass(frozen=True)
class _Hit:
    at: arb
    """In units of the step."""
    guard: int
    transversality: float
    odd: bool
    """Whether the guard changes its sign; else it only touches zero."""


def simulate(problem: Problem, bits: int, *, progress: Progress | None = None, seconds: float | None = None) -> Run:
    """Run a problem at heyoka's precision ``bits``: every event up to the horizon, or to an earlier end of the run.

    A tie or a tangency within ``2**(-3/4 bits)`` (relative) counts as exact. ``seconds`` limits the processor time of
    the run [s]. UnsupportedError if too many contacts with static friction act on each other at once.
    """
    begun = process_time()
    with working_precision(bits + GUARD_BITS):
        run = _Simulation(problem, bits, progress, seconds).run()
    run.seconds = process_time() - begun
    return run


class _Simulation:
    def __init__(self, problem: Problem, bits: int, progress: Progress | None, seconds: float | None) -> None:
        self.problem = problem
        self.deadline = math.inf if seconds is None else process_time() + seconds
        self.bits = bits
        self.zero = arb(2) ** (-(3 * bits) // 4)
        self.progress = progress
        self.modes = SeriesEvaluation(problem.system, bits)
        # Rounded as heyoka rounds them: a horizon between two of its numbers would never be reached.
        self.start, self.until = (to_ball(to_real(exact_ball(t, bits), bits)) for t in (problem.start, problem.until))
        self.span = float(self.until - self.start)
        self.result = Run(bits)
        self.steppers: dict[Mode | frozenset[int], Stepper] = {}
        self.point = self.modes.at(self.start, [exact_ball(v, bits) for v in problem.initial])
        self.mode: Mode = ()
        self.signs: list[int] = []
        """Sign of each guard since its last root (0: the guard stays zero and is not watched)."""
        self.skipped: list[int] = []
        """Number of leading coefficients of each guard that are zero at the start of the next step."""
        self.termination = Termination(self.span, bits)
        self.approaches = Approaches(self.result.near_grazes)
        self.accumulating: frozenset[int] = frozenset()
        """Surfaces whose impacts are near their limit and are no longer recorded."""

    def run(self) -> Run:
        try:
            self._begin()
            for _ in range(MAX_STEPS):
                if self._advance():
                    self.approaches.keep()
                    self.result.end_time = self.until
                    return self.result
                if process_time() > self.deadline:
                    self.result.out_of_time = True
                    raise EndedError("failed", f"{OUT_OF_TIME} at t = {self._now()}")
            raise EndedError("failed", f"stopped after {MAX_STEPS} Taylor steps")
        except EndedError as end:
            self.result.status, self.result.reason, self.result.accumulates = end.status, end.reason, end.accumulates
            if end.accumulates:
                del self.result.instants[-CROWD + 1 :]
            if end.time is not None:
                self.result.end_time = end.time
            return self.result

    def _begin(self) -> None:
        problem = self.problem
        self.result.end_time = self.start
        decision = initial_mode(self.modes.at_start(problem), problem)
        sides, _ = initial_signs(problem)
        self._enter(self._decided(decision), frozenset(i for i, side in enumerate(sides) if side == 0))

    def _decided(self, decision: Decision) -> Mode:
        if decision.mode is not None:
            return decision.mode
        raise EndedError(decision.ending, decision.reason)

    def _enter(self, mode: Mode, active: frozenset[int]) -> None:
        """Enter a mode at the present point; guards that fail at once are the next event."""
        self.mode = mode
        self.approaches.keep()
        terms = self.point.leading_terms(mode, active)
        if terms is None:
            raise EndedError("failed", f"the field is not finite at t = {self._now()}")
        guards = self.problem.system.equations(mode).guards
        self.signs = [0 if term is None else term[1] for term in terms]
        self.skipped = [0 if term is None else term[0] for term in terms]
        failing = [
            g
            for g, s in zip(guards, self.signs, strict=True)
            if (s < 0 and not g.rising_only) or (s == 0 and g.kind == "attracts")
        ]
        if failing:
            self._change_mode(failing, 0.0)
            return
        values = self.point.guard_values(mode)
        self.stepper.start(mode, self.point.time, self.point.state, values)

    @property
    def stepper(self) -> Stepper:
        key, _ = (
            ((), None) if self.problem.system.shared is not None else self.problem.system.common_equations(self.mode)
        )
        if key not in self.steppers:
            self.steppers[key] = Stepper(self.problem.system, self.mode, self.bits)
        return self.steppers[key]

    def _advance(self) -> bool:
        """Take one Taylor step with its event, if any; return True at the horizon."""
        stepper = self.stepper
        step = stepper.step(self.until)
        if not step.finite or not np.isfinite(step.rough[:, :2]).all():
            raise EndedError("failed", f"the field is not finite after t = {self._now()}")
        hits = self._first_hits(step)
        if hits:
            self._land(step, hits)
            return self._at_horizon()
        time, state = stepper.end()
        surfaces = [(k, g.index) for k, g in enumerate(stepper.guards) if g.kind == "surface" and self.signs[k]]
        ends = [(i, stepper.guard_at_end(k)) for k, i in surfaces]
        self.approaches.step(float(step.time) + float(step.length), ends)
        self.point = self._blurred(time, state, step)
        self.skipped = [0] * len(self.skipped)
        self.result.end_time = time
        self.termination.step(step, len(state), stepper.guards, self.until - time)
        if self.progress:
            self.progress(float(time - self.start) / self.span)
        return self._at_horizon()

    def _first_hits(self, step: Step) -> list[_Hit]:
        """The guards that end the mode first on a step; several if they tie."""
        near: list[tuple[arb, NearGraze]] = []
        hits: list[_Hit] = []
        length, begin = to_ball(step.length), to_ball(step.time)
        tie = self.zero * max(arb(1), abs(begin / length), key=float)
        last = room = (self.until - begin) / length + tie
        watched = ((self.stepper.clear_until(step, i, self.skipped[i]), i) for i, s in enumerate(self.signs) if s)
        for clear, i in sorted(watched):
            if not clear < last + tie:
                break  # later entries of the sorted list cannot be first either
            hit = self._hit(step, i, near)
            if hit is not None and hit.at <= room:
                hits.append(hit)
                last = hit.at if hit.at < last else last
        self.result.near_grazes += [graze for at, graze in near if at < last]
        return [hit for hit in hits if hit.at - last <= tie]

    def _hit(self, step: Step, index: int, near: list[tuple[arb, NearGraze]]) -> _Hit | None:
        """First root at which a guard falls from positive to zero or touches zero; updates the guard's sign if none."""
        stepper, guard = self.stepper, self.stepper.guards[index]
        skipped, sign = self.skipped[index], self.signs[index]
        polynomial = stepper.guard_polynomial(step, index)[skipped:]
        if (polynomial[0] > 0) != (sign > 0):
            raise EndedError("failed", f"a root of {guard.expression} near t = {self._now()} was not resolved")
        roots, near_misses = isolate(polynomial, self.zero * max((abs(c) for c in polynomial), key=float))
        if guard.kind == "surface":
            length, begin = float(step.length), float(step.time)
            for place, value in near_misses:
                at = float(place)
                near.append((place, NearGraze(begin + at * length, guard.index, abs(float(value)) * at**skipped)))
        for root in roots:
            touch = not root.odd and (guard.kind != "release" or self.problem.system.held_inside(guard.index))
            if sign > 0 and (root.odd or touch):
                slope = self._slope(step, root.at, skipped, polynomial, root.odd)
                return _Hit(root.at.mid(), index, slope, root.odd)
            if root.odd:
                sign = -sign
        self.signs[index] = sign
        return None

    def _slope(self, step: Step, at: arb, skipped: int, polynomial: Sequence[arb], odd: bool) -> float:
        """Rate at which a guard falls at a root [unit of the guard / s]; 0 if it only touches zero."""
        if not odd:
            return 0.0
        slope = sum((k * c * at ** (k - 1) for k, c in enumerate(polynomial) if k), arb(0))
        return abs(float(slope * at**skipped / to_ball(step.length)))

    def _land(self, step: Step, hits: Sequence[_Hit]) -> None:
        time = (to_ball(step.time) + hits[0].at * to_ball(step.length)).mid()
        self.point = self._blurred(time, self.stepper.state_at(time), step)
        guards = self.problem.system.equations(self.mode).guards
        touched = not any(hit.odd for hit in hits)
        self._change_mode([guards[hit.guard] for hit in hits], min(hit.transversality for hit in hits), touched=touched)

    def _change_mode(self, hits: Sequence[Guard], transversality: float, *, touched: bool = False) -> None:
        """Decide the mode after an event, record the event, and enter the mode."""
        before, point = self.mode, self.point
        self.result.end_time = point.time.mid()
        if not self.accumulating:
            self.termination.event([*(instant[0].time for instant in self.result.instants[-CROWD:]), point.time.mid()])
        due = resetting(self.problem.system, before, hits)
        if due:
            jumped = self._jump(due, hits)
            resets = tuple(i for i, _ in jumped.applied)
            after, active, rests = self.mode, frozenset(jumped.on), jumped.rests
            places = rows_at(before, after, resets)
            states = [(i, jumped.state if place is None else jumped.applied[place][1]) for i, place in places]
        else:
            resets, rests = (), ()
            after = self._decided(after_event(point, before, hits, touched=touched))
            active = self.problem.system.closed({g.index for g in hits}, {i for i, s in enumerate(before) if s == 0})
            states = [(i, point.state) for i in sorted(active) if after[i] != before[i]]
        accumulates = bool(resets) and self.accumulating.issuperset(resets)
        if self.accumulating and not (accumulates or self._turns_in_flight(hits)):
            raise EndedError("failed", f"something happens where impacts accumulate, at t = {self._now()}")
        if not self.accumulating:
            met = [(i, self.point.state) for i in sorted({g.index for g in hits})]
            self._note(before, after, states or met, transversality, resets)
        for rest in rests:
            still = frozenset(i for i, s in enumerate(rest.mode) if s == 0)
            if rest.remaining > SILENT * self.span:
                self.accumulating = self.accumulating or still.intersection(self.problem.system.resets)
                break
            self._come_to_rest(rest, still)
            after, active = rest.mode, still
        self._enter(after, active)

    def _note(self, before: Mode, after: Mode, states: _States, rate: float = 0.0, resets: Sequence[int] = ()) -> None:
        time, slope, instant = self.point.time.mid(), arb(rate), []
        for i, state in states:
            kind: Kind = "reset" if i in resets else transition_kind(before[i], after[i])
            middle = tuple(v.mid() for v in state)
            instant.append(EnclosedTransition(kind, i, before, after, time, middle, slope))
        self.result.instants.append(tuple(instant))

    def _turns_in_flight(self, hits: Sequence[Guard]) -> bool:
        """Whether a friction force reverses at the top of a flight between accumulating impacts."""
        turning = frozenset().union(*(turning_in_flight(self.problem.system, i) for i in self.accumulating))
        return all(guard.kind == "surface" and guard.index in turning for guard in hits)

    def _come_to_rest(self, rest: Rest, still: frozenset[int]) -> None:
        """Go to the time at which bodies come to rest on surfaces, or to the horizon if that is earlier.

        While impacts of several bodies accumulate, the rest of some of them is not recorded.
        """
        time = (self.point.time + rest.remaining).mid()
        late = bool(time > self.until)
        self.point = self.modes.at(self.until if late else time, rest.state)
        self.result.end_time = self.point.time
        if self.accumulating <= still:
            self.accumulating = frozenset()
            before = self.result.instants[-1][-1].to_mode
            if not late:
                self._note(before, rest.mode, [(i, rest.state) for i, s in enumerate(rest.mode) if s != before[i]])

    def _jump(self, due: tuple[int, ...], hits: Sequence[Guard]) -> AfterJump:
        """Apply the state jumps, and move to the point and mode after them."""
        system, time = self.problem.system, self.point.time
        most = arb((SILENT if self.accumulating else REMAINING) * self.span)
        after = after_jump(system, self.modes, self.mode, due, hits, time, self.point.state, most)
        self.mode, self.point = self._decided(after.decision), self.modes.at(time, after.state)
        return after

    def _blurred(self, time: arb, state: Sequence[arb], step: Step) -> Point:
        """Point with the radii of its assumed accuracy."""
        scale = max(abs(float(time)), float(step.length))
        sizes = self.stepper.sizes(step)
        known = [arb(v, self.zero * s) for v, s in zip(state, sizes, strict=True)]
        return self.modes.at(arb(time, self.zero * scale), known)

    def _at_horizon(self) -> bool:
        """Whether the horizon is reached to the precision: heyoka's last step may end one rounding error short."""
        time = self.point.time.mid()
        return bool(self.until - time <= self.zero * max(abs(float(time)), self.span))

    def _now(self) -> str:
        return written(self.point.time)
