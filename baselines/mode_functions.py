"""The callables of one mode (field, guards, their rates and sizes), each made when first asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.numba_callbacks import Callbacks, Fill, compiled, jacobian
from henon_ref.baselines.surface_functions import Slopes, is_linear, landing, normal_velocity, of_few, slopes_of
from henon_ref.modes.callables import ARITHMETIC, Jacobian, Scalar, scalar
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import ModeEvaluation
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import Tape, build_tape

EPSILON = float(np.finfo(float).eps)


class CommonFunctions:
    """Field and guards of all modes of a system as functions of ``(t, *x, *switches)``, parameters put in.

    Numbers that switch tell the modes apart (:mod:`henon_ref.modes.decoupled_contacts`): a chain of many contacts with
    static friction visits a new mode at nearly every transition, and nothing is derived or compiled there.
    """

    def __init__(self, system: FilippovSystem) -> None:
        assert system.shared is not None
        self._shared, self._states = system.shared, system.states
        self.symbols: tuple[sp.Symbol, ...] = tuple(self._shared.owner)
        """The switches."""
        self.field_expressions = tuple(system.numeric(f) for f in self._shared.field)
        self.guard_expressions = tuple(system.numeric(g) for g in self._shared.outputs)
        self.kept: dict[Any, Any] = {}
        """What a library has made of them, under a name of its own."""
        self._rates: dict[int, Scalar] = {}
        self._jacobians: dict[Callbacks, Jacobian] = {}

    def values(self, mode: Mode) -> tuple[float, ...]:
        """What a mode puts for the switches."""
        found = self._shared.values(mode)
        return tuple(float(found[symbol]) for symbol in self.symbols)

    @cached_property
    def field(self) -> Scalar:
        """x'."""
        return scalar((*self._states, *self.symbols), self.field_expressions)

    @cached_property
    def compiled_field(self) -> Fill:
        """``fill(t, y, out)`` of the states and the switches in one array."""
        return compiled((*self._states, *self.symbols), self.field_expressions)

    def rate(self, row: int) -> Scalar:
        """A guard and its time derivative."""
        if row not in self._rates:
            guard = self.guard_expressions[row]
            slope = along(guard, self._states, self.field_expressions)
            self._rates[row] = of_few((*self._states, *self.symbols), (guard, slope))
        return self._rates[row]

    def jacobian(self, callbacks: Callbacks) -> Jacobian:
        """Of the field in the states."""
        if callbacks not in self._jacobians:
            self._jacobians[callbacks] = jacobian(self._states, self.field_expressions, callbacks, self.symbols)
        return self._jacobians[callbacks]


@lru_cache(maxsize=16)
def common_functions(system: FilippovSystem) -> CommonFunctions:
    """Those of a system whose modes have equations in common, made once."""
    return CommonFunctions(system)


