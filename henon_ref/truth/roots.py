"""Roots of a step's Taylor polynomial, every one of them: pairs, touches, roots at the very start.

A polynomial on (0, END] in units of the step. Its coefficients fall fast (a Taylor step is a fraction of the
radius of convergence), so that plain interval evaluation is sharp and a few bisections isolate all roots.
A double root counts as a touch where the extremum is zero to the precision, and its place is the root of the
derivative, which is simple: nothing is lost to the square root of the precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from flint import arb, arb_poly

END = 1 + 2.0**-40
"""A little past the step, where its polynomial still holds: a root at the step's end falls in, not between."""
NARROW = 2.0**-90
"""Width below which roots that do not separate count as one multiple root."""
NEAR = 2.0**-10
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
    derivatives = [arb_poly(list(coefficients))]
    for _ in range(min(8, max(len(coefficients) - 1, 1))):
        derivatives.append(derivatives[-1].derivative())
    found = Roots()
    _search(derivatives, arb(0), arb(END), zero, found)
    return found


def _ball(a: arb, b: arb) -> arb:
    """A ball that holds [a, b]."""
    return a.union(b)


def _sign(value: arb) -> int:
    """Sign of the midpoint."""
    middle = value.mid()
    return (middle > 0) - (middle < 0)


def _excludes_zero(p: arb_poly, slope: arb_poly, x: arb) -> bool:
    if not p(x).contains(0):
        return True
    return not (p(x.mid()) + slope(x) * (x - x.mid())).contains(0)


def _search(d: list[arb_poly], a: arb, b: arb, zero: arb, found: Roots) -> None:
    """Roots on (a, b], appended in order."""
    x = _ball(a, b)
    if _excludes_zero(d[0], d[1], x):
        return
    if not d[1](x).contains(0):
        _between(d, a, b, found)
    elif len(d) > 2 and not d[2](x).contains(0):
        _around_extremum(d, a, b, zero, found)
    elif b - a < NARROW:
        _cluster(d, a, b, zero, found)
    else:
        # Off the middle, so that a root at a round fraction of a step does not fall on a boundary.
        middle = a + (b - a) * arb(0.5078125)
        _search(d, a, middle, zero, found)
        _search(d, middle, b, zero, found)


def _between(d: list[arb_poly], a: arb, b: arb, found: Roots) -> None:
    """The root on (a, b], if any, where the polynomial is monotone."""
    if _sign(d[0](a)) * _sign(d[0](b)) < 0 or _sign(d[0](b)) == 0:
        found.roots.append(Root(simple_root(d[0], d[1], a, b), odd=True))


def simple_root(p: arb_poly, slope: arb_poly, a: arb, b: arb) -> arb:
    """The root of a function that is monotone on [a, b] and changes sign: bisection, then interval Newton."""
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
        step = middle - p(middle) / slope(x)
        if not step.overlaps(x):  # rounding alone: the root lies on the rim
            return middle
        narrower = step.intersection(x)
        if not narrower.rad() < x.rad() / 2:
            return narrower
        x = narrower


def _around_extremum(d: list[arb_poly], a: arb, b: arb, zero: arb, found: Roots) -> None:
    """Roots on (a, b], where the second derivative keeps its sign: at most one extremum."""
    if _sign(d[1](a)) * _sign(d[1](b)) >= 0:
        _between(d, a, b, found)
        return
    at = simple_root(d[1], d[2], a, b).mid()
    value = d[0](at)
    if abs(value.mid()) <= zero:
        found.roots.append(Root(at, odd=False))
        return
    if _sign(value) != _sign(d[2](at)):  # the extremum lies beyond zero: a root on either side where the end is
        _between(d, a, at, found)
        _between(d, at, b, found)
    elif abs(2 * value / d[2](at)) < NEAR**2:
        found.near_misses.append(NearMiss(at, value))


def _cluster(d: list[arb_poly], a: arb, b: arb, zero: arb, found: Roots) -> None:
    """A root of multiplicity three or more: a simple root of the lowest derivative that has one."""
    x = _ball(a, b)
    for order in range(3, len(d)):
        if not d[order](x).contains(0):
            at = x.mid() - d[order - 1](x.mid()) / d[order](x.mid())
            if abs(d[0](at).mid()) <= zero:
                found.roots.append(Root(at.mid(), odd=order % 2 == 1))
            return
