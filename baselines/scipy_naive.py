"""What people write first: friction smoothed by tanh, or ``sign`` in the right-hand side; no modes, no events.

Both integrate one field over the whole run, and their transitions are read off afterwards
(:mod:`henon_ref.baselines.bands`), with a band of 20 widths of the smoothing, or of 200 tolerances.

``scipy-smoothed`` puts tanh(h / eps) for the sign of h, with LSODA and SymPy's Jacobian. The width is
``eps = 100 atol``: wide enough that the error control can tell where on the tanh the state is, no wider. A
stick becomes a creep at a speed below eps; its release is seen late, when the creep has grown to the band.

``scipy-sign`` puts ``sign(h)``, with RK45. In a stick the right-hand side jumps at every step, the step
shrinks to about the tolerance over the jump, and a stick of 1 s at 1e-6 takes a million steps: a budget of
right-hand sides ends such a run, with the transitions so far.

Neither can do a ``sliding`` override: there is no sliding in them to replace.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.baselines.bands import Band, Dense, joined
from henon_ref.baselines.driver import tolerances
from henon_ref.baselines.endings import blown_up
from henon_ref.baselines.flow import LIMIT
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.work import BudgetSpent, DeadlinePassed, Work, installed_version
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.modes.callables import ARITHMETIC, Jacobian, Scalar, scalar
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Run
from henon_ref.trajectory import Status, Trajectory, Transition

WIDTH = 100.0
"""Width of the smoothing, in units of ``atol``."""
BAND = {"tanh": 20.0, "sign": 200.0}
"""Half-width of the band: in widths of the smoothing (tanh is 1 to the last place there), or in tolerances (the
state hops over the surface by tens of them)."""
BUDGET = 100_000
"""Right-hand sides a run of ``scipy-sign`` may take."""


@dataclass(frozen=True)
class ScipyNaive:
    """One field for the whole run, in SciPy, without events.

    Counts: ``steps`` are accepted steps, ``rhs_evaluations`` all calls of the right-hand side (Jacobians not
    counted); there are no event functions.
    """

    name: str
    sign: Literal["tanh", "sign"]
    method: Literal["LSODA", "RK45"]
    budget: int | None = None
    """Right-hand sides a run may take."""
    fixed_step: bool = False
    landing: str = "band"

    @property
    def version(self) -> str:
        """SciPy's version."""
        return installed_version("scipy")

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
        """Lambdify the field; see :meth:`henon_ref.solver.Solver.prepare`.

        Raises
        ------
        UnsupportedError
            Where a surface has its own sliding, the state jumps, or the run begins on a surface and the case gives the
            side: the sign is 0 there.
        """
        rtol, atol = tolerances(self.name, rtol, atol, step)
        if problem.system.resets:
            raise UnsupportedError(f"{self.name} watches no surface, so the state cannot jump where one is reached")
        if any(problem.initial_mode.values()):
            raise UnsupportedError(f"{self.name} has the sign 0 on a surface, so it cannot begin there on a given side")
        if problem.system.overrides:
            raise UnsupportedError(f"{self.name} knows no sliding, so it cannot do one that the case replaces")
        try:
            import scipy.integrate as integrate
        except ImportError as error:
            raise UnavailableError("SciPy is not installed") from error
        method = getattr(integrate, self.method)
        return _Naive(self, problem, method, max(rtol, 100.0 * EPSILON), atol, sample_times, deadline).run


def _sgn(value: float) -> float:
    return float(value > 0.0) - float(value < 0.0)  # SciPy's times are NumPy's, whose booleans do not subtract


