"""Runge-Kutta method of order 4 with a fixed step for one mode: the compiled loop, and Hénon's landing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.baselines.paper import ffi, lib, rows
from henon_ref.expressions.bounds import double_double
from henon_ref.jit.ir_writer import declarations
from henon_ref.jit.native_module import NativeModule
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.tape import TIME, Tape, build_tape

Floats = NDArray[np.float64]

STEEP = 0.5
"""Hénon's swap is used if the guard's rate changes by at most this ratio over the swap; else the root is bracketed."""
EVENT, NOT_FINITE, NO_GUARD = lib.RK4_EVENT, lib.RK4_NOT_FINITE, lib.RK4_NO_GUARD
"""Reasons for which the compiled loop ends before its last step."""


class Kernel:
    """Equations of one mode.

    The loop and its steps are C code for all systems (``rk4.c``); field and guards are machine code generated from the
    tape. Landings use plain Python functions, because they are too rare to be worth a compilation. ModelError if the
    mode has no equations.
    """

    def __init__(self, system: FilippovSystem, mode: Mode) -> None:
        # Signs are inserted as exact numbers; with floats, 1 - s would leave rounding instead of zero.
        equations = system.equations(mode)
        self.guards: tuple[Guard, ...] = equations.guards
        """Guards: surfaces in slip, followed by releases, followed by ``valid``."""
        # A mode without guards still requires one column.
        expressions = [g.expression for g in equations.guards] or [sp.Integer(1)]
        self.rising_only = np.array([g.rising_only for g in equations.guards] or [False])
        """Whether each guard may start negative."""
        n = len(system.states)
        tapes = [build_tape(system.states, (), part) for part in (equations.field, expressions)]
        names = ("field", "guards")
        parts = [expansion_ir(tape, n, 0, name) for tape, name in zip(tapes, names, strict=True)]
        self._code = NativeModule(declarations() + "".join(parts))
        self._constants = [_numbers(system, tape) for tape in tapes]
        self._mode = ffi.new(
            "struct rk4_mode *",
            [
                *(n, len(expressions)),
                *(ffi.cast("rk4_values", self._code.address(name)) for name in names),
                *map(rows, self._constants),
                rows(self.rising_only, "uint8_t"),
            ],
        )
        self._states, self._room = n, 4 * n + len(expressions)
        along = list(zip(system.states, equations.field, strict=True))
        rates = [sp.diff(e, TIME) + sp.Add(*(sp.diff(e, x) * f for x, f in along)) for e in expressions]
        self.field = _function(system, equations.field)
        """Time derivatives of the states as a function of (t, x)."""
        self.rates = _function(system, rates)
        """Time derivatives of the guards as a function of (t, x)."""

    def step(self, t: float, x: Floats, h: float, out: Floats) -> None:
        """Take one step from (t, x) and write the state to ``out``."""
        lib.rk4_step(self._mode, rows(np.empty(self._room)), t, rows(x), h, rows(out))

    def values(self, t: float, x: Floats) -> list[float]:
        """Return the guards at (t, x)."""
        found = np.empty(self._room)
        lib.rk4_guards(self._mode, t, rows(x), rows(found))
        return found[self._states : self._states + self._mode.guards].tolist()

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
        """Take the steps ``steps[0]`` to ``steps[1]`` of length ``h``, counted from time ``base`` (``rk4_advance``).

        Return the number of steps done, the number of samples filled, and the reason of the end. At an event, ``x`` is
        the state before the step that crossed a guard, and ``new`` the state after the step.
        """
        room = np.empty(self._room)
        state = rows(x), rows(new), rows(armed, "uint8_t"), rows(wanted)
        given = ffi.new("struct rk4_steps *", [base, h, *steps, *state, wanted.size, rows(samples), filled, rows(room)])
        code = lib.rk4_advance(self._mode, given)
        return given.first, given.filled, code


def _numbers(system: FilippovSystem, tape: Tape) -> Floats:
    """Return the constants rounded to double, followed by their rounding remainders."""
    pairs = [double_double(system.numeric(c)) for c in tape.constants]
    return np.array([p[0] for p in pairs] + [p[1] for p in pairs] or [0.0])


def _function(system: FilippovSystem, expressions: Sequence[sp.Expr]) -> Callable[..., tuple[float, ...]]:
    """Return a function of (t, x) that returns a tuple of floats; Python's parser rounds every number once."""
    x = sp.DeferredVector("x")
    places = {symbol: x[i] for i, symbol in enumerate(system.states)}
    rounded = [sp.N(system.numeric(e).xreplace(places), 25) for e in expressions]
    function: Callable[..., tuple[float, ...]] = sp.lambdify((TIME, x), tuple(rounded), "math", cse=True)
    return function


def crossed_guards(kernel: Kernel, t: float, x: Floats, armed: NDArray[np.bool_]) -> list[int]:
    """Return the guards that the step ending at (t, x) has crossed, by the same test as in the compiled loop."""
    values = kernel.values(t, x)
    return [
        i for i, g in enumerate(values) if (g < 0 and (armed[i] or not kernel.rising_only[i])) or (g == 0 and armed[i])
    ]


def land(kernel: Kernel, which: int, t: float, x: Floats, new: Floats, h: float) -> tuple[float, Floats, str] | None:
    """Land the step from (t, x) to (t + h, new), which crossed guard ``which``, on that guard.

    Return the time from the start of the step [s], the state, and the method (``henon`` or ``bracket``).

    Hénon's swap is used if the guard is steep. Otherwise Brent's method finds the step length at which the guard is
    zero; it has order 4, too, and does not divide by the guard's rate. The result is None if the guard is not a number
    on the step.
    """
    swapped = _swapped(kernel, which, t + h, new.tolist())
    if swapped is not None and -h <= swapped[0] <= 0:
        return h + swapped[0], swapped[1], "henon"
    state = np.empty_like(x)

    def along(offset: float) -> float:
        kernel.step(t, x, offset, state)
        return float(kernel.values(t + offset, state)[which])

    # In the first step of a mode the guard may start at zero. Find a point inside the step at which it is positive.
    inside = next((o for o in (0.0, *(h / 2**k for k in range(1, 40))) if along(o) > 0), None)
    try:
        offset = 0.0 if inside is None else brentq(along, inside, h, xtol=1e-16 * h, rtol=1e-15)
    except ValueError:
        return None
    along(offset)
    return offset, state, "bracket"


def _swapped(kernel: Kernel, which: int, t: float, x: list[float]) -> tuple[float, Floats] | None:
    """Take one Runge-Kutta step of length -g with the guard g as the independent variable, Eqs. (14) and (15).

    Return the (negative) time to the landing and the state there. Near a tangency the guard's rate changes too much
    for a division by it, and the result is None.
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
        # Outside a function's domain. Python's power returns a complex number, which cannot be compared.
        return None
    return (total / 6, landed) if steep and np.isfinite(landed).all() else None
