"""Fixed-step Runge-Kutta of order 4 for one mode: the compiled loop, and Hénon's landing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.jit.calls import call_expand
from henon_ref.jit.ir_writer import declarations
from henon_ref.jit.native_module import NativeModule
from henon_ref.jit.njit import inner, njit
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.tape import TIME, Tape, build_tape

Floats = NDArray[np.float64]

STEEP = 0.5
"""Hénon's swap is used while the guard's rate stays within this ratio over it; else the root is bracketed."""
DONE, EVENT, NOT_FINITE, NO_GUARD = 0, 1, 2, 3
"""How the compiled loop came back."""


class Kernel:
    """Equations of one mode.

    The loop and its steps are compiled once for all systems; the field and the guards are machine code
    written from the tape. What landings need is plain Python: they are too rare to be worth a compilation.

    Raises
    ------
    ModelError
        Where the mode has no equations.
    """

    def __init__(self, system: FilippovSystem, mode: Mode) -> None:
        # Signs go in as exact numbers: as floats, 1 - s would leave rounding where the mode has nothing.
        equations = system.equations(mode)
        self.guards: tuple[Guard, ...] = equations.guards
        """Surfaces in slip first, then releases, then ``valid``."""
        # A mode that nothing ends still needs one column.
        expressions = [g.expression for g in equations.guards] or [sp.Integer(1)]
        self.rising_only = np.array([g.rising_only for g in equations.guards] or [False])
        """Per guard: it may start negative."""
        n = len(system.states)
        tapes = [build_tape(system.states, (), part) for part in (equations.field, expressions)]
        names = ("field", "guards")
        parts = [expansion_ir(tape, n, 0, name) for tape, name in zip(tapes, names, strict=True)]
        self._code = NativeModule(declarations() + "".join(parts))
        self._addresses = np.array([self._code.address(name) for name in names])
        self._constants = tuple(_numbers(system, tape) for tape in tapes)
        self._room = np.zeros(3 * n), np.zeros(n + len(expressions))
        along = list(zip(system.states, equations.field, strict=True))
        rates = [sp.diff(e, TIME) + sp.Add(*(sp.diff(e, x) * f for x, f in along)) for e in expressions]
        self.field = _function(system, equations.field)
        """x' at (t, x)."""
        self.rates = _function(system, rates)
        """Time derivatives of the guards at (t, x)."""

    def step(self, t: float, x: Floats, h: float, out: Floats) -> None:
        """One step from (t, x), written to ``out``."""
        _step(self._addresses, self._constants, self._room, t, x, h, out)

    def values(self, t: float, x: Floats) -> list[float]:
        """The guards at (t, x)."""
        _values(self._addresses, self._constants, self._room, t, x)
        found: list[float] = self._room[1][x.size :].tolist()
        return found

    def advance(
        self,
        base: float,
        steps: tuple[int, int],
        h: float,
        x: Floats,
        armed: NDArray[np.bool_],
        new: Floats,
        wanted: Floats,
        samples: Floats,
        filled: int,
    ) -> tuple[int, int, int]:
        """The compiled loop, :func:`_advance`."""
        done, filled, code = _advance(
            self._addresses, self._constants, self._room, base, *steps, h, x, armed, self.rising_only, new,
            wanted, samples, filled,
        )  # fmt: skip
        return done, filled, code


@dataclass(frozen=True)
class Landing:
    """Where a step that crossed a guard is put."""

    offset: float
    """Time from the start of the step [s]."""
    state: Floats
    how: str
    """``henon`` or ``bracket``."""


def _numbers(system: FilippovSystem, tape: Tape) -> Floats:
    """Constants rounded to double, then what the rounding lost."""
    pairs = [double_double(system.numeric(c)) for c in tape.constants]
    return np.array([p[0] for p in pairs] + [p[1] for p in pairs] or [0.0])


def _function(system: FilippovSystem, expressions: Sequence[sp.Expr]) -> Callable[..., tuple[float, ...]]:
    """``(t, x) -> tuple`` of floats; every number is rounded once, by Python's parser."""
    x = sp.DeferredVector("x")
    places = {symbol: x[i] for i, symbol in enumerate(system.states)}
    rounded = [sp.N(system.numeric(e).xreplace(places), 25) for e in expressions]
    function: Callable[..., tuple[float, ...]] = sp.lambdify((TIME, x), tuple(rounded), "math", cse=True)
    return function