class _Naive:
    """One problem, ready to run again and again."""

    def __init__(
        self,
        solver: ScipyNaive,
        problem: Problem,
        method: Callable[..., Any],
        rtol: float,
        atol: float,
        sample_times: NDArray[np.float64] | None,
        deadline: float | None,
    ) -> None:
        system = problem.system
        self.system, self.method, self.sample_times = system, method, sample_times
        self.work = Work(deadline, solver.budget)
        self.start, self.until = float(problem.start), float(problem.until)
        self.initial = tuple(float(v) for v in problem.initial)
        self.options: dict[str, Any] = {"rtol": rtol, "atol": atol}
        smooth = solver.sign == "tanh"
        eps = WIDTH * atol if smooth else atol + rtol
        self.width = BAND[solver.sign] * eps
        field = _without_signs(system, solver.sign, eps)
        self.surfaces = [scalar(system.states, [system.numeric(h)]) for h in system.surfaces]
        self.valid = [scalar(system.states, [system.numeric(e)]) for e in system.valid]
        self.field = scalar(system.states, field, functions={"sgn": _sgn})
        if smooth:
            self.options["jac"] = Jacobian(system.states, field)

    def _rhs(self, t: float, x: NDArray[np.float64]) -> tuple[float, ...]:
        self.work.count_rhs()
        try:
            return self.field(t, *x.tolist())
        except ARITHMETIC:
            return (np.nan,) * len(self.initial)

    def run(self) -> Trajectory:
        """The whole run, afresh."""
        self.work.start()
        bands = [Band(h, self.width, self.start, self.initial) for h in self.surfaces]
        times = self.sample_times
        samples = None if times is None else np.full((len(times), len(self.initial)), np.nan)
        if samples is not None and times is not None:
            samples[times <= self.start] = self.initial
        seen: list[tuple[float, tuple[float, ...]]] = [(self.start, self.initial)]

        def accepted(t_old: float, t: float, dense: Dense) -> None:
            for band in bands:
                band.step(t_old, t, dense)
            if samples is not None and times is not None:
                inside = (times > t_old) & (times <= t)
                if inside.any():
                    samples[inside] = dense(times[inside]).T

        status, reason = self._march(seen, accepted)
        t, x = seen[0]
        if status == "failed" and blown_up(self.field, self.initial, t, x):
            status, reason = "diverged", f"the state blows up at t = {t:.17g}: {reason}"
        for band in bands:
            band.end(t)
        transitions, mode = joined(bands)
        modes = None
        if times is not None:
            modes = tuple(_mode_at(transitions, mode, float(time)) for time in times)
        return Trajectory(
            status=status,
            transitions=transitions,
            end_time=t,
            end_state=x,
            end_mode=mode,
            reason=reason,
            counts=self.work.counts,
            samples=samples,
            sample_modes=modes,
        )

    def _march(
        self, seen: list[tuple[float, tuple[float, ...]]], accepted: Callable[[float, float, Dense], None]
    ) -> tuple[Status, str]:
        """Step to the horizon; ``seen[0]`` is the last accepted point, whatever ends the run."""
        if self.until - self.start <= 2.0 * EPSILON * abs(self.until):
            return "ok", ""
        with warnings.catch_warnings(record=True) as said, np.errstate(all="ignore"):
            warnings.simplefilter("always")
            try:
                solver = self.method(self._rhs, self.start, np.array(self.initial), self.until, **self.options)
                while solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        return "failed", " ".join([message, *(str(w.message) for w in said)])
                    self.work.steps += 1
                    t_old, t, dense = solver.t_old, float(solver.t), solver.dense_output()
                    if not np.isfinite(solver.y).all():
                        return "failed", f"the state is not finite after t = {t_old:.17g}"
                    if np.abs(solver.y).max() > LIMIT:
                        seen[0] = (t, tuple(solver.y.tolist()))
                        return "diverged", f"the state passed {LIMIT:g} at t = {t:.17g}"
                    ended = self._left_model(t_old, t, dense)
                    t = t if ended is None else ended
                    seen[0] = (t, tuple(dense(np.array([t]))[:, 0].tolist()))
                    accepted(t_old, t, dense)
                    if ended is not None:
                        return "invalid", f"the model ends: an expression of 'valid' fell to 0 at t = {t:.17g}"
            except DeadlinePassed:
                return "timeout", f"stopped after {self.work.deadline:g} s"
            except BudgetSpent:
                return "failed", f"the budget of {self.work.budget} right-hand sides was spent by t = {seen[0][0]:.17g}"
            except (ValueError, np.linalg.LinAlgError) as error:
                return "failed", str(error)
        return "ok", ""

    def _left_model(self, t_old: float, t: float, dense: Dense) -> float | None:
        """When in a step the first expression of ``valid`` falls to zero; None while none does."""
        ends = []
        for expression in self.valid:

            def value(time: float, expression: Scalar = expression) -> float:
                return expression(time, *dense(np.array([time]))[:, 0].tolist())[0]

            if value(t) <= 0.0:
                ends.append(float(brentq(value, t_old, t)) if value(t_old) > 0.0 else t_old)
        return min(ends, default=None)


def _without_signs(system: FilippovSystem, sign: Literal["tanh", "sign"], eps: float) -> list[sp.Expr]:
    """The field with every sign symbol written out as a function of its surface."""
    sgn = sp.Function("sgn")
    written = {
        s: sp.tanh(system.numeric(h) / sp.Float(eps)) if sign == "tanh" else sgn(system.numeric(h))
        for s, h in zip(system.signs, system.surfaces, strict=True)
    }
    return [system.numeric(f).xreplace(written) for f in system.field]


def _mode_at(transitions: Sequence[Transition], last: Mode, time: float) -> Mode:
    return next((t.from_mode for t in transitions if time <= t.time), last)


SMOOTHED = ScipyNaive("scipy-smoothed", "tanh", "LSODA")
SIGN = ScipyNaive("scipy-sign", "sign", "RK45", budget=BUDGET)
