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

    @cached_property
    def rates(self) -> Scalar:
        """All guards and their time derivatives, in turn."""
        pairs = [(g, along(g, self._states, self.field_expressions)) for g in self.guard_expressions]
        return scalar((*self._states, *self.symbols), [e for pair in pairs for e in pair])

    def jacobian(self, callbacks: Callbacks) -> Jacobian:
        """Of the field in the states."""
        if callbacks not in self._jacobians:
            self._jacobians[callbacks] = jacobian(self._states, self.field_expressions, callbacks, self.symbols)
        return self._jacobians[callbacks]


@lru_cache(maxsize=16)
def common_functions(system: FilippovSystem) -> CommonFunctions:
    """Those of a system, made once."""
    return CommonFunctions(system)
