"""Roots of polynomials in fixed point of 220 bits: the first one through which a guard falls, and touches before it.

A number v stands as the integer v 2^220; the polynomial's size is 1 and its variable runs from 0 to 1. Roots are
isolated as in the compiled ``henon_ref/kernel/roots.c``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import comb, factorial
from typing import Literal

from flint import arb, arb_poly

from henon_ref.kernel.shared import EPS
from henon_ref.precision import working_precision

BITS = 220
"""Bits after the point of a polynomial's coefficients, its size on the step being 1, and of places on the step."""
ONE = 1 << BITS
RELATIVE_ZERO = 2.0**-166
"""What counts as zero: 1e-50 of the polynomial's size."""
FLAT_STEPS = 20
"""Steps of Newton's method after which it is not found."""
ZERO = int(ONE * RELATIVE_ZERO)
"""The same in fixed point."""
CLEARANCE = 4
"""A piece no larger than so many times what counts as zero is a touch, one larger than that is none."""
SAME_PLACE = 2 ** (BITS - 160)
"""Places closer to each other than 1e-48 of the step are one."""
SAME_MINIMUM = int(ONE * 1e-10)
"""Minima closer to each other are one and the same."""
FLAT_RANGE = int(ONE * 1e-6)
"""A place where all is next to nothing lies no farther from where the slope vanishes."""
HIGHEST = 16
"""Highest order of a root that is told."""
POINT = ONE >> 200
"""What is left of the step when it counts as a point."""
NEGLIGIBLE = ZERO >> 20
"""Coefficients that do not count."""
CUT_PIECES = 64
"""Pieces looked at after which they are only halved."""
NEWTON_STEPS = 12
"""Steps of Newton's method towards the minimum of a piece."""
CUT_LEAST, CUT_MOST = 2.0**-20, 2.0**-3
"""What is cut out around a minimum: at least the one and at most the other of its piece, to either side."""
SMALL = ONE >> 40
"""A value that is no touch if it is larger."""
TOUCH_BITS = 80
"""Around a touch so much less than its piece is cut out at first."""
What = Literal["root", "touch", "miss"]
Fixed = Sequence[int]
"""Coefficients, each times 2^220."""


def fixed_point(number: arb) -> int:
    """A number's middle times 2^220, rounded down."""
    mantissa, exponent = number.mid().man_exp()
    shift = int(exponent) + BITS
    return int(mantissa) << shift if shift >= 0 else int(mantissa) >> -shift


def fixed(series: Sequence[arb]) -> list[int]:
    """A polynomial over its size, the sum of its coefficients' sizes."""
    size = sum((abs(c) for c in series), arb(0)).mid()
    return [fixed_point(c / size) for c in series] if size != 0 else [0] * len(series)


def first_event_of(q: Fixed, zeros: int, suspect: int) -> tuple[What, bool, int]:
    """What q tau^zeros does on (0, 1] up to its minimum near a point: (what, at a minimum, where)."""
    outcome, low, high = first_falling_root(q)
    whole = [0] * zeros + list(q)
    bottom = _minimum(whole, suspect)
    middle = (low + high) // 2
    if outcome == "touch" or (outcome == "root" and low == high):  # all is next to nothing there
        crossed = outcome == "root" or _falls_behind(q, low, high)
        if crossed and (bottom is None or bottom >= low):
            return "root", False, _flat_root(q, middle, 1, exact=outcome == "root")
    if outcome == "touch":
        touched = _minimum(whole, middle)
        touched = middle if touched is None else touched
        if bottom is None or touched <= bottom + SAME_MINIMUM:
            return "touch", True, _flat_root(whole, touched, 0, exact=True)
    if outcome != "root" or (bottom is not None and low > bottom):  # what lies behind a minimum has to wait
        return "miss", bottom is not None, suspect if bottom is None else bottom
    return "root", False, rising_root([-c for c in q], low, high)


def _falls_behind(q: Fixed, low: int, high: int) -> bool:
    """Whether a polynomial that is next to nothing between two places is below zero where it is so no more."""
    distance = max(high - low, SAME_PLACE)
    while high + distance <= ONE:
        value = horner(q, high + distance)
        if abs(value) > CLEARANCE * ZERO:
            return value < 0
        distance *= 2
    return False


