"""Saltation matrices: what a perturbation becomes at a transition (:mod:`henon_ref.analysis.variational`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.analysis.tangent_space import TangentSpace
from henon_ref.errors import UnsupportedError
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.resets import Jump, jump_of
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.mode_changes import Jumped
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition

Matrix = NDArray[np.float64]
_Function = Callable[..., list[float]]


class Saltation:
    """Saltation matrices of one system in double precision.

    Parameters
    ----------
    system : FilippovSystem
        The system itself, without tangent vectors.
    """

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._spaces = TangentSpace(system)
        self._fields: dict[Mode, _Function] = {}
        self._guards: dict[sp.Expr, _Function] = {}
        self._maps: dict[Jump, _Function] = {}

    def matrix(self, transition: Transition) -> Matrix:
        """The saltation matrix of a transition, shape (n, n).

        A touch (``graze``) is given the identity: the limit from the side that misses the surface. From the
        other side the flow is not differentiable there.

        Raises
        ------
        UnsupportedError
            Where several surfaces change at one instant, and not by one condition: the flow has no derivative there,
            only one a direction.
        """
        before, after = transition.from_mode, transition.to_mode
        changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
        if len(changed) > 1 and not self._spaces.meet_at_once(before, after):
            raise UnsupportedError(
                f"{len(changed)} surfaces change at t = {transition.time:.17g}: the flow has no saltation matrix there"
            )
        identity = np.eye(len(self.system.states))
        if not changed or self._continuous(transition):
            return identity
        t, x = transition.time, transition.state
        f_before = np.array(self._field(before)(t, *x))
        f_after = np.array(self._field(after)(t, *x))
        _, rate, *gradient = self._guard(self._reached(transition))(t, *x)
        normal = np.array(gradient)
        return identity + np.outer(f_after - f_before, normal) / (normal @ f_before + rate)

    def of_jump(self, jumped: Jumped, after: Mode) -> Matrix:
        """The saltation matrix of a jump of the state, shape (n, n).

        Parameters
        ----------
        jumped : Jumped
        after : Mode
            That follows.

        Raises
        ------
        UnsupportedError
            Where several surfaces reset the state at one instant.
        """
        if len(jumped.surfaces) > 1:
            count = len(jumped.surfaces)
            raise UnsupportedError(
                f"{count} surfaces reset the state at t = {jumped.time:.17g}: the flow has no saltation matrix there"
            )
        jump, n = jump_of(self.system, jumped.surfaces), len(jumped.before)
        assert jump is not None  # of one surface there is one
        if jump not in self._maps:
            slopes = [sp.diff(value, x) for value in jump.states for x in (TIME, *self.system.states)]
            self._maps[jump] = self._lambdified(slopes)
        t = jumped.time
        slopes_there = np.array(self._maps[jump](t, *jumped.before), dtype=float).reshape(n, n + 1)
        drift, matrix = slopes_there[:, 0], slopes_there[:, 1:]
        f_before = np.array(self._field(jumped.mode)(t, *jumped.before))
        f_after = np.array(self._field(after)(t, *jumped.after))
        _, rate, *gradient = self._guard(self.system.surfaces[jumped.surfaces[0]])(t, *jumped.before)
        normal = np.array(gradient)
        return matrix + np.outer(f_after - matrix @ f_before - drift, normal) / (normal @ f_before + rate)

    def _continuous(self, transition: Transition) -> bool:
        """A Filippov release: the equivalent sign reaches +-1, where the sliding field is the field beyond."""
        return transition.kind == "release" and transition.surface not in self.system.overrides

    def _reached(self, transition: Transition) -> sp.Expr:
        """The function that fell to zero."""
        index = transition.surface
        if transition.kind != "release":
            return self.system.surfaces[index]
        ways: list[Guard] = [
            g
            for g in self.system.equations(transition.from_mode).guards
            if g.kind == "release" and g.index == index and g.to_sign == transition.to_mode[index]
        ]
        return min((g.expression for g in ways), key=lambda e: abs(self._relative(e, transition)))

    def _relative(self, expression: sp.Expr, transition: Transition) -> float:
        value, rate, *gradient = self._guard(expression)(transition.time, *transition.state)
        return value / (abs(rate) + sum(map(abs, gradient)) + 1e-300)

    def _field(self, mode: Mode) -> _Function:
        if mode not in self._fields:
            self._fields[mode] = self._lambdified(list(self.system.equations(mode).field))
        return self._fields[mode]

    def _guard(self, g: sp.Expr) -> _Function:
        """Value, rate of change in time, gradient."""
        if g not in self._guards:
            self._guards[g] = self._lambdified([g, sp.diff(g, TIME), *(sp.diff(g, x) for x in self.system.states)])
        return self._guards[g]

    def _lambdified(self, expressions: list[sp.Expr]) -> _Function:
        numeric = [self.system.numeric(e) for e in expressions]
        return cast(_Function, sp.lambdify([TIME, *self.system.states], numeric, "math", cse=True))
