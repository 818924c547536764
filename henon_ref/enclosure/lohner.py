"""Sets of points (t, x) that are carried along: a thin centre plus a parallelepiped (Lohner's QR method).

The centre moves by the flow of one point; the rest by the mean-value form, with a matrix that encloses the
derivative of the flow over the whole set. Turning the axes with the flow (QR) keeps the set from being
wrapped in a box step after step, so that its size grows as the flow's own errors do. See Lohner, *Enclosing
the solutions of ordinary initial and boundary value problems* (1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log2

import numpy as np
from flint import arb, arb_mat

from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError, log2_size
from henon_ref.precision import working_precision

MATRIX_BITS = 64
"""Precision of axes and radii: they multiply what is small already."""


@dataclass(frozen=True)
class PointSet:
    """``centre + axes @ r`` with ``|r_i| <= radii_i``, in (t, x_1, ..., x_n)."""

    centre: tuple[arb, ...]
    """Exact points, t first."""
    axes: arb_mat
    """Exact matrix of order n + 1."""
    radii: tuple[arb, ...]
    scales: tuple[float, ...]
    """Size of each component, as powers of two: what "orthogonal" means where units differ."""

    @classmethod
    def box(cls, enclosures: Sequence[arb]) -> PointSet:
        """The set of a box."""
        size = len(enclosures)
        axes = arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
        return cls(tuple(b.mid() for b in enclosures), axes, tuple(b.rad() for b in enclosures), (0.0,) * size)

    def scaled(self, sizes: Sequence[float]) -> PointSet:
        """The same set, told how large its components are; scales only ever grow, and by powers of two.

        They must not follow a component's oscillation: axes that are orthogonal in one metric are skew in
        the next, and the set is then wrapped step after step after all.
        """
        scales = tuple(
            max(old, 2.0 ** round(log2(size)) if size > 0 else 0.0)
            for old, size in zip(self.scales, sizes, strict=True)
        )
        return replace(self, scales=scales)

    def deviations(self, rows: arb_mat) -> list[arb]:
        """Enclosures of ``rows @ (X - centre)`` over the set."""
        product = rows * self.axes
        return [sum((product[i, j] * r for j, r in enumerate(self._spans())), arb(0)) for i in range(product.nrows())]

    def _spans(self) -> list[arb]:
        return [r * UNIT_BALL for r in self.radii]

    def hull(self) -> list[arb]:
        """The smallest box we know around the set."""
        size = len(self.centre)
        with_axes = (sum((self.axes[i, j] * r for j, r in enumerate(self._spans())), arb(0)) for i in range(size))
        return [c + d for c, d in zip(self.centre, with_axes, strict=True)]

    def moved(self, centre: Sequence[arb], derivative: arb_mat) -> PointSet:
        """The set after a map whose value at the centre and whose derivative over the set are enclosed.

        Raises
        ------
        UndecidedError
            Where the enclosures are not finite.
        """
        if not all(c.is_finite() for c in centre):
            raise UndecidedError("the enclosure of the state has become unbounded", "enclosure")
        with working_precision(MATRIX_BITS):
            spread = derivative * self.axes
            errors = [c.rad() for c in centre]
            axes, inverse = _axes(spread.mid(), self.radii, self.scales)
            turned = inverse * spread
            size = len(centre)
            radii = tuple(
                sum(
                    (abs(turned[i, j]) * self.radii[j] + abs(inverse[i, j]) * errors[j] for j in range(size)), arb(0)
                ).upper()
                for i in range(size)
            )
        if not all(r.is_finite() for r in radii):
            raise UndecidedError("the enclosure of the state has become unbounded", "enclosure")
        return PointSet(tuple(c.mid() for c in centre), axes, radii, self.scales)


def _axes(spread: arb_mat, radii: Sequence[arb], scales: Sequence[float]) -> tuple[arb_mat, arb_mat]:
    """Orthonormal axes (in scaled components), the longest edge of the moved set first, and an enclosed inverse."""
    size = len(radii)
    units = [arb(scale or 1.0) for scale in scales]
    edges = [[(spread[i, j] * radii[j] / units[i]).mid() for j in range(size)] for i in range(size)]
    longest = max(log2_size(e) for row in edges for e in row)
    common = arb(2) ** int(longest if longest > -1e6 else 0)
    matrix = np.array([[float(e / common) for e in row] for row in edges])
    order = np.argsort(-np.linalg.norm(matrix, axis=0), kind="stable")
    q, _ = np.linalg.qr(matrix[:, order])
    turn = arb_mat([[arb(float(value)) for value in row] for row in q])
    stretch = arb_mat(size, size, [units[i] if i == j else 0 for i in range(size) for j in range(size)])
    shrink = arb_mat(size, size, [1 / units[i] if i == j else 0 for i in range(size) for j in range(size)])
    return stretch * turn, turn.inv() * shrink
