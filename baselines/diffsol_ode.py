"""diffsol by pydiffsol: Tsit45 and BDF with ``stop_i``; each mode is a separate model in DiffSL.

A stop function stops the run at every change of its sign, in either direction, and the result does not contain which
function it was. This adapter finds the function from the guards' values and rates, and continues the run if a guard has
risen. A stop function that starts one rounding below zero and rises stops the run at once; therefore the default
restart is ``offset``. Roots are located by a secant method on the step's interpolant.

A whole mode is one call into Rust, without callbacks to Python, so that the deadline is checked only between modes. If
a run fails, its time is taken from the library's message, and the state is the initial state of the mode.
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
from henon_ref.baselines.library import LIMIT, Library, Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LIFT, Restart
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.errors import UnsupportedError
from henon_ref.expressions.traversal import Rules, Walk, fold, fraction
from henon_ref.modes.callables import ARITHMETIC, rounded
from henon_ref.taylor.tape import TIME


class _Mode(SmoothMode):
    """One mode on diffsol."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        self._ode = _compiled(library.module, library.solver.method, mode_text(model))
        self._tolerances = library.rtol, library.atol
        # Right-hand sides per step of Tsit45: seven stages, the first of which is the last of the step before.
        self._stages = 6 if library.solver.method == "tsit45" else 0

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        while True:
            try:
                times, rows = self._solve(t, x, until)
            except RuntimeError as error:
                time = re.search(r" at time = ([-+.e\d]+)", str(error))
                self.divergence(float(time[1]) if time else t, x)
                return self.failed(f"diffsol: {error}")
            steps = times.size - 1
            self.work.steps += steps
            self.work.rhs += self._stages * steps
            self.work.events += steps * (len(self.model.guards) + 1)
            finite = np.flatnonzero(np.isfinite(rows).all(axis=1))[-1]
            self.divergence(float(times[finite]), rows[finite])
            if finite < steps:
                return self.failed(f"the state is not finite after t = {self.last[0]:.17g}")
            t, x = float(times[-1]), rows[-1]
            if t >= until:
                return self.stopped(t, x)
            fallen = self._by_which(t, x)
            if fallen is not None:
                return self.stopped(t, x, [fallen])
            self.work.check()

    def _solve(self, t: float, x: NDArray[np.float64], until: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return times, shape (k,), and unknowns, shape (k, N), of the steps from (t, x)."""
        lifts, quiet = self.lifts, np.maximum(self.quiet, -1e300)
        self._ode.rtol, self._ode.atol = self._tolerances
        # A step shorter than 1e-13 s (diffsol's default) makes the run fail; the first step from a state near zero may
        # be shorter.
        self._ode.options.min_timestep = min(1e-13, EPSILON * abs(until))
        self._ode.t0 = t
        self._ode.h0 = min(1.0, until - t)
        solution = self._ode.solve(np.concatenate([x, lifts, quiet]), until)
        return np.asarray(solution.ts), np.asarray(solution.ys).T

    def _by_which(self, t: float, x: NDArray[np.float64]) -> int | None:
        """Find the guard that stopped the run by falling; None if it rose.

        A guard that rose is lifted, so that the continued run does not stop at the same root.
        """
        model, lifts, state = self.model, self.lifts, x[: self.states].tolist()
        try:
            rates = model.rates(t, *state)
        except ARITHMETIC:
            return len(model.guards)
        aside = [
            (abs(rates[2 * k] + lifts[k]) / (abs(rates[2 * k + 1]) + 1e-300), k)
            for k in range(len(model.guards))
            if t > self.quiet[k]
        ]
        if not aside or sum(map(abs, state)) >= 0.5e100:
            return len(model.guards)
        k = min(aside)[1]
        value, rate = rates[2 * k] + lifts[k], rates[2 * k + 1]
        if rate <= 0.0 or self.root_direction == 0:
            return k
        lifts[k] += 2.0 * abs(value) + LIFT * EPSILON * model.size(k, t, state, 1.0, 0.0)
        return None


@lru_cache(maxsize=64)  # a system visits fewer modes
def _compiled(module: Any, method: str, text: str) -> Any:
    """Compile the ``Ode`` of one mode; tolerances and start are set at every solve."""
    return module.Ode(text, ode_solver=getattr(module, method))


def mode_text(model: ModeFunctions) -> str:
    """Return one mode in DiffSL, with its guards as stop functions.

    The inputs of the model are the initial unknowns and, for each guard, a lift and a time up to which the stop
    function is 1. The last stop function is the guard against divergence, 1e100 minus the sum of abs(x).
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
    """Format a double for DiffSL: digits and a point, a lower-case e, a negative number in parentheses."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def to_diffsl(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """Convert an expression in time and the unknowns to DiffSL; UnsupportedError if DiffSL has no such function.

    ``names`` are the unknowns' names in the text.
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
        if e.exp.is_Integer and int(e.exp) <= 4:  # the derivative of a product has a value at zero
            return "(" + " * ".join([base] * int(e.exp)) + ")"
        if e.exp == sp.Rational(1, 2):
            return f"sqrt({base})"
        return f"pow({base}, {walk(e.exp)})"

    def function(e: sp.Expr, walk: Walk[str]) -> str:
        # DiffSL (https://martinjrobins.github.io/diffsl/functions.html) cannot differentiate inverse trigonometric
        # functions, acosh and atanh. Its tan aborts the process (Enzyme does not support LLVM's intrinsic).
        name, inner = e.func.__name__, walk(e.args[0])
        if name == "tan":
            return f"(sin({inner}) / cos({inner}))"
        if name not in ("sin", "cos", "sinh", "cosh", "tanh", "exp", "log"):
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
    """``pydiffsol.Ode.solve`` for one smooth mode after another, with dense matrices and derivatives by Enzyme.

    Counts: ``steps`` are accepted steps; ``rhs_evaluations`` are computed from Tsit45's accepted steps (0 for BDF,
    because diffsol returns no counts); ``event_evaluations`` is one per guard and accepted step.
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
        return self.method == "bdf"


TSIT45 = DiffsolOde("diffsol-tsit45", "tsit45")
BDF = DiffsolOde("diffsol-bdf", "bdf")
