"""A closer look at an event that double precision cannot decide: a pair of roots, a touch, or a miss.

The polynomial of the step is made again with 220 bits (:mod:`henon_ref.henon.multiprecision`), and
its roots are isolated as in :mod:`henon_ref.henon.polynomial`, in integers: a number v stands as v 2^220. Where the
closer look in double-double has left nothing open but a window that ends at a minimum, that is all that is looked at.
The state at the step's start is taken as it is (its rounded part included).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb, factorial
from typing import Literal

from flint import arb, arb_poly, ctx

from henon_ref.henon.multiprecision import Motions
from henon_ref.henon.near import BESIDE
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem

BITS = 220
"""Bits after the point of a polynomial's coefficients, its size on the step being 1, and of places on the step."""
ONE = 1 << BITS
NOTHING = 2.0**-166
"""What counts as zero: 1e-50 of the polynomial's size."""
NOISE = 2.0**-204
"""Slopes below this of the size cannot be told from zero."""
SETTLED, PLACED = 2.0**-180, 2.0**-60
"""A minimum is found where another step of Newton's would lower it by less than the one, of its size, and move it by
less than the other, of the step."""
ROUNDS = 20
"""Steps of Newton's method after which it is not found."""
_ZERO = int(ONE * NOTHING)
CLOSE = 2 ** (BITS - 160)
"""Places closer to each other than 1e-48 of the step are one."""
SAME = int(ONE * 1e-10)
"""Minima closer to each other are one and the same."""
CURVED = 1e-6
"""A relative second derivative above this at a minimum makes it one of second order."""
UNSEEN = 1e-20
"""Values below this of the size are not relied on where double-double has looked at a flat minimum."""
NEXT = int(ONE * 1e-6)
"""A place where all is next to nothing lies no farther from where the slope vanishes."""
HIGHEST = 16
"""Highest order of a root that is told."""
DEPTH = 200
"""Halvings of the step before what is left of it counts as a point."""
_BEYOND = 1 + arb(2) ** -46
"""A root that rounding has put on the step's end may lie just behind it."""
Pair = tuple[float, float]
What = Literal["root", "touch", "miss"]
Fixed = Sequence[int]
"""Coefficients, each times 2^220."""


@dataclass(frozen=True)
class Finding:
    """What a guard does near a doubtful point."""

    what: What
    lowest: bool
    """True where the guard has a minimum there (a touch, or a miss)."""
    parabolic: bool
    """True where that is a minimum of second order."""
    time: Pair
    """The time of the root or the minimum, and what rounding it lost."""
    state: tuple[Pair, ...]
    """State there."""


class CloserLook:
    """Looks closer at one system's events."""

    def __init__(self, system: FilippovSystem) -> None:
        self._motions = Motions(system)

    def look(
        self,
        mode: Mode,
        guard: int,
        zeros: int,
        time: Pair,
        state: Sequence[Pair],
        near: Pair,
        reach: float,
        clear: float | None = None,
    ) -> Finding:
        """Find the guard's first root up to a doubtful point, or its minimum there.

        Parameters
        ----------
        mode, guard
            Which guard of which mode, in the order of :meth:`FilippovSystem.equations`.
        zeros : int
            Known zeros of the guard at the step's start.
        time, state
            The step's start, each as two doubles that add up to it.
        near : pair of float
            Where the doubtful point was seen, counted from the start.
        reach : float
            End of the step.
        clear : float, optional
            Where the doubtful point is a minimum: up to here, counted from the start, the guard has no root.
            ``near`` itself where the sign of the minimum alone is open.
        """
        with ctx.workprec(BITS):
            start = arb(time[0]) + arb(time[1])
            x = [arb(high) + arb(low) for high, low in state]
            unit = arb(reach) * _BEYOND
            states, series = self._motions.polynomials(mode, guard, start, x, unit)
            if zeros:
                series = _apart(series, zeros)
            place = (arb(near[0]) + arb(near[1])) / unit
            found = None
            if clear is not None:
                found = _at_minimum(series, place, place - arb(clear) / unit if clear < near[0] else None)
            if found is None:
                q = fixed(series.coeffs()[zeros:])
                what, lowest, part = _decided(q, zeros, _integer(place))
                parabolic = lowest and _bend([0] * zeros + q, part) > CURVED * ONE
                found = what, lowest, parabolic, arb(part) / ONE
            what, lowest, parabolic, place = found
            return Finding(
                what, lowest, parabolic, _split(start + unit * place), tuple([_split(x(place)) for x in states])
            )


def _apart(guard: arb_poly, zeros: int) -> arb_poly:
    """A guard with its known zeros put at 0, where rounding has left them beside it; the other roots stay.

    See :func:`henon_ref.henon.near._divide_out`.
    """
    c = guard.coeffs()
    q = c[zeros:]
    if len(q) > 1 and all(abs(low) <= BESIDE * abs(q[0]) for low in c[:zeros]):
        factor = [arb(0)] * zeros
        for _ in range(4):
            for i in range(zeros):
                known = [factor[j] * q[i - j] for j in range(i) if i - j < len(q)]
                factor[i] = ((c[i] - sum(known, arb(0))) / q[0]).mid()
            for k in range(len(q) - 1, -1, -1):
                above = range(max(zeros + k - len(q) + 1, 0), zeros)
                q[k] = c[k + zeros] - sum((factor[j] * q[k + zeros - j] for j in above), arb(0))
    return arb_poly([0] * zeros + q)


