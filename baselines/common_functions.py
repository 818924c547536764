"""Functions that all modes of a system have in common: numbers that switch tell the modes apart.

A chain of many contacts with static friction visits a new mode at nearly every transition; nothing is derived or
compiled there (:mod:`henon_ref.modes.decoupled_contacts`).
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any

import sympy as sp

from henon_ref.baselines.numba_callbacks import Callbacks, Fill, compiled, jacobian
from henon_ref.modes.callables import Jacobian, Scalar, scalar
from henon_ref.modes.equations import along
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

MANY = 16
"""From so many arguments on a function is made of those alone that stand in it: SymPy goes through the expressions once
for each argument."""


class CommonFunctions:
    """Field and guards of all modes as functions of ``(t, *x, *switches)``, parameters put in.

    Parameters
    ----------
    system : FilippovSystem
        Whose modes have equations in common.
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
    """Those of a system, made once."""
    return CommonFunctions(system)


@lru_cache(maxsize=4096)
def of_few(arguments: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Scalar:
    """``f(t, *arguments)``, one float an expression."""
    if len(arguments) < MANY:
        return scalar(arguments, expressions)
    standing = set().union(*(e.free_symbols for e in expressions))
    places = [k for k, symbol in enumerate(arguments) if symbol in standing]
    function = scalar([arguments[k] for k in places], expressions)
    return lambda t, *x: function(t, *[x[k] for k in places])
