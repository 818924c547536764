"""The return map of a periodic orbit with its derivative, over points or boxes.

The map ends either at a fixed time (a forced system: one period later) or at an event (an autonomous system: the same
change of mode again). States that a surface makes redundant are not among its coordinates.

Over a box the map is that of the smooth flows of the modes: a start off the surface (or off the tangent point) that it
should be on is continued as if it were on it. A fixed point is an image, images are on the surface, and on the surface
this map is the return map of the system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp
from flint import arb, arb_mat

from henon_ref.enclosure.balls import enclose, proves_zero
from henon_ref.enclosure.consistency import Entry
from henon_ref.enclosure.enclosure import PointSet
from henon_ref.enclosure.event import Hit
from henon_ref.enclosure.flow import ValidatedFlow
from henon_ref.enclosure.model import SystemModel, solve_for_states
from henon_ref.errors import HenonRefError
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import impact_of, kept_zero, resetting
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

MAX_STEPS = 20_000
"""Largest number of steps of one evaluation; beyond it the guess is considered not to be near an orbit."""


class OrbitError(HenonRefError):
    """No periodic orbit is proven near the guess; the message states the reason."""


@dataclass(frozen=True)
class Guess:
    """Approximate start of a periodic orbit.

    Either ``period`` is given, an exact number: the return map ends that much later. Or ``events`` is given: the orbit
    starts just after an event and returns with the ``events``-th event after it.
    """

    time: sp.Expr
    """Exact start time [s]; arbitrary for an autonomous system, such as 0."""
    state: tuple[float, ...]
    mode: Mode
    period: sp.Expr | None = None
    events: int | None = None
    surface: int | None = None
    """With ``events``: the surface of the event."""
    tangent: bool = False
    """With ``events``: the start is a release, at which the surface's normal velocity is zero too."""
    reset: bool = False
    """With ``events``: the start is just after the surface has reset the state, possibly to a state off the surface."""


@dataclass(frozen=True)
class OrbitEvent:
    """One change of mode on the orbit."""

    from_mode: Mode
    to_mode: Mode
    time: arb
    state: tuple[arb, ...]


@dataclass(frozen=True)
class MappedPoint:
    """Result of the return map."""

    end: list[arb]
    """Free coordinates at the end."""
    derivative: arb_mat
    """Derivative of the end by the start, in free coordinates."""
    elapsed: arb
    """Time taken [s]."""
    events: tuple[OrbitEvent, ...]
    state: tuple[arb, ...]
    """Full state at the start."""


