"""Roots of polynomials in fixed point with 220 bits: the first root through which a guard falls, and earlier touches.

A number v is the integer v 2^220; the polynomial's size is 1 and its variable is in [0, 1]. Roots are isolated as in
the compiled ``henon_ref/kernel/roots.c``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import comb, isqrt
from typing import Literal

from flint import arb, arb_poly

from henon_ref.kernel.library import EPS
from henon_ref.precision import working_precision

BITS = 220
"""Fractional bits of coefficients (the polynomial's size on the step is 1) and of positions on the step."""
ONE = 1 << BITS
RELATIVE_ZERO = 2.0**-166
"""Largest value that counts as zero: 1e-50 of the polynomial's size."""
FLAT_STEPS = 20
"""Largest number of steps of Newton's method."""
ZERO = int(ONE * RELATIVE_ZERO)
""":data:`RELATIVE_ZERO` in fixed point."""
CLEARANCE = 4
"""Largest size of a piece that is a touch, in units of :data:`ZERO`."""
SAME_PLACE = 2 ** (BITS - 160)
"""Distance up to which two positions are equal: 1e-48 of the step."""
FLAT_RANGE = int(ONE * 1e-6)
"""Largest distance of a nearly zero position from a zero of the slope."""
CUT_LEAST = 2.0**-20
"""Least distance of the cuts from a minimum, as a part of its piece."""
SMALL = ONE >> 40
"""Smallest value that cannot be a touch."""
What = Literal["root", "touch", "miss"]
Fixed = Sequence[int]
"""Coefficients, each times 2^220."""


def fixed_point(number: arb) -> int:
    """Return the midpoint of a number times 2^220, rounded down."""
    mantissa, exponent = number.mid().man_exp()
    shift = int(exponent) + BITS
    return int(mantissa) << shift if shift >= 0 else int(mantissa) >> -shift


def fixed(series: Sequence[arb]) -> list[int]:
    """Return a polynomial divided by its size, the sum of the absolute values of its coefficients."""
    size = sum((abs(c) for c in series), arb(0)).mid()
    return [fixed_point(c / size) for c in series] if size != 0 else [0] * len(series)


def first_event_of(q: Fixed, zeros: int, suspect: int) -> tuple[What, bool, int]:
    """Return the first event of q tau^zeros on (0, 1] up to its minimum near a point: (kind, at minimum, place)."""
    outcome, low, high = first_falling_root(q)
    whole = [0] * zeros + list(q)
    bottom = _minimum(whole, suspect)
    middle = (low + high) // 2
    if outcome == "touch" or (outcome == "root" and low == high):  # the polynomial is nearly zero there
        crossed = outcome == "root" or _falls_after(q, low, high)
        if crossed and (bottom is None or bottom >= low):
            return "root", False, _flat_root(q, middle, 1, exact=outcome == "root")
    if outcome == "touch":
        touched = bottom if bottom is not None and low <= bottom <= high else _minimum(whole, middle)
        touched = middle if touched is None else touched
        if bottom is None or touched <= bottom + int(ONE * 1e-10):  # the same minimum
            return "touch", True, _flat_root(whole, touched, 0, exact=True)
    if outcome != "root" or (bottom is not None and low > bottom):  # the minimum is the first event
        return "miss", bottom is not None, suspect if bottom is None else bottom
    return "root", False, rising_root([-c for c in q], low, high)


def _falls_after(q: Fixed, low: int, high: int) -> bool:
    """Check whether a polynomial is negative at its first clear value after a nearly zero interval."""
    distance = max(high - low, SAME_PLACE)
    while high + distance <= ONE:
        value = horner(q, high + distance)
        if abs(value) > CLEARANCE * ZERO:
            return value < 0
        distance *= 2
    return False


def _flat_root(q: Fixed, place: int, parity: int, *, exact: bool) -> int:
    """Return the root of even or odd order in a nearly zero neighbourhood, or the mean of roots that count as one.

    The order, at most 16, is that of the term that dominates away from the root. A root of order m is a simple root of
    the derivative m-1, which determines its position. ``exact``: the root is at ``place``; otherwise it is only near.
    """
    refined = place if exact else _exactly_flat(q, place)
    with working_precision(BITS):
        local = arb_poly([arb(c) / ONE for c in q])(arb_poly([arb(refined) / ONE, 1])).coeffs()
    order = leading_term([float(c) for c in local[:17]], RELATIVE_ZERO)[1]
    if order % 2 != parity or order == 0:
        return place
    *_, flat, steep = accumulate(range(order), lambda d, _: _derivative(d), initial=q)
    for _ in range(8):
        shift = (horner(flat, refined) << BITS) // horner(steep, refined)
        refined -= shift
        if shift == 0:
            break
    return refined


def _exactly_flat(q: Fixed, place: int) -> int:
    """Return the zero of the slope near a position, by Newton's method on the slope over its derivative."""
    derivatives = [*accumulate(range(3), lambda d, _: _derivative(d), initial=q)][1:]
    found, longest = place, FLAT_RANGE
    for _ in range(FLAT_STEPS):
        slope, bend, twist = (horner(d, found) for d in derivatives)
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
    """Return the distance up to which a polynomial stays within ``level``, and the order of the dominant term.

    ``local``: Taylor coefficients at the position.
    """
    return min((((level / abs(c)) ** (1 / k), k) for k, c in enumerate(local) if k and c), default=(1.0, 0))


def first_falling_root(q: Fixed) -> tuple[Literal["none", "root", "touch"], int, int]:
    """Isolate the first root on (0, 1] through which a polynomial falls: (outcome, low, high).

    Descartes' rule of signs on Bernstein coefficients, as ``first_falling_root`` in ``henon_ref/kernel/roots.c``.
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
            if max(map(abs, b)) <= CLEARANCE * ZERO or high - low <= ONE >> 200:  # nearly zero, or a point
                return "touch", low, high
            if before and abs(b[0]) <= ZERO:  # zero at the cut: the values after it decide
                if changes == 0:
                    return ("root" if not signs[0] else "touch"), low, low
            elif before and not signs[0]:
                return "root", low, low
            elif (changes == 0 and not _unclear(b)) or (changes == 1 and not signs[0]):
                before = signs[-1]
                continue
            elif changes == 1 and abs(b[-1]) > CLEARANCE * ZERO:
                return "root", low, high
            places = _around_minimum(q, piece, low, high) if signs[0] and looked < 64 else []  # then only halved
            stack += reversed([*pairwise([low, *(places or [_middle(q, low, high)]), high])])
    return "none", 0, 0


def bernstein_up_to(q: Fixed, place: int) -> list[int]:
    """Return the Bernstein coefficients of a polynomial on [0, place]."""
    return bernstein(_piece(arb_poly([arb(c) / ONE for c in q]), 0, place))


def _piece(whole: arb_poly, low: int, high: int) -> list[int]:
    """Return the coefficients on [low, high] in a variable from 0 to 1, without negligible last coefficients."""
    series = whole(arb_poly([arb(low) / ONE, arb(high - low) / ONE])).coeffs()
    found = [fixed_point(c) for c in series] or [0]
    while len(found) > 1 and abs(found[-1]) <= ZERO >> 20:
        found.pop()
    return found


def _middle(q: Fixed, low: int, high: int) -> int:
    """Return a position near the middle whose value is clear of zero, if there is one."""
    places = [low + (high - low) * part // 16 for part in (8, 7, 9, 6, 10)]
    return next((at for at in places if abs(horner(q, at)) > CLEARANCE * ZERO), places[0])


def _around_minimum(q: Fixed, piece: Fixed, low: int, high: int) -> list[int]:
    """Return two positions next to a minimum (or flat root) of a piece, one on each side and clear of zero; or none."""
    found = _roughly_flat(piece)
    if found is None:
        return []
    width = high - low
    middle, distance = (int(part * 2.0**53) * width >> 53 for part in found)
    if abs(horner(q, low + middle)) < SMALL:
        bend = _derivative(_derivative(q))
        touched = _minimum(q, low + middle) if horner(bend, low + middle) > SMALL else None
        if touched is not None and low < touched < high and abs(horner(q, touched)) <= ZERO:
            middle = touched - low
            distance = isqrt((4 * ZERO << 2 * BITS) // max(horner(bend, touched), 1))  # the value there is 2 ZERO
    while distance < width / 8:
        places = [at for at in (low + middle - distance, low + middle + distance) if low < at < high]
        if all(abs(horner(q, at)) > ZERO for at in places):
            return places
        distance *= 4
    return []


def _roughly_flat(piece: Fixed) -> tuple[float, float] | None:
    """Return a minimum of a piece, or a position with zero slope and value, and a distance for the cuts; None if none.

    As in the compiled ``henon_ref/kernel/roots.c``: Newton's method on the slope over its derivative, in doubles, which
    suffice because the piece that is cut out is examined again.
    """
    size = max(map(abs, piece))
    c = [x / size for x in piece]
    tau, shift = 0.5, 0.0
    for _ in range(12):
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
    """Return the Bernstein coefficients of a polynomial on [0, 1], each with an error of at most 1."""
    degree = len(q) - 1
    found: list[int] = []  # sums of products with binomial coefficients, as in Pascal's triangle
    for k in range(degree, -1, -1):
        found = list(accumulate(found, initial=(q[k] << degree) // comb(degree, k)))
    return [c >> degree for c in found]


def signs_of(b: Sequence[int]) -> list[bool]:
    """Return whether each coefficient is positive, without nearly zero coefficients."""
    return [c > 0 for c in b if abs(c) > ZERO]


def _unclear(b: Sequence[int]) -> bool:
    """Check whether rounding may hide an even number of roots; the ends are examined where pieces meet."""
    return b[0] > ZERO and len(b) > 2 and min(b[1:-1]) <= ZERO


def rising_root(rising: Fixed, low: int, high: int) -> int:
    """Return the root of a polynomial that rises through zero between two positions, by Newton's method in a bracket.

    The bracket is halved if a step leaves it, or if the last steps have not halved it.
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
    """Return the minimum of a polynomial on [0, 1] next to a point; None if there is none."""
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


def minimum_beside(series: Fixed, root: int) -> int:
    """Return the minimum of a polynomial next to a root, or the root itself if there is none."""
    found = _minimum(series, root)
    return found if found is not None and abs(found - root) <= FLAT_RANGE else root


def horner(series: Fixed, place: int) -> int:
    total = 0
    for c in reversed(series):
        total = (total * place >> BITS) + c
    return total


def _derivative(series: Fixed) -> list[int]:
    return [k * c for k, c in enumerate(series)][1:]