def _integer(number: arb) -> int:
    """A number's middle times 2^220, rounded down."""
    mantissa, exponent = number.mid().man_exp()
    shift = int(exponent) + BITS
    return int(mantissa) << shift if shift >= 0 else int(mantissa) >> -shift


def fixed(series: Sequence[arb]) -> list[int]:
    """A polynomial over its size, the sum of its coefficients' sizes."""
    size = sum((abs(c) for c in series), arb(0)).mid()
    return [_integer(c / size) for c in series] if size != 0 else [0] * len(series)


def _split(number: arb) -> Pair:
    """A number as two doubles; what is lost to the second, too, would only make it miss round numbers."""
    high = float(number)
    low = float(number - high)
    return high, (low if abs(low) > 2.0**-106 * abs(high) else 0.0)


def _value(series: Fixed, place: int) -> int:
    total = 0
    for c in reversed(series):
        total = (total * place >> BITS) + c
    return total


def _derivative(series: Fixed) -> list[int]:
    return [k * c for k, c in enumerate(series)][1:]


def _bend(series: Fixed, place: int) -> int:
    return _value(_derivative(_derivative(series)), place)


def _decided(q: Fixed, zeros: int, near: int) -> tuple[What, bool, int]:
    """What q tau^zeros does on (0, 1] up to its minimum near a point: (what, at a minimum, where)."""
    outcome, low, high = first_falling_root(q)
    whole = [0] * zeros + list(q)
    bottom = _minimum(whole, near)
    middle = (low + high) // 2
    if outcome == "touch" or (outcome == "root" and low == high):  # all is next to nothing there
        crossed = _odd_root(q, middle, exact=outcome == "root")
        if crossed is not None and (bottom is None or bottom >= low):
            return "root", False, crossed
    if outcome == "touch":
        touched = _minimum(whole, middle)
        touched = middle if touched is None else touched
        if bottom is None or touched <= bottom + SAME:
            return "touch", True, touched
    if outcome != "root" or (bottom is not None and low > bottom):  # what lies behind a minimum has to wait
        return "miss", bottom is not None, near if bottom is None else bottom
    return "root", False, _root([-c for c in q], low, high)


def _odd_root(q: Fixed, place: int, *, exact: bool) -> int | None:
    """The root of odd order that all is next to nothing about; None where the order is even.

    Its order is that of the term that lifts the polynomial from there. A root of order m is one of order 1 of
    derivative m - 1, which tells where it is. ``exact``: it is at the place, which else is next to it.
    """
    derivatives = [list(q)]
    for _ in range(HIGHEST):
        derivatives.append(_derivative(derivatives[-1]))
    if not exact:
        place = _flat(derivatives, place)
    order = _lift([_value(d, place) / ONE / factorial(k) for k, d in enumerate(derivatives)], NOTHING)[1]
    if order % 2 == 0:
        return None
    for _ in range(8):
        place -= (_value(derivatives[order - 1], place) << BITS) // _value(derivatives[order], place)
    return place


def _flat(derivatives: Sequence[Fixed], place: int) -> int:
    """Where the slope vanishes next to a place: Newton's method on the slope over its derivative."""
    found = place
    for _ in range(ROUNDS):
        slope, bend, twist = (_value(d, found) for d in derivatives[1:4])
        below = bend * bend - slope * twist
        if below <= 0:
            break
        shift = (slope * bend << BITS) // below
        found -= shift
        if abs(shift) <= CLOSE:
            break
    return found if abs(found - place) <= NEXT else place


def _lift(local: Sequence[float], level: float) -> tuple[float, int]:
    """How far from a place a polynomial stays within ``level`` of its value there, and the order of what lifts it.

    ``local`` are its Taylor coefficients at the place.
    """
    return min((((level / abs(c)) ** (1 / k), k) for k, c in enumerate(local) if k and c), default=(1.0, 0))


