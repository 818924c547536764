"""Fixed-step Runge-Kutta of order 4 for one mode: the compiled loop, and Hénon's landing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.model.modes import Mode
from henon_ref.model.system import TIME, FilippovSystem, Guard

Floats = NDArray[np.float64]
_compile = numba.njit(error_model="numpy")

STEEP = 0.5
"""Hénon's swap is used while the guard's rate stays within this ratio over it; else the root is bracketed."""
DONE, EVENT, NOT_FINITE, NO_GUARD = 0, 1, 2, 3
"""How the compiled loop came back."""


@dataclass(frozen=True)
class Kernel:
    """Equations of one mode, as functions of (t, x, 0.0)."""

    guards: tuple[Guard, ...]
    """Surfaces in slip first, then releases, then ``valid``."""
    rising_only: NDArray[np.bool_]
    """Per guard: it may start negative."""
    advance: Callable[..., tuple[int, int, int]]
    """The compiled loop of :func:`_advance`."""
    step: Callable[..., None]
    """One compiled step, (t, x, h, out)."""
    values: Callable[..., tuple[float, ...]]
    """Guards, compiled."""
    field: Callable[..., tuple[float, ...]]
    """x'; plain Python, as ``rates``: landings are too rare to be worth a compilation."""
    rates: Callable[..., tuple[float, ...]]
    """Time derivatives of the guards."""


@dataclass(frozen=True)
class Landing:
    """Where a step that crossed a guard is put."""

    offset: float
    """Time from the start of the step [s]."""
    state: Floats
    how: str
    """``henon`` or ``bracket``."""


def build_kernel(system: FilippovSystem, mode: Mode) -> Kernel:
    """Compile one mode.

    Raises
    ------
    ModelError
        Where it has no equations.
    """
    # Signs go in as exact numbers: as floats, 1 - s would leave rounding where the mode has nothing.
    equations = system.equations(mode)
    # A mode that nothing ends still needs one column.
    expressions = [g.expression for g in equations.guards] or [sp.Integer(1)]
    along = list(zip(system.states, equations.field, strict=True))
    rates = [sp.diff(e, TIME) + sp.Add(*(sp.diff(e, x) * f for x, f in along)) for e in expressions]
    field = _function(system, equations.field)
    values = _compile(_function(system, expressions))
    step = _step(_compile(field))
    rising_only = np.array([g.rising_only for g in equations.guards] or [False])
    return Kernel(equations.guards, rising_only, _advance(step, values), step, values, field, _function(system, rates))


def _function(system: FilippovSystem, expressions: Sequence[sp.Expr]) -> Callable[..., tuple[float, ...]]:
    """``(t, x, zero) -> tuple`` of floats; every number is rounded once, by Python's parser."""
    x, zero = sp.DeferredVector("x"), sp.Symbol("zero")
    places = {symbol: x[i] for i, symbol in enumerate(system.states)}
    rounded = [sp.N(system.numeric(e).xreplace(places), 25) for e in expressions]
    # A constant alone would print as an int, and numba wants one type in a tuple.
    rounded = [e + zero if e.is_number else e for e in rounded]
    function: Callable[..., tuple[float, ...]] = sp.lambdify((TIME, x, zero), tuple(rounded), "math", cse=True)
    return function


def _step(field: Callable[..., Any]) -> Callable[..., None]:
    @_compile
    def step(t, x, h, out):  # type: ignore[no-untyped-def]
        """One classical Runge-Kutta step from (t, x), written to ``out``."""
        n = x.size
        k1 = field(t, x, 0.0)
        for i in range(n):
            out[i] = x[i] + h / 2 * k1[i]
        k2 = field(t + h / 2, out, 0.0)
        for i in range(n):
            out[i] = x[i] + h / 2 * k2[i]
        k3 = field(t + h / 2, out, 0.0)
        for i in range(n):
            out[i] = x[i] + h * k3[i]
        k4 = field(t + h, out, 0.0)
        for i in range(n):
            out[i] = x[i] + h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i])

    return step


