"""Proven enclosures: one Taylor expansion with its remainder, functions of time along it, propagated sets of points.

A set of points (t, x) is a thin centre plus a parallelepiped (Lohner's QR method). The centre moves with the flow of
one point; the deviations by the mean-value form, with a matrix that encloses the derivative of the flow over the whole
set. The axes turn with the flow (QR), which avoids the wrapping effect of boxes: the set grows as the errors of the
flow do. See Lohner, *Enclosing the solutions of ordinary initial and boundary value problems* (1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, log2

import numpy as np
from flint import arb, arb_mat, arb_poly, ctx

from henon_ref.enclosure.tail_bounds import Program, Series, Tails, magnitudes
from henon_ref.precision import working_precision

UNIT_BALL = arb(0, 1)
SMALLEST = 1e-300
"""Replaces zero in logarithms."""


class UndecidedError(Exception):
    """A sign or an enclosure that a proof requires is undecided at the working precision.

    ``kind``: ``graze``, ``tie``, ``mode``, ``enclosure``, ``start``. ``place``: time on the step, in its time unit.
    """

    def __init__(self, reason: str, kind: str, place: float | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.kind = kind
        self.place = place


@dataclass(frozen=True)
class Tail:
    """Bound of a Taylor remainder of orders >= ``power``: ``bound * (|s|/radius)**power`` at s."""

    power: int
    bound: float
    radius: float

    def size(self, s: arb) -> arb:
        """Bound at |s| < radius."""
        return arb(self.bound) * (abs(s).upper() / arb(self.radius)) ** self.power

    def slope(self, s: arb) -> arb:
        """Bound of the derivative at s, ``sum k |e_k| s^(k-1)``; infinite unless its terms decrease."""
        part = abs(s).upper() / arb(self.radius)
        if not part * (self.power + 1) <= self.power:
            return arb.pos_inf()
        return arb(self.bound) * self.power * part ** (self.power - 1) / arb(self.radius)


@dataclass(frozen=True)
class Curve:
    """A function of s: a polynomial with ball coefficients plus bounded remainders."""

    polynomial: arb_poly
    """In powers of ``s - origin``."""
    derivative: arb_poly
    tails: tuple[Tail, ...]
    origin: float = 0.0

    @classmethod
    def of(cls, coefficients: Sequence[arb], tails: Sequence[Tail]) -> Curve:
        polynomial = arb_poly(list(coefficients))
        return cls(polynomial, polynomial.derivative(), tuple(tails))

    def at(self, s: arb) -> arb:
        return sum((t.size(s) * UNIT_BALL for t in self.tails), self.polynomial(s - self.origin))

    def slope(self, s: arb) -> arb:
        return sum((t.slope(s) * UNIT_BALL for t in self.tails), self.derivative(s - self.origin))

    def recentred(self, origin: float) -> Curve:
        """Expand the function around another point, which sharpens enclosures on short intervals near that point."""
        shifted = self.polynomial(arb_poly([arb(origin) - self.origin, 1]))
        return Curve(shifted, shifted.derivative(), self.tails, origin)

    def over(self, low: float, high: float) -> tuple[arb, arb]:
        """Enclosures of the value (mean-value form intersected with the direct one) and derivative on [low, high]."""
        s, middle = interval(low, high), arb(0.5 * (low + high))
        plain, slope = self.at(s), self.slope(s)
        if not slope.is_finite():
            return plain, slope
        centred = self.at(middle) + slope * (s - middle)
        return (plain.intersection(centred) if plain.overlaps(centred) else plain), slope


def interval(low: float, high: float) -> arb:
    """Return a ball that contains [low, high]."""
    middle = 0.5 * (low + high)
    return arb(middle, max(high - middle, middle - low) * (1 + 2.0**-50))


@dataclass(frozen=True)
class Expansion:
    """Taylor coefficients of solution and outputs in s = (t - t0) / unit, proven on the disc |s| <= radius."""

    order: int
    unit: float
    radius: float
    states: list[Series]
    outputs: list[Series]
    state_tails: list[float]
    output_tails: list[float]
    sizes: list[float]
    """Norm of each state's and output's polynomial on a disc of about the step's length."""

    def reach(self, bits: int) -> float:
        """Largest |s| at which every remainder is below 2**-bits of the norm of its state or output.

        At most 3/4 of the disc's radius, so that derivatives of the remainder are bounded too.
        """
        room = inf
        for size, tail in zip(self.sizes, self.state_tails + self.output_tails, strict=True):
            room = min(room, (log2(max(size, SMALLEST)) - log2(max(tail, SMALLEST)) - bits) / (self.order + 1))
        return self.radius * min(0.75, 2.0 ** min(room, 0.0))

    def state(self, index: int) -> Curve:
        return Curve.of(self.states[index], [Tail(self.order + 1, self.state_tails[index], self.radius)])

    def output_tail(self, index: int) -> Tail:
        return Tail(self.order + 1, self.output_tails[index], self.radius)

    def output(self, index: int) -> Curve:
        return Curve.of(self.outputs[index], [self.output_tail(index)])


def expand(
    program: Program, time: arb, state: Sequence[arb], order: int, unit: float, radius: float | None = None
) -> Expansion:
    """Expand the solutions through all points of a box (thin or not), with proven remainder bounds.

    ``unit``: time unit, a power of two; the result holds the unit that was used. ``radius``: radius of the first disc,
    in units; by default an estimate from the coefficients. UndecidedError if no disc is proven: the field is undefined
    on the box, or the box is too wide.
    """
    series = program.run(ctx.prec, time, state, order, arb(unit))
    if not all(row[order].is_finite() for row in series) or not unit > SMALLEST:
        raise _no_enclosure(time)
    if radius is None:
        radius = _estimate([series[i] for i in program.states + program.outputs], order)
        if radius < 2.0**-4:
            # In this unit, powers of such a small radius would underflow: change the unit.
            return expand(program, time, state, order, unit * 2.0 ** round(log2(radius)))
    states = [series[i] for i in program.states]
    outputs = [series[i] for i in program.outputs]
    sizes = magnitudes(series)
    for attempt in range(40):  # down to 1e-11 of the first radius
        tails = Tails(program, program.numbers(ctx.prec), sizes, radius, unit)
        proven = tails.validate()
        if proven is not None:
            norms = [tails.inner_norm(i) for i in program.states + program.outputs]
            return Expansion(order, unit, radius, states, outputs, proven[0], proven[1], norms)
        radius *= 0.8 if attempt < 6 else 0.5
    raise _no_enclosure(time)


def _no_enclosure(time: arb) -> UndecidedError:
    where = time.str(20, radius=False)
    reason = f"no enclosure of the solution just after t = {where}: the field is undefined or unbounded there"
    return UndecidedError(reason, "enclosure")


def _estimate(rows: Sequence[Series], order: int) -> float:
    """Estimate the radius of convergence, in units, from the growth of the later half of the coefficients."""
    half = order // 2
    growth = -1e3
    for row in rows:
        early = max(log2_size(c) for c in row[half - 1 : half + 2])
        late = max(log2_size(c) for c in row[order - 2 :])
        if early > -1e6:
            growth = max(growth, (late - early) / (order - half))
    # At most 2^6 units (the unit is adapted after each step), and no power of the radius may leave the doubles.
    return 0.9 * 2.0 ** min(-growth, 6.0, 900 / order)


def log2_size(c: arb) -> float:
    """log2 of the size of a ball's midpoint; a large negative number for 0."""
    mantissa, exponent = c.mid().man_exp()
    return float(int(exponent) + int(mantissa).bit_length()) if mantissa else -1e6


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
