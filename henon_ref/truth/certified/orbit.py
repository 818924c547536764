"""Periodic orbits: a fixed point of the return map by Krawczyk's test, with everything about it enclosed.

The return map ends either at a fixed time (a forced system: one period later) or at an event (an autonomous
system: the same change of mode again). Its derivative comes with the walk (variational equations and
saltation matrices); coordinates that a surface makes redundant are left out, so that an orbit that starts in
a stick of a one-degree-of-freedom oscillator is the fixed point of a scalar map.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, log2

import sympy as sp
from flint import acb, arb, arb_mat, ctx

from henon_ref.errors import HenonRefError
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.trajectory import Problem
from henon_ref.truth.certified.enclosure import UNIT_BALL, UndecidedError
from henon_ref.truth.certified.exact import enclose
from henon_ref.truth.certified.model import SystemModel
from henon_ref.truth.certified.modes import EndedError, Entry
from henon_ref.truth.certified.sets import PointSet
from henon_ref.truth.certified.trajectory import certify
from henon_ref.truth.certified.walk import Hit, Precision, Walk

NEWTON_STEPS = 12
MAX_STEPS = 20_000
SPARE_BITS = 56
SETTLED_RADIUS = 1e-8
FIRST_BITS = 80
BOXES = 4
INFLATION = 16.0
"""The box that is tested, against the last Newton correction."""


class OrbitError(HenonRefError):
    """No periodic orbit could be proven near the guess; the message says why."""


@dataclass(frozen=True)
class Guess:
    """Where a periodic orbit is believed to pass.

    Either ``period`` is given (an exact number: the return map ends that much later), or ``events``: the
    orbit starts just after an event, and comes back with the ``events``-th event after it.
    """

    time: sp.Expr
    """Exact start time [s]; for an autonomous system any, such as 0."""
    state: tuple[float, ...]
    mode: Mode
    """Mode just after the start."""
    period: sp.Expr | None = None
    events: int | None = None
    surface: int | None = None
    """With ``events``: the surface that the start lies on."""
    tangent: bool = False
    """With ``events``: the start is a release, where the surface's normal velocity is zero too."""


