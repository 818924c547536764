"""Callables of one mode: field, guards, their rates and sizes. Each is made on first use.

For the solvers named ``+numba``, right-hand sides and Jacobians are functions of arrays compiled by numba, which is
imported when the first of them is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.surface_functions import is_linear, landing, of_few, slopes_of
from henon_ref.errors import UnavailableError
from henon_ref.jit.native_module import target
from henon_ref.method_cache import cached_method
from henon_ref.modes.callables import (
    ARITHMETIC,
    Jacobian,
    Scalar,
    ScalarPrinter,
    interpreted,
    scalar,
    with_rounded_constants,
)
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import ModeEvaluation, acting_on
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

EPSILON = float(np.finfo(float).eps)
Callbacks = Literal["python", "numba"]
"""Kind of the callbacks for right-hand sides, Jacobians and guards: plain Python, or compiled by numba."""
Fill = Callable[[float, Any, Any], None]
"""``f(t, x, out)`` writes one value per expression into the flat array ``out``."""


class CommonFunctions:
    """Field and guards of all modes of a system as functions of ``(t, *x, *switches)``, with parameter values inserted.

    The modes differ only in the values of the switches (:mod:`henon_ref.modes.decoupled_contacts`). A chain of many
    contacts with static friction visits a new mode at nearly every transition; with common functions a new mode
    requires no derivation and no compilation.
    """

    def __init__(self, system: FilippovSystem) -> None:
        assert system.shared is not None
        self._shared, self.states = system.shared, system.states
        self.symbols: tuple[sp.Symbol, ...] = tuple(self._shared.owner)
        """Symbols of the switches."""
        self.field_expressions = tuple(system.numeric(f) for f in self._shared.field)
        self.guard_expressions = tuple(system.numeric(g) for g in self._shared.outputs)

    def values(self, mode: Mode) -> tuple[float, ...]:
        """Values of the switches in a mode."""
        found = self._shared.values(mode)
        return tuple(float(found[symbol]) for symbol in self.symbols)

    @cached_property
    def field(self) -> Scalar:
        """Time derivatives of the states."""
        return scalar((*self.states, *self.symbols), self.field_expressions)

    @cached_property
    def compiled_field(self) -> Fill:
        """Compiled ``fill(t, y, out)``; ``y`` holds the states and the switches."""
        return compiled((*self.states, *self.symbols), self.field_expressions)

    @cached_method
    def rate(self, row: int) -> Scalar:
        """Function of a guard and its time derivative."""
        guard = self.guard_expressions[row]
        slope = along(guard, self.states, self.field_expressions)
        return of_few((*self.states, *self.symbols), (guard, slope))

    @cached_method
    def jacobian(self, callbacks: Callbacks) -> Jacobian:
        """Jacobian of the field in the states."""
        return jacobian(self.states, self.field_expressions, callbacks, self.symbols)


@lru_cache(maxsize=16)
def common_functions(system: FilippovSystem) -> CommonFunctions:
    """Cached common functions of a system whose modes share their equations."""
    return CommonFunctions(system)


class ModeFunctions:
    """One mode of one system as functions of ``(t, *x)``, with parameter values inserted.

    ``evaluation`` makes the tapes of the system's modes. ``idle`` are surfaces on which the mode stays although their
    signs are not zero: their values do not change, and their guards are left out. ModelError if the mode has no
    equations.
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
        self.symbols: tuple[sp.Symbol, ...] = ()
        self.surface_guard = {g.index: k for k, g in enumerate(self.guards) if g.kind == "surface"}

    @cached_property
    def field_expressions(self) -> tuple[sp.Expr, ...]:
        return tuple(self.system.numeric(f) for f in self.equations.field)

    @cached_property
    def common(self) -> CommonFunctions | None:
        """Functions that all modes share; None if the modes do not share equations, or if guards are followed."""
        found = None if self.system.shared is None else common_functions(self.system)
        return None if found is None or self.followed else found

    @cached_property
    def switches(self) -> tuple[float, ...]:
        """Values of the switches of this mode in :attr:`common`."""
        return () if self.common is None else self.common.values(self.mode)

    @cached_property
    def rows(self) -> list[int]:
        """Index of each guard among the guards of :attr:`common`."""
        shared = self.system.shared
        if shared is None:
            return list(range(len(self.guards)))
        rows = shared.rows(self.mode)
        return [rows[k] for k in self._watched]

    @cached_property
    def places(self) -> dict[int, int]:
        """Map from the index of a guard in the full mode to its index without the guards of idle surfaces."""
        return {k: place for place, k in enumerate(self._watched)}

    @cached_property
    def followed(self) -> tuple[int, ...]:
        """Guards that are not linear in time and states; error control of the states alone ignores their motion."""
        return tuple(k for k, g in enumerate(self.guard_expressions) if not is_linear(g, self.states))

    @cached_property
    def unknowns(self) -> tuple[sp.Symbol, ...]:
        """The states, followed by a copy of each followed guard."""
        return (*self.states, *(sp.Dummy(f"g{k}", real=True) for k in self.followed))

    @cached_property
    def right(self) -> tuple[sp.Expr, ...]:
        """Time derivatives of the unknowns."""
        return (*self.field_expressions, *(self.along(self.guard_expressions[k]) for k in self.followed))

    def start(self, t: float, x: Sequence[float]) -> NDArray[np.float64]:
        """Return the unknowns at (t, x).

        A library chooses its steps by the error of the integrated unknowns. In a stick the states may move along a
        straight line while a release guard oscillates. Steps that suit the states then step over pairs of roots of
        the guard. Therefore the value of the guard is integrated in addition to the states (heyoka does so by itself).
        Events are still located on the guard as a function of time and state.
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
        """Time derivatives of the states, n floats."""
        if self.common is None:
            return scalar(self.states, self.field_expressions)
        field, switches = self.common.field, self.switches
        return lambda t, *x: field(t, *x, *switches)

    @cached_property
    def derivatives(self) -> Scalar:
        """:attr:`right` as a function of the unknowns."""
        return self.field if self.common is not None else scalar(self.unknowns, self.right)

    def compiled_derivatives(self) -> tuple[Fill, bool]:
        """Return :attr:`right` as compiled ``fill(t, x, out)``, and whether it is machine code throughout."""
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
        """One function per guard, each returns (value,)."""
        return tuple(of_few(self.states, (g,)) for g in self.guard_expressions)

    @cached_property
    def rates(self) -> Scalar:
        """Function that returns (g_0, dg_0/dt, g_1, dg_1/dt, ...) of all guards along this mode's field."""
        if self.common is not None:
            own, switches = [self.common.rate(row) for row in self.rows], self.switches
            return lambda t, *x: tuple([value for rate in own for value in rate(t, *x, *switches)])
        pairs = [(g, self.along(g)) for g in self.guard_expressions]
        return scalar(self.states, [e for pair in pairs for e in pair])

    def along(self, expression: sp.Expr) -> sp.Expr:
        """Time derivative of an expression in time and states along this mode's field."""
        return along(expression, self.states, self.field_expressions)

    def size(self, index: int, t: float, x: Sequence[float], rtol: float, atol: float) -> float:
        """Error of a guard for these errors of x: sum of abs(dg/dx_k) (rtol abs(x_k) + atol)."""
        places, slopes, _ = slopes_of(self.guard_expressions[index], self.states)
        try:
            values = slopes(t, *x)
        except ARITHMETIC:
            return 0.0
        return math.fsum(abs(d) * (rtol * abs(x[k]) + atol) for k, d in zip(places, values, strict=True))

    def jacobian(self, callbacks: Callbacks) -> Jacobian:
        """Jacobian of :attr:`right` in :attr:`unknowns`."""
        if self.common is not None:
            return self.common.jacobian(callbacks).at(self.switches)
        return jacobian(self.unknowns, self.right, callbacks)

    def landing(self, index: int) -> Scalar:
        """Function of a surface on which this mode begins or ends (:func:`landing`)."""
        acting = {*acting_on(self.system, index)} - {index}
        # Signs that do not act on this surface are set to 1, so that modes share the cached function.
        return landing(self.system, tuple(s if k in acting else 1 for k, s in enumerate(self.mode)), index)

    @cached_method
    def bend(self, index: int) -> Scalar:
        """Function of a guard's first and second time derivative along this mode's field."""
        rate = self.along(self.guard_expressions[index])
        return scalar(self.states, [rate, self.along(rate)])

    @cached_property
    def _tape(self) -> tuple[Tape, list[float]]:
        if self._evaluation is not None and self.common is not None:
            tape, numbers = self._evaluation.tape(self.mode)
            return replace(tape, outputs=tuple(tape.outputs[k] for k in self._watched)), numbers
        tape = build_tape(self.states, self.field_expressions, self.guard_expressions)
        return tape, [float(c) for c in tape.constants]

    def series(self, t: float, x: Sequence[float], order: int) -> tuple[list[list[float]], list[list[float]]]:
        """Compute Taylor coefficients in time of the states and the guards along this mode's solution through (t, x).

        Raise an exception of ``ARITHMETIC`` if the field has no value there.
        """
        tape, numbers = self._tape
        return expand(tape, numbers, t, list(x), order)


