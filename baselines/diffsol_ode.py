"""diffsol by pydiffsol: Tsit45 and BDF with ``stop_i``, each mode a model of its own in DiffSL.

A stop function counts at every change of its sign, whichever the direction, and the result says when the run stopped,
not by which function: that is told here from the guards' values and rates, and where one has risen the run goes on. A
stop function that is exactly zero where a run starts is out of play until it has left zero, as in SUNDIALS; one that
is a rounding below zero and rises stops the run there. Hence the ``offset`` as default
(:mod:`henon_ref.baselines.restart`). Roots are located by a secant method on the step's interpolant to ``100 eps
(abs(t) + abs(h))``; a pair of roots inside one step is not seen.

A whole mode is one call into Rust, so that a deadline is looked at between modes only, and the guards are never called
back: when a run failed is known from the library's message alone, and the state there is not known (the mode's first
one stands for it).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter, ConfiguredLibrary
from henon_ref.baselines.base import SmoothMode
from henon_ref.baselines.diffsl_text import mode_text
from henon_ref.baselines.flow import Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LIFT, Restart
from henon_ref.baselines.work import Work
from henon_ref.modes.callables import ARITHMETIC

STAGES = 6
"""Right-hand sides of a step of Tsit45: seven stages, of which the first is the last of the step before."""

SHORTEST = 1e-13
"""diffsol's own shortest step, below which a run fails [s]: its estimate of a first step from a state that is nearly
zero is shorter. What the horizon's rounding is longer than would not advance."""
KEPT = 64
"""Compiled modes that a process keeps: more than a system visits."""


@dataclass(frozen=True)
class DiffsolOde(Adapter):
    """``pydiffsol.Ode.solve`` on one smooth mode after another, dense matrices, derivatives by Enzyme.

    Counts: ``steps`` are accepted steps; ``rhs_evaluations`` are those of Tsit45's accepted steps (diffsol does not
    count: of BDF nothing is known, 0); ``event_evaluations`` one a guard and accepted step.
    """

    method: Literal["tsit45", "bdf"]
    restart: Restart = field(default="offset", kw_only=True)
    landing = "secant"
    distribution = "pydiffsol"
    extra = "peers"

    def load(self) -> Any:
        """The module."""
        import pydiffsol

        return pydiffsol

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """An explicit method's first step is as exact as it is short."""
        return super().start_errors(rtol, atol) if self.method == "bdf" else (EPSILON, 0.0)

    def location_error(self, t: float) -> float:
        """``100 eps (abs(t) + abs(h))``; the step h is not known here."""
        return 100.0 * EPSILON * abs(t)

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, library, model, work, horizon)


class _Flow(SmoothMode):
    """diffsol on one mode."""

    def __init__(
        self, adapter: DiffsolOde, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float
    ) -> None:
        super().__init__(library, model, work, horizon)
        self._ode = _compiled(library.module, adapter.method, mode_text(model))
        self._tolerances = library.rtol, library.atol
        self._stages = STAGES if adapter.method == "tsit45" else 0

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """See :class:`henon_ref.baselines.base.SmoothMode`."""
        begin, start = t, x
        while True:
            try:
                times, rows = self._solve(t, x, until)
            except RuntimeError as error:
                told = re.search(r" at time = ([-+.e\d]+)", str(error))
                self.last.value(float(told[1]) if told else t, x)
                return self.failed(f"diffsol: {error}")
            steps = times.size - 1
            self.work.steps += steps
            self.work.rhs += self._stages * steps
            self.work.events += steps * (len(self.model.guards) + 1)
            finite = np.flatnonzero(np.isfinite(rows).all(axis=1))[-1]
            self.last.value(float(times[finite]), rows[finite])
            if finite < steps:
                return self.failed(f"the state is not finite after t = {self.last.t:.17g}")
            t, x = float(times[-1]), rows[-1]
            if t >= until:
                fallen = None
                break
            fallen, risen = self._by_which(t, x)
            if not risen:
                break
            self.work.check()
        stop = self.stopped(t, x, fallen)
        return stop if self.wanted is None else stop._replace(samples=self._sampled(begin, start, stop.t))

    def _solve(self, t: float, x: NDArray[np.float64], until: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times, shape (k,), and unknowns, shape (k, N), of the steps from (t, x) on."""
        lifts, quiet = self.gates.lifts, np.maximum(self.gates.quiet, -1e300)
        self._ode.rtol, self._ode.atol = self._tolerances
        self._ode.options.min_timestep = min(SHORTEST, EPSILON * abs(until))
        self._ode.t0 = t
        self._ode.h0 = min(1.0, until - t)
        solution = self._ode.solve(np.concatenate([x, lifts, quiet]), until)
        return np.asarray(solution.ts), np.asarray(solution.ys).T

    def _by_which(self, t: float, x: NDArray[np.float64]) -> tuple[list[int], bool]:
        """The guard that stopped the run, or no guard and whether one has risen, which is lifted then."""
        model, gates, state = self.model, self.gates, x[: self.states].tolist()
        try:
            rates = model.rates(t, *state)
        except ARITHMETIC:
            return [len(model.guards)], False
        aside = [
            (abs(rates[2 * k] + gates.lifts[k]) / (abs(rates[2 * k + 1]) + 1e-300), k)
            for k in range(len(model.guards))
            if t > gates.quiet[k]
        ]
        if not aside or sum(map(abs, state)) >= 0.5e100:
            return [len(model.guards)], False
        k = min(aside)[1]
        value, rate = rates[2 * k] + gates.lifts[k], rates[2 * k + 1]
        if rate <= 0.0 or gates.policy == "none":
            return [k], False
        gates.lifts[k] += 2.0 * abs(value) + LIFT * EPSILON * model.size(k, t, state, 1.0, 0.0)
        return [], True

    def _sampled(self, t: float, x: NDArray[np.float64], end: float) -> NDArray[np.float64]:
        """States at the wanted times up to the end, from one to the next, by a second pass that counts for nothing."""
        assert self.wanted is not None
        rows = []
        for time in self.wanted[self.wanted <= end].tolist():
            if time > t:
                t, x = time, self._solve(t, x, time)[1][-1]
            rows.append(x[: self.states])
        return np.array(rows).reshape(-1, self.states)


@lru_cache(maxsize=KEPT)
def _compiled(module: Any, method: str, text: str) -> Any:
    """The ``Ode`` of one mode, compiled once for all tolerances and restarts; every solve sets what it depends on."""
    return module.Ode(text, ode_solver=getattr(module, method))


TSIT45 = DiffsolOde("diffsol-tsit45", "tsit45")
BDF = DiffsolOde("diffsol-bdf", "bdf")