class ReturnMap:
    """The return map of a guess.

    OrbitError if a fixed point would not prove a periodic orbit: the system is not proven to have the given period, or
    it depends on time and no period is given.
    """

    def __init__(self, system: FilippovSystem, guess: Guess) -> None:
        self.model, self.guess = SystemModel(system), guess
        _check_repeats(system, guess)
        on = {i for i, s in enumerate(guess.mode) if s == 0}
        leads_off = guess.reset and guess.surface is not None and impact_of(system, guess.surface) is None
        self.section = None if leads_off else guess.surface
        """The surface that the start is on because of its event."""
        if self.section is not None:
            on.add(self.section)
        zeros = [self.model.surfaces[i] for i in sorted(on)]
        slid_on = [i for i in sorted(on) if guess.mode[i] == 0]
        zeros += [system.numeric(speed) for i in slid_on for speed in kept_zero(system, i)[1:]]
        self.solved = solve_for_states(zeros, system.states)
        taken = {index for index, _, _ in self.solved}
        self.free = [i for i in range(len(guess.state)) if i not in taken]
        """Indices of the states that are coordinates of the map."""

    @property
    def time(self) -> arb:
        """Start time, at the working precision."""
        return enclose(self.model.system.numeric(self.guess.time))

    def __call__(self, free: Sequence[arb], bits: int, *, sharp: bool) -> MappedPoint:
        """Evaluate the map at a point or over a box of free coordinates, at the working precision ``bits``.

        ``sharp``: the derivative is accurate to all digits, not only enough to propagate a radius.
        """
        state = self._state(free)
        flow = ValidatedFlow(self.model, PointSet.box([self.time, *state]), self._entry(), bits, sharp=sharp)
        begin = flow.points.hull()
        events: list[Hit] = []
        period = sp.Integer(2**40) if self.guess.period is None else self.guess.period  # an event ends it earlier
        horizon = self.time + enclose(self.model.system.numeric(period))
        while not flow.done and len(events) != self.guess.events:
            if flow.steps >= MAX_STEPS:
                raise OrbitError(f"the return map does not end within {MAX_STEPS} steps")
            hit = flow.step(horizon)
            if hit is not None:
                events.append(hit)
        wanted = self.guess.events
        if wanted is not None and len(events) < wanted:
            raise OrbitError(f"the return map has {len(events)} events, not {wanted}")
        if flow.mode != self.guess.mode:
            raise OrbitError(f"the return map ends in mode {flow.mode}, not in {self.guess.mode} where it started")
        if wanted is not None:
            self._check_last(events[-1])
        end = flow.points.hull()
        return MappedPoint(
            [end[i + 1] for i in self.free],
            self._derivative(flow.derivative, begin),
            end[0] - self.time,
            tuple(OrbitEvent(h.before, h.after, h.box[0], h.box[1:]) for h in events),
            tuple(state),
        )

    def _entry(self) -> Entry:
        zeros = []
        for guard in self.model.mode(self.guess.mode).guards:
            started = guard.kind == "surface" and guard.index == self.section
            zeros.append((2 if self.guess.tangent else 1) if started else 0)
        return Entry(self.guess.mode, tuple(zeros))

    def _state(self, free: Sequence[arb]) -> list[arb]:
        state = [arb(0)] * len(self.guess.state)
        for i, value in zip(self.free, free, strict=True):
            state[i] = value
        for index, value, _ in reversed(self.solved):
            state[index] = enclose(value, self.model.at((self.time, *state)))
        return state

    def _derivative(self, whole: arb_mat, at: Sequence[arb]) -> arb_mat:
        """Derivative in free coordinates, by the chain rule through the solved states."""
        values = self.model.at(at)
        columns: list[list[arb]] = []
        for i in self.free:
            column = [arb(int(k == i + 1)) for k in range(len(at))]
            for index, _, gradient in reversed(self.solved):
                slopes = [enclose(g, values) for g in gradient]
                column[index + 1] = sum((g * c for g, c in zip(slopes, column, strict=True)), arb(0))
            columns.append(column)
        return arb_mat(
            [
                [sum((whole[i + 1, k] * c for k, c in enumerate(column)), arb(0)) for column in columns]
                for i in self.free
            ]
        )

    def _check_last(self, last: Hit) -> None:
        """Check that the map ends on the surface that it starts from, with the same kind of event."""
        system, guess = self.model.system, self.guess
        tangent = last.guard.kind == "release" and last.guard.index not in system.overrides
        reset = bool(resetting(system, last.before, [last.guard]))
        if (last.guard.index, tangent, reset) != (guess.surface, guess.tangent, guess.reset):
            name = system.sign_names[last.guard.index]
            raise OrbitError(
                f"the return map ends with a {last.guard.kind} event of {name}, not with the event it starts at"
            )


def _check_repeats(system: FilippovSystem, guess: Guess) -> None:
    """Check that the equations are the same at the end of the map as at its start."""
    if (guess.period is None) == (guess.events is None):
        raise OrbitError("a guess gives either a period or a number of events")
    for expression in system.expressions:
        number = system.numeric(expression)
        if not number.has(TIME):
            continue
        if guess.period is None:
            raise OrbitError(f"the system depends on time ({expression}): give the period of its drive")
        later = sp.expand(number.xreplace({TIME: sp.expand(TIME + system.numeric(guess.period))}))
        if not proves_zero(later - sp.expand(number)):
            raise OrbitError(f"{expression} is not proven to have the period {guess.period}")