@njit()
def _step(addresses, constants, room, t, x, h, out):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step from (t, x), written to ``out``; time is a state."""
    n, f = x.size, room[0]
    field = addresses[0]
    call_expand(field, t, 0.0, 1.0, x, constants[0], f)  # f: the states, then their rates
    for i in range(n):
        f[2 * n + i] = f[n + i]
        out[i] = x[i] + h / 2 * f[n + i]
    for stage in range(2):
        call_expand(field, t + h / 2, 0.0, 1.0, out, constants[0], f)
        for i in range(n):
            f[2 * n + i] += 2 * f[n + i]
            out[i] = x[i] + (h / 2 if stage == 0 else h) * f[n + i]
    call_expand(field, t + h, 0.0, 1.0, out, constants[0], f)
    for i in range(n):
        out[i] = x[i] + h / 6 * (f[2 * n + i] + f[n + i])


@njit()
def _values(addresses, constants, room, t, x):  # type: ignore[no-untyped-def]
    """Guards at (t, x), into the second room behind the states."""
    call_expand(addresses[1], t, 0.0, 1.0, x, constants[1], room[1])


@inner()
def _is_through(g, armed, rising_only):  # type: ignore[no-untyped-def]
    return (g < 0 and (armed or not rising_only)) or (g == 0 and armed)


@njit()
def _advance(addresses, constants, room, base, first, last, h, x, armed, rising_only, new, wanted, samples, filled):  # type: ignore[no-untyped-def]
    """Steps ``first`` to ``last`` of length ``h``, counted from time ``base`` (so that time does not drift).

    Returns the steps done, the samples filled, and how it came back. At an event ``x`` is the
    state before the step that crossed a guard and ``new`` the one after it.
    """
    n, g = x.size, room[1]
    for k in range(first, last):
        t, after = base + k * h, base + (k + 1) * h
        _step(addresses, constants, room, t, x, h, new)
        for i in range(n):
            if not math.isfinite(new[i]):
                return k, filled, NOT_FINITE
        _values(addresses, constants, room, after, new)
        for i in range(armed.size):
            if _is_through(g[n + i], armed[i], rising_only[i]):
                return k, filled, EVENT
        for i in range(armed.size):
            if math.isnan(g[n + i]):
                return k, filled, NO_GUARD
        while filled < wanted.size and wanted[filled] <= after:
            _step(addresses, constants, room, t, x, wanted[filled] - t, samples[filled])
            filled += 1
        for i in range(armed.size):
            armed[i] = armed[i] or g[n + i] > 0
        for i in range(n):
            x[i] = new[i]
    return last, filled, DONE


def crossed_guards(kernel: Kernel, t: float, x: Floats, armed: NDArray[np.bool_]) -> list[int]:
    """Guards that are through at the end (t, x) of a step; the same test as the compiled loop's."""
    values = kernel.values(t, x)
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
        return float(kernel.values(t + offset, state)[which])

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
    length = -kernel.values(t, np.array(x))[which]
    try:
        first = kernel.rates(t, x)[which]
        shift = total = length / first
        direction = moved = [shift * f for f in kernel.field(t, x)]
        for share, weight in ((0.5, 2), (0.5, 2), (1.0, 1)):
            point = [xi + share * d for xi, d in zip(x, direction, strict=True)]
            at = t + share * shift
            shift = length / kernel.rates(at, point)[which]
            direction = [shift * f for f in kernel.field(at, point)]
            total += weight * shift
            moved = [m + weight * d for m, d in zip(moved, direction, strict=True)]
        landed = np.array([xi + m / 6 for xi, m in zip(x, moved, strict=True)])
        ratio = kernel.rates(t + total / 6, landed.tolist())[which] / first
        steep = STEEP <= ratio <= 1 / STEEP
    except (ArithmeticError, ValueError, TypeError):
        # Outside a function's domain; Python's power makes a complex number of it, which has no order.
        return None
    return (total / 6, landed) if steep and np.isfinite(landed).all() else None
