"""SUNDIALS' CVODE (Adams and BDF) and IDA by scikit-sundae, with their own rootfinding.

CVODE ignores an event function that is exactly zero at the start until the function has left zero; a function that is
one rounding off zero has its sign. With the default restart ``direction`` the guard is not changed, and only falling
roots count. After an event-free step CVODE would no longer ignore a guard that stays at zero. The first steps (order 1,
with Newton's iteration stopped at a part of the tolerance) move a guard by about the tolerance. Roots are located by
the Illinois method on the Nordsieck polynomial to ``100 eps (abs(t) + abs(h))``; a pair of roots inside one step is not
detected. What the documentation advises: ``docs/solvers.md``.

IDA solves sliding as an index-1 DAE with the friction force as algebraic unknown. In slip the residual is ``x' - f(t,
x)``. For each sliding surface the equivalent sign is a further unknown s_i with the equation ``dh_i/dt (t, x, s) = 0``,
and the stick ends when s_i reaches -1 or +1. If a surface is a multiple of another one, its equation sets its sign to
plus or minus the other sign. The DAE keeps ``dh/dt`` at zero, but not h, so that h drifts by about the tolerance
during a stick; the driver projects the state onto the surface at its end. A ``sliding`` override is integrated as an
ODE. The initial state is consistent by construction (x' = f, s from the expression of the equivalent sign).
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.library import Library, Stalled, Stop, Work
from henon_ref.baselines.mode_functions import Callbacks, Fill, ModeFunctions, compiled, jacobian, njit
from henon_ref.baselines.restart import Restart
from henon_ref.baselines.smooth_mode import SmoothMode, Watcher
from henon_ref.modes.callables import ARITHMETIC, Scalar, scalar
from henon_ref.modes.equations import Guard

# SUNDIALS' logger writes its warnings ("t + h = t") directly to the standard output of the process.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)


class _CvodeMode(SmoothMode):
    """One mode on CVODE; IDA's mode overrides `build` and `start`."""

    function: Callable[..., None]
    """Right-hand side or residual."""
    options: dict[str, Any]
    """Options of the integrator."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        self.build(library.solver)

    def build(self, own: Sundials) -> None:
        """Set ``function`` and ``options``."""
        self.function, jacobian = _filling_field(self, own.callbacks), self.model.jacobian(own.callbacks)

        def jacfn(t: float, x: NDArray[np.float64], xp: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            jacobian.fill(t, x, out)

        self.connect(jacfn, self.watchers, method=own.method)

    def start(self, t: float, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return the initial arrays for the library's ``solve``; raise an arithmetic error if the field has no value.

        ``x`` are the unknowns at ``t``.
        """
        return (x,)

    def connect(self, jacfn: Callable[..., None], watchers: Sequence[Watcher], dae: bool = False, **more: Any) -> None:
        """Set the options and ``more``. All events are terminal; the last event is the guard against divergence."""
        divergence, count = self.divergence, len(watchers)

        def of_ode(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            for k, watcher in enumerate(watchers):
                out[k] = watcher(t, x)
            out[count] = divergence(t, x)

        eventsfn: Any = (lambda t, y, yp, out: of_ode(t, y, out)) if dae else of_ode
        # scikit-sundae reads both attributes of the function.
        eventsfn.terminal, eventsfn.direction = [True] * (count + 1), [self.root_direction] * count + [-1]
        # max_num_steps counts steps between outputs; this value has no effect: only the deadline bounds a run.
        self.options = {
            "rtol": self.rtol, "atol": self.atol, "jacfn": jacfn, "max_num_steps": 1_000_000,
            "eventsfn": eventsfn, "num_events": count + 1, **more,
        }  # fmt: skip

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        try:
            start = self.start(t, x)
        except ARITHMETIC as error:
            return self.failed(f"the field has no value at the start: {error}")
        work, printed = self.work, io.StringIO()
        before = work.rhs
        # scikit-sundae prints its errors.
        with redirect_stdout(printed):
            try:
                # A new object for every run, because an object keeps the events of earlier calls.
                result = self.library.module(self.function, **self.options).solve([t, until], *start)
            except (RuntimeError, Stalled) as error:
                return self.failed(f"{error} {printed.getvalue().strip()}")
        work.steps += result.t.size - 1
        work.rhs = before + int(result.nfev)
        end, state = float(result.t[-1]), tuple(result.y[-1, : self.states].tolist())
        if not result.success:
            return Stop("failed", end, 0.0, state, reason=" ".join([result.message, *printed.getvalue().split()]))
        if result.t_events is None:
            return self.stopped(until, state)
        return self.stopped(end, state, np.flatnonzero(result.i_events[-1]).tolist())


def _filling_field(mode: SmoothMode, callbacks: Callbacks) -> Callable[..., None]:
    """Return ``rhs(t, x, out)``, which writes the time derivatives of a mode's unknowns into the library's array.

    A compiled function is passed directly: the library counts its calls, and the event function checks the deadline.
    """
    if callbacks == "numba":
        fill, whole = mode.model.compiled_derivatives()
        if whole:
            return _ready(fill, len(mode.model.unknowns))
    field = mode.counted_field(callbacks)

    def rhs(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        out[:] = field(t, x)

    return rhs


def _ready(function: Callable[..., None], unknowns: int, points: int = 1) -> Callable[..., None]:
    """Call a function of a time, ``points`` arrays and a result once, so that numba compiles it before the run."""
    point = np.ones(unknowns)
    point.flags.writeable = False  # the library passes read-only arrays, which have another type in numba
    function(0.0, *[point] * points, np.empty(unknowns))
    return function


class _IdaMode(_CvodeMode):
    """One mode on IDA, as a DAE in ``y = (x, g, s)``: ``(x, g)' = f(t, y)``, ``0 = c(t, y)``.

    x are the states, g copies of the followed guards (:meth:`ModeFunctions.start`), s the equivalent signs.
    """

    def build(self, own: Sundials) -> None:
        model, callbacks, system = self.model, own.callbacks, self.model.system
        self._sliding = sliding = tuple(model.equations.equivalent_signs)
        """Surfaces whose equivalent sign is an unknown, in order; none in slip or under a ``sliding`` override."""
        seen = [k for k in model.followed if not self._by_sign(model.guards[k])]
        guards = [model.guard_expressions[k] for k in seen]
        swings = tuple(model.along(g) for g in guards)
        signs = [system.numeric(e) for e in model.equations.equivalent_signs.values()]
        field, conditions = _convex(model, sliding) if sliding else (model.field_expressions, ())
        copies = tuple(sp.Dummy(f"g{k}", real=True) for k in seen)
        unknowns, right = (*system.states, *copies, *(system.signs[i] for i in sliding)), (*field, *swings, *conditions)
        self._unknowns = len(unknowns)
        self._differential = self.states + len(seen)
        """Number of unknowns that have a time derivative."""
        started = [*guards, *signs, *model.field_expressions, *swings, *(model.along(e) for e in signs)]
        if model.common is not None and not sliding:  # the equations common to all modes, without signs and copies
            self._start, slopes, self.function = model.field, model.jacobian(callbacks), self._residual(model.field)
        else:
            self._start, slopes = scalar(system.states, started), jacobian(unknowns, right, callbacks)
            if callbacks == "numba":
                self.function = _compiled_residual(compiled(unknowns, right), len(unknowns), self._differential)
            else:
                self.function = self._residual(scalar(unknowns, right))
        moving = np.arange(self._differential)

        def jacfn(t: float, y: Any, yp: Any, res: Any, cj: float, out: NDArray[np.float64]) -> None:
            slopes.fill(t, y, out)
            np.negative(out, out=out)
            out[moving, moving] += cj

        algebraic = list(range(self._differential, self._unknowns))
        watchers = [self._watcher(k) for k in range(len(model.guards))]
        self.connect(jacfn, watchers, dae=True, algebraic_idx=algebraic or None)

    def _by_sign(self, guard: Guard) -> bool:
        """Check whether a guard ends a stick, so that its value follows from an unknown s_i."""
        return guard.kind == "release" and guard.index in self._sliding

    def _watcher(self, k: int) -> Watcher:
        """Return the event function of guard k; a stick ends when its unknown s_i reaches -1 or +1."""
        guard = self.model.guards[k]
        if not self._by_sign(guard):
            return self.watcher(k)
        at, side = self._differential + self._sliding.index(guard.index), guard.to_sign
        return self.watcher(k, lambda t, y: 1.0 - side * float(y[at]))

    def start(self, t: float, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return the unknowns of the residual and their time derivatives."""
        states = x[: self.states].tolist()
        found = self._start(t, *states)  # (g, s, x', g', s')
        further = self._unknowns - self.states
        return np.array([*states, *found[:further]]), np.array(found[further:])

    def _residual(self, right: Scalar) -> Callable[..., None]:
        """Return ``resfn(t, y, yp, res)``: y' - f(t, y) of the differential unknowns, followed by -c(t, y)."""
        nowhere, count, n = (np.nan,) * self._unknowns, self.work.count_rhs, self._differential

        def resfn(t: float, y: NDArray[np.float64], yp: NDArray[np.float64], res: NDArray[np.float64]) -> None:
            count()
            try:
                res[:] = right(t, *y.tolist())
            except ARITHMETIC:
                res[:] = nowhere
            np.negative(res, out=res)
            res[:n] += yp[:n]

        return resfn


def _convex(model: ModeFunctions, sliding: Sequence[int]) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """Return the field and the conditions ``0 = c`` in the states and the equivalent signs of ``sliding`` surfaces."""
    system = model.system
    slip = system.slip_signs(model.mode)
    ties = {system.signs[j]: way * system.signs[i] for j, (i, way) in system.multiples.items() if j in sliding}
    free = {system.signs[i] for i in sliding} - set(ties)

    def convex(expression: sp.Expr) -> sp.Expr:
        return system.numeric(_between_signs(expression.xreplace(slip | ties), free))

    def condition(index: int) -> sp.Expr:
        sign = system.signs[index]
        return sign - ties[sign] if sign in ties else convex(system.normal_velocity(index))

    return tuple(map(convex, system.field)), tuple(map(condition, sliding))


def _between_signs(expression: sp.Expr, signs: set[sp.Symbol]) -> sp.Expr:
    """Return Filippov's convex combination, which is affine in each sign between -1 and +1."""
    for s in signs:
        if sp.diff(expression, s, 2) != 0:
            up, down = expression.xreplace({s: sp.Integer(1)}), expression.xreplace({s: sp.Integer(-1)})
            expression = (1 + s) / 2 * up + (1 - s) / 2 * down
    return expression


def _compiled_residual(fill: Fill, unknowns: int, differential: int) -> Callable[..., None]:
    """Return the compiled residual. The library counts its calls; the event function checks the deadline."""

    def resfn(t: float, y: Any, yp: Any, res: Any) -> None:
        fill(t, y, res)
        for k in range(res.size):
            res[k] = yp[k] - res[k] if k < differential else -res[k]

    return _ready(njit(resfn), unknowns, points=2)


@dataclass(frozen=True)
class Sundials(Adapter):
    """CVODE or IDA on one mode after another: dense Newton iteration with a Jacobian derived by SymPy.

    Counts: ``steps`` are internal steps; ``rhs_evaluations`` is the library's own count of right-hand sides or, for
    IDA, of residuals (Jacobians not counted); ``event_evaluations`` counts evaluations of one guard each, with the
    guard against divergence.
    """

    method: Literal["Adams", "BDF", "IDA"]
    restart: Restart = field(default="direction", kw_only=True)
    callbacks: Callbacks = field(default="python", kw_only=True)
    """Right-hand side (or residual) and Jacobian in plain Python or compiled; event functions are always Python."""
    landing = "illinois"
    distribution = "scikit-sundae"
    least_rtol = 1e-15  # smallest value that the documentation recommends
    implicit = True
    located = (100.0, 0.0)  # 100 eps (abs(t) + abs(h)); the step h is not known here

    @property
    def mode(self) -> type[SmoothMode]:  # type: ignore[override]
        return _IdaMode if self.method == "IDA" else _CvodeMode

    def load(self) -> Any:
        if self.method == "IDA":
            return import_module("sksundae.ida").IDA
        return import_module("sksundae.cvode").CVODE


ADAMS = Sundials("cvode-adams", "Adams")
BDF = Sundials("cvode-bdf", "BDF")
IDA = Sundials("ida", "IDA", restart="offset")
