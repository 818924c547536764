"""Saltation matrices: what a perturbation becomes at a transition (:mod:`henon_ref.analysis.variational`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import UnsupportedError
from henon_ref.filippov.equations import Guard, along
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.resets import Jump, jump_of
from henon_ref.filippov.resting import impact_of
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.mode_changes import Jumped
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition

Matrix = NDArray[np.float64]
SINGULAR = 1e-13
"""A jump whose derivative has a singular value this small, relative to the largest, takes a direction away."""
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
        self._fields: dict[Mode, _Function] = {}
        self._guards: dict[sp.Expr, _Function] = {}
        self._maps: dict[Jump, _Function] = {}
        self._rests: dict[tuple[Mode, int], _Function] = {}

    def matrix(self, transition: Transition) -> Matrix:
        """The saltation matrix of a transition, shape (n, n).

        A touch (``graze``) is given the identity: the limit from the side that misses the surface. From the
        other side the flow is not differentiable there.

        Raises
        ------
        UnsupportedError
            Where several surfaces change at one instant: the flow has no derivative there, only one a
            direction.
        """
        before, after = transition.from_mode, transition.to_mode
        changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
        if len(changed) > 1:
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

    def of_rest(self, transition: Transition) -> Matrix:
        """What the limit of impacts on a surface does to a perturbation after the last of them, shape (n, n).

        ``I - A (C A)^-1 C``, with the gradients of h and h' in the rows of C, and in the columns of A the change p of
        the state by an impulse that changes h' by 1, and ``(df/dx) p - dp/dt``, by which the state moves on after one.
        When the body comes to rest is of no account: from the impact on the force is the same in the mean. It is the
        limit for a rest that follows at once.
        """
        system, mode = self.system, transition.from_mode
        key = mode, next(i for i, entry in enumerate(transition.to_mode) if entry == 0 != mode[i])
        if key not in self._rests:
            impact, states = impact_of(system, key[1]), system.states
            assert impact is not None  # a body rests
            field, push = system.equations(mode).field, impact.push
            moved = [
                along(f, states, push) - sp.diff(f, TIME) - along(p, states, field)
                for f, p in zip(field, push, strict=True)
            ]
            rows = [sp.diff(zero, x) for zero in (system.surfaces[key[1]], impact.speed) for x in states]
            self._rests[key] = self._lambdified([*push, *moved, *rows])
        pushes, rows = np.array(self._rests[key](transition.time, *transition.state)).reshape(2, 2, -1)
        return np.eye(len(system.states)) - pushes.T @ np.linalg.solve(rows @ pushes.T, rows)

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


def rank_lost(matrix: Matrix) -> int:
    """Directions, of as many as a matrix has columns, that it takes away."""
    return matrix.shape[1] - int(np.linalg.matrix_rank(matrix, rtol=SINGULAR))
