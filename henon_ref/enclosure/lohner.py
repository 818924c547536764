"""Propagated sets of points (t, x): a thin centre plus a parallelepiped (Lohner's QR method).

The centre moves with the flow of one point; the deviations by the mean-value form, with a matrix that encloses the
derivative of the flow over the whole set. The axes turn with the flow (QR), which avoids the wrapping effect of boxes:
the set grows as the errors of the flow do. See Lohner, *Enclosing the solutions of ordinary initial and boundary
value problems* (1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log2

import numpy as np
from flint import arb, arb_mat

from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError, log2_size
from henon_ref.precision import working_precision


@dataclass(frozen=True)
class PointSet:
    """``centre + axes @ r`` with ``|r_i| <= radii_i``, in (t, x_1, ..., x_n)."""

    centre: tuple[arb, ...]
    """Exact point, t first."""
    axes: arb_mat
    """Exact matrix of order n + 1."""
    radii: tuple[arb, ...]
    scales: tuple[float, ...]
    """Size of each component, a power of two; the metric in which the axes are orthogonal."""

    @classmethod
    def box(cls, enclosures: Sequence[arb]) -> PointSet:
        size = len(enclosures)
        centre, radii = tuple(b.mid() for b in enclosures), tuple(b.rad() for b in enclosures)
        return cls(centre, diagonal([1] * size), radii, (0.0,) * size)

    def scaled(self, sizes: Sequence[float]) -> PointSet:
        """Return the set with larger scales; scales only grow, by powers of two.

        Scales that followed the oscillations of a component would make axes that are orthogonal in one metric skew in
        the next, and the wrapping effect would return.
        """
        scales = tuple(
            max(old, 2.0 ** round(log2(size)) if size > 0 else 0.0)
            for old, size in zip(self.scales, sizes, strict=True)
        )
        return replace(self, scales=scales)

    def deviations(self, rows: arb_mat) -> list[arb]:
        """Enclosures of ``rows @ (X - centre)`` over the set."""
        return self._spread(rows * self.axes)

    def hull(self) -> list[arb]:
        """Box around the set."""
        return [c + d for c, d in zip(self.centre, self._spread(self.axes), strict=True)]

    def _spread(self, axes: arb_mat) -> list[arb]:
        spans = [r * UNIT_BALL for r in self.radii]
        return [sum((axes[i, j] * r for j, r in enumerate(spans)), arb(0)) for i in range(axes.nrows())]

    def moved(self, centre: Sequence[arb], derivative: arb_mat) -> PointSet:
        """Return the image of the set under a map, from enclosures of its value at the centre and its derivative.

        UndecidedError if they are not finite.
        """
        if not all(c.is_finite() for c in centre):
            raise UndecidedError("the enclosure of the state has become unbounded", "enclosure")
        with working_precision(64):  # enough, because axes and radii multiply small deviations
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
    """Orthonormal axes (in scaled components), the longest edge of the moved set first, and their enclosed inverse."""
    size = len(radii)
    units = [arb(scale or 1.0) for scale in scales]
    edges = [[(spread[i, j] * radii[j] / units[i]).mid() for j in range(size)] for i in range(size)]
    longest = max(log2_size(e) for row in edges for e in row)
    common = arb(2) ** int(longest if longest > -1e6 else 0)
    matrix = np.array([[float(e / common) for e in row] for row in edges])
    order = np.argsort(-np.linalg.norm(matrix, axis=0), kind="stable")
    q, _ = np.linalg.qr(matrix[:, order])
    turn = arb_mat([[arb(float(value)) for value in row] for row in q])
    return diagonal(units) * turn, turn.inv() * diagonal([1 / unit for unit in units])


def diagonal(entries: Sequence[arb | int]) -> arb_mat:
    """Diagonal matrix with these entries."""
    size = len(entries)
    return arb_mat(size, size, [entry if i == j else 0 for i, entry in enumerate(entries) for j in range(size)])
