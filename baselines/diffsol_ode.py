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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.library import LIMIT, Library, Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LIFT, Restart
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.baselines.work import Work
from henon_ref.errors import UnsupportedError
from henon_ref.modes.callables import ARITHMETIC, rounded
from henon_ref.taylor.fold import Rules, Walk, fold, fraction
from henon_ref.taylor.tape import TIME

STAGES = 6
"""Right-hand sides of a step of Tsit45: seven stages, of which the first is the last of the step before."""

SHORTEST = 1e-13
"""diffsol's own shortest step, below which a run fails [s]: its estimate of a first step from a state that is nearly
zero is shorter. What the horizon's rounding is longer than would not advance."""
KEPT = 64
"""Compiled modes that a process keeps: more than a system visits."""
FUNCTIONS = ("sin", "cos", "sinh", "cosh", "tanh", "exp", "log")
"""Of DiffSL (https://martinjrobins.github.io/diffsl/functions.html). It has neither the inverse trigonometric functions
nor acosh and atanh under names of its own that it can differentiate; its ``tan`` ends the process (Enzyme does not know
LLVM's intrinsic), so that a tangent is written as a quotient here."""
MOST_FACTORS = 4
"""Up to this whole number a power is written as a product, whose derivative has a value at zero, too."""


class _Mode(SmoothMode):
    """diffsol on one mode."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        self._ode = _compiled(library.module, library.solver.method, mode_text(model))
        self._tolerances = library.rtol, library.atol
        self._stages = STAGES if library.solver.method == "tsit45" else 0

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """See :class:`henon_ref.baselines.smooth_mode.SmoothMode`."""
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
                return self.stopped(t, x)
            fallen, risen = self._by_which(t, x)
            if not risen:
                return self.stopped(t, x, fallen)
            self.work.check()

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


@lru_cache(maxsize=KEPT)
def _compiled(module: Any, method: str, text: str) -> Any:
    """The ``Ode`` of one mode, compiled once for all tolerances and restarts; every solve sets what it depends on."""
    return module.Ode(text, ode_solver=getattr(module, method))


def mode_text(model: ModeFunctions) -> str:
    """One mode with its guards as stop functions.

    Its inputs are the initial unknowns, and for each guard a lift and a time up to which it reads 1. The last stop
    function is the guard against divergence, 1e100 minus the sum of abs(x).
    """
    names = {x: f"x{k}" for k, x in enumerate(model.unknowns)}
    guards = range(len(model.guards))
    inputs = [*(f"a{k} = 0.0" for k in range(len(names)))]
    inputs += [f"{letter}{k} = 0.0" for letter in ("l", "q") for k in guards]
    awake = [f"w{k} {{ heaviside(t - q{k}) }}" for k in guards]
    stops = [f"(1.0 - w{k}) + w{k} * ({to_diffsl(model.guard_expressions[k], names)} + l{k})" for k in guards]
    size = " - ".join([number(LIMIT), *(f"abs(x{k})" for k in range(len(model.states)))])
    parts = [
        _tensor("in_i", inputs),
        _tensor("u_i", [f"{name} = a{k}" for k, name in enumerate(names.values())]),
        *awake,
        _tensor("F_i", [to_diffsl(f, names) for f in model.right]),
        _tensor("stop_i", [*stops, size]),
    ]
    return "\n".join(parts)


def _tensor(name: str, entries: Sequence[str]) -> str:
    return f"{name} {{\n  " + ",\n  ".join(entries) + "\n}"


def number(value: float) -> str:
    """A double as DiffSL reads it: digits and a point, a small e, a sign in parentheses."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def to_diffsl(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """An expression in time and the unknowns, of which these are the names in the text, as DiffSL.

    Raises
    ------
    UnsupportedError
        For a function that DiffSL does not have.
    """

    def product(e: sp.Expr, walk: Walk[str]) -> str:
        above, below = fraction(e)
        numerator = " * ".join(map(walk, above)) or "1.0"
        return f"({numerator}" + "".join(f" / {walk(b)}" for b in below) + ")"

    def power(e: sp.Expr, walk: Walk[str]) -> str:
        if e.base == sp.E:
            return f"exp({walk(e.exp)})"
        if e.exp.is_Rational and e.exp.is_negative:
            return f"(1.0 / {walk(sp.Pow(e.base, -e.exp))})"
        base = walk(e.base)
        if e.exp.is_Integer and int(e.exp) <= MOST_FACTORS:
            return "(" + " * ".join([base] * int(e.exp)) + ")"
        if e.exp == sp.Rational(1, 2):
            return f"sqrt({base})"
        return f"pow({base}, {walk(e.exp)})"

    def function(e: sp.Expr, walk: Walk[str]) -> str:
        name, inner = e.func.__name__, walk(e.args[0])
        if name == "tan":
            return f"(sin({inner}) / cos({inner}))"
        if name not in FUNCTIONS:
            raise UnsupportedError(f"DiffSL has no {name}")
        return f"{name}({inner})"

    rules = Rules(
        number=lambda e: number(float(e)),
        add=lambda e, walk: "(" + " + ".join(map(walk, e.args)) + ")",
        multiply=product,
        power=power,
        function=function,
    )
    return fold(rounded(expression), rules, {TIME: "t", **names})


@dataclass(frozen=True)
class DiffsolOde(Adapter):
    """``pydiffsol.Ode.solve`` on one smooth mode after another, dense matrices, derivatives by Enzyme.

    Counts: ``steps`` are accepted steps; ``rhs_evaluations`` are those of Tsit45's accepted steps (diffsol does not
    count: of BDF nothing is known, 0); ``event_evaluations`` one a guard and accepted step.
    """

    method: Literal["tsit45", "bdf"]
    restart: Restart = field(default="offset", kw_only=True)
    mode = _Mode
    landing = "secant"
    distribution = "pydiffsol"
    module = "pydiffsol"
    extra = "peers"
    located = (100.0, 0.0)  # 100 eps (abs(t) + abs(h)); the step h is not known here

    @property
    def implicit(self) -> bool:  # type: ignore[override]
        """Whether the method is."""
        return self.method == "bdf"


TSIT45 = DiffsolOde("diffsol-tsit45", "tsit45")
BDF = DiffsolOde("diffsol-bdf", "bdf")