def _advance(step: Callable[..., None], values: Callable[..., Any]) -> Callable[..., tuple[int, int, int]]:
    @_compile
    def advance(base, first, last, h, x, armed, rising_only, new, wanted, samples, filled):  # type: ignore[no-untyped-def]
        """Steps ``first`` to ``last`` of length ``h``, counted from time ``base`` (so that time does not drift).

        Returns the steps done, the samples filled, and how it came back. At an event ``x`` is the
        state before the step that crossed a guard and ``new`` the one after it.
        """
        for k in range(first, last):
            t, after = base + k * h, base + (k + 1) * h
            step(t, x, h, new)
            for i in range(x.size):
                if not math.isfinite(new[i]):
                    return k, filled, NOT_FINITE
            g = values(after, new, 0.0)
            for i in range(armed.size):
                if (g[i] < 0 and (armed[i] or not rising_only[i])) or (g[i] == 0 and armed[i]):
                    return k, filled, EVENT
            for i in range(armed.size):
                if math.isnan(g[i]):
                    return k, filled, NO_GUARD
            while filled < wanted.size and wanted[filled] <= after:
                step(t, x, wanted[filled] - t, samples[filled])
                filled += 1
            for i in range(armed.size):
                armed[i] = armed[i] or g[i] > 0
            for i in range(x.size):
                x[i] = new[i]
        return last, filled, DONE

    return advance


def crossed_guards(kernel: Kernel, t: float, x: Floats, armed: NDArray[np.bool_]) -> list[int]:
    """Guards that are through at the end (t, x) of a step; the same test as the compiled loop's."""
    values = kernel.values(t, x, 0.0)
    return [
        i for i, g in enumerate(values) if (g < 0 and (armed[i] or not kernel.rising_only[i])) or (g == 0 and armed[i])
    ]


def land(kernel: Kernel, which: int, t: float, x: Floats, new: Floats, h: float) -> Landing | None:
    """Put the step from (t, x) to (t + h, new), which crossed guard ``which``, on that guard.

    Hénon's swap where the guard is steep over it, else a root of the guard along the step bracketed in
    its length (Brent), which stays order 4 and needs no division by the guard's rate; None where the guard
    is not a number on the way.
    """
    swapped = _swapped(kernel, which, t + h, new.tolist())
    if swapped is not None and -h <= swapped[0] <= 0:
        return Landing(h + swapped[0], swapped[1], "henon")
    state = np.empty_like(x)

    def along(offset: float) -> float:
        kernel.step(t, x, offset, state)
        return float(kernel.values(t + offset, state, 0.0)[which])

    # A mode that has just begun starts on its guard: look for a place inside the step where it is positive.
    inside = next((o for o in (0.0, *(h / 2**k for k in range(1, 40))) if along(o) > 0), None)
    try:
        offset = 0.0 if inside is None else brentq(along, inside, h, xtol=1e-16 * h, rtol=1e-15)
    except ValueError:
        return None
    along(offset)
    return Landing(offset, state, "bracket")


def _swapped(kernel: Kernel, which: int, t: float, x: list[float]) -> tuple[float, Floats] | None:
    """One Runge-Kutta step of length -g with the guard g as the independent variable, Eqs. (14) and (15).

    Returns the (negative) time to the landing and the state there, or None where the guard's rate changes
    so much over the step, near a tangency, that dividing by it is no use.
    """
    length = -kernel.values(t, np.array(x), 0.0)[which]
    try:
        first = kernel.rates(t, x, 0.0)[which]
        shift = total = length / first
        direction = moved = [shift * f for f in kernel.field(t, x, 0.0)]
        for share, weight in ((0.5, 2), (0.5, 2), (1.0, 1)):
            point = [xi + share * d for xi, d in zip(x, direction, strict=True)]
            at = t + share * shift
            shift = length / kernel.rates(at, point, 0.0)[which]
            direction = [shift * f for f in kernel.field(at, point, 0.0)]
            total += weight * shift
            moved = [m + weight * d for m, d in zip(moved, direction, strict=True)]
        landed = np.array([xi + m / 6 for xi, m in zip(x, moved, strict=True)])
        ratio = kernel.rates(t + total / 6, landed.tolist(), 0.0)[which] / first
        steep = STEEP <= ratio <= 1 / STEEP
    except (ArithmeticError, ValueError, TypeError):
        # Outside a function's domain; Python's power makes a complex number of it, which has no order.
        return None
    return (total / 6, landed) if steep and np.isfinite(landed).all() else None
