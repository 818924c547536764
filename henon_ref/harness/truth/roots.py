"""All roots of a step's Taylor polynomial, including close pairs, double roots and roots near the start.

A polynomial on (0, END] in units of the step is bisected and recentred until the coefficients of each piece prove that
the piece has no root, one root, one extremum, or is zero to the precision. An extremum whose value is zero to the
precision counts as a double root (a graze) at the root of the derivative. That root is simple, so no digits are lost
to the square root of the precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial, perm

from flint import arb, arb_poly

END = 1 + 2.0**-40
"""End of the search, slightly after the step, where its polynomial still holds: finds a root at the step's end."""


@dataclass(frozen=True)
class Root:
    """One root, in units of the step."""

    at: arb
    """The place of the root; its radius comes from the radii of the coefficients."""
    odd: bool
    """True: the polynomial changes sign; False: it touches zero."""


NearMiss = tuple[arb, arb]
"""Place (in units of the step) and value of an extremum near zero."""


def isolate(coefficients: Sequence[arb], zero: arb) -> tuple[list[Root], list[NearMiss]]:
    """Locate all roots and near misses on (0, END], in order.

    The coefficients are in units of the step, lowest first. The polynomial must not be zero at 0: divide it by any
    power of the variable that is a known factor. An extremum below ``zero`` counts as zero.
    """
    search = _Search(arb_poly(list(coefficients)), zero)
    search.piece(arb(0), arb(END), search.polynomial(arb_poly([END / 2, END / 2])))
    return search.roots, search.near_misses


def _sign(value: arb) -> int:
    """Sign of the midpoint."""
    middle = value.mid()
    return (middle > 0) - (middle < 0)


class _Search:
    def __init__(self, polynomial: arb_poly, zero: arb) -> None:
        self.polynomial = polynomial
        self.slope = polynomial.derivative()
        self.curvature = self.slope.derivative()
        self.zero = zero
        self.roots: list[Root] = []
        self.near_misses: list[NearMiss] = []

    def piece(self, a: arb, b: arb, local: arb_poly) -> None:
        """Append the roots on (a, b], where the polynomial is ``local`` in a variable from -1 to 1."""
        c = self._shortened(local)
        sizes = [abs(v).upper() for v in c]
        order = next((n for n in range(len(c)) if _dominates(c, sizes, n)), len(c))
        if order == 0:
            return
        if order == 1:
            self._between(a, b)
        elif order == 2:
            self._around_extremum(a, b)
        elif sum(sizes, arb(0)) <= self.zero:
            if order < len(c):
                self._cluster(a, b, order)
        else:
            split = 0.5078125  # not 0.5, so that a root at a simple fraction of a step is on no boundary
            middle, right = a + (b - a) * arb(split), 1 - split
            short = arb_poly(c)
            self.piece(a, middle.mid(), short(arb_poly([split - 1, split])))
            self.piece(middle.mid(), b, short(arb_poly([1 - right, right])))

    def _shortened(self, local: arb_poly) -> list[arb]:
        """Coefficients without negligible terms of high order, which are added to the radius of the first one."""
        c = local.coeffs()
        tail, negligible = arb(0), self.zero * 2.0**-40
        while len(c) > 4 and tail + abs(c[-1]) < negligible:
            tail += abs(c.pop())
        c[0] += arb(0, tail.upper())
        return c

    def _between(self, a: arb, b: arb) -> None:
        """Append the root on (a, b], if any, of the monotone polynomial."""
        end = _sign(self.polynomial(b))
        if _sign(self.polynomial(a)) * end < 0 or end == 0:
            self.roots.append(Root(simple_root(self.polynomial, self.slope, a, b), odd=True))

    def _around_extremum(self, a: arb, b: arb) -> None:
        """Append the roots on (a, b], where the second derivative has one sign: at most one extremum."""
        if _sign(self.slope(a)) * _sign(self.slope(b)) >= 0:
            self._between(a, b)
            return
        at = simple_root(self.slope, self.curvature, a, b).mid()
        value, curvature = self.polynomial(at), self.curvature(at)
        if abs(value.mid()) <= self.zero:
            self.roots.append(Root(at, odd=False))
        elif _sign(value) != _sign(curvature):  # the extremum is across zero: one root on each side of it
            self._between(a, at)
            self._between(at, b)
        elif abs(2 * value / curvature) < 2.0**-20:  # as if a pair of roots were less than 2^-10 of the step apart
            self.near_misses.append((at, value))

    def _cluster(self, a: arb, b: arb, order: int) -> None:
        """Append a root of multiplicity ``order`` >= 3: the simple root of the derivative of one order less."""
        before = self.polynomial
        for _ in range(order - 1):
            before = before.derivative()
        end = _sign(before(b))
        if _sign(before(a)) * end < 0 or end == 0:  # else the root is on a neighbouring piece
            at = simple_root(before, before.derivative(), a, b).mid()
            self.roots.append(Root(at, odd=order % 2 == 1))


def _dominates(c: Sequence[arb], sizes: Sequence[arb], order: int) -> bool:
    """Whether the derivative of an order has one sign for a variable from -1 to 1."""
    rest = sum((perm(k, order) * sizes[k] for k in range(order + 1, len(c))), arb(0))
    return bool(factorial(order) * abs(c[order]) > rest)


def simple_root(p: arb_poly, slope: arb_poly, a: arb, b: arb) -> arb:
    """Locate the root of a monotone function that changes sign on [a, b], by bisection and interval Newton."""
    sign_b = _sign(p(b))
    if sign_b == 0:
        return b
    while slope(a.union(b)).contains(0):
        middle = ((a + b) / 2).mid()
        sign = _sign(p(middle))
        if sign == 0 or not a < middle < b:
            return middle
        a, b = (a, middle) if sign == sign_b else (middle, b)
    x = a.union(b)
    while True:
        middle = x.mid()
        value = p(middle)
        step = middle - value / slope(x)
        if not step.overlaps(x):  # only by rounding: the root is at the end of the bracket
            return middle
        narrower = step.intersection(x)
        if not narrower.rad() < x.rad() / 2:
            if value.contains(0):
                return narrower
            # The slope varies too much over the bracket, because of an extremum nearby: halve it.
            low, high = arb(x.lower()), arb(x.upper())
            narrower = low.union(middle) if _sign(value) == sign_b else middle.union(high)
            if not narrower.rad() < x.rad():
                return narrower
        x = narrower
