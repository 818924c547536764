"""Directions that perturbations have in a mode: all in slip, those along the surface in sliding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import impact_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

Vector = Sequence[float] | NDArray[np.float64]
Matrix = NDArray[np.float64]
SINGULAR = 1e-13
"""A jump whose derivative has a singular value this small, relative to the largest, takes a direction away."""


class TangentSpace:
    """The tangent spaces of a system's modes.

    Parameters
    ----------
    system : FilippovSystem
        The system itself, without tangent vectors.
    """

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._gradients: dict[frozenset[int], list[list[sp.Expr]]] = {}
        self._normals: dict[frozenset[int], Callable[..., list[list[float]]]] = {}

    def dimension(self, mode: Mode) -> int:
        """How many directions perturbations have in a mode."""
        return len(self.system.states) - len(self._gradients_in(_slid_on(mode)))

    def completed(self, vectors: Matrix, mode: Mode, t: float, x: Vector) -> Matrix:
        """Orthonormal vectors of a mode's tangent space, and as many more as make them a basis of it.

        Parameters
        ----------
        vectors : ndarray, shape (n, k)
            Orthonormal; k may be 0.
        mode : Mode
        t, x
            Time [s] and state.

        Returns
        -------
        ndarray, shape (n, dimension)
        """
        beside = np.column_stack([vectors, np.reshape(self._normals_in(_slid_on(mode))(t, *x), (-1, len(x))).T])
        more = np.linalg.qr(beside, mode="complete")[0][:, beside.shape[1] :]
        return np.column_stack([vectors, more])

    def basis(self, mode: Mode, t: float, x: Vector) -> Matrix:
        """An orthonormal basis of a mode's tangent space, shape (n, dimension)."""
        return self.completed(np.zeros((len(x), 0)), mode, t, x)

    def meet_at_once(self, before: Mode, after: Mode) -> bool:
        """Whether the surfaces that change from one mode to the next are one, beside those that are slid on in both.

        One may be a multiple of another, and in a loop of contacts the last ones come to rest together.
        """
        kept = _slid_on(before) & _slid_on(after)
        changed = {i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new}
        return len(self._gradients_in(kept | changed)) <= len(self._gradients_in(kept)) + 1

    def jacobian(self, mode: Mode, t: float, x: Vector) -> Matrix:
        """Derivative of a mode's field by the state, shape (n, n); zero where it has no finite value."""
        states = self.system.states
        slopes = [self.system.numeric(sp.diff(f, x)) for f in self.system.equations(mode).field for x in states]
        values = sp.lambdify([TIME, *states], slopes, "numpy", cse=True)
        with np.errstate(all="ignore"):
            found = np.array(values(np.float64(t), *np.asarray(x, dtype=float)), dtype=float).reshape(len(states), -1)
        return found if np.isfinite(found).all() else np.zeros_like(found)

    def divergence(self, field: Sequence[sp.Expr], sliding: frozenset[int]) -> sp.Expr:
        """The rate at which a mode's field spreads volumes of its tangent space.

        The trace of its Jacobian J restricted to the directions that are orthogonal to the gradients N of what is kept
        at zero: ``tr J - tr((N N^T)^-1 N J N^T)``.

        Parameters
        ----------
        field : sequence of Expr, shape (n,)
        sliding : frozenset of int
            Surfaces slid on.
        """
        states = self.system.states
        trace = sp.Add(*(sp.diff(f, x) for f, x in zip(field, states, strict=True)))
        gradients = self._gradients_in(sliding)
        if not gradients:
            return trace
        normals = sp.Matrix(gradients)
        inverse = (normals * normals.T).inv()
        along = [
            [sp.Add(*(g * sp.diff(f, x) for g, x in zip(row, states, strict=True) if g != 0)) for f in field]
            for row in gradients
        ]
        return trace - (inverse * normals * sp.Matrix(along).T).trace()

    def _gradients_in(self, sliding: frozenset[int]) -> list[list[sp.Expr]]:
        """Gradients of surfaces slid on, and of the speeds of bodies at rest; none that follows from the others."""
        if sliding not in self._gradients:
            system = self.system
            found: list[list[sp.Expr]] = []
            for i in sorted(sliding):
                impact = impact_of(system, i) if system.rests(i) else None
                for zero in (system.surfaces[i], *(() if impact is None else (impact.speed,))):
                    row = [system.numeric(sp.diff(zero, x)) for x in system.states]
                    if sp.Matrix([*found, row]).rank() > len(found):
                        found.append(row)
            self._gradients[sliding] = found
        return self._gradients[sliding]

    def _normals_in(self, sliding: frozenset[int]) -> Callable[..., list[list[float]]]:
        if sliding not in self._normals:
            made = sp.lambdify([TIME, *self.system.states], self._gradients_in(sliding), "math", cse=True)
            self._normals[sliding] = cast(Callable[..., list[list[float]]], made)
        return self._normals[sliding]


def _slid_on(mode: Mode) -> frozenset[int]:
    return frozenset(i for i, entry in enumerate(mode) if entry == 0)


def rank_lost(matrix: Matrix) -> int:
    """Directions, of as many as a matrix has columns, that it takes away."""
    return matrix.shape[1] - int(np.linalg.matrix_rank(matrix, rtol=SINGULAR))
