"""Solvers without modes and events: friction smoothed by tanh, or ``sign`` in the right-hand side.

Both integrate one field over the whole run. Their transitions are found from the accepted steps, by the time for which
a surface is near zero. A surface is *in its band* while abs(h) is below 20 widths of the smoothing, or 200 tolerances.
If it passes through the band in about the time that its speed requires, the root of h is a crossing. If it stays much
longer, it sticks from entering the band to leaving it. If it only touches the band, there is no transition.

``scipy-smoothed`` replaces the sign of h by tanh(h / eps) and uses LSODA with SymPy's Jacobian. The width
``eps = 100 atol`` is just wide enough for the error control to resolve the tanh. A stick becomes a creep at a speed
below eps; its release is detected late, when the creep has grown to the band.

``scipy-sign`` uses ``sign(h)`` and RK45. In a stick the right-hand side jumps at every step and the step size shrinks
to about the tolerance over the jump; a stick of 1 s at 1e-6 takes a million steps. A budget of right-hand sides ends
such a run, with the transitions so far.

Neither supports a ``sliding`` override, because they have no sliding to replace.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.baselines.adapter import LibrarySolver
from henon_ref.baselines.library import LIMIT, DeadlinePassed, Stalled, Times, Work
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.record import blown_up
from henon_ref.errors import UnsupportedError
from henon_ref.modes.callables import ARITHMETIC, Jacobian, Scalar, scalar
from henon_ref.modes.mode import Mode, replaced, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.trajectory import Status, Trajectory, Transition

LINGERS = 3.5
"""A stay in the band is a stick if it lasts longer than this multiple of the passing time by the slopes at the edges.

Passing a root of order p takes p times as long, and roots of order above three are exceptional."""

Dense = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Dense output of a step: maps k times to (n, k) states."""


@dataclass(frozen=True)
class ScipyNaive(LibrarySolver):
    """One field for the whole run, in SciPy, without events.

    Counts: ``steps`` are accepted steps, ``rhs_evaluations`` all calls of the right-hand side (Jacobians not
    counted); there are no event functions.
    """

    sign: Literal["tanh", "sign"]
    method: Literal["LSODA", "RK45"]
    budget: int | None = None
    """Largest number of right-hand sides of a run."""
    landing = "band"
    distribution = "SciPy"
    module = "scipy.integrate"

    def prepared(self, problem: Problem, rtol: float, atol: float, work: Work, times: Times) -> Run:
        """Lambdify the field."""
        if problem.system.resets:
            raise UnsupportedError(f"{self.name} has no events and does not support jumps of the state")
        if any(problem.initial_mode.values()):
            raise UnsupportedError(f"{self.name} has the sign 0 on a surface, so it cannot begin there on a given side")
        if problem.system.overrides:
            raise UnsupportedError(f"{self.name} has no sliding mode that a 'sliding' override could replace")
        return _Naive(self, problem, max(rtol, 100.0 * EPSILON), atol, work).run


def _state(dense: Dense, t: float) -> tuple[float, ...]:
    return tuple(dense(np.array([t]))[:, 0].tolist())


def _sgn(value: float) -> float:
    return float(value > 0.0) - float(value < 0.0)  # SciPy's times are NumPy's, whose booleans do not subtract


