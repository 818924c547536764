"""Tangent spaces of a system's modes, and saltation matrices of its transitions.

See :mod:`henon_ref.analysis.variational` for the formulas and their sources.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import UnsupportedError
from henon_ref.integrator.run import Jumped
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import along
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import impact_of, jump_of, kept_zero
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition

Vector = Sequence[float] | NDArray[np.float64]
Matrix = NDArray[np.float64]
_Function = Callable[..., list[float]]


class TangentSpace:
    """Tangent spaces of a system's modes: all directions in slip, directions along the surfaces in sliding."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system

    def dimension(self, mode: Mode) -> int:
        """Dimension of a mode's tangent space."""
        return len(self.system.states) - len(self._gradients_in(_slid_on(mode)))

    def completed(self, vectors: Matrix, mode: Mode, t: float, x: Vector) -> Matrix:
        """Complete orthonormal vectors, shape (n, k), to a basis of a mode's tangent space, shape (n, dimension)."""
        beside = np.column_stack([vectors, np.reshape(self._normals_in(_slid_on(mode))(t, *x), (-1, len(x))).T])
        more = np.linalg.qr(beside, mode="complete")[0][:, beside.shape[1] :]
        return np.column_stack([vectors, more])

    def basis(self, mode: Mode, t: float, x: Vector) -> Matrix:
        """Orthonormal basis of a mode's tangent space, shape (n, dimension)."""
        return self.completed(np.zeros((len(x), 0)), mode, t, x)

    def meet_at_once(self, before: Mode, after: Mode) -> bool:
        """Check whether the surfaces that change are one independent condition beside those that slide in both modes.

        One surface may be a multiple of another, and in a loop of contacts the last contacts come to rest together.
        """
        both = _slid_on(before) & _slid_on(after)
        changed = {i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new}
        return len(self._gradients_in(both | changed)) <= len(self._gradients_in(both)) + 1

    def jacobian(self, mode: Mode, t: float, x: Vector) -> Matrix:
        """Derivative of a mode's field by the state, shape (n, n); zero if it is not finite."""
        states = self.system.states
        slopes = [self.system.numeric(sp.diff(f, x)) for f in self.system.equations(mode).field for x in states]
        values = sp.lambdify([TIME, *states], slopes, "numpy", cse=True)
        with np.errstate(all="ignore"):
            found = np.array(values(np.float64(t), *np.asarray(x, dtype=float)), dtype=float).reshape(len(states), -1)
        return found if np.isfinite(found).all() else np.zeros_like(found)

    def divergence(self, field: Sequence[sp.Expr], sliding: frozenset[int]) -> sp.Expr:
        """Rate at which a field, shape (n,), expands volumes of the tangent space of sliding on some surfaces.

        This is the trace of its Jacobian J restricted to the directions orthogonal to the gradients N of the functions
        that sliding keeps at zero: ``tr J - tr((N N^T)^-1 N J N^T)``.
        """
        states = self.system.states
        trace = sp.Add(*(sp.diff(f, x) for f, x in zip(field, states, strict=True)))
        gradients = self._gradients_in(sliding)
        if not gradients:
            return trace
        normals = sp.Matrix(gradients)
        inverse = (normals * normals.T).inv()
        along_normals = [
            [sp.Add(*(g * sp.diff(f, x) for g, x in zip(row, states, strict=True) if g != 0)) for f in field]
            for row in gradients
        ]
        return trace - (inverse * normals * sp.Matrix(along_normals).T).trace()

    @cached_method
    def _gradients_in(self, sliding: frozenset[int]) -> list[list[sp.Expr]]:
        """Linearly independent gradients of sliding surfaces and of the speeds of bodies at rest."""
        system = self.system
        found: list[list[sp.Expr]] = []
        for i in sorted(sliding):
            for zero in kept_zero(system, i):
                row = [system.numeric(sp.diff(zero, x)) for x in system.states]
                if sp.Matrix([*found, row]).rank() > len(found):
                    found.append(row)
        return found

    @cached_method
    def _normals_in(self, sliding: frozenset[int]) -> Callable[..., list[list[float]]]:
        made = sp.lambdify([TIME, *self.system.states], self._gradients_in(sliding), "math", cse=True)
        return cast(Callable[..., list[list[float]]], made)


def _slid_on(mode: Mode) -> frozenset[int]:
    return frozenset(i for i, entry in enumerate(mode) if entry == 0)


def rank_lost(matrix: Matrix) -> int:
    """Number of directions, out of the columns of a matrix, that the matrix removes: singular values near zero."""
    return matrix.shape[1] - int(np.linalg.matrix_rank(matrix, rtol=1e-13))


