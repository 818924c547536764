"""Periodic orbits: a fixed point of the return map by Krawczyk's test, with everything about it enclosed.

The derivative of the return map comes with the flow (variational equations and saltation matrices). Coordinates
that a surface makes redundant are left out, so that an orbit which starts in a stick of an oscillator with one
degree of freedom is the fixed point of a scalar map.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, log2

import sympy as sp
from flint import acb, arb, arb_mat

from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError
from henon_ref.enclosure.return_map import Guess, OrbitError, OrbitEvent, ReturnMap
from henon_ref.enclosure.run import certify
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision

NEWTON_STEPS = 12
"""Digits double at a step: from eight digits five steps reach the precision; the rest is for a poor guess."""
SPARE_BITS = 56
"""Bits beyond those of the radius that is asked for: room for what one round of the return map loses."""
SETTLED_RADIUS = 1e-8
"""Proven radius of the run towards the orbit: near enough for Newton's method to begin."""
FIRST_BITS = 80
"""Precision of the first Newton steps, whose point is not yet better than that."""
BOXES = 4
"""Boxes tried by Krawczyk's test, each as wide as the last one's image asks for."""
SINGULAR_WITHIN = 1e-6
"""Corrections beyond this say that the point is too far from an orbit to tell why Newton's method fails."""
SINGULAR = (
    "the return map less the identity is singular: no isolated orbit here, others near by are as periodic "
    "(where nothing is lost, say)"
)
INFLATION = 16.0
"""The box that is tested, against the last Newton correction."""


@dataclass(frozen=True)
class PeriodicOrbit:
    """A proven periodic orbit; it is the only one through the box ``unique_in``."""

    start: arb
    """Time it is started at [s]."""
    state: tuple[arb, ...]
    """State there."""
    mode: Mode
    period: arb
    events: tuple[OrbitEvent, ...]
    """Over one period, from the start on."""
    derivative: arb_mat
    """Derivative of the return map in the coordinates that are free (saltation included)."""
    multipliers: tuple[acb, ...]
    """Its eigenvalues, largest first: Floquet multipliers."""
    dimension: int
    """How many coordinates are free."""
    unique_in: tuple[arb, ...]
    """The box of free coordinates in which there is no other fixed point."""
    bits: int
    seconds: float

    def durations(self, mode: Mode) -> list[arb]:
        """How long each visit to a mode lasts [s], by its entry on the period (the last may wrap around)."""
        if not self.events:
            return []
        with working_precision(self.bits):
            times = [*(event.time for event in self.events), self.events[0].time + self.period]
            return [times[i + 1] - times[i] for i, event in enumerate(self.events) if event.to_mode == mode]


def find_periodic_orbit(system: FilippovSystem, guess: Guess, *, radius: float = 1e-40) -> PeriodicOrbit:
    """Find and prove the periodic orbit near a guess.

    Parameters
    ----------
    system : FilippovSystem
    guess : Guess
        Good to a few digits: Newton's method does the rest.
    radius : float
        Asked of state, period and derivative (the multipliers of a double eigenvalue are blurred to its root).

    Raises
    ------
    OrbitError
        Where Newton's method does not converge, or the box cannot be proven to hold a fixed point.
    """
    begun = clock.monotonic()
    returned = ReturnMap(system, guess)
    bits = ceil(-log2(radius)) + SPARE_BITS
    try:
        with working_precision(bits):
            found = _Search(returned, bits).prove()
            worst = max(float(b.rad()) for b in (*found.state, found.period, *found.derivative.entries()))
    except (UndecidedError, EndedError) as stop:
        raise OrbitError(f"the return map near the guess is not smooth or not provable: {stop.reason}") from stop
    if not worst <= radius:
        raise OrbitError(f"the orbit is proven, but only to a radius of {worst:.3g}; ask for a smaller one")
    return PeriodicOrbit(**{**found.__dict__, "seconds": clock.monotonic() - begun})


