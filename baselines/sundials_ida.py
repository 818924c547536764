"""SUNDIALS IDA by scikit-sundae: sliding as an index-1 DAE with the friction force as algebraic unknown.

In slip the residual is ``x' - f(t, x)``. Where surfaces slide, the equivalent sign of each is a further
unknown s_i with the equation ``dh_i/dt (t, x, s) = 0``, and the stick ends where s_i reaches -1 or +1: nobody
solves for the friction force by hand. Several sliding surfaces are so many unknowns (one that is a multiple of
another has that one's sign, or the opposite, as its equation). The condition keeps
``dh/dt``, not h, at zero, so h drifts by about the tolerance along a stick; the driver puts the state back
on the surface at the stick's end and reports the drift. A ``sliding`` override is its own ODE.

Starting points: the state is consistent by construction (x' = f, s from the expression of the equivalent
sign), so no initial-condition solve is needed. At a root at the starting point IDA does as CVODE: an exact
zero is out of play until it leaves zero, and the first steps (order 1, Newton stopped at a part of the
tolerance) move a guard by the tolerance; hence the event-free step as default (:mod:`baselines.restart`).
Roots are located by the Illinois method to ``100 eps (abs(t) + abs(h))``; a pair inside one step is not
seen; a new object for every run of a mode, as for CVODE.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from baselines.callbacks import LastSeen
from baselines.driver import prepared, tolerances
from baselines.flow import Stop
from baselines.functions import ARITHMETIC, Callbacks, Jacobian, compiled, scalar
from baselines.mode_functions import ModeFunctions
from baselines.restart import Fresh, GatedGuards, Restart, Watcher
from baselines.sundials import (
    LEAST_RTOL,
    STEPS_BETWEEN_OUTPUTS,
    SundialsLibrary,
    event_function_of_dae,
    sampled,
    stopped,
    sundae_version,
)
from baselines.work import Stalled, Work
from henon_ref.errors import UnavailableError
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.problem import Problem
from henon_ref.solver import Run


@dataclass(frozen=True)
class SundialsIda:
    """IDA on one mode after another, dense Newton iteration with the Jacobian that SymPy derives.

    Counts: ``steps`` are internal steps; ``rhs_evaluations`` are IDA's own count of residuals (Jacobians not
    counted); ``event_evaluations`` all evaluations of one guard each, the guard against divergence among
    them. A second pass for samples is not counted.
    """

    name: str
    callbacks: Callbacks = "python"
    """Residual and Jacobian in plain Python or compiled; the event function is plain Python."""
    restart: Restart = "event-free-step"
    fixed_step: bool = False
    landing: str = "illinois"

    @property
    def version(self) -> str:
        """scikit-sundae's version."""
        return sundae_version()

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
        """Lambdify (or compile) every mode; see :meth:`henon_ref.solver.Solver.prepare`."""
        rtol, atol = tolerances(self.name, rtol, atol, step)
        try:
            from sksundae.ida import IDA
        except ImportError as error:
            raise UnavailableError("scikit-sundae is not installed") from error
        library = _Library(self, IDA, max(rtol, LEAST_RTOL), atol)
        return prepared(problem, library, sample_times=sample_times, deadline=deadline)


class _Library(SundialsLibrary):
    """IDA with its tolerances."""

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, model, work, horizon)


class _Equations:
    """A mode as ``y = (x, g, s)``: ``y' = f(t, y)`` for the first two, ``0 = c(t, y)`` for the last.

    g are copies of the followed guards (:meth:`ModeFunctions.start`), s the equivalent signs.
    """

    def __init__(self, model: ModeFunctions) -> None:
        system, mode = model.system, model.mode
        self.sliding = tuple(model.equations.equivalent_signs)
        """Surfaces whose equivalent sign is an unknown, in order (none in slip or under an override)."""
        seen = [k for k in model.followed if not self.by_sign(model.guards[k])]
        slip = {s: sp.Integer(v) for s, v in zip(system.signs, mode, strict=True) if v}
        ties = {system.signs[j]: way * system.signs[i] for j, (i, way) in system.multiples.items() if j in self.sliding}
        free = {system.signs[i] for i in self.sliding} - set(ties)

        def convex(expression: sp.Expr) -> sp.Expr:
            return system.numeric(_between_signs(expression.xreplace(slip | ties), free))

        def condition(index: int) -> sp.Expr:
            sign = system.signs[index]
            return sign - ties[sign] if sign in ties else convex(system.normal_velocity(index))

        field = tuple(convex(f) for f in system.field) if self.sliding else model.field_expressions
        copies = tuple(sp.Dummy(f"g{k}", real=True) for k in seen)
        guards = [model.guard_expressions[k] for k in seen]
        swings = tuple(model.along(g) for g in guards)
        signs = [system.numeric(e) for e in model.equations.equivalent_signs.values()]
        self.differential = len(system.states) + len(seen)
        """Number of unknowns that have a time derivative."""
        self.unknowns = (*system.states, *copies, *(system.signs[i] for i in self.sliding))
        self.right = (*field, *swings, *(condition(i) for i in self.sliding))
        self.start = scalar(
            system.states, [*guards, *signs, *model.field_expressions, *swings, *(model.along(e) for e in signs)]
        )
        """(t, *x) -> (g, s, x', g', s')."""

    def by_sign(self, guard: Guard) -> bool:
        """Whether a guard is a stick's end, which is read off its unknown."""
        return guard.kind == "release" and guard.index in self.sliding


