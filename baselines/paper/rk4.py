"""``henon-rk4``: the paper's method for any Filippov system, implemented correctly.

The method is classical Runge-Kutta of order 4 with a fixed step. The time is a state, so that the forcing is evaluated
at the stage times. If a step has crossed a guard g = 0 (a surface in slip, a tangent point in sliding), the independent
variable is swapped from t to g, ``dx/dg = f/g'`` and ``dt/dg = 1/g'``, and one step of length -g lands on g = 0. This
is Eq. (14) of Olejnik and Awrejcewicz (2013) for a surface, Eq. (15) for the end of a stick. The method is Hénon's,
*Physica D* 5 (1982) 412-413.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from functools import lru_cache
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.library import Times, Work
from henon_ref.baselines.paper import COMPILER
from henon_ref.baselines.paper.rk4_kernel import EVENT, NO_GUARD, NOT_FINITE, Floats, Kernel, crossed_guards, land
from henon_ref.baselines.record import Record
from henon_ref.baselines.surface_functions import surface
from henon_ref.errors import UnsupportedError
from henon_ref.jit.processor_time import compiling
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced, sign_after
from henon_ref.modes.mode_evaluation import ModeEvaluation, in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event, initial_mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Run
from henon_ref.trajectory import Status, Trajectory, without_hidden_kinks


class HenonRK4:
    """Solver ``henon-rk4``: the paper's fixed-step method.

    The step after an event starts at the landed point, so that the grid of steps shifts with every event. The mode's
    field is used up to the end of the step that crosses the guard, and the swap goes back from there. Near a tangency
    the swap would divide by g' -> 0; there, a bracketed root of g along the step is used, and the landing of the
    transition is ``bracket``. States are not projected: on a curved surface a slide drifts with order 4
    (``max_surface_drift``).

    As in the paper, events are detected only by the signs of guards at the ends of steps. Two roots in one step, of a
    graze or a short excursion, are missed.

    ``steps`` are Runge-Kutta steps, those cut by an event included. ``rhs_evaluations`` is 4 for each step and each
    landing. ``event_evaluations`` counts the ends of steps at which all guards were evaluated.
    """

    name = "henon-rk4"
    fixed_step = True
    landing = "henon"
    version = COMPILER

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Compile every mode that the run visits, by one run (see :class:`henon_ref.solver.Solver`).

        A process compiles a system once, for all step lengths.
        """
        if problem.system.resets:
            raise UnsupportedError(f"{self.name} does not support jumps of the state")
        if step is None or not step > 0:
            raise UnsupportedError(f"{self.name} needs a positive step, got {step}")
        modes = in_doubles(problem.system)

        def run() -> Trajectory:
            found = _Integration(problem, step, modes, sample_times, deadline).run()
            return without_hidden_kinks(found, problem.system)

        run()
        return run


RK4 = HenonRK4()


@lru_cache(maxsize=1024)
def _kernel(system: FilippovSystem, mode: Mode) -> Kernel:
    """Compiled kernel of a mode, for all step lengths."""
    with compiling():
        return Kernel(system, mode)


