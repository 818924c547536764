"""Periodic orbits: existence and uniqueness of a fixed point of the return map by Krawczyk's test.

With the residual r = p - P(p) of a point p, a box X around p, slopes S of x - P(x) over X and C ~ S^-1, Krawczyk's
operator is ``K = p - C r + (1 - C S)(X - p)``; if K is in the interior of X, X contains exactly one fixed point
(Krawczyk, *Computing* 4, 1969). The derivative of P comes with the flow (variational equations and saltation matrices).
Coordinates that a surface makes redundant are eliminated: an orbit of an oscillator with one degree of freedom that
starts in a stick is the fixed point of a scalar map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, log2

from flint import acb, arb, arb_mat

from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError, diagonal
from henon_ref.enclosure.return_map import Guess, OrbitError, OrbitEvent, ReturnMap
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision

SPARE_BITS = 56
"""Working precision beyond the requested radius, for the error growth of one evaluation of the return map."""
BOXES = 4
"""Largest number of boxes tried by Krawczyk's test; each is sized by the image of the previous one."""
SINGULAR = (
    "the derivative of the return map minus the identity is singular: no isolated orbit here, but a family of "
    "periodic orbits (as without energy losses)"
)


@dataclass(frozen=True)
class PeriodicOrbit:
    """A proven periodic orbit, unique among those through the box ``unique_in``."""

    start: arb
    """Start time [s]."""
    state: tuple[arb, ...]
    """State at the start."""
    mode: Mode
    period: arb
    events: tuple[OrbitEvent, ...]
    """Over one period, from the start on."""
    derivative: arb_mat
    """Derivative of the return map in the free coordinates, saltation included."""
    multipliers: tuple[acb, ...]
    """Floquet multipliers: eigenvalues of ``derivative``, largest first."""
    dimension: int
    """Number of free coordinates."""
    unique_in: tuple[arb, ...]
    """Box of free coordinates that contains no other fixed point."""
    bits: int

    def durations(self, mode: Mode) -> list[arb]:
        """Durations of the visits to a mode [s], ordered by entry time; the last visit may include the start."""
        if not self.events:
            return []
        with working_precision(self.bits):
            times = [*(event.time for event in self.events), self.events[0].time + self.period]
            return [times[i + 1] - times[i] for i, event in enumerate(self.events) if event.to_mode == mode]


def find_periodic_orbit(system: FilippovSystem, guess: Guess, *, radius: float = 1e-40) -> PeriodicOrbit:
    """Find and prove the periodic orbit near a guess, which is accurate to a few digits.

    ``radius``: required radius of state, period and derivative; a double multiplier is enclosed to about its square
    root. OrbitError if Newton's method does not converge, or no box is proven to contain a fixed point.
    """
    returned = ReturnMap(system, guess)
    bits = ceil(-log2(radius)) + SPARE_BITS
    try:
        with working_precision(bits):
            found = _Search(returned, bits).prove()
            worst = max(float(b.rad()) for b in (*found.state, found.period, *found.derivative.entries()))
    except (UndecidedError, EndedError) as stop:
        raise OrbitError(f"the return map near the guess is not smooth or not provable: {stop.reason}") from stop
    if not worst <= radius:
        raise OrbitError(f"the orbit is proven only to a radius of {worst:.3g}; request a smaller radius")
    return found


