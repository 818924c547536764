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
tolerance) move a guard by the tolerance. ``offset`` is the default (:mod:`henon_ref.baselines.restart`): with it IDA is
right most often over the suite; behind an event-free step a guard that stays at zero is no longer out of play. Roots
are located by the Illinois method to ``100 eps (abs(t) + abs(h))``; a pair inside one step is not seen; a new object
for every run of a mode, as for CVODE. Which of the documentation's advice is followed: ``docs/solvers.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import ConfiguredLibrary
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.numba_callbacks import Callbacks, compiled, jacobian, njit
from henon_ref.baselines.restart import Restart, Watcher
from henon_ref.baselines.sundials import SundialsAdapter, SundialsFlow
from henon_ref.baselines.work import Work
from henon_ref.modes.callables import ARITHMETIC, scalar
from henon_ref.modes.equations import Guard


@dataclass(frozen=True)
class SundialsIda(SundialsAdapter):
    """IDA on one mode after another, dense Newton iteration with the Jacobian that SymPy derives.

    Counts: ``steps`` are internal steps; ``rhs_evaluations`` are IDA's own count of residuals (Jacobians not
    counted); ``event_evaluations`` all evaluations of one guard each, the guard against divergence among
    them. A second pass for samples is not counted.
    """

    restart: Restart = field(default="offset", kw_only=True)
    callbacks: Callbacks = "python"
    """Residual and Jacobian in plain Python or compiled; the event function is plain Python."""

    def load(self) -> Callable[..., Any]:
        """The class ``IDA``."""
        from sksundae.ida import IDA

        return IDA

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, library, model, work, horizon)


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
        self.alike = model.common is not None and not self.sliding
        """Whether its equations are those that all modes have in common: no equivalent signs, no copies."""
        self.values = model.field if self.alike else scalar(self.unknowns, self.right)
        """(t, *y) -> f, c."""
        started = [*guards, *signs, *model.field_expressions, *swings, *(model.along(e) for e in signs)]
        self.start = model.field if self.alike else scalar(system.states, started)
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


class _Flow(SundialsFlow):
    """IDA on one mode."""

    def __init__(
        self, adapter: SundialsIda, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float
    ) -> None:
        super().__init__(library, model, work, horizon)
        self._equations = equations = _Equations(model)
        slopes = (
            model.jacobian(adapter.callbacks)
            if equations.alike
            else jacobian(equations.unknowns, equations.right, adapter.callbacks)
        )
        self.function = _residual(equations, adapter.callbacks, work)
        moving = np.arange(equations.differential)

        def jacfn(t: float, y: Any, yp: Any, res: Any, cj: float, out: NDArray[np.float64]) -> None:
            slopes.fill(t, y, out)
            np.negative(out, out=out)
            out[moving, moving] += cj

        watchers = [self._watcher(k) for k in range(len(model.guards))]
        algebraic = list(range(equations.differential, len(equations.unknowns)))
        self.connect(jacfn, watchers, dae=True, algebraic_idx=algebraic or None)

    def _watcher(self, k: int) -> Watcher:
        """Guard k as a function of (t, y): a stick ends where its unknown reaches -1 or +1."""
        guard, equations, count = self.model.guards[k], self._equations, self.work.count_event
        if not equations.by_sign(guard):
            return self.gates.watcher(k, count)
        at, side = equations.differential + equations.sliding.index(guard.index), guard.to_sign
        return self.gates.watcher(k, count, lambda t, y: 1.0 - side * float(y[at]))

    def start(self, t: float, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Unknowns of the residual and their time derivatives."""
        states = x[: self.states].tolist()
        found = self._equations.start(t, *states)
        further = len(self._equations.unknowns) - self.states
        return np.array([*states, *found[:further]]), np.array(found[further:])


def _residual(equations: _Equations, callbacks: Callbacks, work: Work) -> Callable[..., None]:
    """``resfn(t, y, yp, res)``: y' - f(t, y) of the differential unknowns, then -c(t, y)."""
    if callbacks == "numba" and not equations.alike:
        return _compiled_residual(equations)
    right = equations.values
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
    fill, n = compiled(equations.unknowns, equations.right), equations.differential

    def resfn(t: float, y: Any, yp: Any, res: Any) -> None:
        fill(t, y, res)
        for k in range(res.size):
            res[k] = yp[k] - res[k] if k < n else -res[k]

    made: Callable[..., None] = njit(resfn)
    point = np.ones(len(equations.unknowns))
    point.flags.writeable = False  # as the library hands it in: a type of its own to numba
    made(0.0, point, point, np.empty(point.size))
    return made


IDA = SundialsIda("ida")