class _Integration:
    """One run: the mode loop around the compiled kernels."""

    def __init__(
        self, problem: Problem, step: float, modes: ModeEvaluation, wanted: Times, deadline: float | None
    ) -> None:
        self.problem, self.system, self.step, self.modes = problem, problem.system, step, modes
        self.work = Work(deadline)
        self.record = Record(self.work, problem, "henon", sample_times=wanted)
        self.time, self.time_low = float(problem.start), 0.0
        self.until = float(problem.until)
        self.x: Floats = np.array([float(v) for v in problem.initial])
        self.mode: Mode = (0,) * len(self.system.surfaces)
        self.wanted: Floats = np.array([] if wanted is None else wanted, dtype=float)
        self.samples, self.filled = np.empty((self.wanted.size, self.x.size)), 0

    def run(self) -> Trajectory:
        """Integrate to the horizon, or to an earlier end."""
        decision = initial_mode(self.modes.at_start(self.problem), self.problem)
        crowded = 100  # so many events within the length of one step accumulate, or the run chatters
        recent: deque[float] = deque(maxlen=crowded)
        while decision.mode is not None:
            self.mode = decision.mode
            ended = self._through_mode()
            if not isinstance(ended, Decision):
                return self._result(*ended)
            decision = ended
            recent.append(self.time)
            if len(recent) == crowded and self.time - recent[0] < self.step:
                return self._result("failed", f"{crowded} events within one step at t = {self.time:.17g}")
        return self._result(decision.ending, decision.reason)

    def _through_mode(self) -> Decision | tuple[Status, str]:
        """Step through one mode; return the decision at its end, or the status and reason of the run's end."""
        kernel, h = _kernel(self.system, self.mode), self.step
        new = np.empty_like(self.x)
        armed = np.array(kernel.values(self.time, self.x)) > 0
        done, last = 0, int((self.until - self.time) / h)
        while True:
            first = done
            # The clock is checked after at most 200,000 steps.
            done, filled, code = kernel.advance(
                self.time, (first, min(first + 200_000, last)), h, self.x, armed, new,
                self.wanted, self.samples, self.filled,
            )  # fmt: skip
            self._sampled(filled)
            taken = done - first + (code == EVENT)
            self.work.steps, self.work.events = self.work.steps + taken, self.work.events + taken
            self.work.rhs += 4 * taken
            if code == EVENT:
                self._move(done * h)
                return self._event(kernel, h, armed, new)
            if code in (NOT_FINITE, NO_GUARD):
                self._move(done * h)
                return self._lost(code)
            if done == last:
                self._move(done * h)
                done, last, h = 0, 1, self.until - self.time
                if h <= 0 or self.time + h == self.time:
                    return "ok", ""
            elif self.work.clock.passed():
                self._move(done * h)
                return "timeout", f"out of time at t = {self.time:.17g}"

    def _event(self, kernel: Kernel, h: float, armed: NDArray[np.bool_], new: Floats) -> Decision | tuple[Status, str]:
        """Land on the first guard that the step from the current state to ``new`` has crossed; select the next mode."""
        t = self.time
        found = {i: land(kernel, i, t, self.x, new, h) for i in crossed_guards(kernel, t + h, new, armed)}
        landings = {i: landing for i, landing in found.items() if landing is not None}
        if len(landings) < len(found):
            return "failed", f"a guard is not a number on the step from t = {t:.17g}"
        self.work.rhs += 4 * len(landings)
        if not found:  # the compiled loop rounds the time differently; the next step will cross the guard
            self._sample_up_to(kernel, h)
            self._move(h)
            self.x = new.copy()
            return Decision("unique", self.mode)
        offset, self.x, how = min(landings.values(), key=itemgetter(0))
        # Guards that land within 1e-12 s of each other are one event.
        hits = [kernel.guards[i] for i, (other, *_) in landings.items() if other <= offset + 1e-12]
        self._sample_up_to(kernel, offset)
        self._move(offset)
        state = tuple(self.x.tolist())
        touched = {g.index for g in hits if g.kind == "surface"}
        self._note_drift(touched)
        decision = self._after_event(state, hits)
        if decision.mode is not None:
            self.record.event(self.time, self.time_low, state, self.mode, decision.mode, touched, landing=how)
        if self.work.clock.passed():
            return "timeout", f"out of time at t = {self.time:.17g}"
        return decision

    def _sample_up_to(self, kernel: Kernel, offset: float) -> None:
        """Fill the samples up to ``offset`` after the current time."""
        filled = self.filled
        while filled < self.wanted.size and self.wanted[filled] <= self.time + offset:
            kernel.step(self.time, self.x, self.wanted[filled] - self.time, self.samples[filled])
            filled += 1
        self._sampled(filled)

    def _sampled(self, filled: int) -> None:
        self.record.sampled(self.samples[self.filled : filled], self.mode)
        self.filled = filled

    def _after_event(self, x: Sequence[float], hits: Sequence[Guard]) -> Decision:
        """Select the next mode: by two normal velocities if they decide it, otherwise by :func:`.after_event`."""
        at, mode, i = self.modes.at(self.time, x), self.mode, hits[0].index
        # The slip fields may select the next mode, unless a hold zone decides sticking on the surface.
        if len(hits) == 1 and hits[0].kind == "surface" and 0 not in mode and not self.system.held_inside(i):
            try:
                sign = sign_after(*at.sides(mode, i))
            except ARITHMETIC:
                sign = None
            if sign is not None:
                return Decision("unique", replaced(mode, i, sign))
        return after_event(at, mode, hits)

    def _lost(self, code: int) -> tuple[Status, str]:
        """Status and reason of a run whose next step is not finite."""
        if code == NO_GUARD:
            return "failed", f"a guard is not a number after t = {self.time:.17g}"
        if np.abs(self.x).max() > 1e10:  # otherwise the run has failed
            return "diverged", f"the state is no longer finite after t = {self.time:.17g}"
        return "failed", f"the field is not a number after t = {self.time:.17g}"

    def _move(self, duration: float) -> None:
        """Advance the time in double-double arithmetic."""
        total = self.time + duration
        moved = total - self.time
        low = self.time_low + (self.time - (total - moved)) + (duration - moved)
        self.time = total + low
        self.time_low = low - (self.time - total)

    def _note_drift(self, surfaces: Iterable[int]) -> None:
        on = {*surfaces, *(i for i, s in enumerate(self.mode) if s == 0)}
        values = (surface(self.system, i)[0](self.time, *self.x.tolist())[0] for i in on)
        self.record.drift = max([self.record.drift, *map(abs, values)])

    def _result(self, status: Status, reason: str) -> Trajectory:
        if status == "ok":
            self._note_drift(())
        return self.record.finish(status, self.time, self.x.tolist(), self.mode, reason)
