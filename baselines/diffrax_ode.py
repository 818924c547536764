"""diffrax: Dopri8 and Kvaerno5 with ``diffrax.Event``, one compiled solve per mode (``docs/solvers_peers.md``).

The adapter uses one condition, the minimum of the guards, because of several conditions that change in one step the
first in the list would count; bisection within the step (which accepts one condition only), because Newton's method
would find the step's last root; the direction downwards; and the restart ``offset``, because a condition that is zero
at the start stops the run at once or loses its root (:mod:`henon_ref.baselines.causes.diffrax_events`). A guard that is
negative at the start of its mode is first watched for its rise, then for its fall.

The parameters are arguments of the jax functions: a process traces and compiles a mode once for all their values.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.library import LIMIT, Library, Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import SMALLEST_LIFT, Restart
from henon_ref.baselines.scipy_ivp import scouting
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.equations import along
from henon_ref.taylor.tape import TIME


class _Mode(SmoothMode):
    """One mode on diffrax."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        method = library.solver.method
        # Right-hand sides per step of Dopri8: 14 stages, the first of which is the last of the step before.
        self._stages = 13 if method == "Dopri8" else 0
        source, values = mode_source(model)
        self._solve = _compiled(method, library.solver.restart == "none", source)
        self._numbers = np.array(values, dtype=float)
        self._tolerances = np.array([library.rtol, library.atol])

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        self._lift(t, x)
        signs, n, count = self._unarmed(t, x), len(x), len(self.model.guards)
        while True:
            watch = np.array([signs[:-1], self.lifts, self.quiet])
            try:
                packed, result = self._solve(float(t), x, float(until), self._numbers, watch, self._tolerances)
                row = np.asarray(packed)
            except RuntimeError as error:  # raised by compiled code, with a traceback in its text
                return self.failed(f"diffrax: {_message(error)}")
            began, t, x = t, float(row[0]), row[1 : n + 1]
            event, arrived, more = (bool(flag) for flag in row[-5:-2])
            steps, tried = int(row[-2]), int(row[-1])
            self.work.steps += steps
            self.work.rhs += self._stages * tried
            self.work.events += (count + 1) * steps
            hit = self._nearest(row[n + 1 : n + 2 + count], t, x) if event else count
            self.divergence(t, x)
            if signs[hit] < 0:
                signs[hit] = 1.0
            elif event or arrived:
                return self.stopped(t, x, [hit] if event else None)
            elif not more:
                return self.failed(f"diffrax: {result}")
            elif t - began <= 4.0 * EPSILON * abs(t):
                return self.failed(f"diffrax does not advance from t = {began:.17g}")
            self.work.check()

    def _lift(self, t: float, x: NDArray[np.float64]) -> None:
        """Raise the lift of a fresh guard that is still not positive (a guard of time alone may be so by rounding).

        A minimum that starts negative cannot fall through zero, so that the roots of all guards would be lost.
        """
        lifts = self.lifts
        for k, guard in enumerate(self.model.guards):
            if lifts[k] > 0.0 and not guard.rising_only and (value := self._value(k, t, x)) <= 0.0:
                lifts[k] += SMALLEST_LIFT - 2.0 * value

    def _unarmed(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return -1 for a guard that must rise before it counts (its negative is watched until then), 1 otherwise."""
        signs = np.ones(len(self.model.guards) + 1)
        for k, guard in enumerate(self.model.guards):
            if guard.rising_only and (t <= self.quiet[k] or self._value(k, t, x) <= 0.0):
                signs[k] = -1.0
        return signs

    def _value(self, k: int, t: float, x: NDArray[np.float64]) -> float:
        try:
            return self.model.guard[k](t, *x[: self.states].tolist())[0] + self.lifts[k]
        except ARITHMETIC:
            return -1.0

    def _nearest(self, values: NDArray[np.float64], t: float, x: NDArray[np.float64]) -> int:
        """Return the guard whose root is nearest in time; the last entry of ``values`` is that of divergence.

        The values alone do not decide it: at the located root of the minimum a slow guard may have a smaller value than
        the guard that falls.
        """
        try:
            rates = np.abs(self.model.rates(t, *x[: self.states].tolist())[1::2])
        except ARITHMETIC:
            return int(np.argmin(values))
        return int(np.argmin(np.append(values[:-1] / np.maximum(rates, SMALLEST_LIFT), np.sign(values[-1]) * np.inf)))


def _message(error: RuntimeError) -> str:
    """Extract the message of Equinox's check from jax's message; without one, return the first line."""
    found = re.search(r"EquinoxRuntimeError: (.+)", str(error))
    return found[1] if found else str(error).partition("\n")[0]


@cache
def _compiled(method: str, either: bool, source: ModeSource) -> Any:
    """Return the compiled ``solve(t, x, until, numbers, watch, tolerances)`` of one mode, once per process.

    ``watch`` holds each guard's sign, lift, and the time up to which its value is 1, shape (3, m). The result is an
    array of time, unknowns, watched guards, the guard against divergence, three flags (stopped by an event, arrived at
    the horizon, ``max_steps`` used), the accepted steps and all steps; and diffrax's result.
    """
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    rates, guards = jax_function(source, source.right), jax_function(source, source.guards)
    states = source.states
    finder = optimistix.Bisection(4.0 * EPSILON, 4.0 * EPSILON, flip="detect" if either else True)

    def watched(t: Any, x: Any, numbers: Any, watch: Any) -> Any:
        signs, lifts, quiet = watch
        values = jnp.where(t <= quiet, 1.0, signs * (guards(t, x, numbers) + lifts))
        return jnp.append(values, LIMIT - jnp.sum(jnp.abs(x[:states])))

    def least(t: Any, y: Any, args: Any, **_: Any) -> Any:  # diffrax passes these by name
        # Bisection stops only when the condition, too, is below the absolute tolerance, which is chosen for the time;
        # the factor makes the condition irrelevant.
        return 1e-100 * jnp.min(watched(t, y, *args))

    def solve(t: Any, x: Any, until: Any, numbers: Any, watch: Any, tolerances: Any) -> Any:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, args: rates(t, y, args[0])),
            getattr(diffrax, method)(),
            t,
            until,
            None,
            x,
            args=(numbers, watch),
            saveat=diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=tolerances[0], atol=tolerances[1]),
            event=diffrax.Event(least, finder, None if either else False),
            max_steps=4096,  # between two checks of the clock; diffrax's default
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        end, y, results = solution.ts[0], solution.ys[0], diffrax.RESULTS
        flags = [solution.result == r for r in (results.event_occurred, results.successful, results.max_steps_reached)]
        counts = [solution.stats["num_accepted_steps"], solution.stats["num_steps"]]
        parts = [end, y, watched(end, y, numbers, watch), jnp.array(flags, dtype=float), jnp.array(counts)]
        return jnp.concatenate([jnp.atleast_1d(part) for part in parts]), solution.result

    shapes = [(), (len(source.unknowns),), (), (len(source.numbers),), (3, len(source.guards)), (2,)]
    return jax.jit(solve).lower(*(jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes)).compile()


class ModeSource(NamedTuple):
    """Equations of one mode with parameters as symbols; the key of the compiled solves."""

    unknowns: tuple[sp.Symbol, ...]
    """The states, followed by a copy of each guard that is not linear in time and states."""
    states: int
    numbers: tuple[sp.Symbol, ...]
    """Parameters that are arguments of the compiled function."""
    right: tuple[sp.Expr, ...]
    """Time derivatives of the unknowns."""
    guards: tuple[sp.Expr, ...]


def mode_source(model: ModeFunctions) -> tuple[ModeSource, tuple[float, ...]]:
    """Return a mode's equations with parameters as symbols, and the parameters' values.

    The value of a parameter in an exponent is inserted, because ``x**2`` is a product but ``x**p`` a logarithm.
    """
    fields, guards = model.equations.field, tuple(g.expression for g in model.guards)
    parameters = model.system.parameters
    used = set().union(*(e.free_symbols for e in (*fields, *guards)))
    powers = {e.exp for f in (*fields, *guards) for e in f.atoms(sp.Pow)}
    fixed = {p: v for p, v in parameters.items() if any(p in e.free_symbols for e in powers)}
    fields, guards = (tuple(e.xreplace(fixed) for e in group) for group in (fields, guards))
    numbers = tuple(p for p in parameters if p in used and p not in fixed)
    copies = tuple(sp.Symbol(f"guard_{k}_", real=True) for k in model.followed)
    right = (*fields, *(along(guards[k], model.states, fields) for k in model.followed))
    source = ModeSource((*model.states, *copies), len(model.states), numbers, right, guards)
    return source, tuple(float(parameters[p]) for p in numbers)


def jax_function(source: ModeSource, expressions: Sequence[sp.Expr]) -> Callable[[Any, Any, Any], Any]:
    """Return ``f(t, x, numbers)``, a jax array with one entry per expression; x is an array of the unknowns."""
    import jax.numpy as jnp

    arguments = [TIME, *source.unknowns, *source.numbers]
    function = sp.lambdify(arguments, list(expressions), modules="jax", cse=True, dummify=True)
    n, count = len(source.unknowns), len(source.numbers)

    def values(t: Any, x: Any, numbers: Any) -> Any:
        found = function(t, *(x[k] for k in range(n)), *(numbers[k] for k in range(count)))
        return jnp.array(found, dtype=float)  # unlike stack(), also of an empty list: a mode may have no guards

    return values


@dataclass(frozen=True)
class DiffraxOde(Adapter):
    """``diffrax.diffeqsolve`` for one smooth mode after another, in double precision on the CPU.

    Counts: ``steps`` are accepted steps; ``rhs_evaluations`` are 13 per step of Dopri8, rejected steps included, and 0
    for Kvaerno5, because diffrax does not count its iterations; ``event_evaluations`` is one per guard and accepted
    step, without those of the root finder.
    """

    method: Literal["Dopri8", "Kvaerno5"]
    restart: Restart = field(default="offset", kw_only=True)
    mode = _Mode
    landing = "bisection"
    distribution = "diffrax"
    extra = "peers"
    located = (64.0, 1.0)  # of the dense output: for x' = 1 the root t = 1 is 1.4e-14 off

    def load(self) -> Any:
        import diffrax
        import jax

        jax.config.update("jax_enable_x64", True)
        jax.config.update("jax_platforms", "cpu")
        # The processor time of a run is measured for its own thread.
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        return diffrax

    @property
    def implicit(self) -> bool:  # type: ignore[override]
        return self.method == "Kvaerno5"

    loosened = scouting


DOPRI8 = DiffraxOde("diffrax-dopri8", "Dopri8")
KVAERNO5 = DiffraxOde("diffrax-kvaerno5", "Kvaerno5")