def njit(function: Callable[..., Any]) -> Any:
    """Compile a function by numba, for the same processor as the reference's modes (see ``target``).

    A division by zero gives infinity or NaN (numba's ``numpy`` error model). UnavailableError if numba is missing.
    """
    try:
        import numba
    except ImportError as error:
        raise UnavailableError("numba is not installed: pip install 'henon-ref[numba]'") from error
    numba.core.config.CPU_NAME, numba.core.config.CPU_FEATURES = target()
    return numba.njit(function, error_model="numpy")


def compiled(states: Sequence[sp.Symbol], expressions: Iterable[sp.Expr]) -> Fill:
    """Compile expressions in time and states; an expression without a value gives NaN or infinity."""
    clock, array = sp.Symbol("clock_"), sp.IndexedBase("x_")
    names = {TIME: clock, **{x: array[k] for k, x in enumerate(states)}}
    exprs = tuple(e.xreplace(names) for e in with_rounded_constants(expressions))
    values = njit(
        sp.lambdify([clock, array], exprs, modules=[{"pow": math.pow}, "math"], printer=ScalarPrinter(), cse=True)
    )

    def fill(t: float, x: Any, out: Any) -> None:
        results = values(t, x)
        for k in range(len(results)):
            out[k] = results[k]

    made: Fill = njit(fill)
    return made


def jacobian(
    states: Sequence[sp.Symbol], field: Sequence[sp.Expr], callbacks: Callbacks, switches: Sequence[sp.Symbol] = ()
) -> Jacobian:
    """Return df/dx derived by SymPy, with entries in plain Python or compiled."""
    return Jacobian(states, field, switches, _filled if callbacks == "numba" else interpreted)


def _filled(symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[[float, Any], Any]:
    fill, room = compiled(symbols, expressions), np.empty(len(expressions))

    def values(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        fill(t, x, room)
        return room

    return values
