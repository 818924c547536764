"""Fixed-step Runge-Kutta of order 4 for one mode: the compiled loop, and Hénon's landing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from henon_ref.baselines.paper.compiled import ffi, flags, lib, rows
from henon_ref.jit.ir_writer import declarations
from henon_ref.jit.native_module import NativeModule
from henon_ref.modes.bounds import double_double
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.tape import TIME, Tape, build_tape

Floats = NDArray[np.float64]

STEEP = 0.5
"""Hénon's swap is used while the guard's rate stays within this ratio over it; else the root is bracketed."""
EVENT, NOT_FINITE, NO_GUARD = lib.RK4_EVENT, lib.RK4_NOT_FINITE, lib.RK4_NO_GUARD
"""How the compiled loop came back before its last step."""


class Kernel:
    """Equations of one mode.

    The loop and its steps are C (``rk4.c``), the same for all systems; the field and the guards are machine code
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
        self._constants = [_numbers(system, tape) for tape in tapes]
        self._mode = ffi.new(
            "struct rk4_mode *",
            [
                *(n, len(expressions)),
                *(ffi.cast("rk4_values", self._code.address(name)) for name in names),
                *map(rows, self._constants),
                flags(self.rising_only),
            ],
        )
        self._states, self._room = n, 4 * n + len(expressions)
        along = list(zip(system.states, equations.field, strict=True))
        rates = [sp.diff(e, TIME) + sp.Add(*(sp.diff(e, x) * f for x, f in along)) for e in expressions]
        self.field = _function(system, equations.field)
        """x' at (t, x)."""
        self.rates = _function(system, rates)
        """Time derivatives of the guards at (t, x)."""

    def step(self, t: float, x: Floats, h: float, out: Floats) -> None:
        """One step from (t, x), written to ``out``."""
        lib.rk4_step(self._mode, rows(np.empty(self._room)), t, rows(x), h, rows(out))

    def values(self, t: float, x: Floats) -> list[float]:
        """The guards at (t, x)."""
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
        """Steps of length ``h`` by their numbers, counted from time ``base`` (``rk4_advance`` of ``paper.h``).

        Returns the steps done, the samples filled, and how it came back. At an event ``x`` is the state before the
        step that crossed a guard and ``new`` the one after it.
        """
        room = np.empty(self._room)
        state = rows(x), rows(new), flags(armed), rows(wanted)
        given = ffi.new("struct rk4_steps *", [base, h, *steps, *state, wanted.size, rows(samples), filled, rows(room)])
        code = lib.rk4_advance(self._mode, given)
        return given.first, given.filled, code


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
