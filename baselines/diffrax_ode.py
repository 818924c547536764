"""diffrax: Dopri8 and Kvaerno5 with ``diffrax.Event``, one compiled solve a mode.

diffrax compares the sign of each condition function at the ends of a step and, where one has changed, seeks its root
on the step's dense output. Three things follow, each shown in :mod:`henon_ref.baselines.causes.diffrax_events`: of
several conditions that change in one step the first in their list counts, not the first in time; from the step's end
Newton's method, the "typical choice" of its page, goes to the last root of the step; a condition that is zero where a
run starts stops it there, or, with a direction, loses its root in the first step. So the guards are one condition here,
their minimum, the root finder is bisection within the step, the direction is downwards, and the guard of a surface just
left starts clearly positive (``offset``, :mod:`henon_ref.baselines.restart`). (Bisection takes one condition only.) A
guard that is negative where its mode begins is watched for its rise first, then for its fall.

Kvaerno5's dense output is a cubic: its event times are less accurate than its steps. A pair of roots inside one step
is not seen.

The vector field and the guards are jax functions of the parameters, too: a mode is traced and compiled (four to eight
seconds) once a process for all parameter values and tolerances; that time is ``compile_s``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter, ConfiguredLibrary
from henon_ref.baselines.base import SmoothMode
from henon_ref.baselines.flow import LIMIT, Stop
from henon_ref.baselines.jax_functions import ModeSource, jax_function, mode_source
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LEAST, Restart
from henon_ref.baselines.scipy_ivp import scouting
from henon_ref.baselines.work import Work
from henon_ref.modes.callables import ARITHMETIC

MAX_STEPS = 4096
"""Steps between two looks at the clock (diffrax's own default for ``max_steps``)."""
STAGES = 13
"""Right-hand sides of a step of Dopri8: 14 stages, of which the first is the last of the step before."""
DENSE_OUTPUT = 64.0
"""Roundings of a time that the dense output makes of a root: on x' = 1 it is found 1.4e-14 from t = 1."""
SCALE = 1e-100
"""Of the condition: bisection ends only where the condition, too, is below its absolute tolerance, which is one of
time here."""


@dataclass(frozen=True)
class DiffraxOde(Adapter):
    """``diffrax.diffeqsolve`` on one smooth mode after another, in double precision on the processor.

    Counts: ``steps`` are accepted steps; ``rhs_evaluations`` are counted for Dopri8, 13 a step, rejected ones too
    (diffrax does not count, and of Kvaerno5's iterations nothing is known: 0); ``event_evaluations`` one a guard and
    accepted step, those of the root finder not counted.
    """

    method: Literal["Dopri8", "Kvaerno5"]
    restart: Restart = field(default="offset", kw_only=True)
    landing = "bisection"
    distribution = "diffrax"
    extra = "peers"

    def load(self) -> Any:
        """jax, diffrax and optimistix."""
        import diffrax
        import jax
        import optimistix

        jax.config.update("jax_enable_x64", True)
        jax.config.update("jax_platforms", "cpu")
        # A run's processor time is that of its own thread.
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        return SimpleNamespace(jax=jax, diffrax=diffrax, optimistix=optimistix)

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """An explicit method's first step is as exact as it is short."""
        return super().start_errors(rtol, atol) if self.method == "Kvaerno5" else (EPSILON, 0.0)

    loosened = scouting

    def location_error(self, t: float) -> float:
        """Rounding of the dense output whose root is sought: more than the tolerances of the root finder."""
        return DENSE_OUTPUT * EPSILON * (1.0 + abs(t))

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, library, model, work, horizon)