class Saltation:
    """Saltation matrices of one system (without tangent vectors) in double precision."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system, self.spaces = system, TangentSpace(system)

    def matrix(self, transition: Transition) -> Matrix:
        """Saltation matrix of a transition, shape (n, n).

        A touch (``graze``) has the identity: the limit from the side that misses the surface. From the other side the
        flow is not differentiable there. UnsupportedError if several surfaces change at one instant by independent
        conditions: only directional derivatives exist.
        """
        before, after = transition.from_mode, transition.to_mode
        changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
        if len(changed) > 1 and not self.spaces.meet_at_once(before, after):
            raise UnsupportedError(
                f"{len(changed)} surfaces change at t = {transition.time:.17g}: the flow has no saltation matrix there"
            )
        identity = np.eye(len(self.system.states))
        if not changed or self._continuous(transition):
            return identity
        t, x = transition.time, transition.state
        f_before, f_after = (np.array(self._field(mode)(t, *x)) for mode in (before, after))
        _, rate, *gradient = self._guard(self._reached(transition))(t, *x)
        normal = np.array(gradient)
        return identity + np.outer(f_after - f_before, normal) / (normal @ f_before + rate)

    def of_jump(self, jumped: Jumped, after: Mode) -> Matrix:
        """Saltation matrix of a jump of the state into the mode ``after``, shape (n, n).

        UnsupportedError if several surfaces that reset the state are reached at one instant.
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
        _, rate, *gradient = self._guard(self.system.surfaces[first])(t, *jumped.before)
        normal = np.array(gradient)
        return matrix + np.outer(f_after - matrix @ f_before - drift, normal) / (normal @ f_before + rate)

    def of_limit(self, transition: Transition) -> Matrix:
        """Saltation matrix from just after the last recorded impact to rest on a surface h, shape (n, n).

        It is ``I - A (C A)^-1 C``. The rows of C are the gradients of h and h'. The columns of A are the change p of
        the state by an impulse that changes h' by 1, and ``(df/dx) p - dp/dt``, the rate of the state after this
        impulse. The time of coming to rest has no effect, since the mean force is the same from the impact on. The
        matrix is the limit for a rest that follows at once.
        """
        mode = transition.from_mode
        index = next(i for i, entry in enumerate(transition.to_mode) if entry == 0 != mode[i])
        found = self._pushes_and_gradients(mode, index)(transition.time, *transition.state)
        pushes, rows = np.array(found).reshape(2, 2, -1)
        return np.eye(len(self.system.states)) - pushes.T @ np.linalg.solve(rows @ pushes.T, rows)

    def _is_on(self, index: int, jumped: Jumped) -> bool:
        """Check whether a surface's function is zero before a jump, relative to the size of its terms."""
        value, _, *gradient = self._guard(self.system.surfaces[index])(jumped.time, *jumped.before)
        return abs(value) <= 1e-12 * sum(abs(g * x) for g, x in zip(gradient, jumped.before, strict=True))

    def _map(self, jumped: Jumped) -> tuple[Matrix, Matrix]:
        """Derivatives of the composed maps of a jump by time, shape (n,), and by the state, shape (n, n)."""
        n, state = len(jumped.before), jumped.before
        drift, matrix = np.zeros(n), np.eye(n)
        for index in jumped.surfaces:
            after, slopes = np.split(np.array(self._values_and_slopes(index)(jumped.time, *state), dtype=float), [n])
            slopes = slopes.reshape(n, n + 1)
            drift, matrix = slopes[:, 1:] @ drift + slopes[:, 0], slopes[:, 1:] @ matrix
            state = tuple(after.tolist())
        return drift, matrix

    def _continuous(self, transition: Transition) -> bool:
        """Check for a Filippov release: at an equivalent sign of +-1 the sliding field equals the slip field."""
        return transition.kind == "release" and transition.surface not in self.system.overrides

    def _reached(self, transition: Transition) -> sp.Expr:
        """Return the function whose zero ends the mode: of those of the surfaces that change, the closest to zero."""
        before, after = transition.from_mode, transition.to_mode
        sides = {(i, entry) for i, entry in enumerate(after) if entry != before[i]}
        found = [self.system.surfaces[i] for i, _ in sorted(sides) if before[i]]
        for g in self.system.equations(before).guards:
            if g.kind == "release" and not sides.isdisjoint({(g.index, g.to_sign), *g.cut}):
                found.append(g.expression)
        return min(found, key=lambda e: abs(self._relative(e, transition)))

    def _relative(self, expression: sp.Expr, transition: Transition) -> float:
        value, rate, *gradient = self._guard(expression)(transition.time, *transition.state)
        return value / (abs(rate) + sum(map(abs, gradient)) + 1e-300)

    @cached_method
    def _field(self, mode: Mode) -> _Function:
        return self._lambdified(self.system.equations(mode).field)

    @cached_method
    def _guard(self, g: sp.Expr) -> _Function:
        """Value, rate of change in time, and gradient."""
        return self._lambdified([g, *(sp.diff(g, x) for x in (TIME, *self.system.states))])

    @cached_method
    def _values_and_slopes(self, index: int) -> _Function:
        """Map of a surface, then its derivatives by time and states, row by row."""
        values = jump_of(self.system, index).states
        return self._lambdified([*values, *(sp.diff(v, x) for v in values for x in (TIME, *self.system.states))])

    @cached_method
    def _pushes_and_gradients(self, mode: Mode, index: int) -> _Function:
        """Columns of A, then rows of C (:meth:`of_limit`)."""
        system, impact = self.system, impact_of(self.system, index)
        assert impact is not None  # a body rests
        states, field, push = system.states, system.equations(mode).field, impact.push
        moved = [
            along(f, states, push) - sp.diff(f, TIME) - along(p, states, field)
            for f, p in zip(field, push, strict=True)
        ]
        rows = [sp.diff(zero, x) for zero in (system.surfaces[index], impact.speed) for x in states]
        return self._lambdified([*push, *moved, *rows])

    def _lambdified(self, expressions: Sequence[sp.Expr]) -> _Function:
        numeric = [self.system.numeric(e) for e in expressions]
        return cast(_Function, sp.lambdify([TIME, *self.system.states], numeric, "math", cse=True))