def _between_signs(expression: sp.Expr, signs: set[sp.Symbol]) -> sp.Expr:
    """Filippov's convex combination: affine in each sign between -1 and +1."""
    for s in signs:
        if sp.diff(expression, s, 2) != 0:
            up, down = expression.xreplace({s: sp.Integer(1)}), expression.xreplace({s: sp.Integer(-1)})
            expression = (1 + s) / 2 * up + (1 - s) / 2 * down
    return expression


class _Flow:
    """IDA on one mode."""

    def __init__(self, library: _Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        solver = library.solver
        self._ida, self._work, self._horizon = library.make, work, horizon
        self._states = n = len(model.states)
        self._equations = equations = _Equations(model)
        self._gates = GatedGuards(model, solver.restart, library.errors)
        self._last = LastSeen(n, work.count_event)
        jacobian = Jacobian(equations.unknowns, equations.right, solver.callbacks)
        self._resfn = _residual(equations, solver.callbacks, work)
        moving = np.arange(equations.differential)

        def jacfn(t: float, y: Any, yp: Any, res: Any, cj: float, out: NDArray[np.float64]) -> None:
            jacobian.fill(t, y, out)
            np.negative(out, out=out)
            out[moving, moving] += cj

        self._options = {
            "rtol": library.rtol,
            "atol": library.atol,
            "jacfn": jacfn,
            "algebraic_idx": list(range(equations.differential, len(equations.unknowns))) or None,
            "max_num_steps": STEPS_BETWEEN_OUTPUTS,
        }
        watchers = [self._watcher(model, k) for k in range(len(model.guards))]
        self._events = {
            "eventsfn": event_function_of_dae(watchers, self._last, self._gates.direction),
            "num_events": len(watchers) + 1,
        }

    def _watcher(self, model: ModeFunctions, k: int) -> Watcher:
        """Guard k as a function of (t, y): a stick ends where its unknown reaches -1 or +1."""
        guard, equations, count = model.guards[k], self._equations, self._work.count_event
        if not equations.by_sign(guard):
            return self._gates.watcher(k, count)
        at, side = equations.differential + equations.sliding.index(guard.index), guard.to_sign
        return self._gates.watcher(k, count, lambda t, y: 1.0 - side * float(y[at]))

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        """See :class:`baselines.flow.Flow`."""
        n, work, said = self._states, self._work, io.StringIO()
        self._gates.open(t, x, fresh, self._horizon)
        self._last.start(t, tuple(x))
        try:
            found = self._equations.start(t, *x)
        except ARITHMETIC as error:
            return Stop("failed", t, 0.0, tuple(x), reason=f"the field has no value at the start: {error}")
        further = len(self._equations.unknowns) - n
        y, yp = np.array([*x, *found[:further]]), np.array(found[further:])
        before = work.rhs
        # scikit-sundae prints its errors.
        with redirect_stdout(said), np.errstate(all="ignore"):
            try:
                result = self._ida(self._resfn, **self._options, **self._events).solve([t, until], y, yp)
            except (RuntimeError, Stalled) as error:
                return Stop("failed", self._last.t, 0.0, self._last.x, reason=f"{error} {said.getvalue().strip()}")
            work.steps += result.t.size - 1
            work.rhs = before + int(result.nfev)
            stop = stopped(result, n, until, said.getvalue(), self._last)
            if wanted is None:
                return stop
            kept = work.rhs
            samples = sampled(
                lambda times: self._ida(self._resfn, **self._options).solve(times, y, yp), wanted, t, stop.t, n
            )
            work.rhs = kept
        return stop._replace(samples=samples)


def _residual(equations: _Equations, callbacks: Callbacks, work: Work) -> Callable[..., None]:
    """``resfn(t, y, yp, res)``: y' - f(t, y) of the differential unknowns, then -c(t, y)."""
    if callbacks == "numba":
        return _compiled_residual(equations)
    right = scalar(equations.unknowns, equations.right)
    nowhere = (np.nan,) * len(equations.unknowns)
    count, n = work.count_rhs, equations.differential

    def resfn(t: float, y: NDArray[np.float64], yp: NDArray[np.float64], res: NDArray[np.float64]) -> None:
        count()
        try:
            res[:] = right(t, *y.tolist())
        except ARITHMETIC:
            res[:] = nowhere
        np.negative(res, out=res)
        res[:n] += yp[:n]

    return resfn


def _compiled_residual(equations: _Equations) -> Callable[..., None]:
    """The same, compiled: the library counts its calls, the deadline is looked at in the event function."""
    import numba

    fill, n = compiled(equations.unknowns, equations.right), equations.differential

    def resfn(t: float, y: Any, yp: Any, res: Any) -> None:
        fill(t, y, res)
        for k in range(res.size):
            res[k] = yp[k] - res[k] if k < n else -res[k]

    made = numba.njit(resfn, error_model="numpy")
    point = np.ones(len(equations.unknowns))
    point.flags.writeable = False  # as the library hands it in: a type of its own to numba
    made(0.0, point, point, np.empty(point.size))
    return made


IDA = SundialsIda("ida")
IDA_NUMBA = SundialsIda("ida+numba", callbacks="numba")
