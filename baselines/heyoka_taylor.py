"""heyoka: Taylor integration with terminal events, one compiled integrator a mode.

What heyoka does with a root at its starting point: without a direction an event that is exactly zero there
stops the integrator at once; with a direction it does not, but then the next true root of the step is lost
(x = 0, v = 1, a = -1, falling: the root at t = 2 is never reported). A guard that starts one rounding
above zero is treated rightly. Hence the ``offset`` as default: the fresh guard is lifted by a few roundings
of its terms through a heyoka parameter, which costs no step and makes its next root late by that lift over
the guard's rate, about one rounding of the state over its rate. heyoka finds a root on the guard's Taylor
polynomial, so at a loose tolerance a tangential release is a little early or late and the guard may first fall
by the square of that: the lift then covers this, too. ``event-free-step`` takes a short step
with a second integrator without events; ``direction`` and ``none`` show what happens without either.

An exact double root inside a step is not seen. A root very early in a long step (a ballistic return within 1e-4
of the step) is now and then lost with the guard's start: where such a guard is then below zero, the start is done
again with an event-free step. heyoka keeps its time as two doubles, and so do the
transitions here (``time_low``). heyoka has one tolerance: it gets ``rtol``; ``atol`` is not used. Which of its
documentation's advice is followed: ``docs/solvers.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter, ConfiguredLibrary
from henon_ref.baselines.flow import LIMIT, Stop
from henon_ref.baselines.heyoka_expressions import to_heyoka
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LEAST, LIFT, SPAN, Fresh, Restart, dips, lift, quiet_until
from henon_ref.baselines.scipy_ivp import scouting
from henon_ref.baselines.work import Work
from henon_ref.jit.processor_time import compiling
from henon_ref.modes.callables import ARITHMETIC

CHUNK = 4096
"""Steps between two looks at the clock and at the size of the state."""
COMPACT = 20
"""From so many states on heyoka compiles in compact mode (shorter compilation, slower steps)."""
OUTCOMES = -(2**32)
"""heyoka's own outcomes lie at and below this; terminal events, as -index - 1, above."""
LOST = 1e3
"""A guard below zero by so many times what the tolerance makes of it has been stepped over."""
TIME_LIMIT = OUTCOMES - 3
"""``taylor_outcome.time_limit``: the end of the interval was reached."""


@dataclass(frozen=True)
class HeyokaTaylor(Adapter):
    """heyoka's adaptive Taylor integrator on one smooth mode after another.

    Preparing compiles every mode that a first run visits. Counts: ``steps`` are Taylor steps (those cut off
    by an event too); heyoka evaluates a Taylor expansion and all events once a step, so
    ``rhs_evaluations`` (expansions) and ``event_evaluations`` (event polynomials, one guard each) follow.
    """

    restart: Restart = field(default="offset", kw_only=True)
    fast_math: bool = False
    """Let the compiler reorder sums (heyoka's own switch, off by default there too)."""
    cooldown: Literal["none", "automatic"] = "none"
    """How long an event is ignored after it: not at all, or as long as heyoka deduces from the tolerance and the
    event's slope, into the next visit of the mode."""
    landing = "taylor"
    distribution = "heyoka"
    warm_up = True

    def load(self) -> Any:
        """The module."""
        import heyoka

        # heyoka's warnings go to the standard output of the process, past Python.
        heyoka.set_logger_level_error()
        return heyoka

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """heyoka has one tolerance, and no step is more accurate than rounding."""
        return max(rtol, EPSILON), max(rtol, EPSILON)

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """A Taylor expansion starts exactly at its state."""
        return EPSILON, 0.0

    loosened = scouting

    def location_error(self, t: float) -> float:
        """Rounding of the time."""
        return 4.0 * EPSILON * abs(t)

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, library, model, work, horizon)


class _Integrators:
    """heyoka's integrator, with and without events, of one mode or of all that have their equations in common.

    Parameters
    ----------
    solver, library
        heyoka and its options.
    states : sequence of Symbol
    field, guards : sequences of Expr
    switches : sequence of Symbol
        Symbols of these that tell modes apart: run-time parameters, behind the guards' lifts.
    """

    def __init__(
        self,
        solver: HeyokaTaylor,
        library: ConfiguredLibrary,
        states: Sequence[sp.Symbol],
        field: Sequence[sp.Expr],
        guards: Sequence[sp.Expr],
        switches: Sequence[sp.Symbol] = (),
    ) -> None:
        hy = library.module
        # heyoka has no events on constants; a guard that never changes never falls either.
        self.moving = [k for k, g in enumerate(guards) if not g.is_number]
        """Guards that are events, by their places."""
        variables = {x: hy.expression(f"x{k}") for k, x in enumerate(states)}
        symbols = variables | {s: hy.par[len(self.moving) + k] for k, s in enumerate(switches)}
        equations = [(variables[x], to_heyoka(f, symbols)) for x, f in zip(states, field, strict=True)]
        options: dict[str, Any] = {
            "tol": library.rtol,
            "fast_math": solver.fast_math,
            "compact_mode": len(equations) >= COMPACT,
        }
        start = [0.0] * len(equations)
        plain = dict(options)
        self._make_quiet = lambda: hy.taylor_adaptive(equations, start, **plain)
        if solver.restart == "event-free-step":
            self.quiet  # noqa: B018 - made on first access
        if self.moving:
            direction = hy.event_direction.any if solver.restart == "none" else hy.event_direction.negative
            # A cooldown of zero: after an event the state goes to another mode, or starts this one afresh.
            cooldown = {"cooldown": 0.0} if solver.cooldown == "none" else {}
            options["t_events"] = [
                hy.t_event(to_heyoka(guards[k], symbols) + hy.par[slot], direction=direction, **cooldown)
                for slot, k in enumerate(self.moving)
            ]
        self.taylor: Any = hy.taylor_adaptive(equations, start, **options)

    @cached_property
    def quiet(self) -> Any:
        """A twin without events, for the event-free step."""
        with compiling():
            return self._make_quiet()