class _Flow(SmoothMode):
    """diffrax on one mode."""

    def __init__(
        self, adapter: DiffraxOde, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float
    ) -> None:
        super().__init__(library, model, work, horizon)
        self._stages = STAGES if adapter.method == "Dopri8" else 0
        source, values = mode_source(model)
        self._solve = _compiled(library.module, adapter.method, adapter.restart == "none", source)
        self._numbers = np.array(values, dtype=float)
        self._tolerances = np.array([library.rtol, library.atol])

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """See :class:`henon_ref.baselines.base.SmoothMode`."""
        begin, start = t, x
        self._lift(t, x)
        signs = self._unarmed(t, x)
        while True:
            try:
                solved = self._run(t, x, until, signs)
            except RuntimeError as error:  # raised out of compiled code, with its traceback as text
                return self.failed(f"diffrax: {_said(error)}")
            self.last.value(solved.t, solved.x)
            risen = [k for k in solved.fallen if signs[k] < 0]
            if risen:
                signs[risen] = 1.0
            elif solved.event or solved.arrived:
                stop = self.stopped(solved.t, solved.x, solved.fallen if solved.event else None)
                break
            elif not solved.more:
                return self.failed(f"diffrax: {solved.words}")
            if not risen and solved.t - t <= 4.0 * EPSILON * abs(solved.t):
                return self.failed(f"diffrax does not advance from t = {t:.17g}")
            t, x = solved.t, solved.x
            self.work.check()
        return stop if self.wanted is None else stop._replace(samples=self._sampled(begin, start, stop.t))

    def _lift(self, t: float, x: NDArray[np.float64]) -> None:
        """Lift a guard that was left and still reads no more than zero, as one of the time alone may by its rounding.

        A minimum that is negative already falls no more: the roots of all others would be lost with it.
        """
        lifts = self.gates.lifts
        for k, guard in enumerate(self.model.guards):
            if lifts[k] > 0.0 and not guard.rising_only and (value := self._value(k, t, x)) <= 0.0:
                lifts[k] += LEAST - 2.0 * value

    def _unarmed(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """-1 for a guard that has yet to rise, whose negative is watched until it has; 1 for all others."""
        signs = np.ones(len(self.model.guards) + 1)
        for k, guard in enumerate(self.model.guards):
            if guard.rising_only and (t <= self.gates.quiet[k] or self._value(k, t, x) <= 0.0):
                signs[k] = -1.0
        return signs

    def _value(self, k: int, t: float, x: NDArray[np.float64]) -> float:
        try:
            return self.model.guard[k](t, *x[: self.states].tolist())[0] + self.gates.lifts[k]
        except ARITHMETIC:
            return -1.0

    def _run(self, t: float, x: NDArray[np.float64], until: float, signs: NDArray[np.float64]) -> SimpleNamespace:
        gates, n, count = self.gates, len(x), len(self.model.guards)
        watch = np.array([signs[:-1], gates.lifts, gates.quiet])
        packed, result = self._solve(float(t), x, float(until), self._numbers, watch, self._tolerances)
        row = np.asarray(packed)
        steps, tried = int(row[-2]), int(row[-1])
        self.work.steps += steps
        self.work.rhs += self._stages * tried
        self.work.events += (count + 1) * steps
        event, arrived, more = (bool(flag) for flag in row[-5:-2])
        values = row[n + 1 : n + 2 + count]
        return SimpleNamespace(
            t=float(row[0]),
            x=row[1 : n + 1],
            event=event,
            arrived=arrived,
            more=more,
            fallen=[self._nearest(values, float(row[0]), row[1 : n + 1])] if event else [],
            words="" if event or arrived or more else str(result),
        )

    def _nearest(self, values: NDArray[np.float64], t: float, x: NDArray[np.float64]) -> int:
        """The guard whose root is nearest in time, of those that were watched: the last one is that of divergence.

        Where the minimum's root is located to a rounding, a slow guard may read less than the one that falls.
        """
        try:
            rates = np.abs(self.model.rates(t, *x[: self.states].tolist())[1::2])
        except ARITHMETIC:
            return int(np.argmin(values))
        return int(np.argmin(np.append(values[:-1] / np.maximum(rates, LEAST), np.sign(values[-1]) * np.inf)))

    def _sampled(self, t: float, x: NDArray[np.float64], end: float) -> NDArray[np.float64]:
        """States at the wanted times up to the end, from one to the next, by a second pass that counts for nothing."""
        assert self.wanted is not None
        work, rows, signs = self.work, [], self._unarmed(t, x)
        kept = work.steps, work.rhs, work.events
        for time in self.wanted[self.wanted <= end].tolist():
            if time > t:
                solved = self._run(t, x, time, signs)
                t, x = time, solved.x
            rows.append(x[: self.states])
        work.steps, work.rhs, work.events = kept
        return np.array(rows).reshape(-1, self.states)


def _said(error: RuntimeError) -> str:
    """What Equinox's check says within jax's message; else that message's first line."""
    found = re.search(r"EquinoxRuntimeError: (.+)", str(error))
    return found[1] if found else str(error).partition("\n")[0]


_SOLVES: dict[tuple[str, bool, ModeSource], Any] = {}
"""Compiled solves of this process."""


def _compiled(module: Any, method: str, either: bool, source: ModeSource) -> Any:
    """``solve(t, x, until, numbers, watch, tolerances)`` of one mode, compiled once."""
    key = (method, either, source)
    if key not in _SOLVES:
        jax, n = module.jax, len(source.unknowns)
        shapes = [(), (n,), (), (len(source.numbers),), (3, len(source.guards)), (2,)]
        wanted = [jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes]
        _SOLVES[key] = jax.jit(_solve(module, method, either, source)).lower(*wanted).compile()
    return _SOLVES[key]


def _solve(module: Any, method: str, either: bool, source: ModeSource) -> Any:
    """The same, to be traced by jax: the end of the solve as one array, and diffrax's result.

    ``watch`` holds each guard's sign, lift, and the time up to which it reads 1, shape (3, m). The array holds time,
    unknowns, the guards so watched, the guard against divergence, then whether an event stopped it, whether it arrived
    at the horizon, whether its steps were used up, accepted steps, steps.
    """
    diffrax, jnp = module.diffrax, module.jax.numpy
    rates, guards = jax_function(source, source.right), jax_function(source, source.guards)
    states = source.states
    finder = module.optimistix.Bisection(4.0 * EPSILON, 4.0 * EPSILON, flip="detect" if either else True)

    def watched(t: Any, x: Any, numbers: Any, watch: Any) -> Any:
        signs, lifts, quiet = watch
        values = jnp.where(t <= quiet, 1.0, signs * (guards(t, x, numbers) + lifts))
        return jnp.append(values, LIMIT - jnp.sum(jnp.abs(x[:states])))

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
            event=diffrax.Event(
                lambda t, y, args, **_: SCALE * jnp.min(watched(t, y, *args)), finder, None if either else False
            ),
            max_steps=MAX_STEPS,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        end, y, results = solution.ts[0], solution.ys[0], diffrax.RESULTS
        flags = [solution.result == r for r in (results.event_occurred, results.successful, results.max_steps_reached)]
        counts = [solution.stats["num_accepted_steps"], solution.stats["num_steps"]]
        parts = [end, y, watched(end, y, numbers, watch), jnp.array(flags, dtype=float), jnp.array(counts)]
        return jnp.concatenate([jnp.atleast_1d(part) for part in parts]), solution.result

    return solve


DOPRI8 = DiffraxOde("diffrax-dopri8", "Dopri8")
KVAERNO5 = DiffraxOde("diffrax-kvaerno5", "Kvaerno5")