class _Naive:
    """One problem prepared for repeated runs."""

    def __init__(self, solver: ScipyNaive, problem: Problem, rtol: float, atol: float, work: Work) -> None:
        system = problem.system
        self.method, self.work, self.budget = getattr(solver.loaded(), solver.method), work, solver.budget
        self.start, self.until = float(problem.start), float(problem.until)
        self.initial = tuple(float(v) for v in problem.initial)
        self.options: dict[str, Any] = {"rtol": rtol, "atol": atol}
        smooth = solver.sign == "tanh"
        eps = 100.0 * atol if smooth else atol + rtol
        # Half-width of the band: at 20 widths of the smoothing tanh is 1 to the last place; with sign the state jumps
        # over the surface by tens of tolerances.
        self.width = (20.0 if smooth else 200.0) * eps
        # The field with every sign symbol replaced by a function of its surface.
        surfaces = [system.numeric(h) for h in system.surfaces]
        sign = (lambda h: sp.tanh(h / sp.Float(eps))) if smooth else sp.Function("sgn")
        written = dict(zip(system.signs, map(sign, surfaces), strict=True))
        field = [system.numeric(f).xreplace(written) for f in system.field]
        self.surfaces = [scalar(system.states, [h]) for h in surfaces]
        self.valid = [scalar(system.states, [system.numeric(e)]) for e in system.valid]
        self.field = scalar(system.states, field, functions={"sgn": _sgn})
        if smooth:
            self.options["jac"] = Jacobian(system.states, field)

    def _rhs(self, t: float, x: NDArray[np.float64]) -> tuple[float, ...]:
        self.work.count_rhs()
        if self.budget is not None and self.work.rhs > self.budget:
            raise Stalled(f"the budget of {self.budget} right-hand sides was spent by t = {self.t:.17g}")
        try:
            return self.field(t, *x.tolist())
        except ARITHMETIC:
            return (np.nan,) * len(self.initial)

    def run(self) -> Trajectory:
        """Run from the start to the horizon."""
        self.work.start()
        bands = [Band(h, self.width, self.start, self.initial) for h in self.surfaces]
        self.t, self.x = self.start, self.initial
        status, reason = self._march(bands)
        t, x = self.t, self.x
        if status == "failed" and blown_up(self.field, self.initial, t, x):
            status, reason = "diverged", f"the state blows up at t = {t:.17g}: {reason}"
        for band in bands:
            band.end(t)
        transitions, mode = joined(bands)
        return Trajectory(status, transitions, t, x, mode, reason, self.work.counts)

    def _march(self, bands: Sequence[Band]) -> tuple[Status, str]:
        """Step to the horizon; (self.t, self.x) is the last accepted point."""
        if self.until - self.start <= 2.0 * EPSILON * abs(self.until):
            return "ok", ""
        with warnings.catch_warnings(record=True) as caught, np.errstate(all="ignore"):
            warnings.simplefilter("always")
            try:
                solver = self.method(self._rhs, self.start, np.array(self.initial), self.until, **self.options)
                while solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        return "failed", " ".join([message, *(str(w.message) for w in caught)])
                    self.work.steps += 1
                    t_old, t, dense = solver.t_old, float(solver.t), solver.dense_output()
                    if not np.isfinite(solver.y).all():
                        return "failed", f"the state is not finite after t = {t_old:.17g}"
                    if np.abs(solver.y).max() > LIMIT:
                        self.t, self.x = t, tuple(solver.y.tolist())
                        return "diverged", f"the state passed {LIMIT:g} at t = {t:.17g}"
                    ended = self._left_model(t_old, t, dense)
                    t = t if ended is None else ended
                    self.t, self.x = t, _state(dense, t)
                    for band in bands:
                        band.step(t_old, t, dense)
                    if ended is not None:
                        return "invalid", f"the model ends: an expression of 'valid' fell to 0 at t = {t:.17g}"
            except DeadlinePassed:
                return "timeout", f"stopped after {self.work.deadline:g} s"
            except (Stalled, ValueError, np.linalg.LinAlgError) as error:
                return "failed", str(error)
        return "ok", ""

    def _left_model(self, t_old: float, t: float, dense: Dense) -> float | None:
        """Time at which the first expression of ``valid`` falls to zero in a step; None if none does."""
        ends = []
        for expression in self.valid:

            def value(time: float, expression: Scalar = expression) -> float:
                return expression(time, *_state(dense, time))[0]

            if value(t) <= 0.0:
                ends.append(float(brentq(value, t_old, t)) if value(t_old) > 0.0 else t_old)
        return min(ends, default=None)


class _Point(NamedTuple):
    """Time and state at which a surface meets an edge of its band or its root."""

    t: float
    x: tuple[float, ...]
    slope: float
    """dh/dt."""