def _flat_root(q: Fixed, place: int, parity: int, *, exact: bool) -> int:
    """The root of even or odd order that all is next to nothing about, or the mean of several that are told as one.

    Its order is that of the term that lifts the polynomial from there. A root of order m is one of order 1 of
    derivative m - 1, which tells where it is. ``exact``: it is at the place, which else is next to it.
    """
    derivatives = [list(q)]
    for _ in range(HIGHEST):
        derivatives.append(_derivative(derivatives[-1]))
    refined = place if exact else _exactly_flat(derivatives, place)
    order = leading_term([horner(d, refined) / ONE / factorial(k) for k, d in enumerate(derivatives)], RELATIVE_ZERO)[1]
    if order % 2 != parity or order == 0:
        return place
    for _ in range(8):
        refined -= (horner(derivatives[order - 1], refined) << BITS) // horner(derivatives[order], refined)
    return refined


def _exactly_flat(derivatives: Sequence[Fixed], place: int) -> int:
    """Where the slope vanishes near a place: Newton's method on the slope over its derivative while it converges."""
    found, longest = place, FLAT_RANGE
    for _ in range(FLAT_STEPS):
        slope, bend, twist = (horner(d, found) for d in derivatives[1:4])
        below = bend * bend - slope * twist
        if below <= 0:
            break
        shift = (slope * bend << BITS) // below
        if abs(shift) > longest:
            break
        found -= shift
        if abs(shift) <= SAME_PLACE:
            break
        longest = abs(shift) // 2
    return found


def leading_term(local: Sequence[float], level: float) -> tuple[float, int]:
    """How far from a place a polynomial stays within ``level`` of its value there, and the order of what lifts it.

    ``local`` are its Taylor coefficients at the place.
    """
    return min((((level / abs(c)) ** (1 / k), k) for k, c in enumerate(local) if k and c), default=(1.0, 0))


def first_falling_root(q: Fixed) -> tuple[Literal["none", "root", "touch"], int, int]:
    """Isolate the first root on (0, 1] through which a polynomial falls: (outcome, low, high).

    Descartes' rule of signs on Bernstein coefficients, as in the compiled
    ``first_falling_root`` of ``henon_ref/kernel/roots.c``.
    """
    with working_precision(BITS):
        whole = arb_poly([arb(c) / ONE for c in q])
        stack = [(0, ONE)]
        before, looked = False, 0
        while stack:
            low, high = stack.pop()
            looked += 1
            piece = q if high - low == ONE else _piece(whole, low, high)
            b = bernstein(piece)
            signs = signs_of(b)
            changes = sum(x != y for x, y in pairwise(signs))
            if max(map(abs, b)) <= CLEARANCE * ZERO or high - low <= POINT:
                return "touch", low, high
            if before and abs(b[0]) <= ZERO:  # zero where the step was cut: what comes next decides
                if changes == 0:
                    return ("root" if not signs[0] else "touch"), low, low
            elif before and not signs[0]:
                return "root", low, low
            elif (changes == 0 and not _unclear(b)) or (changes == 1 and not signs[0]):
                before = signs[-1]
                continue
            elif changes == 1 and abs(b[-1]) > CLEARANCE * ZERO:
                return "root", low, high
            places = _around_minimum(q, piece, low, high) if signs[0] and looked < CUT_PIECES else []
            stack += reversed([*pairwise([low, *(places or [_middle(q, low, high)]), high])])
    return "none", 0, 0


def bernstein_on(q: Fixed, low: int, high: int) -> list[int]:
    """Coefficients of a polynomial on [low, high] in Bernstein's basis."""
    return bernstein(_piece(arb_poly([arb(c) / ONE for c in q]), low, high))


def _piece(whole: arb_poly, low: int, high: int) -> list[int]:
    """Coefficients on [low, high], of a variable from 0 to 1 there, without last ones that count for nothing."""
    series = whole(arb_poly([arb(low) / ONE, arb(high - low) / ONE])).coeffs()
    found = [fixed_point(c) for c in series] or [0]
    while len(found) > 1 and abs(found[-1]) <= NEGLIGIBLE:
        found.pop()
    return found


