"""A closer look at an event that double precision cannot decide: a pair of roots, a touch, or a miss.

The polynomial of the step is made again with 220 bits (:mod:`henon_ref.henon.multiprecision`), and
its roots are isolated (:mod:`henon_ref.henon.isolation`). Where the closer look in double-double has left nothing open
but a window that ends at a minimum, that is all that is looked at.
The state at the step's start is taken as it is (its rounded part included).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from flint import arb, arb_poly, ctx

from henon_ref.henon.doubledouble import LOST
from henon_ref.henon.isolation import (
    BITS,
    CLOSE,
    NOTHING,
    ONE,
    ROUNDS,
    What,
    bernstein,
    curvature,
    decided,
    fixed,
    fixed_point,
    horner,
    lift,
    rising_root,
    signs_of,
)
from henon_ref.henon.multiprecision import Motions
from henon_ref.henon.polynomial import BESIDE
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem

NOISE = 2.0**-204
"""Slopes below this of the size cannot be told from zero."""
SETTLED, PLACED = 2.0**-180, 2.0**-60
"""A minimum is found where another step of Newton's would lower it by less than the one, of its size, and move it by
less than the other, of the step."""
CURVED = 1e-6
"""A relative second derivative above this at a minimum makes it one of second order."""
SECOND = 1e-10
"""And one above this makes it one whose next derivatives need not be looked at."""
HEAD = 26
"""Coefficients that tell zeros next to 0 apart from the rest, to all digits."""
UNCOUNTED = NOTHING * 2.0**-20
"""Terms below this of the size do not count."""
UNSEEN = 1e-20
"""Values below this of the size are not relied on where double-double has looked at a flat minimum."""
_BEYOND = 1 + arb(2) ** -46
"""A root that rounding has put on the step's end may lie just behind it."""
Pair = tuple[float, float]


@dataclass(frozen=True)
class Finding:
    """What a guard does near a doubtful point."""

    what: What
    lowest: bool
    """True where the guard has a minimum there (a touch, or a miss)."""
    parabolic: bool
    """True where that is for certain a minimum of second order."""
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
                what, lowest, part = decided(q, zeros, fixed_point(place))
                parabolic = lowest and curvature([0] * zeros + q, part) > SECOND * ONE
                found = what, lowest, parabolic, arb(part) / ONE
            what, lowest, parabolic, place = found
            return Finding(
                what, lowest, parabolic, _split(start + unit * place), tuple([_split(x(place)) for x in states])
            )


def _apart(guard: arb_poly, zeros: int) -> arb_poly:
    """A guard with its known zeros put at 0, where rounding has left them beside it; the other roots stay.

    See :func:`henon_ref.henon.polynomial.factored`.
    """
    c = guard.coeffs()
    q = c[zeros:]
    if len(q) > 1 and all(abs(low) <= BESIDE * abs(q[0]) for low in c[:zeros]):
        head, factor = arb_poly(c[: zeros + HEAD]), [arb(0)] * zeros
        for _ in range(ROUNDS):
            before = factor.copy()
            for i in range(zeros):
                known = [factor[j] * q[i - j] for j in range(i) if i - j < len(q)]
                factor[i] = ((c[i] - sum(known, arb(0))) / q[0]).mid()
            if all(abs(new - old) <= NOISE * abs(new) for new, old in zip(factor, before, strict=True)):
                break
            q = (head // arb_poly([*factor, 1])).coeffs()
        q = (guard // arb_poly([*factor, 1])).coeffs()
    return arb_poly([0] * zeros + q)


def _split(number: arb) -> Pair:
    """A number as two doubles; what is lost to the second, too, would only make it miss round numbers."""
    high = float(number)
    low = float(number - high)
    return high, (low if abs(low) > LOST * abs(high) else 0.0)


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
    about = guard(arb_poly([bottom, 1])).coeffs()
    local = list(map(float, about))
    point, order = lift(local, NOTHING * size / len(local))
    if order % 2:  # no minimum, a root of odd order
        return None
    if width is not None:
        width = width + (bottom - place)
    elif not parabolic:  # next to a flat minimum there may be roots that double-double has not seen
        width = arb(lift(local, UNSEEN * size)[0])
    if width is not None:
        before, after = _beside(about, point, width, size)
        if touching or depth > 0.0:
            proven = all(before) and all(after)
        else:
            proven = sum(x != y for x, y in pairwise(before)) == 1
        if not proven:
            return None
    if touching or depth > 0.0:
        return "touch" if touching else "miss", True, bend > SECOND * size, bottom
    q, high, across = fixed(coefficients), fixed_point(bottom), CLOSE
    while horner(q, high - across) <= 0:
        across *= 4
    return "root", False, False, arb(rising_root([-c for c in q], high - across, high)) / ONE


def _beside(about: Sequence[arb], point: float, width: arb, size: float) -> list[list[bool]]:
    """Signs of a guard's Bernstein coefficients on both sides of a place, from one distance to another.

    ``about`` are its Taylor coefficients there; the last ones do not count.
    """
    reach, count = float(width), len(about)
    while count > 1 and abs(float(about[count - 1])) * reach ** (count - 1) <= UNCOUNTED * size:
        count -= 1
    kept = arb_poly(about[:count])
    sides = [kept(arb_poly([side * point, side * (width - point)])).coeffs() for side in (-1, 1)]
    return [signs_of(bernstein([fixed_point(c / size) for c in side])) for side in sides]
