"""heyoka: Taylor integration with terminal events, one compiled integrator per mode.

Without a direction, an event that is exactly zero at the start stops heyoka at once. With a direction it does not, but
the next true root in the first step is lost. A guard that starts one rounding above zero is treated correctly.
Therefore the default restart is ``offset``: a heyoka parameter lifts the fresh guard by a few roundings of its terms,
which delays the next root by the lift divided by the guard's rate. heyoka finds a root on the guard's Taylor
polynomial. At a loose tolerance a tangential release is therefore slightly early or late, and the guard may first fall
by the square of this time; the lift covers this fall. ``event-free-step`` takes a short step with a second integrator
without events.

An exact double root inside a step is not detected. A root very early in a long step (a ballistic return within 1e-4 of
the step) is sometimes lost together with the guard's root at the start. If such a guard is below zero at the next stop,
the start is repeated with an event-free step. heyoka stores its time as two doubles, and the transitions keep both
(``time_low``). Its one tolerance is ``rtol``. What its documentation advises: ``docs/solvers.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from math import isfinite
from typing import Any, Literal

import sympy as sp

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.driver import MISSED_ROOT
from henon_ref.baselines.library import LIMIT, Library, Stop, Times, Work
from henon_ref.baselines.mode_functions import EPSILON, CommonFunctions, ModeFunctions
from henon_ref.baselines.restart import LIFT, LONGEST, SMALLEST_LIFT, SPAN, Fresh, Restart, dips, lift, quiet_until
from henon_ref.baselines.scipy_ivp import scouting
from henon_ref.baselines.surface_functions import slopes_of
from henon_ref.errors import UnsupportedError
from henon_ref.expressions.grammar import ELEMENTARY
from henon_ref.expressions.traversal import Rules, Walk, fold, fraction
from henon_ref.jit.processor_time import compiling
from henon_ref.modes.callables import ARITHMETIC, rounded
from henon_ref.taylor.tape import TIME

CHUNK = 4096
"""Largest number of steps between two checks of the clock and of the size of the state."""
OUTCOMES = -(2**32)
"""Outcomes above this value are terminal events, -index - 1; outcomes up to it are heyoka's status codes."""


class _Integrators:
    """heyoka's integrators, with and without events, of one mode or of all modes that share their equations.

    The symbols in which modes differ are run-time parameters of heyoka, after the guards' lifts.
    """

    def __init__(self, library: Library, functions: ModeFunctions | CommonFunctions) -> None:
        hy, solver, guards = library.module, library.solver, functions.guard_expressions
        # heyoka does not support events on constants; a constant guard never falls.
        self.moving = [k for k, g in enumerate(guards) if not g.is_number]
        """Indices of the guards that are events."""
        variables = {x: hy.expression(f"x{k}") for k, x in enumerate(functions.states)}
        symbols = variables | {s: hy.par[len(self.moving) + k] for k, s in enumerate(functions.symbols)}
        field = (to_heyoka(f, symbols) for f in functions.field_expressions)
        equations = list(zip(variables.values(), field, strict=True))
        # In compact mode the compilation is shorter and the steps are slower.
        start, compact = [0.0] * len(equations), len(equations) >= 20
        make = partial(
            hy.taylor_adaptive, equations, start, tol=library.rtol, fast_math=solver.fast_math, compact_mode=compact
        )
        self._make_quiet, events = make, {}
        if solver.restart == "event-free-step":
            self.quiet  # noqa: B018 - made on first access
        if self.moving:
            direction = hy.event_direction.any if solver.restart == "none" else hy.event_direction.negative
            # No cooldown, because every event ends the run of the mode.
            cooldown = {"cooldown": 0.0} if solver.cooldown == "none" else {}
            events["t_events"] = [
                hy.t_event(to_heyoka(guards[k], symbols) + hy.par[slot], direction=direction, **cooldown)
                for slot, k in enumerate(self.moving)
            ]
        self.taylor: Any = make(**events)

    @cached_property
    def quiet(self) -> Any:
        """Integrator without events, for the event-free step."""
        with compiling():
            return self._make_quiet()


_common_integrators = lru_cache(maxsize=16)(_Integrators)
"""Integrators of all modes that share their equations."""


