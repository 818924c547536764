"""What one guard does on a step, in multiprecision: its first root or touch, up to its minimum next to a place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb, arb_poly

from henon_ref.integrator.precise_modes import ENDING_ORDERS
from henon_ref.kernel.shared import EPS, LEVELS
from henon_ref.modes.equations import Guard
from henon_ref.roots.multiprecision import (
    CLEARANCE,
    FLAT_STEPS,
    ONE,
    RELATIVE_ZERO,
    ZERO,
    What,
    bernstein_on,
    first_event_of,
    fixed,
    leading_term,
)

EQUAL_LEVEL = 2.0**-204
"""Coefficients below this of each other count as equal: a few roundings."""
LEADING_COEFFICIENTS = 26
"""Coefficients that tell zeros next to 0 apart from the rest, to all digits."""
FINEST = 1e-47
"""No place on the step is known to less."""
ROUNDING = 32 * EPS
"""Part of its size within which double precision takes a guard for zero at the event of another one."""
DECIDED_STEEPNESS = 1e-5
"""Relative steepness from which double precision decides a root."""
CLEAR_LEVEL = 1e-9
"""A guard that stays above this of its size by the sizes of its terms alone has no event."""
EQUAL = 1e-13
"""Part of the friction by which a force may be off that counts as equal to it (as in the compiled loop)."""


@dataclass(frozen=True)
class GuardEvent:
    """What a guard does first, up to its minimum next to a place on the step."""

    guard: int
    what: What
    """``miss``: it stays above zero."""
    lowest: bool
    """Whether it has a minimum here."""
    place: int
    """In fixed point, of the step."""
    radius: float
    """To which the place is known, of the step."""
    order: int
    """Of the zero, or the minimum."""
    rounding: float
    """Where the guard is steep: how far from the place double precision takes it for zero. Else 0."""
    depth: float
    """Where it is flat: how far from zero its minimum is, on either side, of its size on the step. Else infinite."""
    below_rounding: bool = False
    """Whether rounding of the state leaves open what it does here; it then counts as a ``miss``."""

    def meets(self, other: GuardEvent) -> bool:
        """Whether two events are at one instant: their radii overlap, or rounding of a steep guard is all between."""
        away = abs(self.place - other.place) / ONE
        return away <= max(self.radius + other.radius, self.rounding, other.rounding)


class GuardSeries:
    """A guard over its size on the step, in fixed point, its known zeros put apart.

    ``coefficients`` are in units of the step, ``zeros`` those known at its start; ``whole``: no term is left out.
    """

    def __init__(self, coefficients: Sequence[arb], zeros: int, whole: bool) -> None:
        self.zeros, self.q = zeros, fixed(_without_known_zeros(coefficients, zeros)[zeros:])
        self._order = len(coefficients) - 1
        last = [] if whole else [abs(float(c)) for c in coefficients[-ENDING_ORDERS:]]
        self._last = max(last, default=0.0) / (sum(abs(float(c)) for c in coefficients) or 1.0)

    def positive(self, place: int) -> bool:
        """Whether it is clearly positive up to a little behind a place, by its Bernstein coefficients."""
        return min(bernstein_on(self.q, 0, min(ONE, place + (place >> 30) + 1))) > CLEARANCE * ZERO

    def around(self, place: int) -> list[float]:
        """Its Taylor coefficients at a place."""
        polynomial = arb_poly([0] * self.zeros + [arb(c) / ONE for c in self.q])
        return [float(c) for c in polynomial(arb_poly([arb(place) / ONE, 1])).coeffs()]

    def size(self, part: float) -> float:
        """Sum of the sizes of its terms at a place."""
        return sum(abs(c / ONE) * part ** (self.zeros + k) for k, c in enumerate(self.q))

    def noise(self, part: float) -> float:
        """What its value at a place may be off: what counts as zero, or what is left out of the series."""
        return CLEARANCE * max(RELATIVE_ZERO, self._last * part**self._order)


def first_guard_event(guard: int, series: GuardSeries, suspect: int) -> GuardEvent:
    """What a guard does up to a place on the step."""
    what, lowest, place = first_event_of(series.q, series.zeros, suspect)
    part, local = place / ONE, series.around(place)
    radius, order = leading_term(local, series.noise(part))
    slope, size = (abs(local[1]) if len(local) > 1 else 0.0), series.size(part)
    steep = what == "root" and slope * part > DECIDED_STEEPNESS * size
    rounding = ROUNDING * size / slope if steep else 0.0
    depth = math.inf
    if not steep and len(local) > 2 and local[2] > 0.0:
        depth = abs(local[0] - local[1] ** 2 / (4.0 * local[2]))
    order = order - order % 2 if lowest else order
    return GuardEvent(guard, what, lowest, place, max(radius, FINEST), order, rounding, depth)


def _without_known_zeros(c: Sequence[arb], zeros: int) -> list[arb]:
    """A guard with its known zeros put at 0, where rounding has left them beside it; the other roots stay.

    See ``deflated`` of ``henon_ref/kernel/roots.c``.
    """
    q = list(c[zeros:])
    if zeros and len(q) > 1 and all(abs(low) <= LEVELS.known_zero_level * abs(q[0]) for low in c[:zeros]):
        head, factor = arb_poly(c[: zeros + LEADING_COEFFICIENTS]), [arb(0)] * zeros
        for _ in range(FLAT_STEPS):
            before = factor.copy()
            for i in range(zeros):
                known = [factor[j] * q[i - j] for j in range(i) if i - j < len(q)]
                factor[i] = ((c[i] - sum(known, arb(0))) / q[0]).mid()
            if all(abs(new - old) <= EQUAL_LEVEL * abs(new) for new, old in zip(factor, before, strict=True)):
                break
            q = (head // arb_poly([*factor, 1])).coeffs()
        q = (arb_poly(list(c)) // arb_poly([*factor, 1])).coeffs()
    return [arb(0)] * zeros + q


def load_equals_friction(guards: Sequence[Guard], outputs: Sequence[Sequence[arb]], own: int, longer: float) -> bool:
    """Whether a guard is a slide's end at which the force equals the friction all over the step: the slide holds.

    ``longer``: length of the step in units of what is expanded.
    """
    guard = guards[own]
    if guard.kind != "release":
        return False
    ends = [g for g, end in enumerate(guards) if end.kind == "release" and end.index == guard.index]
    friction = sum(float(outputs[end][0]) for end in ends)
    size, power = 0.0, 1.0
    for c in outputs[own]:
        size += abs(float(c)) * power
        power = min(power * longer, 1e300)
    return size <= EQUAL * friction


def is_clear(series: Sequence[arb], guard: Guard, place: int) -> bool:
    """Whether the sizes of its terms show that a guard has no event up to a place (True where it is not finite)."""
    part = place / ONE
    first, *rest = (float(c) for c in series)
    size, power = 0.0, part
    for c in rest:
        size += abs(c) * power
        power *= part
    if guard.rising_only and first < 0.0:
        first = -first
    return not first - size <= CLEAR_LEVEL * (abs(first) + size)