class _Search:
    """Newton's method on the return map, followed by Krawczyk's test on a box (at the working precision)."""

    def __init__(self, returned: ReturnMap, bits: int) -> None:
        self.returned, self.guess, self.bits = returned, returned.guess, bits

    def prove(self) -> PeriodicOrbit:
        size = len(self.returned.free)
        point, correction = self._newton()
        residual = [p - q for p, q in zip(point, self.returned(point, self.bits, sharp=False).end, strict=True)]
        for _ in range(BOXES):
            box, slope = self._slope_around(point, correction)
            if slope.det().contains(0):
                break
            inverse = slope.mid().inv().mid()
            away = arb_mat(size, 1, [b - p for b, p in zip(box, point, strict=True)])
            moved = (diagonal([1] * size) - inverse * slope) * away - inverse * arb_mat(size, 1, residual)
            krawczyk = [p + moved[i, 0] for i, p in enumerate(point)]
            if all(b.contains_interior(k) for b, k in zip(box, krawczyk, strict=True)):
                return self._describe(krawczyk, box)
            correction = [abs(k - p).upper() for k, p in zip(krawczyk, point, strict=True)]
        self._refuse_singular(point, correction)
        raise OrbitError("Newton's method converges, but no box around its limit is proven to hold a fixed point")

    def _slope_around(self, point: Sequence[arb], correction: Sequence[arb]) -> tuple[list[arb], arb_mat]:
        """Box around a point, sized by a correction, and the derivative of x - P(x) over the box."""
        floor = arb(2) ** -(self.bits - SPARE_BITS // 2)
        half = [16 * abs(c) + floor * (1 + abs(p)) for c, p in zip(correction, point, strict=True)]
        box = [p + h.upper() * UNIT_BALL for p, h in zip(point, half, strict=True)]
        return box, diagonal([1] * len(box)) - self.returned(box, self.bits, sharp=True).derivative

    def _refuse_singular(self, point: Sequence[arb], correction: Sequence[arb]) -> None:
        """Raise OrbitError if the derivative of x - P(x) is singular near a point that the map hardly moves."""
        if max(map(float, correction), default=0.0) < 1e-6:
            _, slope = self._slope_around(point, correction)
            if slope.det().contains(0):
                raise OrbitError(SINGULAR)

    def _newton(self) -> tuple[list[arb], list[arb]]:
        """Approximate fixed point of the return map, and the last Newton correction."""
        point = [arb(self.guess.state[i]).mid() for i in self.returned.free]
        bits, before = min(80, self.bits), inf  # the first points are less accurate
        nearest, least = point, [arb(inf)]
        for _ in range(12):  # five suffice from eight digits
            with working_precision(bits):
                made = self.returned(point, bits, sharp=False)
                residual = arb_mat(len(point), 1, [p - q for p, q in zip(point, made.end, strict=True)])
                try:
                    step = (diagonal([1] * len(point)) - made.derivative).mid().solve(residual.mid())
                except ZeroDivisionError:
                    raise OrbitError(SINGULAR) from None
                correction = [step[i, 0].mid() for i in range(len(point))]
                now = max((float(abs(c)) for c in correction), default=0.0)
                if now <= max(map(float, map(abs, least)), default=0.0):
                    nearest, least = point, correction
                point = [(p - c).mid() for p, c in zip(point, correction, strict=True)]
            rough = bits < self.bits
            if not rough and (now < 2.0 ** -(self.bits - SPARE_BITS) or (before < 1e-20 and now > before / 2)):
                return point, correction
            bits, before = min(2 * bits, self.bits) if now < 2.0 ** -(bits // 4) else bits, now
        self._refuse_singular(nearest, [abs(c) for c in least])
        raise OrbitError(f"Newton's method does not converge from the guess: its last correction is {before:.3g}")

    def _describe(self, free: Sequence[arb], box: Sequence[arb]) -> PeriodicOrbit:
        made = self.returned(free, self.bits, sharp=True)
        return PeriodicOrbit(
            start=self.returned.time,
            state=made.state,
            mode=self.guess.mode,
            period=made.elapsed,
            events=made.events,
            derivative=made.derivative,
            multipliers=_eigenvalues(made.derivative),
            dimension=len(self.returned.free),
            unique_in=tuple(box),
            bits=self.bits,
        )


def _eigenvalues(matrix: arb_mat) -> tuple[acb, ...]:
    """Enclosures of the eigenvalues, largest first."""
    if matrix.nrows() == 0:
        return ()
    if matrix.nrows() == 1:
        return (acb(matrix[0, 0]),)
    if matrix.nrows() == 2:
        half = (matrix[0, 0] + matrix[1, 1]) / 2
        root = acb(half * half - matrix.det()).sqrt()
        values = [half + root, half - root]
    else:
        try:
            values = list(matrix.eig())
        except ValueError:
            values = list(matrix.eig(multiple=True))  # eigenvalues that overlap
    return tuple(sorted(values, key=lambda value: -float(abs(value).mid())))