class _Flow:
    """heyoka on one mode."""

    def __init__(
        self, solver: HeyokaTaylor, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float
    ) -> None:
        self._model, self._work, self._horizon = model, work, horizon
        self._policy, self._rtol = solver.restart, library.rtol
        if model.common is None:
            made = _Integrators(solver, library, model.states, model.field_expressions, model.guard_expressions)
        else:
            name, common = (solver.name, solver.restart, solver.cooldown, library.rtol), model.common
            if name not in common.kept:
                common.kept[name] = _Integrators(
                    solver, library, model.states, common.field_expressions, common.guard_expressions, common.symbols
                )
            made = common.kept[name]
        self._switches = model.switches
        guard_of = {row: k for k, row in enumerate(model.rows)}
        self._hit = [guard_of.get(row, -1) for row in made.moving]
        """Of each event the guard of the mode."""
        self._slots = {k: slot for slot, k in enumerate(self._hit) if k >= 0}
        self._guards = len(self._hit)
        self._forgets = self._guards > 0 and solver.cooldown == "none"
        self._made, self._taylor = made, made.taylor
        self._state, self._lifts = self._taylor.state, self._taylor.pars

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        """See :class:`henon_ref.baselines.flow.Flow`."""
        lifted: Sequence[Fresh] = ()
        steps_free = bool(fresh) and self._policy == "event-free-step"
        if fresh and self._policy == "offset":
            lifted = [item for item in fresh if item[0] in self._slots]
            for item in lifted:
                self._lifts[self._slots[item[0]]] = self._lift(item, t, x)
        if not steps_free:
            stop = self._propagate(t, low, x, until)
            for guard, *_ in lifted:
                self._lifts[self._slots[guard]] = 0.0
            steps_free = bool(lifted) and self._is_lost(lifted, stop)
        if steps_free:
            late = self._event_free_step(t, low, x, until, fresh)
            if late.status != "horizon" or late.t >= until:
                return late
            t, low, x = late.t, late.low, late.x
            stop = self._propagate(t, low, x, until)
        return stop if wanted is None else stop._replace(samples=self._sampled(t, low, x, wanted[wanted <= stop.t]))

    def _is_lost(self, lifted: Sequence[Fresh], stop: Stop) -> bool:
        """Whether heyoka has stepped over a root of a guard that it began at: it is below zero without an event."""
        model = self._model
        for guard, speed, _ in lifted:
            if guard in stop.hits or model.guards[guard].rising_only:
                continue
            try:
                value = model.guard[guard](stop.t, *stop.x)[0]
            except ARITHMETIC:
                continue
            if value < -LOST * (
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
            if code == TIME_LIMIT:
                return Stop("horizon", now, rest, point)
            if now - t <= 4.0 * EPSILON * abs(now):
                return Stop("failed", now, rest, point, reason=f"heyoka does not advance from t = {now:.17g}")
            t, low, x = now, rest, point
            work.check()

    def _sampled(self, t: float, low: float, x: Sequence[float], times: NDArray[np.float64]) -> NDArray[np.float64]:
        """States at some times by a second pass, with heyoka's continuous output."""
        if not times.size:
            return np.empty((0, len(x)))
        self._begin(t, low, x)
        output = self._taylor.propagate_until(float(times[-1]), c_output=True)[4]
        # heyoka hands out the same array every time.
        return np.array([output(time).copy() for time in times.tolist()])

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
        """Where in the last step the state passes the limit, by bisection on the step's polynomial."""
        while (middle := 0.5 * (inside + beyond)) not in (inside, beyond):
            if max(map(abs, self._taylor.update_d_output(middle).tolist())) > LIMIT:
                beyond = middle
            else:
                inside = middle
        return Stop("diverged", beyond, 0.0, tuple(self._taylor.update_d_output(beyond).tolist()))

    def _lift(self, item: Fresh, t: float, x: Sequence[float]) -> float:
        guard, speed, rate = item
        slopes = self._model.slopes(guard)
        if slopes.constants is None or dips(speed, rate):
            return lift(self._model, item, t, x, self._horizon)
        size = speed * SPAN * self._horizon
        for k, slope in zip(slopes.places, slopes.constants, strict=True):
            size += abs(slope * x[k])
        return max(LIFT * EPSILON * size, LEAST)

    def _event_free_step(self, t: float, low: float, x: Sequence[float], until: float, fresh: Sequence[Fresh]) -> Stop:
        """A first step with the twin that has no events; an event, late, where a guard ends it below zero."""
        model, quiet = self._model, self._made.quiet
        levels = [model.size(guard, t, x, self._rtol, self._rtol) for guard, *_ in fresh]
        end = min(max(quiet_until(model, fresh, t, x, levels, 1e-3 * self._horizon)), until)
        if self._switches:
            quiet.pars[self._guards :] = self._switches
        quiet.dtime = (t, low)
        quiet.state[:] = x
        steps = quiet.propagate_until(end)[3]
        self._work.steps += steps
        self._work.rhs += steps
        t, low = quiet.dtime
        point = tuple(quiet.state.tolist())
        below = tuple(k for k, g in enumerate(model.guard) if not model.guards[k].rising_only and g(t, *point)[0] < 0.0)
        return Stop("event" if below else "horizon", t, low, point, below)


HEYOKA = HeyokaTaylor("heyoka")
HEYOKA_FAST_MATH = HeyokaTaylor("heyoka+fastmath", fast_math=True)