class ModeFunctions:
    """One mode of one system, parameters put in, as functions of ``(t, *x)``.

    ``evaluation`` makes the tapes of the system's modes. ``idle`` are surfaces that the mode stays on without sliding:
    nothing moves them, and their guards are nobody's.

    Raises
    ------
    ModelError
        Where the mode has no equations.
    """

    def __init__(
        self,
        system: FilippovSystem,
        mode: Mode,
        evaluation: ModeEvaluation | None = None,
        idle: frozenset[int] = frozenset(),
    ) -> None:
        self.system, self.mode, self.states, self.idle = system, mode, system.states, idle
        self.equations, self._evaluation = system.equations(mode), evaluation
        guards = self.equations.guards
        self._watched = [k for k, g in enumerate(guards) if not (g.kind == "surface" and g.index in idle)]
        self.guards: tuple[Guard, ...] = tuple(guards[k] for k in self._watched)
        self.guard_expressions = tuple(system.numeric(g.expression) for g in self.guards)
        self._bends: dict[int, Scalar] = {}
        self.surface_guard = {g.index: k for k, g in enumerate(self.guards) if g.kind == "surface"}

    @cached_property
    def field_expressions(self) -> tuple[sp.Expr, ...]:
        """Time derivatives of the states."""
        return tuple(self.system.numeric(f) for f in self.equations.field)

    @cached_property
    def common(self) -> CommonFunctions | None:
        """Functions that all modes have in common; None where each has its own, or where guards are followed."""
        found = None if self.system.shared is None else common_functions(self.system)
        return None if found is None or self.followed else found

    @cached_property
    def switches(self) -> tuple[float, ...]:
        """What tells this mode apart in :attr:`common`."""
        return () if self.common is None else self.common.values(self.mode)

    @cached_property
    def rows(self) -> list[int]:
        """Of each guard its place among those of :attr:`common`."""
        shared = self.system.shared
        if shared is None:
            return list(range(len(self.guards)))
        rows = shared.rows(self.mode)
        return [rows[k] for k in self._watched]

    @cached_property
    def places(self) -> dict[int, int]:
        """Of the guards of the whole mode, idle ones left out, the places among those watched."""
        return {k: place for place, k in enumerate(self._watched)}

    @cached_property
    def followed(self) -> tuple[int, ...]:
        """Guards that are not linear in the states: error control on the states alone does not see them."""
        return tuple(k for k, g in enumerate(self.guard_expressions) if not is_linear(g, self.states))

    @cached_property
    def unknowns(self) -> tuple[sp.Symbol, ...]:
        """The states, then a copy of each followed guard."""
        return (*self.states, *(sp.Dummy(f"g{k}", real=True) for k in self.followed))

    @cached_property
    def right(self) -> tuple[sp.Expr, ...]:
        """Time derivatives of the unknowns."""
        return (*self.field_expressions, *(self.along(self.guard_expressions[k]) for k in self.followed))

    def start(self, t: float, x: Sequence[float]) -> NDArray[np.float64]:
        """The unknowns at (t, x).

        A library chooses its steps by the error of what it integrates. In a stick the states may move along a
        straight line while a release guard swings to and fro, and steps that are right for the states leap
        over pairs of its roots. So the guard's value is integrated along (heyoka does the like by itself);
        events are still located on the guard as a function of time and state.
        """
        values = list(x)
        for k in self.followed:
            try:
                values.append(self.guard[k](t, *x)[0])
            except ARITHMETIC:
                values.append(0.0)
        return np.array(values)

    @cached_property
    def field(self) -> Scalar:
        """x' -> n floats."""
        if self.common is None:
            return scalar(self.states, self.field_expressions)
        field, switches = self.common.field, self.switches
        return lambda t, *x: field(t, *x, *switches)

    @cached_property
    def derivatives(self) -> Scalar:
        """:attr:`right` as a function of the unknowns."""
        return self.field if self.common is not None else scalar(self.unknowns, self.right)

    def compiled_derivatives(self) -> tuple[Fill, bool]:
        """``fill(t, x, out)`` of the same, compiled; and whether it is machine code all through."""
        if self.common is None:
            return compiled(self.unknowns, self.right), True
        fill, n = self.common.compiled_field, len(self.states)
        point = np.array([0.0] * n + list(self.switches))

        def bound(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            point[:n] = x
            fill(t, point, out)

        return bound, False

    @cached_property
    def guard(self) -> tuple[Scalar, ...]:
        """One function a guard, each -> (value,)."""
        return tuple(of_few(self.states, (g,)) for g in self.guard_expressions)

    @cached_property
    def rates(self) -> Scalar:
        """All guards -> (g_0, dg_0/dt, g_1, dg_1/dt, ...) along this mode's own field."""
        if self.common is not None:
            own, switches = [self.common.rate(row) for row in self.rows], self.switches
            return lambda t, *x: tuple([value for rate in own for value in rate(t, *x, *switches)])
        pairs = [(g, self.along(g)) for g in self.guard_expressions]
        return scalar(self.states, [e for pair in pairs for e in pair])

    def along(self, expression: sp.Expr) -> sp.Expr:
        """Time derivative of an expression in time and states along this mode's field."""
        return along(expression, self.states, self.field_expressions)

    def size(self, index: int, t: float, x: Sequence[float], rtol: float, atol: float) -> float:
        """What relative and absolute errors in x make of a guard: sum of abs(dg/dx_k) (rtol abs(x_k) + atol)."""
        slopes = self.slopes(index)
        try:
            values = slopes.values(t, *x)
        except ARITHMETIC:
            return 0.0
        return math.fsum(abs(d) * (rtol * abs(x[k]) + atol) for k, d in zip(slopes.places, values, strict=True))

    def slopes(self, index: int) -> Slopes:
        """A guard's derivatives in the states."""
        return slopes_of(self.guard_expressions[index], self.states)

    def jacobian(self, callbacks: Callbacks) -> Jacobian:
        """Of :attr:`right` in :attr:`unknowns`."""
        if self.common is not None:
            return self.common.jacobian(callbacks).at(self.switches)
        return jacobian(self.unknowns, self.right, callbacks)

    def landing(self, index: int) -> Scalar:
        """What is needed of one surface when this mode begins or ends on it (:func:`landing`)."""
        acting = normal_velocity(self.system, index).free_symbols
        pairs = enumerate(zip(self.system.signs, self.mode, strict=True))
        told = tuple(entry if sign in acting and k != index else 1 for k, (sign, entry) in pairs)
        return landing(self.system, told, index)

    def bend(self, index: int) -> Scalar:
        """One guard's first and second time derivative along this mode's field."""
        if index not in self._bends:
            rate = self.along(self.guard_expressions[index])
            self._bends[index] = scalar(self.states, [rate, self.along(rate)])
        return self._bends[index]

    @cached_property
    def _tape(self) -> tuple[Tape, list[float]]:
        if self._evaluation is not None and self.common is not None:
            tape, numbers = self._evaluation.tape(self.mode)
            return replace(tape, outputs=tuple(tape.outputs[k] for k in self._watched)), numbers
        tape = build_tape(self.states, self.field_expressions, self.guard_expressions)
        return tape, [float(c) for c in tape.constants]

    def series(self, t: float, x: Sequence[float], order: int) -> tuple[list[list[float]], list[list[float]]]:
        """Taylor coefficients in time of the states, and of every guard, along this mode's solution through (t, x).

        Raises
        ------
        ArithmeticError, ValueError
            Where the field has no value.
        """
        tape, numbers = self._tape
        return expand(tape, numbers, t, list(x), order)