def _at_minimum(guard: arb_poly, place: arb, width: arb | None) -> tuple[What, bool, bool, arb] | None:
    """What a guard does up to its minimum next to a place: (what, at a minimum, whether parabolic, where).

    None where the whole step has to be looked at. The guard has no root but on a window of some width that ends at the
    place; without a width the minimum's sign alone is open.
    """
    coefficients = guard.coeffs()
    size = sum(map(abs, map(float, coefficients)))
    first = guard.derivative()
    slopes = first, (second := first.derivative()), second.derivative()
    bottom = place
    # Newton's method on the slope over its derivative: flat minima, too, are simple roots of that.
    for _ in range(ROUNDS):
        slope, bend, twist = [float(p(bottom)) for p in slopes]
        if abs(slope) <= NOISE * size:
            break
        below = bend * bend - slope * twist
        if not (bend > 0.0 and below > 0.0):
            return None
        shift = slope * bend / below
        if abs(slope * shift) <= SETTLED * size and abs(shift) <= PLACED:
            break
        bottom -= shift
    else:
        return None
    parabolic = bend > CURVED * size
    depth = float(guard(bottom))
    touching = abs(depth) <= NOTHING * size
    local = list(map(float, guard(arb_poly([bottom, 1])).coeffs()))
    point, order = _lift(local, NOTHING * size / len(local))
    if order % 2:  # no minimum, a root of odd order
        return None
    if width is not None:
        width = width + (bottom - place)
    elif not parabolic:  # next to a flat minimum there may be roots that double-double has not seen
        width = arb(_lift(local, UNSEEN * size)[0])
    if width is not None:
        before, after = _beside(guard, bottom, point, width, size)
        if touching or depth > 0.0:
            proven = all(before) and all(after)
        else:
            proven = sum(x != y for x, y in pairwise(before)) == 1
        if not proven:
            return None
    if touching or depth > 0.0:
        return "touch" if touching else "miss", True, parabolic, bottom
    q, high, across = fixed(coefficients), _integer(bottom), CLOSE
    while _value(q, high - across) <= 0:
        across *= 4
    return "root", False, False, arb(_root([-c for c in q], high - across, high)) / ONE


def _beside(guard: arb_poly, place: arb, point: float, width: arb, size: float) -> list[list[bool]]:
    """Signs of a guard's Bernstein coefficients on both sides of a place, from one distance to another."""
    sides = [guard(arb_poly([place + side * point, side * (width - point)])).coeffs() for side in (-1, 1)]
    return [_signs(_bernstein([_integer(c / size) for c in side])) for side in sides]


def first_falling_root(q: Fixed) -> tuple[Literal["none", "root", "touch"], int, int]:
    """Isolate the first root on (0, 1] through which a polynomial falls: (outcome, low, high).

    Descartes' rule of signs on Bernstein coefficients, as in the compiled
    :func:`henon_ref.henon.polynomial.first_falling_root`.
    """
    stack = [(0, 0, _bernstein(q))]  # (level, place, coefficients) of the piece [place, place + 1] / 2^level
    before = False
    while stack:
        level, place, b = stack.pop()
        low, high = place << (BITS - level), (place + 1) << (BITS - level)
        signs = _signs(b)
        changes = sum(x != y for x, y in pairwise(signs))
        if not signs or level >= DEPTH:
            return "touch", low, high
        if before and abs(b[0]) <= _ZERO:  # zero where the step was halved: what comes next decides
            if changes == 0:
                return ("root" if not signs[0] else "touch"), low, low
        elif before and not signs[0]:
            return "root", low, low
        elif changes == 0 or (changes == 1 and not signs[0]):
            before = signs[-1]
            continue
        elif changes == 1 and abs(b[-1]) > _ZERO:
            return "root", low, high
        left, right = _halves(b)
        stack += [(level + 1, 2 * place + 1, right), (level + 1, 2 * place, left)]
    return "none", 0, 0


def _bernstein(q: Fixed) -> list[int]:
    """Coefficients of a polynomial on [0, 1] in Bernstein's basis."""
    degree = len(q) - 1
    return [sum(comb(i, k) * q[k] // comb(degree, k) for k in range(i + 1)) for i in range(degree + 1)]


def _signs(b: Sequence[int]) -> list[bool]:
    """For each coefficient that is not next to nothing whether it is positive."""
    return [c > 0 for c in b if abs(c) > _ZERO]


def _halves(b: list[int]) -> tuple[list[int], list[int]]:
    """Bernstein coefficients on the two halves (de Casteljau)."""
    left, right = [b[0]], [b[-1]]
    while len(b) > 1:
        b = [(x + y) >> 1 for x, y in pairwise(b)]
        left.append(b[0])
        right.append(b[-1])
    return left, right[::-1]


def _root(rising: Fixed, low: int, high: int) -> int:
    """The root of a polynomial that rises through zero between two places: Newton's method in a bracket.

    Where a step leaves the bracket, or two in a row have not halved it, it is halved.
    """
    slope = _derivative(rising)
    tau, slow = (low + high) >> 1, 0
    while high - low > CLOSE:
        width = high - low
        value, rate = _value(rising, tau), _value(slope, tau)
        low, high = (tau, high) if value < 0 else (low, tau)
        new = tau - (value << BITS) // rate if rate > 0 else -1
        if abs(new - tau) <= CLOSE and low <= new <= high:
            return new
        slow = slow + 1 if 2 * (high - low) > width else 0
        if slow > 2 or not low <= new <= high:
            new, slow = (low + high) >> 1, 0
        tau = new
    return tau


def _minimum(series: Fixed, near: int) -> int | None:
    """The minimum of a polynomial on [0, 1] that a point lies next to; None if there is none."""
    slope = _derivative(series)
    width = max(near >> 50, 1)
    low, high = near - width, near + width
    while _value(slope, low) >= 0:
        width *= 4
        low = near - width
        if low <= 0:
            return None
    while _value(slope, high) <= 0:
        width *= 4
        high = near + width
        if high > ONE:
            return None
    return _root(slope, low, high)