def settled_guess(problem: Problem, *, period: sp.Expr | None = None, events: int | None = None) -> Guess:
    """A guess from where a run has settled: its state at the horizon, or (with ``events``) after its last event.

    Parameters
    ----------
    problem : Problem
        Its run from start to horizon is certified roughly; the horizon is where the orbit is started.
    period, events
        As in :class:`Guess`.
    """
    run = certify(problem, radius=SETTLED_RADIUS)
    if run.status != "certified" or run.mode is None:
        raise OrbitError(f"the run towards the orbit is not provable: {run.reason}")
    if events is None:
        return Guess(problem.until, tuple(float(c) for c in run.state), run.mode, period=period)
    last = run.transitions[-1]
    tangent = last.kind == "release" and last.surface not in problem.system.overrides
    state = tuple(float(c) for c in last.state)
    return Guess(problem.start, state, last.to_mode, events=events, surface=last.surface, tangent=tangent)


class _Search:
    """Newton's method on the return map, then Krawczyk's test on a box (at the working precision)."""

    def __init__(self, returned: ReturnMap, bits: int) -> None:
        self.returned, self.guess, self.bits = returned, returned.guess, bits

    def prove(self) -> PeriodicOrbit:
        """The orbit, or OrbitError."""
        size = len(self.returned.free)
        point, correction = self._newton()
        residual = [p - q for p, q in zip(point, self.returned(point, self.bits, sharp=False).end, strict=True)]
        for _ in range(BOXES):
            box, slope = self._slope_around(point, correction)
            if slope.det().contains(0):
                break
            inverse = slope.mid().inv().mid()
            away = arb_mat(size, 1, [b - p for b, p in zip(box, point, strict=True)])
            moved = (_unit(size) - inverse * slope) * away - inverse * arb_mat(size, 1, residual)
            krawczyk = [p + moved[i, 0] for i, p in enumerate(point)]
            if all(b.contains_interior(k) for b, k in zip(box, krawczyk, strict=True)):
                return self._describe(krawczyk, box)
            correction = [abs(k - p).upper() for k, p in zip(krawczyk, point, strict=True)]
        self._refuse_singular(point, correction)
        raise OrbitError("Newton's method converges, but no box around its limit is proven to hold a fixed point")

    def _slope_around(self, point: Sequence[arb], correction: Sequence[arb]) -> tuple[list[arb], arb_mat]:
        """A box around a point, as wide as a correction asks for, and the derivative of the map's shift over it."""
        floor = arb(2) ** -(self.bits - SPARE_BITS // 2)
        half = [abs(c) * INFLATION + floor * (1 + abs(p)) for c, p in zip(correction, point, strict=True)]
        box = [p + h.upper() * UNIT_BALL for p, h in zip(point, half, strict=True)]
        return box, _unit(len(box)) - self.returned(box, self.bits, sharp=True).derivative

    def _refuse_singular(self, point: Sequence[arb], correction: Sequence[arb]) -> None:
        """Raise where the return map, less the identity, is singular near a point that it hardly moves."""
        if max(map(float, correction), default=0.0) < SINGULAR_WITHIN:
            _, slope = self._slope_around(point, correction)
            if slope.det().contains(0):
                raise OrbitError(SINGULAR)

    def _newton(self) -> tuple[list[arb], list[arb]]:
        """A point that the return map moves by next to nothing, and the last correction."""
        point = [arb(self.guess.state[i]).mid() for i in self.returned.free]
        bits, before = min(FIRST_BITS, self.bits), inf
        nearest, least = point, [arb(inf)]
        for _ in range(NEWTON_STEPS):
            with working_precision(bits):
                made = self.returned(point, bits, sharp=False)
                residual = arb_mat(len(point), 1, [p - q for p, q in zip(point, made.end, strict=True)])
                try:
                    step = (_unit(len(point)) - made.derivative).mid().solve(residual.mid())
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
            seconds=0.0,
        )


def _unit(size: int) -> arb_mat:
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])


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
