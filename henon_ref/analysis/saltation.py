"""Saltation matrices: what a perturbation becomes at a transition (:mod:`henon_ref.analysis.variational`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.analysis.tangent_space import TangentSpace
from henon_ref.errors import UnsupportedError
from henon_ref.integrator.run import Jumped
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import jump_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition

Matrix = NDArray[np.float64]
AT_ZERO = 1e-12
"""Part of the sizes of its terms below which a surface's function counts as zero."""
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
        self._maps: dict[int, _Function] = {}

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
            Where several surfaces that reset the state are reached at one instant.
        """
        t, (first, *others) = jumped.time, jumped.surfaces
        reached = [i for i in {*others} - {first} if self._is_on(i, jumped)]
        if reached:
            raise UnsupportedError(
                f"{len(reached) + 1} surfaces reset the state at t = {t:.17g}: the flow has no saltation matrix there"
            )
        drift, matrix = self._map(jumped)
        f_before = np.array(self._field(jumped.mode)(t, *jumped.before))
        f_after = np.array(self._field(after)(t, *jumped.after))
        _, rate, *gradient = self._guard(self.system.surfaces[jumped.surfaces[0]])(t, *jumped.before)
        normal = np.array(gradient)
        return matrix + np.outer(f_after - matrix @ f_before - drift, normal) / (normal @ f_before + rate)

    def _is_on(self, index: int, jumped: Jumped) -> bool:
        """Whether the state was on a surface before a jump, so far as rounding tells."""
        value, _, *gradient = self._guard(self.system.surfaces[index])(jumped.time, *jumped.before)
        return abs(value) <= AT_ZERO * sum(abs(g * x) for g, x in zip(gradient, jumped.before, strict=True))

    def _map(self, jumped: Jumped) -> tuple[Matrix, Matrix]:
        """Derivatives of the maps applied, one after the other, in time, shape (n,), and in the state, shape (n, n)."""
        n, state = len(jumped.before), jumped.before
        drift, matrix = np.zeros(n), np.eye(n)
        for index in jumped.surfaces:
            if index not in self._maps:
                values = jump_of(self.system, index).states
                slopes = [sp.diff(value, x) for value in values for x in (TIME, *self.system.states)]
                self._maps[index] = self._lambdified([*values, *slopes])
            after, *found = np.split(np.array(self._maps[index](jumped.time, *state), dtype=float), [n])
            slopes_there = found[0].reshape(n, n + 1)
            drift, matrix = slopes_there[:, 1:] @ drift + slopes_there[:, 0], slopes_there[:, 1:] @ matrix
            state = tuple(after.tolist())
        return drift, matrix

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
