"""Roots of a step's Taylor polynomial, every one of them: pairs, touches, roots at the very start.

A polynomial on (0, END] in units of the step is halved and recentred until each piece shows, by the sizes of its
own coefficients, that it has no root, one, one extremum, or is zero to the precision altogether. A double root
counts as a touch where the extremum is zero to the precision, and its place is the root of the derivative,
which is simple: nothing is lost to the square root of the precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import factorial, perm

from flint import arb, arb_poly

END = 1 + 2.0**-40
"""A little past the step, where its polynomial still holds: a root at the step's end falls in, not between."""
SPLIT = 0.5078125
"""Where a piece is split: off the middle, so that a root at a round fraction of a step is on no boundary."""
LEAST_SEPARATION = 2.0**-10
"""Fraction of a step: a minimum that would have a pair of roots so close together is a near graze."""


@dataclass(frozen=True)
class Root:
    """One root, in units of the step."""

    at: arb
    """Its place; the radius is what the coefficients leave open."""
    odd: bool
    """True: the polynomial changes sign; False: it touches zero."""


@dataclass(frozen=True)
class NearMiss:
    """An extremum that nearly reaches zero, in units of the step."""

    at: arb
    value: arb
    """Value of the polynomial there."""


@dataclass
class Roots:
    """All roots of a polynomial on (0, END], in order."""

    roots: list[Root] = field(default_factory=list)
    near_misses: list[NearMiss] = field(default_factory=list)


def isolate(coefficients: Sequence[arb], zero: arb) -> Roots:
    """All roots on (0, END].

    Parameters
    ----------
    coefficients : sequence of arb
        Lowest first, in units of the step. The polynomial is not zero at 0: divide by the power of the
        variable that is known to be a factor first.
    zero : arb
        A value below which an extremum counts as zero.
    """
    search = _Search(arb_poly(list(coefficients)), zero)
    search.piece(arb(0), arb(END), search.polynomial(arb_poly([END / 2, END / 2])))
    return search.found


def _ball(a: arb, b: arb) -> arb:
    """A ball that holds [a, b]."""
    return a.union(b)


def _sign(value: arb) -> int:
    """Sign of the midpoint."""
    middle = value.mid()
    return (middle > 0) - (middle < 0)


class _Search:
    """The search for all roots of one polynomial."""

    def __init__(self, polynomial: arb_poly, zero: arb) -> None:
        self.polynomial = polynomial
        self.slope = polynomial.derivative()
        self.curvature = self.slope.derivative()
        self.zero = zero
        self.found = Roots()

    def piece(self, a: arb, b: arb, local: arb_poly) -> None:
        """Append the roots on (a, b], where the polynomial is ``local`` in a variable that runs from -1 to 1."""
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
            middle, right = a + (b - a) * arb(SPLIT), 1 - SPLIT
            short = arb_poly(c)
            self.piece(a, middle.mid(), short(arb_poly([SPLIT - 1, SPLIT])))
            self.piece(middle.mid(), b, short(arb_poly([1 - right, right])))

    def _shortened(self, local: arb_poly) -> list[arb]:
        """Coefficients without a tail that is far below what counts as zero; the first one's radius holds it."""
        c = local.coeffs()
        tail, negligible = arb(0), self.zero * 2.0**-40
        while len(c) > 4 and tail + abs(c[-1]) < negligible:
            tail += abs(c.pop())
        c[0] += arb(0, tail.upper())
        return c

    def _between(self, a: arb, b: arb) -> None:
        """The root on (a, b], if any, where the polynomial is monotone."""
        end = _sign(self.polynomial(b))
        if _sign(self.polynomial(a)) * end < 0 or end == 0:
            self.found.roots.append(Root(simple_root(self.polynomial, self.slope, a, b), odd=True))

    def _around_extremum(self, a: arb, b: arb) -> None:
        """Roots on (a, b], where the second derivative keeps its sign: at most one extremum."""
        if _sign(self.slope(a)) * _sign(self.slope(b)) >= 0:
            self._between(a, b)
            return
        at = simple_root(self.slope, self.curvature, a, b).mid()
        value, curvature = self.polynomial(at), self.curvature(at)
        if abs(value.mid()) <= self.zero:
            self.found.roots.append(Root(at, odd=False))
        elif _sign(value) != _sign(curvature):  # the extremum lies beyond zero: a root on either side of it
            self._between(a, at)
            self._between(at, b)
        elif abs(2 * value / curvature) < LEAST_SEPARATION**2:
            self.found.near_misses.append(NearMiss(at, value))

    def _cluster(self, a: arb, b: arb, order: int) -> None:
        """A root of multiplicity three or more: the simple root of the derivative before the one that dominates."""
        before = self.polynomial
        for _ in range(order - 1):
            before = before.derivative()
        end = _sign(before(b))
        if _sign(before(a)) * end < 0 or end == 0:  # else the root is on a neighbouring piece
            at = simple_root(before, before.derivative(), a, b).mid()
            self.found.roots.append(Root(at, odd=order % 2 == 1))


def _dominates(c: Sequence[arb], sizes: Sequence[arb], order: int) -> bool:
    """Whether the derivative of an order keeps its sign for a variable from -1 to 1."""
    rest = sum((perm(k, order) * sizes[k] for k in range(order + 1, len(c))), arb(0))
    return bool(factorial(order) * abs(c[order]) > rest)


def simple_root(p: arb_poly, slope: arb_poly, a: arb, b: arb) -> arb:
    """The root of a function that is monotone on [a, b] and changes sign: bisection and interval Newton."""
    sign_b = _sign(p(b))
    if sign_b == 0:
        return b
    while slope(_ball(a, b)).contains(0):
        middle = ((a + b) / 2).mid()
        sign = _sign(p(middle))
        if sign == 0 or not a < middle < b:
            return middle
        a, b = (a, middle) if sign == sign_b else (middle, b)
    x = _ball(a, b)
    while True:
        middle = x.mid()
        value = p(middle)
        step = middle - value / slope(x)
        if not step.overlaps(x):  # rounding alone: the root lies on the rim
            return middle
        narrower = step.intersection(x)
        if not narrower.rad() < x.rad() / 2:
            if value.contains(0):
                return narrower
            # The slope varies too much over the bracket (an extremum close by): halve it.
            low, high = arb(x.lower()), arb(x.upper())
            narrower = _ball(low, middle) if _sign(value) == sign_b else _ball(middle, high)
            if not narrower.rad() < x.rad():
                return narrower
        x = narrower
