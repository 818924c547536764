"""Multiprecision event location: what double precision cannot decide (a graze, a pair of roots, a flat root).

The mode is expanded again with 220 bits (:mod:`henon_ref.integrator.precise_modes`), from the step's start as it is,
and the roots of its guards are isolated (:mod:`henon_ref.roots.multiprecision`). Expansions are cut off where their
terms count for nothing, and roots found to about 1e-50 of the step: no proof, but far beyond what a double can tell.
Every guard of the mode is looked at. The first event of any of them is gone to, and what else happens there within the
radius to which the place is known is part of it. The mode that follows is decided there in the same arithmetic. Where
the state at the step's start is known to a rounding only, and that may lift a guard's touch from zero or make it two
roots, nothing is decided: the run goes on past it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from flint import arb, arb_poly

from henon_ref.integrator.guard_events import (
    GuardEvent,
    GuardSeries,
    first_guard_event,
    is_clear,
    load_equals_friction,
)
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.precise_modes import MOST_ORDER, PreciseModes
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import resetting
from henon_ref.modes.selection import after_event, contact_orders
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS, ONE, fixed_point

PAIR_ROUNDING = 2.0**-106
"""What two doubles lose of a number; less than that would only make the second one miss round numbers."""
FLAT_LEVEL = 1e-6
"""Part of its size above which a minimum is beyond rounding, whatever that makes of it."""
SMALL_PART = 2.0**-40
"""Part of a rounding that the state is moved by, for what it makes of a minimum to first order."""
LEAST_MOVE = 1e-40
"""Part of a guard's size below which what moves its minimum is higher order, or multiprecision's own rounding."""
EXPANDED_PART = 1.25
"""So many times as far as the place that is suspected the motion is expanded: what lies behind has to wait."""
SAME_MINIMUM_PART = 1e-12
"""Minima no farther from each other than this part of the step, one of them above zero, are left behind together."""
TIE_LEVELS = (1e-15, 0.0)
"""Relative sizes of zero where balls leave no mode: what rounding has left of a tie of steep guards."""
_STEP_MARGIN = 1 + arb(2) ** -46
"""A root that rounding has put on the step's end may lie just behind it."""


class UndecidedStep(NamedTuple):
    """A step on which double precision sees a guard near zero. Guards are in the order of the mode's equations."""

    mode: Mode
    time: Pair
    """Start of the step [s]."""
    state: Sequence[arb]
    """State there."""
    rounding: Sequence[float]
    """What each of its entries may be off."""
    length: float
    """How far the step is valid [s]."""
    suspect: float
    """Where the guard was seen near zero, or how far the step is to go, from the start [s]."""
    guard: int | None
    """None: none was seen near zero."""
    known_zeros: tuple[int, ...]
    """For each guard, zeros at the start that are divided out."""


class LocatedEvent(NamedTuple):
    """Where the step ends, and what happens there."""

    time: Pair
    """[s]"""
    state: tuple[Pair, ...]
    falling: tuple[int, ...]
    """Guards that fall through zero at this instant, or end their mode where they touch it."""
    touching: tuple[tuple[int, int], ...]
    """(guard, even order) of those that touch zero and turn."""
    decision: Decision | None
    """The mode that follows; None where the mode goes on, and where the state jumps first."""
    known_zeros: tuple[int, ...]
    """For each guard of the mode gone on with, zeros at this instant. A minimum just above zero counts as one."""
    below_rounding: tuple[int, ...] = ()
    """Guards of which rounding of the state leaves open whether they reach zero here."""


def locate_event(modes: PreciseModes, step: UndecidedStep) -> LocatedEvent | None:
    """Go to the first event of a step, or past the place where one was suspected.

    None where no guard was seen near zero and the series do not converge as far as the step is to go.
    """
    with working_precision(BITS):
        start = arb(step.time[0]) + arb(step.time[1])
        unit = arb(min(step.length, EXPANDED_PART * step.suspect)) * _STEP_MARGIN
        states, outputs, whole = modes.expand(step.mode, start, step.state, unit)
        if step.guard is None and not whole and len(outputs[0]) > MOST_ORDER:
            return None
        guards = modes.guards(step.mode)
        events = _events(guards, outputs, step, unit, whole=whole)
        events = _beyond_rounding(modes, step, start, unit, outputs, events)
        if not events:
            end = arb(step.suspect)
            state = tuple(_split(series(end / unit)) for series in states)
            return LocatedEvent(_split(start + end), state, (), (), None, (0,) * len(guards))
        first = events[0]
        met = [event for event in events if event is first or event.meets(first)]
        reported = [event for event in met if event.what != "miss"] or met
        best = min(reported, key=lambda event: event.radius)
        radius = max(event.radius + abs(event.place - best.place) / ONE for event in reported)
        place = arb(best.place) / ONE
        time, state = _split(start + unit * place), tuple(_split(series(place)) for series in states)
        falling = [event.guard for event in met if event.what == "root" or _ends(modes, guards, event)]
        touching = [(e.guard, e.order) for e in met if e.what == "touch" and e.guard not in falling]
        ball = arb(place, radius)
        point = start + unit * ball, [series(ball) for series in states]
        if falling:
            hits = [guards[g] for g in sorted([*falling, *(g for g, _ in touching)])]
            jumps = resetting(modes.system, step.mode, [guards[g] for g in falling])
            decision, zeros = (None, ()) if jumps else _next_mode(modes, step.mode, point, hits)
        else:
            decision = _unless_unique(modes, step.mode, point, [guards[g] for g, _ in touching])
            zeros = _zeros_behind(events, best, len(guards))
        below = tuple(event.guard for event in events if event.below_rounding)
        return LocatedEvent(time, state, tuple(falling), tuple(touching), decision, zeros, below)