class _Mode:
    """One mode on heyoka."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        solver: HeyokaTaylor = library.solver
        self._model, self._work, self._horizon = model, work, horizon
        self._policy, self._rtol = solver.restart, library.rtol
        made = _Integrators(library, model) if model.common is None else _common_integrators(library, model.common)
        self._switches = model.switches
        guard_of = {row: k for k, row in enumerate(model.rows)}
        self._hit = [guard_of.get(row, -1) for row in made.moving]
        """Guard of the mode for each event; -1 if the mode does not have the guard."""
        self._slots = {k: slot for slot, k in enumerate(self._hit) if k >= 0}
        self._guards = len(self._hit)
        self._forgets = self._guards > 0 and solver.cooldown == "none"
        self._made, self._taylor = made, made.taylor
        self._state, self._lifts = self._taylor.state, self._taylor.pars

    def advance(
        self, t: float, low: float, x: Sequence[float], until: float, fresh: Sequence[Fresh], wanted: Times
    ) -> Stop:
        """See :data:`henon_ref.baselines.library.Advance`."""
        if fresh and self._policy == "event-free-step":
            return self._event_free_step(t, low, x, until, fresh)
        lifted = [item for item in fresh if item[0] in self._slots] if self._policy == "offset" else []
        for item in lifted:
            self._lifts[self._slots[item[0]]] = self._lift(item, t, x)
        stop = self._propagate(t, low, x, until)
        for guard, *_ in lifted:
            self._lifts[self._slots[guard]] = 0.0
        return self._event_free_step(t, low, x, until, fresh) if self._is_lost(lifted, stop) else stop

    def _is_lost(self, lifted: Sequence[Fresh], stop: Stop) -> bool:
        """Check whether a guard that started at zero is below zero without an event: heyoka stepped over its root."""
        model = self._model
        for guard, speed, _ in lifted:
            if guard in stop.hits or model.guards[guard].rising_only:
                continue
            try:
                value = model.guard[guard](stop.t, *stop.x)[0]
            except ARITHMETIC:
                continue
            if value < -MISSED_ROOT * (
                model.size(guard, stop.t, stop.x, self._rtol, self._rtol) + speed * EPSILON * abs(stop.t)
            ):
                return True
        return False

    def _begin(self, t: float, low: float, x: Sequence[float]) -> None:
        self._taylor.dtime = (t, low)
        state = self._state
        for k, value in enumerate(x):
            state[k] = value
        if self._switches:
            self._lifts[self._guards : self._guards + len(self._switches)] = self._switches
        if self._forgets:
            self._taylor.reset_cooldowns()

    def _propagate(self, t: float, low: float, x: Sequence[float], until: float) -> Stop:
        taylor, work, tolist = self._taylor, self._work, self._state.tolist
        propagate = taylor.propagate_until
        self._begin(t, low, x)
        while True:
            outcome, _, _, steps, _, _ = propagate(until, max_steps=CHUNK)
            work.steps += steps
            work.rhs += steps
            work.events += steps * self._guards
            code, (now, rest), point = int(outcome), taylor.dtime, tuple(tolist())
            for value in point:
                if not -LIMIT <= value <= LIMIT:
                    return self._overflow(t, low, x, until)
            if code > OUTCOMES:
                return Stop("event", now, rest, point, (self._hit[-code - 1],))
            if code == OUTCOMES - 3:  # taylor_outcome.time_limit: the end of the interval was reached
                return Stop("horizon", now, rest, point)
            if now - t <= 4.0 * EPSILON * abs(now):
                return Stop("failed", now, rest, point, reason=f"heyoka does not advance from t = {now:.17g}")
            t, low, x = now, rest, point
            work.check()

    def _overflow(self, t: float, low: float, x: Sequence[float], until: float) -> Stop:
        """Repeat a chunk step by step up to the first state beyond the limit."""
        taylor, point = self._taylor, tuple(x)
        self._begin(t, low, x)
        for _ in range(CHUNK):
            taylor.step(max_delta_t=until - t)
            ahead = tuple(self._state.tolist())
            if not all(map(isfinite, ahead)):
                return Stop("failed", t, low, point, reason=f"heyoka: the state is not finite after t = {t:.17g}")
            t_old, (t, low) = t, taylor.dtime
            if max(map(abs, ahead)) > LIMIT:
                return self._passing(t_old, t)
            point = ahead
        return Stop("failed", t, low, point, reason="heyoka: the state was not finite")

    def _passing(self, inside: float, beyond: float) -> Stop:
        """Locate the time at which the state passes the limit, by bisection on the polynomial of the last step."""
        while (middle := 0.5 * (inside + beyond)) not in (inside, beyond):
            if max(map(abs, self._taylor.update_d_output(middle).tolist())) > LIMIT:
                beyond = middle
            else:
                inside = middle
        return Stop("diverged", beyond, 0.0, tuple(self._taylor.update_d_output(beyond).tolist()))

    def _lift(self, item: Fresh, t: float, x: Sequence[float]) -> float:
        guard, speed, rate = item
        places, _, slopes = slopes_of(self._model.guard_expressions[guard], self._model.states)
        if slopes is None or dips(speed, rate):
            return lift(self._model, item, t, x, self._horizon)
        size = speed * SPAN * self._horizon
        for k, slope in zip(places, slopes, strict=True):
            size += abs(slope * x[k])
        return max(LIFT * EPSILON * size, SMALLEST_LIFT)

    def _event_free_step(self, t: float, low: float, x: Sequence[float], until: float, fresh: Sequence[Fresh]) -> Stop:
        """Take a first step without events, then integrate with events.

        If a guard is below zero at the end of the step, return an event at that time (later than the true root).
        """
        model, quiet = self._model, self._made.quiet
        levels = [model.size(guard, t, x, self._rtol, self._rtol) for guard, *_ in fresh]
        end = min(max(quiet_until(model, fresh, t, x, levels, LONGEST * self._horizon)), until)
        if self._switches:
            pars = quiet.pars[self._guards :]  # the switches, up to the last one in the field
            pars[:] = self._switches[: len(pars)]
        quiet.dtime = (t, low)
        quiet.state[:] = x
        steps = quiet.propagate_until(end)[3]
        self._work.steps += steps
        self._work.rhs += steps
        t, low = quiet.dtime
        point = tuple(quiet.state.tolist())
        below = tuple(k for k, g in enumerate(model.guard) if not model.guards[k].rising_only and g(t, *point)[0] < 0.0)
        if below or t >= until:
            return Stop("event" if below else "horizon", t, low, point, below)
        return self._propagate(t, low, point, until)


@dataclass(frozen=True)
class HeyokaTaylor(Adapter):
    """heyoka's adaptive Taylor integrator, called for one smooth mode after another.

    Preparing compiles every mode that a first run visits. Counts: ``steps`` are Taylor steps (those cut by an event
    included). heyoka evaluates a Taylor expansion and all events once per step; ``rhs_evaluations`` (expansions) and
    ``event_evaluations`` (event polynomials, one per guard) are computed from the steps.
    """

    restart: Restart = field(default="offset", kw_only=True)
    fast_math: bool = False
    """heyoka's option ``fast_math``, which lets the compiler reorder sums (heyoka's default is off)."""
    cooldown: Literal["none", "automatic"] = "none"
    """Time for which heyoka ignores an event after its root: zero, or deduced by heyoka from the tolerance and the
    event's slope (``automatic``; it may last into the next visit of the mode)."""
    mode = _Mode
    landing = "taylor"
    distribution = "heyoka"
    located = (4.0, 0.0)
    warm_up = True

    def load(self) -> Any:
        import heyoka

        # heyoka writes its warnings directly to the standard output of the process.
        heyoka.set_logger_level_error()
        return heyoka

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """Return heyoka's only tolerance, at least rounding, as relative and absolute error."""
        return max(rtol, EPSILON), max(rtol, EPSILON)

    loosened = scouting