class Band:
    """Transitions of one surface ``h(t, *x) -> (value,)`` of a run from (t, x), found step by step.

    ``width`` is the half-width of the band.
    """

    def __init__(self, h: Scalar, width: float, t: float, x: Sequence[float]) -> None:
        self._h, self._width = h, width
        value = h(t, *x)[0]
        self._last = (t, value)
        self._region = self._mode = self.initial = 0 if abs(value) <= width else 1 if value > 0 else -1
        """Where the surface is now, the entry of the mode, and that at the start (0 until it first leaves its band)."""
        self._open = self._region == 0
        self._entered = _Point(t, tuple(x), 0.0) if self._open else None
        self._root: Callable[[], _Point] | None = None
        self.changes: list[tuple[float, int, tuple[float, ...]]] = []
        """(time, new entry of the mode, state)."""

    def step(self, t_old: float, t: float, dense: Dense) -> None:
        """Process one accepted step.

        A step that begins and ends inside the band is evaluated at its end only: with a jumping right-hand side a stick
        consists of hundreds of thousands of such steps.
        """
        end = self._h(t, *_state(dense, t))[0]
        if self._region == 0 and abs(end) <= self._width:
            self._check_crossings(t, end, dense)
            return
        times = np.linspace(t_old, t, 5)[1:]  # the surface is evaluated at four points
        states = dense(times)
        for time, state in zip(times.tolist(), states.T, strict=True):
            self._check_crossings(time, self._h(time, *state.tolist())[0], dense)

    def _check_crossings(self, t: float, value: float, dense: Dense) -> None:
        t_old, old = self._last
        slope = (value - old) / (t - t_old) if t > t_old else 0.0
        if (old < 0.0) != (value < 0.0) and old != 0.0:
            self._root = partial(self._locate, t_old, t, 0.0, slope, dense)
        edges = [edge for edge in (-self._width, self._width) if min(old, value) < edge <= max(old, value)]
        for edge in edges if value > old else edges[::-1]:
            point = self._locate(t_old, t, edge, slope, dense)
            if (slope > 0) == (edge > 0):
                self._leave(point, 1 if edge > 0 else -1)
            else:
                self._entered, self._region = point, 0
        self._last = (t, value)

    def _locate(self, t_old: float, t: float, level: float, slope: float, dense: Dense) -> _Point:
        def above(time: float) -> float:
            return self._h(time, *_state(dense, time))[0] - level

        low, high = above(t_old), above(t)
        time = t if low * high > 0.0 else float(brentq(above, t_old, t, xtol=1e-300, rtol=1e-15))
        return _Point(time, _state(dense, time), slope)

    def _leave(self, point: _Point, side: int) -> None:
        entered, self._region = self._entered, side
        if entered is None:
            return
        passing = sum(self._width / abs(p.slope) for p in (entered, point) if p.slope)
        if self._open:
            self._open = False
            if point.t - entered.t <= LINGERS * passing:
                self.initial = self._mode = side
            else:
                self._change(point, side)
        elif point.t - entered.t > LINGERS * passing:
            self._change(entered, 0)
            self._change(point, side)
        elif side != self._mode:
            self._change(self._root() if self._root else point, side)
        self._entered = None

    def _change(self, point: _Point, entry: int) -> None:
        self._mode = entry
        self.changes.append((point.t, entry, point.x))

    def end(self, t: float) -> None:
        """End the run at t; a surface that has been in its band for long enough sticks."""
        entered = self._entered
        if entered is None or self._open or self._region:
            return
        passing = 2.0 * self._width / abs(entered.slope) if entered.slope else 0.0
        if t - entered.t > LINGERS * passing:
            self._change(entered, 0)


def joined(bands: Sequence[Band]) -> tuple[list[Transition], Mode]:
    """Return the transitions of all surfaces in order of time, with joint modes, and the last mode."""
    mode: Mode = tuple(band.initial for band in bands)
    changes = sorted((t, i, entry, x) for i, band in enumerate(bands) for t, entry, x in band.changes)
    found: list[Transition] = []
    for t, i, entry, x in changes:
        after = replaced(mode, i, entry)
        found.append(Transition(transition_kind(mode[i], entry), i, mode, after, t, x, landing="band"))
        mode = after
    return found, mode


SMOOTHED = ScipyNaive("scipy-smoothed", "tanh", "LSODA")
SIGN = ScipyNaive("scipy-sign", "sign", "RK45", budget=100_000)