def _events(
    guards: Sequence[Guard], outputs: Sequence[Sequence[arb]], step: UndecidedStep, unit: arb, *, whole: bool
) -> list[GuardEvent]:
    """What the guards do up to the first event of any of them; that one comes first. ``whole``: no term is left out."""
    longer, place = step.length / float(unit), fixed_point(arb(step.suspect) / unit)
    found: list[GuardEvent] = []
    if step.guard is not None:
        found.append(
            first_guard_event(step.guard, GuardSeries(outputs[step.guard], step.known_zeros[step.guard], whole), place)
        )
        place = found[0].place
    for g, guard in enumerate(guards):
        if g == step.guard or load_equals_friction(guards, outputs, g, longer) or is_clear(outputs[g], guard, place):
            continue
        series = GuardSeries(outputs[g], step.known_zeros[g], whole)
        if series.positive(place):
            continue
        event = first_guard_event(g, series, place)
        if not found or (event.what != "miss" and event.place < place and not event.meets(found[0])):
            found.insert(0, event)
            place = event.place
        else:
            found.append(event)
    return found


def _beyond_rounding(
    modes: PreciseModes,
    step: UndecidedStep,
    start: arb,
    unit: arb,
    outputs: Sequence[Sequence[arb]],
    events: Sequence[GuardEvent],
) -> list[GuardEvent]:
    """The events, those left out (``miss``) of which rounding of the state leaves open whether they are there.

    The minimum of a square is zero wherever the state is: differences are taken to both sides.
    """
    flat = {e.guard: 0.0 for e in events if e.depth <= FLAT_LEVEL}
    if not flat or not any(step.rounding):
        return list(events)
    for i, off in enumerate(step.rounding):
        if off == 0.0:
            continue
        sides = [
            [x + side * arb(SMALL_PART * off) if j == i else x for j, x in enumerate(step.state)] for side in (-1, 1)
        ]
        below, above = (modes.expand(step.mode, start, state, unit)[1] for state in sides)
        for event in (e for e in events if e.guard in flat):
            low, high = (arb_poly(list(o[event.guard]))(arb(event.place) / ONE) for o in (below, above))
            size = sum((abs(float(c)) for c in outputs[event.guard]), 0.0) or 1.0
            flat[event.guard] += abs(float(high - low)) / (2.0 * SMALL_PART * size)
    found = [
        replace(e, what="miss", lowest=True, order=2, below_rounding=True)
        if flat.get(e.guard, 0.0) > max(e.depth, LEAST_MOVE)
        else e
        for e in events
    ]
    first = min(found, key=lambda e: (e.what == "miss", e.place))
    return [first, *(e for e in found if e is not first)]


def _ends(modes: PreciseModes, guards: Sequence[Guard], event: GuardEvent) -> bool:
    """Whether a guard's mode ends where it only touches zero: a model's end, or a surface that is held at."""
    guard = guards[event.guard]
    held = guard.kind == "surface" and modes.system.held_inside(guard.index)
    return event.what == "touch" and (guard.ends is not None or held)


def _zeros_behind(events: Sequence[GuardEvent], here: GuardEvent, count: int) -> tuple[int, ...]:
    """Zeros of a mode's guards where it goes on from a minimum of one of them."""
    zeros = [0] * count
    for event in events:
        same_minimum = abs(event.place - here.place) / ONE <= SAME_MINIMUM_PART
        if event.lowest and (event is here or event.meets(here) or (same_minimum and event.what == "miss")):
            zeros[event.guard] = event.order
    return tuple(zeros)


def _next_mode(
    modes: PreciseModes, mode: Mode, point: tuple[arb, list[arb]], hits: Sequence[Guard]
) -> tuple[Decision, tuple[int, ...]]:
    """The mode after guards have fallen at a point, and the known zeros of its guards there.

    A state is off the surfaces that it slides on by what rounding has left: so much wider is its ball. Where steep
    guards are tied but for rounding no mode may fit; then double precision decides, as it does without this route.
    """
    time, state = point
    sliding = [i for i, s in enumerate(mode) if s == 0]
    off = modes.off_surfaces(sliding, time, state)
    state = [arb(x.mid(), float(x.rad()) + off) for x in state]
    at = modes.in_balls.at(time, state)
    decision = after_event(at, mode, hits)
    if decision.status == "none":
        at = modes.in_doubles.at(float(time), [float(x) for x in state], TIE_LEVELS)
        decision = after_event(at, mode, hits)
    if decision.mode is None:
        return decision, ()
    zero = {g.index for g in hits if g.kind != "valid"}
    slid = {i for i, s in enumerate(decision.mode) if s == 0 or mode[i] == 0}
    active = modes.system.closed(zero, slid)
    return decision, tuple(contact_orders(at, decision.mode, active))


def _unless_unique(
    modes: PreciseModes, mode: Mode, point: tuple[arb, list[arb]], touching: Sequence[Guard]
) -> Decision | None:
    """Why a run ends where surfaces are touched from which other motions lead away, too; None where it goes on.

    So it is where the field on the other side leads away: at once, or at a visible two-fold (Filippov 1988, Sec. 19).
    """
    surfaces = [guard for guard in touching if guard.kind == "surface"]
    if not surfaces:
        return None
    decision = after_event(modes.in_balls.at(*point), mode, surfaces)
    return decision if decision.status == "nonunique" else None


def _split(number: arb) -> Pair:
    """A number as two doubles."""
    high = float(number)
    low = float(number - high)
    return high, (low if abs(low) > PAIR_ROUNDING * abs(high) else 0.0)
