"""Multiprecision event location, for events that double precision cannot decide (grazes, close or multiple roots).

The mode is expanded again with 220 bits (:mod:`henon_ref.integrator.precise_modes`) from the start of the step, and the
roots of its guards are isolated (:mod:`henon_ref.integrator.multiprecision_roots`). Expansions are truncated where
their terms are negligible, and roots are located to about 1e-50 of the step: not a proof, but far more accurate than
double precision.

All guards of the mode are examined. The step ends at the first event of any guard; events of other guards within its
radius belong to it. The following mode is decided there in the same arithmetic. If the rounding error of the state at
the start of the step could remove a touch or split it into two roots, the event is not decided: the run continues past
it.
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
from henon_ref.integrator.multiprecision_roots import BITS, ONE, fixed_point
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.precise_modes import MOST_ORDER, PreciseModes, split
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import resetting
from henon_ref.modes.selection import after_event, contact_orders
from henon_ref.precision import working_precision

SMALL_PART = 2.0**-40
"""Perturbation of the state relative to its rounding error, for the first-order change of a minimum."""


class UndecidedStep(NamedTuple):
    """Step on which a guard is near zero in double precision. Guards are in the order of the mode's equations."""

    mode: Mode
    time: Pair
    """Start of the step [s]."""
    state: Sequence[arb]
    """State there."""
    rounding: Sequence[float]
    """Bound of the error of each entry."""
    length: float
    """Length of the step for which the expansion is valid [s]."""
    suspect: float
    """Time from the start of the step to the suspected event, or to the requested end [s]."""
    guard: int | None
    """Guard that was near zero; None: no guard was."""
    known_zeros: tuple[int, ...]
    """Number of zeros of each guard at the start, which are divided out."""
    tolerance: float = 0.0
    """Relative error of a step that led here."""


class LocatedEvent(NamedTuple):
    """End of the step, and the events there."""

    time: Pair
    """[s]"""
    state: tuple[Pair, ...]
    falling: tuple[int, ...]
    """Guards that fall through zero at this instant, or whose touch ends the mode."""
    touching: tuple[tuple[int, int], ...]
    """(guard, even order) of guards that touch zero."""
    decision: Decision | None
    """Decision on the following mode; None if the mode continues, or a jump comes first."""
    known_zeros: tuple[int, ...]
    """Number of zeros of each guard of the following mode at this instant; a minimum just above zero counts as one."""
    below_rounding: tuple[int, ...] = ()
    """Guards for which rounding of the state leaves undecided whether they reach zero here."""


def locate_event(modes: PreciseModes, step: UndecidedStep) -> LocatedEvent | None:
    """Locate the first event of a step; without an event, the step ends at the suspected place.

    None if no guard was near zero and the series do not converge up to the requested end.
    """
    with working_precision(BITS):
        start = arb(step.time[0]) + arb(step.time[1])
        # A root that rounding has put at the end of the step may lie just beyond it.
        unit = arb(min(step.length, 1.25 * step.suspect)) * (1 + arb(2) ** -46)
        states, outputs, whole = modes.expand(step.mode, start, step.state, unit)
        if step.guard is None and not whole and len(outputs[0]) > MOST_ORDER:
            return None
        guards = modes.guards(step.mode)
        events = _events(guards, outputs, step, unit, whole=whole)
        events = _beyond_rounding(modes, step, start, unit, outputs, events)
        if not events:
            end = arb(step.suspect)
            state = tuple(split(series(end / unit)) for series in states)
            return LocatedEvent(split(start + end), state, (), (), None, (0,) * len(guards))
        first = events[0]
        met = [event for event in events if event is first or event.meets(first)]
        reported = [event for event in met if event.what != "miss"] or met
        best = min(reported, key=lambda event: event.radius)
        radius = max(event.radius + abs(event.place - best.place) / ONE for event in reported)
        place = arb(best.place) / ONE
        time, state = split(start + unit * place), tuple(split(series(place)) for series in states)
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
    """Return the events of the guards up to the first of them, which comes first in the list.

    ``whole``: the series are polynomials without truncation.
    """
    longer, place = step.length / float(unit), fixed_point(arb(step.suspect) / unit)
    found: list[GuardEvent] = []
    if step.guard is not None:
        found.append(
            first_guard_event(step.guard, GuardSeries(outputs[step.guard], step.known_zeros[step.guard], whole), place)
        )
        place = found[0].place
    for g, guard in enumerate(guards):
        if g == step.guard or is_clear(outputs[g], guard, place):
            continue
        if load_equals_friction(guards, outputs, g, longer, step.tolerance):
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
    """Return the events; an event that rounding of the state leaves undecided becomes a ``miss``, at the minimum.

    Central differences show how much rounding moves a minimum. (They are zero for the minimum of a square, which is 0
    for every state.)
    """
    flat = {e.guard: 0.0 for e in events if e.depth <= 1e-6}  # certainly no other minimum is affected by rounding
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
    # A relative change of less than 1e-40 is of higher order, or rounding of multiprecision itself.
    found = [
        replace(e, what="miss", lowest=True, order=2, place=e.bottom, below_rounding=True)
        if flat.get(e.guard, 0.0) > max(e.depth, 1e-40)
        else e
        for e in events
    ]
    first = min(found, key=lambda e: (e.what == "miss", e.place))
    return [first, *(e for e in found if e is not first)]


def _ends(modes: PreciseModes, guards: Sequence[Guard], event: GuardEvent) -> bool:
    """Whether a touch of zero ends the mode: at the end of the model, or at a surface with static friction."""
    guard = guards[event.guard]
    held = guard.kind == "surface" and modes.system.held_inside(guard.index)
    return event.what == "touch" and (guard.ends is not None or held)


def _zeros_behind(events: Sequence[GuardEvent], here: GuardEvent, count: int) -> tuple[int, ...]:
    """Return the number of zeros of each guard at a minimum of one of them at which the mode continues.

    A minimum above zero is passed together with another one within 1e-12 of the step.
    """
    zeros = [0] * count
    for event in events:
        same_minimum = abs(event.place - here.place) / ONE <= 1e-12
        if event.lowest and (event is here or event.meets(here) or (same_minimum and event.what == "miss")):
            zeros[event.guard] = event.order
    return tuple(zeros)


def _next_mode(
    modes: PreciseModes, mode: Mode, point: tuple[arb, list[arb]], hits: Sequence[Guard]
) -> tuple[Decision, tuple[int, ...]]:
    """Return the decision on the mode after guards have fallen at a point, and the known zeros of its guards there.

    Rounding moves a sliding state off its surfaces; its ball is widened by this distance. If rounding has split a tie
    of steep guards, no mode may be consistent; then double precision decides, as it does for ordinary events.
    """
    time, state = point
    sliding = [i for i, s in enumerate(mode) if s == 0]
    off = modes.off_surfaces(sliding, time, state)
    state = [arb(x.mid(), float(x.rad()) + off) for x in state]
    at = modes.in_balls.at(time, state)
    decision = after_event(at, mode, hits)
    if decision.status == "none":
        levels = 1e-15, 0.0  # relative size of zero
        at = modes.in_doubles.at(float(time), [float(x) for x in state], levels, modes.unit)
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
    """Return the decision ``nonunique`` if another motion departs from a touched surface; otherwise None.

    This is the case if the field on the other side points away from it, immediately or at a visible two-fold (Filippov
    1988, Sec. 19).
    """
    surfaces = [guard for guard in touching if guard.kind == "surface"]
    if not surfaces:
        return None
    decision = after_event(modes.in_balls.at(*point), mode, surfaces)
    return decision if decision.status == "nonunique" else None
