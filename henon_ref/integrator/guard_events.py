"""First root, touch or minimum of one guard on a step, in multiprecision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb, arb_poly

from henon_ref.integrator.multiprecision_roots import (
    CLEARANCE,
    FLAT_STEPS,
    ONE,
    RELATIVE_ZERO,
    ZERO,
    What,
    bernstein_up_to,
    first_event_of,
    fixed,
    leading_term,
    minimum_beside,
)
from henon_ref.integrator.precise_modes import ENDING_ORDERS
from henon_ref.kernel.library import EPS, LEVELS
from henon_ref.modes.equations import Guard


@dataclass(frozen=True)
class GuardEvent:
    """First event of a guard, up to its minimum next to a place on the step."""

    guard: int
    what: What
    """``miss``: the guard stays above zero."""
    lowest: bool
    """Whether the guard has a minimum here."""
    place: int
    """Place on the step, in fixed point."""
    radius: float
    """Radius of the place, relative to the step."""
    order: int
    """Order of the zero or minimum."""
    rounding: float
    """Of a steep guard: distance from the place within which double precision takes it for zero. Otherwise 0."""
    depth: float
    """Of a flat guard: size of its minimum relative to its size on the step. Otherwise infinite."""
    bottom: int
    """Place of the minimum of a flat guard next to the event; otherwise the event's own place."""
    below_rounding: bool = False
    """Whether rounding of the state leaves the event undecided; it then counts as a ``miss``."""

    def meets(self, other: GuardEvent) -> bool:
        """Whether two events coincide: their radii overlap, or the rounding of a steep guard covers their distance."""
        away = abs(self.place - other.place) / ONE
        return away <= max(self.radius + other.radius, self.rounding, other.rounding)


class GuardSeries:
    """Series of a guard in fixed point, relative to its size on the step, with its known zeros divided out.

    ``coefficients`` are in units of the step; ``zeros`` is the number of known zeros at its start; ``whole``: the
    series is a polynomial without truncation.
    """

    def __init__(self, coefficients: Sequence[arb], zeros: int, whole: bool) -> None:
        self.zeros, self.q = zeros, fixed(_without_known_zeros(coefficients, zeros)[zeros:])
        self._order = len(coefficients) - 1
        last = [] if whole else [abs(float(c)) for c in coefficients[-ENDING_ORDERS:]]
        self._last = max(last, default=0.0) / (sum(abs(float(c)) for c in coefficients) or 1.0)

    def positive(self, place: int) -> bool:
        """Whether its Bernstein coefficients show that it is positive up to slightly beyond a place."""
        return min(bernstein_up_to(self.q, min(ONE, place + (place >> 30) + 1))) > CLEARANCE * ZERO

    def around(self, place: int) -> list[float]:
        """Return its Taylor coefficients at a place."""
        polynomial = arb_poly([0] * self.zeros + [arb(c) / ONE for c in self.q])
        return [float(c) for c in polynomial(arb_poly([arb(place) / ONE, 1])).coeffs()]

    def size(self, part: float) -> float:
        """Return the sum of the absolute values of its terms at a place."""
        return sum(abs(c / ONE) * part ** (self.zeros + k) for k, c in enumerate(self.q))

    def noise(self, part: float) -> float:
        """Return a bound of the error of its value at a place: the level of zero, or the truncation error."""
        return CLEARANCE * max(RELATIVE_ZERO, self._last * part**self._order)


def first_guard_event(guard: int, series: GuardSeries, suspect: int) -> GuardEvent:
    """Return the first event of a guard up to a place on the step."""
    what, lowest, place = first_event_of(series.q, series.zeros, suspect)
    part, local = place / ONE, series.around(place)
    radius, order = leading_term(local, series.noise(part))
    slope, size = (abs(local[1]) if len(local) > 1 else 0.0), series.size(part)
    steep = what == "root" and slope * part > 1e-5 * size  # double precision decides such a root
    rounding = 32 * EPS * size / slope if steep else 0.0
    depth = math.inf
    if not steep and len(local) > 2 and local[2] > 0.0:
        depth = abs(local[0] - local[1] ** 2 / (4.0 * local[2]))
    bottom = place if lowest or depth == math.inf else minimum_beside([0] * series.zeros + series.q, place)
    order = order - order % 2 if lowest else order
    return GuardEvent(guard, what, lowest, place, max(radius, 1e-47), order, rounding, depth, bottom)


def _without_known_zeros(c: Sequence[arb], zeros: int) -> list[arb]:
    """Move the known zeros of a guard, which rounding has shifted, to exactly 0; its other roots remain.

    See ``deflated`` in ``henon_ref/kernel/roots.c``.
    """
    q = list(c[zeros:])
    if zeros and len(q) > 1 and all(abs(low) <= LEVELS.known_zero_level * abs(q[0]) for low in c[:zeros]):
        head = arb_poly(c[: zeros + 26])  # as many as determine the zeros near 0 to full precision
        factor = [arb(0)] * zeros
        for _ in range(FLAT_STEPS):
            before = factor.copy()
            for i in range(zeros):
                known = [factor[j] * q[i - j] for j in range(i) if i - j < len(q)]
                factor[i] = ((c[i] - sum(known, arb(0))) / q[0]).mid()
            if all(abs(new - old) <= 2.0**-204 * abs(new) for new, old in zip(factor, before, strict=True)):
                break  # equal up to a few rounding errors
            q = (head // arb_poly([*factor, 1])).coeffs()
        q = (arb_poly(list(c)) // arb_poly([*factor, 1])).coeffs()
    return [arb(0)] * zeros + q


def load_equals_friction(
    guards: Sequence[Guard], outputs: Sequence[Sequence[arb]], own: int, longer: float, tolerance: float
) -> bool:
    """Whether a guard ends a slide and the force equals the friction on the entire step, so that the slide continues.

    See ``load_equals_friction`` in ``henon_ref/kernel/events.c``. ``longer``: length of the step in units of the
    expansion.
    """
    guard = guards[own]
    if guard.kind != "release":
        return False
    ends = [g for g, end in enumerate(guards) if end.kind == "release" and end.index == guard.index]
    friction = sum(float(outputs[end][0]) for end in ends)
    first, *rest = (abs(float(c)) for c in outputs[own])
    if guard.held and not first <= (LEVELS.equal_part + LEVELS.held_tolerances * tolerance) * friction:
        return False
    size, power = (0.0 if guard.held else first), 1.0
    for c in rest:
        power = min(power * longer, 1e300)
        size += c * power
    return bool(size <= LEVELS.equal_part * friction)


def is_clear(series: Sequence[arb], guard: Guard, place: int) -> bool:
    """Whether the sizes of its terms exclude an event up to a place (True if the series is not finite)."""
    part = place / ONE
    first, *rest = (float(c) for c in series)
    size, power = 0.0, part
    for c in rest:
        size += abs(c) * power
        power *= part
    if guard.rising_only and first < 0.0:
        first = -first
    return not first - size <= 1e-9 * (abs(first) + size)
