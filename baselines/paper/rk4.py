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
from weakref import WeakKeyDictionary

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.paper import COMPILER
from henon_ref.baselines.paper.rk4_kernel import EVENT, NO_GUARD, NOT_FINITE, Floats, Kernel, crossed_guards, land
from henon_ref.errors import UnsupportedError
from henon_ref.jit.processor_time import Deadline, compiling
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced, sign_after, transition_kind
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event, initial_mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Run
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Counts, Status, Trajectory, Transition, without_hidden_kinks

CHUNK = 200_000
"""Largest number of steps between two checks of the clock."""
TOGETHER = 1e-12
"""Guards that land within this time of each other [s] are one event."""
CROWDED = 100
"""Number of events within the length of one step after which the run fails: events accumulate, or the run chatters."""
HUGE = 1e10
"""A run whose state is no longer finite has diverged if the state before was larger than this; otherwise it failed."""

_KERNELS: WeakKeyDictionary[FilippovSystem, dict[Mode, Kernel]] = WeakKeyDictionary()
"""Compiled kernels of each system and mode, for all step lengths."""


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

    @property
    def version(self) -> str:
        """Name and version of the C compiler."""
        return COMPILER

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

        Raises
        ------
        UnsupportedError
            If there is no positive step, or the system has jumps of the state.
        """
        if problem.system.resets:
            raise UnsupportedError(f"{self.name} does not support jumps of the state")
        if step is None or not step > 0:
            raise UnsupportedError(f"{self.name} needs a positive step, got {step}")
        wanted = np.empty(0) if sample_times is None else np.asarray(sample_times, dtype=float)
        plan = _Plan(problem, step)
        _Integration(plan, wanted, deadline).run()

        def run() -> Trajectory:
            return without_hidden_kinks(_Integration(plan, wanted, deadline).run(), problem.system)

        return run


RK4 = HenonRK4()


class _Plan:
    """Compiled kernels and switching rule of one problem, shared by all its runs."""

    def __init__(self, problem: Problem, step: float) -> None:
        self.problem = problem
        self.step = step
        self.in_doubles = in_doubles(problem.system)
        system = problem.system
        surfaces = [system.numeric(h) for h in system.surfaces]
        normals = [system.numeric(system.normal_velocity(i)) for i in range(len(surfaces))]
        self.surfaces = sp.lambdify((TIME, *system.states), surfaces, "math")
        self._normals = sp.lambdify((TIME, *system.states, *system.signs), normals, "math", cse=True)
        self._kernels = _KERNELS.setdefault(system, {})

    def kernel(self, mode: Mode) -> Kernel:
        if mode not in self._kernels:
            with compiling():
                self._kernels[mode] = Kernel(self.problem.system, mode)
        return self._kernels[mode]

    def after_event(self, t: float, x: Sequence[float], mode: Mode, hits: Sequence[Guard]) -> Decision:
        """Select the next mode: by two normal velocities if they decide it, otherwise by :func:`.after_event`."""
        i = hits[0].index
        # The slip fields may select the next mode, unless a hold zone decides sticking on the surface.
        if len(hits) == 1 and hits[0].kind == "surface" and 0 not in mode and not self.problem.system.held_inside(i):
            try:
                sign = sign_after(*(self._normals(t, *x, *replaced(mode, i, s))[i] for s in (-1, 1)))
            except (ArithmeticError, ValueError):
                sign = None
            if sign is not None:
                return Decision("unique", replaced(mode, i, sign))
        return after_event(self.in_doubles.at(t, x), mode, hits)


class _Integration:
    """One run: the mode loop around the compiled kernels."""

    def __init__(self, plan: _Plan, wanted: Floats, deadline: float | None) -> None:
        problem = plan.problem
        self.plan = plan
        self.deadline = Deadline(deadline)
        self.time, self.time_low = float(problem.start), 0.0
        self.until = float(problem.until)
        self.x: Floats = np.array([float(v) for v in problem.initial])
        self.mode: Mode = (0,) * len(problem.system.surfaces)
        self.transitions: list[Transition] = []
        self.drift = 0.0
        self.steps = self.landings = 0
        self.wanted, self.filled = wanted, 0
        self.samples = np.full((wanted.size, self.x.size), np.nan)
        self.sample_modes: list[Mode] = []

    def run(self) -> Trajectory:
        """Integrate to the horizon, or to an earlier end."""
        problem = self.plan.problem
        decision = initial_mode(self.plan.in_doubles.at_start(problem), problem)
        recent: deque[float] = deque(maxlen=CROWDED)
        while decision.mode is not None:
            self.mode = decision.mode
            ended = self._through_mode()
            if not isinstance(ended, Decision):
                return self._result(*ended)
            decision = ended
            recent.append(self.time)
            if len(recent) == CROWDED and self.time - recent[0] < self.plan.step:
                return self._result("failed", f"{CROWDED} events within one step at t = {self.time:.17g}")
        return self._result(decision.ending, decision.reason)

    def _through_mode(self) -> Decision | tuple[Status, str]:
        """Step through one mode; return the decision at its end, or the status and reason of the run's end."""
        kernel, h = self.plan.kernel(self.mode), self.plan.step
        new = np.empty_like(self.x)
        armed = np.array(kernel.values(self.time, self.x)) > 0
        done, last = 0, int((self.until - self.time) / h)
        while True:
            first = done
            done, self.filled, code = kernel.advance(
                self.time, (first, min(first + CHUNK, last)), h, self.x, armed, new,
                self.wanted, self.samples, self.filled,
            )  # fmt: skip
            self._record_modes()
            self.steps += done - first + (code == EVENT)
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
            elif self.deadline.passed():
                self._move(done * h)
                return "timeout", f"out of time at t = {self.time:.17g}"

    def _event(self, kernel: Kernel, h: float, armed: NDArray[np.bool_], new: Floats) -> Decision | tuple[Status, str]:
        """Land on the first guard that the step from the current state to ``new`` has crossed; select the next mode."""
        t = self.time
        found = {i: land(kernel, i, t, self.x, new, h) for i in crossed_guards(kernel, t + h, new, armed)}
        landings = {i: landing for i, landing in found.items() if landing is not None}
        if len(landings) < len(found):
            return "failed", f"a guard is not a number on the step from t = {t:.17g}"
        self.landings += len(landings)
        if not found:  # the compiled loop rounds the time differently; the next step will cross the guard
            self._sample_up_to(kernel, h)
            self._move(h)
            self.x = new.copy()
            return Decision("unique", self.mode)
        first = min(landings.values(), key=lambda landing: landing.offset)
        hits = [kernel.guards[i] for i, landing in landings.items() if landing.offset <= first.offset + TOGETHER]
        self._sample_up_to(kernel, first.offset)
        self._move(first.offset)
        self.x = first.state
        state = tuple(self.x.tolist())
        self._note_drift(g.index for g in hits if g.kind == "surface")
        decision = self.plan.after_event(self.time, state, self.mode, hits)
        if decision.mode is not None:
            self._report(decision.mode, hits, state, first.how)
        if self.deadline.passed():
            return "timeout", f"out of time at t = {self.time:.17g}"
        return decision

    def _sample_up_to(self, kernel: Kernel, offset: float) -> None:
        """Fill the samples up to ``offset`` after the current time."""
        while self.filled < self.wanted.size and self.wanted[self.filled] <= self.time + offset:
            kernel.step(self.time, self.x, self.wanted[self.filled] - self.time, self.samples[self.filled])
            self.filled += 1
        self._record_modes()

    def _lost(self, code: int) -> tuple[Status, str]:
        """Status and reason of a run whose next step is not finite."""
        if code == NO_GUARD:
            return "failed", f"a guard is not a number after t = {self.time:.17g}"
        if np.abs(self.x).max() > HUGE:
            return "diverged", f"the state is no longer finite after t = {self.time:.17g}"
        return "failed", f"the field is not a number after t = {self.time:.17g}"

    def _report(self, mode: Mode, hits: Sequence[Guard], state: tuple[float, ...], how: str) -> None:
        touched = {g.index for g in hits if g.kind == "surface"}
        for i, (old, entry) in enumerate(zip(self.mode, mode, strict=True)):
            if old != entry or i in touched:
                kind = transition_kind(old, entry)
                self.transitions.append(
                    Transition(kind, i, self.mode, mode, self.time, state, time_low=self.time_low, landing=how)
                )

    def _move(self, duration: float) -> None:
        """Advance the time in double-double arithmetic."""
        total = self.time + duration
        moved = total - self.time
        low = self.time_low + (self.time - (total - moved)) + (duration - moved)
        self.time = total + low
        self.time_low = low - (self.time - total)

    def _record_modes(self) -> None:
        self.sample_modes += [self.mode] * (self.filled - len(self.sample_modes))

    def _note_drift(self, surfaces: Iterable[int]) -> None:
        on = {*surfaces, *(i for i, s in enumerate(self.mode) if s == 0)}
        if on:
            h = self.plan.surfaces(self.time, *self.x.tolist())
            self.drift = max(self.drift, *(abs(h[i]) for i in on))

    def _result(self, status: Status, reason: str) -> Trajectory:
        if status == "ok":
            self._note_drift(())
        count = len(self.wanted)
        return Trajectory(
            status=status,
            transitions=tuple(self.transitions),
            end_time=self.time,
            end_state=tuple(self.x.tolist()),
            end_mode=self.mode,
            reason=reason,
            counts=Counts(self.steps, 4 * (self.steps + self.landings), self.steps),
            max_surface_drift=self.drift,
            samples=self.samples if count else None,
            sample_modes=tuple(self.sample_modes + [self.mode] * (count - self.filled)) if count else None,
        )