@dataclass(frozen=True)
class OrbitEvent:
    """One change of mode on the orbit."""

    from_mode: Mode
    to_mode: Mode
    time: arb
    state: tuple[arb, ...]


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
        with ctx.workprec(self.bits):
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
    model = SystemModel(system)
    bits = ceil(-log2(radius)) + SPARE_BITS
    try:
        with ctx.workprec(bits):
            found = _Search(model, guess, bits).prove()
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

    def __init__(self, model: SystemModel, guess: Guess, bits: int) -> None:
        if (guess.period is None) == (guess.events is None):
            raise OrbitError("a guess gives either a period or a number of events")
        self.model, self.guess, self.bits = model, guess, bits
        self.on = [i for i, s in enumerate(guess.mode) if s == 0]
        if guess.surface is not None and guess.surface not in self.on:
            self.on = sorted([*self.on, guess.surface])
        self.solved = model.solved(tuple(self.on))
        taken = {s.index for s in self.solved}
        self.free = [i for i in range(len(guess.state)) if i not in taken]
        self.time = enclose(model.system.numeric(guess.time))

    def prove(self) -> PeriodicOrbit:
        """The orbit, or OrbitError."""
        size = len(self.free)
        point, correction = self._newton()
        floor = arb(2) ** -(self.bits - SPARE_BITS // 2)
        residual = [p - q for p, q in zip(point, self._return(point, self.bits, sharp=False).end, strict=True)]
        for _ in range(BOXES):
            half = [abs(c) * INFLATION + floor * (1 + abs(p)) for c, p in zip(correction, point, strict=True)]
            box = [p + h.upper() * UNIT_BALL for p, h in zip(point, half, strict=True)]
            slope = _unit(size) - self._return(box, self.bits, sharp=True).derivative
            inverse = slope.mid().inv().mid()
            away = arb_mat(size, 1, [b - p for b, p in zip(box, point, strict=True)])
            moved = (_unit(size) - inverse * slope) * away - inverse * arb_mat(size, 1, residual)
            krawczyk = [p + moved[i, 0] for i, p in enumerate(point)]
            if all(b.contains_interior(k) for b, k in zip(box, krawczyk, strict=True)):
                return self._describe(krawczyk, box)
            correction = [abs(k - p).upper() for k, p in zip(krawczyk, point, strict=True)]
        raise OrbitError("Newton's method converges, but no box around its limit is proven to hold a fixed point")

    def _newton(self) -> tuple[list[arb], list[arb]]:
        """A point that the return map moves by next to nothing, and the last correction."""
        point = [arb(self.guess.state[i]).mid() for i in self.free]
        bits, before = min(FIRST_BITS, self.bits), inf
        for _ in range(NEWTON_STEPS):
            with ctx.workprec(bits):
                made = self._return(point, bits, sharp=False)
                residual = arb_mat(len(point), 1, [p - q for p, q in zip(point, made.end, strict=True)])
                try:
                    step = (_unit(len(point)) - made.derivative).mid().solve(residual.mid())
                except ZeroDivisionError:
                    raise OrbitError("the return map leaves a direction as it is: no isolated orbit here") from None
                correction = [step[i, 0].mid() for i in range(len(point))]
                point = [(p - c).mid() for p, c in zip(point, correction, strict=True)]
            now = max(float(abs(c)) for c in correction)
            rough = bits < self.bits
            if not rough and (now < 2.0 ** -(self.bits - SPARE_BITS) or (before < 1e-20 and now > before / 2)):
                return point, correction
            bits, before = min(2 * bits, self.bits) if now < 2.0 ** -(bits // 4) else bits, now
        raise OrbitError(f"Newton's method does not converge from the guess: its last correction is {before:.3g}")

    def _return(self, free: Sequence[arb], bits: int, *, sharp: bool) -> _Returned:
        """The return map at a point or over a box."""
        state = self._state(free)
        walk = Walk(
            self.model,
            PointSet.box([self.time, *state]),
            self._entry(),
            Precision.of(bits, sharp_tangent=sharp),
        )
        begin = walk.points.hull()
        events: list[Hit] = []
        period = self.guess.period
        horizon = self.time + enclose(self.model.system.numeric(period)) if period is not None else self.time + 2**40
        while not walk.done and len(events) != self.guess.events:
            if walk.steps >= MAX_STEPS:
                raise OrbitError(f"the return map does not end within {MAX_STEPS} steps")
            hit = walk.step(horizon)
            if hit is not None:
                events.append(hit)
        if walk.mode != self.guess.mode:
            raise OrbitError(f"the return map ends in mode {walk.mode}, not in {self.guess.mode} where it started")
        end = walk.points.hull()
        return _Returned(
            [end[i + 1] for i in self.free],
            self._derivative(walk.derivative, begin),
            end[0] - self.time,
            tuple(OrbitEvent(h.before, h.after, h.box[0], h.box[1:]) for h in events),
            tuple(state),
        )

    def _entry(self) -> Entry:
        zeros = []
        for guard in self.model.mode(self.guess.mode).guards:
            started = guard.kind == "surface" and guard.index == self.guess.surface
            zeros.append((2 if self.guess.tangent else 1) if started else 0)
        return Entry(self.guess.mode, tuple(zeros))

    def _state(self, free: Sequence[arb]) -> list[arb]:
        """The whole state from its free coordinates."""
        state = [arb(0)] * len(self.guess.state)
        for i, value in zip(self.free, free, strict=True):
            state[i] = value
        for solved in reversed(self.solved):
            state[solved.index] = enclose(solved.value, dict(zip(self.model.symbols, (self.time, *state), strict=True)))
        return state

    def _derivative(self, whole: arb_mat, at: Sequence[arb]) -> arb_mat:
        """Derivative in free coordinates: the solved states follow along their surfaces."""
        values = dict(zip(self.model.symbols, at, strict=True))
        columns: list[list[arb]] = []
        for i in self.free:
            column = [arb(int(k == i + 1)) for k in range(len(at))]
            for solved in reversed(self.solved):
                gradient = [enclose(g, values) for g in solved.gradient]
                column[solved.index + 1] = sum((g * c for g, c in zip(gradient, column, strict=True)), arb(0))
            columns.append(column)
        return arb_mat(
            [
                [sum((whole[i + 1, k] * c for k, c in enumerate(column)), arb(0)) for column in columns]
                for i in self.free
            ]
        )

    def _describe(self, free: Sequence[arb], box: Sequence[arb]) -> PeriodicOrbit:
        made = self._return(free, self.bits, sharp=True)
        return PeriodicOrbit(
            start=self.time,
            state=made.state,
            mode=self.guess.mode,
            period=made.elapsed,
            events=made.events,
            derivative=made.derivative,
            multipliers=_eigenvalues(made.derivative),
            dimension=len(self.free),
            unique_in=tuple(box),
            bits=self.bits,
            seconds=0.0,
        )


@dataclass(frozen=True)
class _Returned:
    end: list[arb]
    derivative: arb_mat
    elapsed: arb
    events: tuple[OrbitEvent, ...]
    state: tuple[arb, ...]


def _unit(size: int) -> arb_mat:
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])


def _eigenvalues(matrix: arb_mat) -> tuple[acb, ...]:
    """Enclosures of the eigenvalues, largest first."""
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