def _middle(q: Fixed, low: int, high: int) -> int:
    """A place about half way that is clear of zero, where there is one."""
    places = [low + (high - low) * part // 16 for part in (8, 7, 9, 6, 10)]
    return next((at for at in places if abs(horner(q, at)) > CLEARANCE * ZERO), places[0])


def _around_minimum(q: Fixed, piece: Fixed, low: int, high: int) -> list[int]:
    """Two places on a piece, one on each side of a minimum (or a flat root), next to it and clear of zero, or none."""
    found = _roughly_flat(piece)
    if found is None:
        return []
    width = high - low
    middle, distance = (int(part * 2.0**53) * width >> 53 for part in found)
    if abs(horner(q, low + middle)) < SMALL:
        touched = _minimum(q, low + middle)
        if touched is not None and low < touched < high and abs(horner(q, touched)) <= ZERO:
            middle, distance = touched - low, width >> TOUCH_BITS
    while distance < CUT_MOST * width:
        places = [at for at in (low + middle - distance, low + middle + distance) if low < at < high]
        if all(abs(horner(q, at)) > CLEARANCE * ZERO for at in places):
            return places
        distance *= 4
    return []


def _roughly_flat(piece: Fixed) -> tuple[float, float] | None:
    """A minimum of a piece, or a place where slope and value vanish, and how far from it to cut; None without one.

    As in the compiled ``henon_ref/kernel/roots.c``, on the slope over its derivative; doubles do, for what is cut
    out is looked at again.
    """
    size = max(map(abs, piece))
    c = [x / size for x in piece]
    tau, shift = 0.5, 0.0
    for _ in range(NEWTON_STEPS):
        slope, bend, twist = 0.0, 0.0, 0.0  # twist is half the third derivative
        for k in range(len(c) - 1, 0, -1):
            twist = twist * tau + bend
            bend = bend * tau + slope
            slope = slope * tau + k * c[k]
        if abs(slope) <= EPS:
            shift = 0.0
            break
        below = bend * bend - 2.0 * slope * twist
        if not below > 0.0:
            return None
        shift = -slope * bend / below
        tau += shift
        if not 0.0 < tau < 1.0:
            return None
        if abs(shift) <= CUT_LEAST:
            break
    height = 0.0
    for x in reversed(c):
        height = height * tau + x
    return (tau, max(8.0 * abs(shift), CUT_LEAST)) if bend > 0.0 or abs(height) <= CUT_LEAST else None


def bernstein(q: Fixed) -> list[int]:
    """Coefficients of a polynomial on [0, 1] in Bernstein's basis, each off by one at most."""
    degree = len(q) - 1
    found: list[int] = []  # sums of products with binomial coefficients, as in Pascal's triangle
    for k in range(degree, -1, -1):
        found = list(accumulate(found, initial=(q[k] << degree) // comb(degree, k)))
    return [c >> degree for c in found]


def signs_of(b: Sequence[int]) -> list[bool]:
    """For each coefficient that is not next to nothing whether it is positive."""
    return [c > 0 for c in b if abs(c) > ZERO]


def _unclear(b: Sequence[int]) -> bool:
    """True where rounding may have hidden roots of even number; the ends are looked at where pieces meet."""
    return b[0] > ZERO and len(b) > 2 and min(b[1:-1]) <= ZERO


def rising_root(rising: Fixed, low: int, high: int) -> int:
    """The root of a polynomial that rises through zero between two places: Newton's method in a bracket.

    Where a step leaves the bracket, or two in a row have not halved it, it is halved.
    """
    slope = _derivative(rising)
    tau, slow = (low + high) >> 1, 0
    while high - low > SAME_PLACE:
        width = high - low
        value, rate = horner(rising, tau), horner(slope, tau)
        low, high = (tau, high) if value < 0 else (low, tau)
        new = tau - (value << BITS) // rate if rate > 0 else -1
        if abs(new - tau) <= SAME_PLACE and low <= new <= high:
            return new
        slow = slow + 1 if 2 * (high - low) > width else 0
        if slow > 2 or not low <= new <= high:
            new, slow = (low + high) >> 1, 0
        tau = new
    return tau


def _minimum(series: Fixed, suspect: int) -> int | None:
    """The minimum of a polynomial on [0, 1] that a point lies next to; None if there is none."""
    slope = _derivative(series)
    width = max(suspect >> 50, 1)
    low, high = suspect - width, suspect + width
    while horner(slope, low) >= 0:
        width *= 4
        low = suspect - width
        if low <= 0:
            return None
    while horner(slope, high) <= 0:
        width *= 4
        high = suspect + width
        if high > ONE:
            return None
    return rising_root(slope, low, high)


def horner(series: Fixed, place: int) -> int:
    """Value of a polynomial at a place."""
    total = 0
    for c in reversed(series):
        total = (total * place >> BITS) + c
    return total


def _derivative(series: Fixed) -> list[int]:
    return [k * c for k, c in enumerate(series)][1:]