def to_heyoka(expression: sp.Expr, variables: Mapping[sp.Symbol, Any]) -> Any:
    """Convert an expression in time and symbols to heyoka; ``variables`` maps the symbols to heyoka's expressions.

    heyoka's ``from_sympy`` refuses rationals whose denominator is not a power of two. This function rounds every
    constant subexpression to one double, as for all other libraries. UnsupportedError if heyoka has no such function.
    """
    import heyoka as hy

    def number(value: sp.Expr) -> Any:
        return hy.expression(float(value))

    def product(e: sp.Expr, walk: Walk[Any]) -> Any:
        above, below = fraction(e)
        numerator = hy.prod(list(map(walk, above))) if above else number(sp.Integer(1))
        return numerator / hy.prod(list(map(walk, below))) if below else numerator

    def power(e: sp.Expr, walk: Walk[Any]) -> Any:
        if e.base == sp.E:
            return hy.exp(walk(e.exp))
        if e.exp.is_Rational and e.exp.is_negative:
            return number(sp.Integer(1)) / walk(sp.Pow(e.base, -e.exp))
        base = walk(e.base)
        if e.exp.is_Integer:
            return whole_power(base, int(e.exp))
        if e.exp == sp.Rational(1, 2):
            return hy.sqrt(base)
        return base ** (float(e.exp) if e.exp.is_number else walk(e.exp))

    def whole_power(base: Any, n: int) -> Any:
        # heyoka expands x**3 by a recurrence that divides by x. At x = 0 the result is NaN and events on it are lost;
        # near 0 the steps are short. Products and squares avoid both.
        if n == 1:
            return base
        return whole_power(base, n - 1) * base if n % 2 else whole_power(base, n // 2) ** 2.0

    def function(e: sp.Expr, walk: Walk[Any]) -> Any:
        name = e.func.__name__
        if name not in ELEMENTARY:
            raise UnsupportedError(f"heyoka has no {name}")
        return getattr(hy, name)(walk(e.args[0]))

    rules = Rules(number, lambda e, walk: hy.sum(list(map(walk, e.args))), product, power, function)
    return fold(rounded(expression), rules, {TIME: hy.time, **variables})


HEYOKA = HeyokaTaylor("heyoka")
HEYOKA_FAST_MATH = HeyokaTaylor("heyoka+fastmath", fast_math=True)
