"""Answers to the return codes of the compiled loop: mode changes, jumps and events in multiprecision.

Most runs do not need them: the loop (``henon_ref/kernel/loop.c``) decides all that double precision can decide.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from flint import arb

from henon_ref.integrator.endings import ending_of, pass_branch_point, range_ending
from henon_ref.integrator.multiprecision_event import LocatedEvent, UndecidedStep, locate_event
from henon_ref.integrator.multiprecision_roots import BITS
from henon_ref.integrator.precise_modes import PreciseMotion, split
from henon_ref.integrator.records import TRANSITION, TRANSITION_PLACES, written
from henon_ref.integrator.run_result import KINDS, Reason
from henon_ref.integrator.state_view import State
from henon_ref.kernel.library import LEVELS, kernel
from henon_ref.modes.after_jump import after_jump
from henon_ref.modes.arithmetic import time_unit
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, numbered_mode, replaced, transition_kind
from henon_ref.modes.mode_evaluation import TapePoint
from henon_ref.modes.resets import REMAINING, resetting, rows_at
from henon_ref.modes.selection import after_event, contact_orders
from henon_ref.precision import working_precision
from henon_ref.trajectory import Status

Ending = tuple[Status, Reason]
"""Status and reason of a run that ends."""


def answered(run: State, code: int) -> Ending | None:
    """Handle a return code of the loop; None if the run continues."""
    if code in (kernel.SELECT_MODE, kernel.UNDECIDED_EVENT, kernel.MODE_NOT_COMPILED):
        if code == kernel.MODE_NOT_COMPILED:
            ending = enter_new_mode(run)
        else:
            ending = select_mode(run) if code == kernel.SELECT_MODE else locate(run)
        return ("ok", "") if ending is None and run.scalars.stopped else ending
    if code == kernel.STALLED:
        if pass_branch_point(run):
            return None
        if close_to_horizon(run):
            return locate(run)
    if code == kernel.OUT_OF_RANGE:
        run.count("ranges")
        ending = range_ending(run)
        run.scalars.within_range = run.scalars.steps + 1
        run.scalars.expansions -= 1  # the expansion is repeated
        return ending
    return ending_of(run, code)


def locate(run: State) -> Ending | None:
    """Take a step in multiprecision that double precision leaves undecided; None if the run continues."""
    run.count("event_locations")
    integrator, scalars, mode = run.integrator, run.scalars, run.mode
    places = integrator.mode_table.places(mode)
    zeros = dict(zip(places, run.known_zeros.tolist(), strict=False))
    state, rounding = _digits(run)
    found = locate_event(
        run.start.constants.precise.in_unit(_unit(run)),
        UndecidedStep(
            mode=mode,
            time=run.now,
            state=state,
            rounding=rounding,
            length=float(scalars.step_length),
            suspect=float(scalars.suspect),
            guard=None if scalars.guard == kernel.NOWHERE else places[int(scalars.guard)],
            known_zeros=tuple(zeros.get(g, 0) for g in range(len(integrator.system.guards(mode)))),
            tolerance=float(scalars.tolerance),
        ),
    )
    return ending_of(run, kernel.STALLED) if found is None else _gone_to(run, found)


def _gone_to(run: State, found: LocatedEvent) -> Ending | None:
    """Complete the step to an event and change the mode; None if the run continues."""
    integrator, scalars, mode, row = run.integrator, run.scalars, run.mode, run.row
    length = (found.time[0] - float(scalars.time)) + (found.time[1] - float(scalars.time_low))
    run.keep_step(length)
    if scalars.guard == kernel.NOWHERE:
        run.fill_samples_on_line(length, [high for high, _ in found.state])
    run.put(found.time, found.state)
    run.scalars.steps += 1
    run.known_zeros[:] = 0
    left, resolution = run.left(found.time), 2e-17 * abs(run.until[0])  # rounding of a sum
    if left < -resolution or (left < resolution and not (found.falling or found.touching)):
        scalars.time, scalars.time_low = run.until
        return None
    guards = integrator.system.guards(mode)
    for g in found.below_rounding:
        _passed_over(run, guards[g])
    falling = [guards[g] for g in found.falling]
    if surfaces := resetting(integrator.system, mode, falling):
        return jump(run, surfaces, [*falling, *(guards[g] for g, _ in found.touching)])
    touching = [guards[g] for g, _ in found.touching]
    tangential = sorted({g.index for g in touching if g.kind == "surface" or integrator.system.held_inside(g.index)})
    if found.decision is not None and not falling:
        return found.decision.ending, found.decision.reason
    if found.decision is not None:
        tangential += [guards[g].index for g in found.falling if guards[g].kind == "surface"]
        return change_mode(run, found.decision, found.known_zeros, sorted(set(tangential)))
    _set_known_zeros(run, mode, found.known_zeros)
    for i in tangential:  # without static friction, a touch of the end of sliding is not recorded
        record(run, kernel.GRAZE, i, row, row, side=0)
    return None


def _digits(run: State) -> tuple[list[arb], list[float]]:
    """Return the state with as many digits as are known, and a bound of the error of each entry.

    More digits than double precision are known in the first mode, until a jump or the caller changes the state.
    """
    scalars, start, state = run.scalars, run.start, run.x.tolist()
    if scalars.more_digits and scalars.remembered == 1:
        if run.motion is None:
            run.motion = PreciseMotion(start.constants.precise, run.mode, start.time, start.x)
        found = run.motion.at(run.now, state, float(scalars.step_length))
        if found is not None:
            return found
    scalars.more_digits = 0
    with working_precision(BITS):
        return run.exact_state, [LEVELS.state_rounding * abs(x) for x in state]


def _passed_over(run: State, guard: Guard) -> None:
    """Record that a guard is below its rounding error here (``henon_ref/kernel/below_rounding.c``)."""
    since = run.workspace.since
    place = kernel.rounding_place(guard.kind == "valid", guard.index, len(since))
    if not since[place] <= run.scalars.time:
        since[place] = run.scalars.time
        run.scalars.below_rounding += 1


def _set_known_zeros(run: State, mode: Mode, zeros: Sequence[int]) -> None:
    """Set the known zeros of the current mode's guards; ``zeros`` is in the order of its equations."""
    for g, place in enumerate(run.integrator.mode_table.places(mode)):
        run.known_zeros[g] = zeros[place] if place >= 0 else 0


def _without_equations(run: State) -> Ending:
    return "failed", f"the mode after t = {run.time:.17g} has no equations"


def change_mode(
    run: State,
    decision: Decision,
    zeros: Sequence[int],
    tangential: Sequence[int],
    applied: Sequence[tuple[int, Sequence[float]]] = (),
) -> Ending | None:
    """Change to the decided mode and record the transitions.

    ``tangential``: surfaces at zero, recorded if no surface changes its entry; ``applied``: surfaces that have reset
    the state, in order, each with the state after its map.
    """
    if decision.mode is None:
        return decision.ending, decision.reason
    before, source = run.mode, run.row
    row = run.integrator.mode_table.row(decision.mode)
    if row is None:
        return _without_equations(run)
    run.row = row
    _set_known_zeros(run, decision.mode, zeros)
    if applied:
        changed = rows_at(before, decision.mode, [i for i, _ in applied])
    else:
        changed = [(i, None) for i, s in enumerate(decision.mode) if s != before[i]]
    for i, place in changed:
        if place is None:
            record(run, KINDS.index(transition_kind(before[i], decision.mode[i])), i, source, row, side=before[i])
        else:
            record(run, kernel.RESET, i, source, row, side=1, state=applied[place][1])
    for i in () if changed else tangential:
        record(run, KINDS.index(transition_kind(before[i], decision.mode[i])), i, source, row, side=0)
    return ending_of(run, kernel.EVENTS_ACCUMULATE) if kernel.events_accumulate(run.workspace.run) else None


def jump(run: State, surfaces: tuple[int, ...], hits: Sequence[Guard]) -> Ending | None:
    """Apply the resets of surfaces, ``hits`` being all guards at zero; None if the run continues."""
    run.count("jumps")
    precise = run.start.constants.precise.in_unit(_unit(run))
    most = REMAINING * (run.until[0] - run.start.time[0])
    with working_precision(BITS):
        t, before = run.exact_time, run.exact_state
        found = after_jump(precise.system, precise, run.mode, surfaces, hits, t, before, arb(most))
        after = [split(x) for x in found.state]
        applied = [(i, [float(x.mid()) for x in left]) for i, left in found.applied]
        rests = [(split(t + rest.remaining), [split(x) for x in rest.state], rest) for rest in found.rests]
    run.before_jump[:] = run.x
    run.scalars.more_digits = 0
    run.put(run.now, after)
    if not all(abs(high) < LEVELS.blown_up for high, _ in after):
        return ending_of(run, kernel.DIVERGED)
    ended = change_mode(run, found.decision, _zeros_on(run, found.decision.mode, found.on, found.left), (), applied)
    for end, resting, rest in rests:
        if ended is not None:
            break
        length = (end[0] - run.now[0]) + (end[1] - run.now[1])
        run.keep_line(length, [high for high, _ in resting])
        if run.left(end) < 0.0:
            run.put(run.until, resting)
            return None
        run.put(end, resting)
        ended = change_mode(run, Decision("unique", rest.mode), _zeros_on(run, rest.mode, rest.on), ())
    return ended


def _zeros_on(run: State, mode: Mode | None, on: Collection[int], left: Collection[int] = ()) -> Sequence[int]:
    """Return the known zeros of a mode's guards at the current point, which lies on the surfaces ``on``.

    ``left``: surfaces that the state leaves with a speed, which derivatives in doubles might take for zero.
    """
    if mode is None:
        return ()
    orders = contact_orders(_point(run), mode, on)
    guards = run.integrator.system.guards(mode) if orders else ()
    own = [guard.kind == "surface" and guard.index in left for guard in guards]
    return [1 if leaves else order for leaves, order in zip(own, orders, strict=True)]


def _unit(run: State) -> float:
    return time_unit(run.until[0] - run.start.time[0])


def _point(run: State) -> TapePoint:
    """Return the current point in doubles."""
    return run.start.constants.in_doubles.at(run.time, run.x.tolist(), unit=_unit(run))


def close_to_horizon(run: State) -> bool:
    """Prepare a step to the horizon in multiprecision if too little time is left for double precision.

    Over such a time guards change by less than the rounding error of the states, so that no step can be validated.
    """
    scalars, left = run.scalars, run.left(run.now)
    if not (left <= 2.0**-40 * abs(run.until[0]) and run.guards):
        return False
    scalars.suspect = scalars.step_length = left
    scalars.guard, scalars.stalled = kernel.NOWHERE, 0
    return True


def record(
    run: State, kind: int, surface: int, source: int, target: int, *, side: int, state: Sequence[float] | None = None
) -> None:
    """Record a transition, at the run's state unless ``state`` is given."""
    if run.scalars.transitions >= run.scalars.transition_capacity:
        run.close_block()
    scalars = run.scalars
    row, last = run.workspace.transitions[scalars.transitions], TRANSITION_PLACES + run.x.size
    row[TRANSITION_PLACES:last] = run.x if state is None else state
    made, contacts = row[:TRANSITION_PLACES].view(TRANSITION)[0], run.integrator.mode_table.contacts
    made["time"], made["time_low"] = scalars.time, scalars.time_low
    made["kind"], made["surface"], made["landing"] = kind, surface, scalars.landing
    if contacts:
        made["from_mode"] = made["to_mode"] = 0
        row[last:].view(np.int64)[:] = [*written(source, contacts), *written(target, contacts)]
    else:
        made["from_mode"], made["to_mode"] = source, target
    scalars.transitions += 1
    ends_here = scalars.stop_falling if side > 0 else scalars.stop_rising if side < 0 else 0
    if int(ends_here) >> surface & 1 and not scalars.stopped:
        scalars.stopped = 1 + surface


def enter_new_mode(run: State) -> Ending | None:
    """Compile the mode that an event leads to; the loop then repeats the event."""
    mode, table, scalars = run.mode, run.integrator.mode_table, run.scalars
    hit, what, number = int(scalars.guard), int(scalars.pending_kind), int(scalars.pending_mode)
    if number >= 0:
        compiled = table.row(numbered_mode(number, len(mode))) is not None
    else:
        row, guard = int(scalars.mode), table.guards(mode)[hit]
        entry = 0 if what == kernel.STICK else guard.to_sign
        compiled = table.row(replaced(mode, guard.index, entry)) is not None and table.leads_to(row, hit, entry) >= 0
    if compiled:
        run.count("new_modes")
        return None
    unsettled, scalars.event_pending = scalars.event_pending == kernel.UNSETTLED, 0
    if unsettled:
        return locate(run)
    if number >= 0 and what == kernel.RESET:
        return _without_equations(run)
    return select_mode(run)  # no such mode, or known zeros must be determined


def select_mode(run: State) -> Ending | None:
    """Select the mode at an event that signs alone do not decide; None if the run continues."""
    before = run.mode
    hits: list[Guard] = [g for g, hit in zip(run.guards, run.hits, strict=False) if hit]
    if surfaces := resetting(run.integrator.system, before, hits):
        return jump(run, surfaces, hits)
    at = _point(run)
    placed = zip(run.guards, run.hits, run.integrator.mode_table.places(before), strict=False)
    reached = [place for g, hit, place in placed if hit and g.kind == "surface" and place >= 0]
    if len(reached) == 1:  # a force that begins at this surface is exactly zero, whatever the error of the time
        at = at.at_zero_of(before, reached[0])
    decision = after_event(at, before, hits)
    seen = decision.mode is not None and run.integrator.mode_table.knows(decision.mode)
    run.count("mode_selections" if seen else "new_modes")
    if decision.mode is None:
        return decision.ending, decision.reason
    early = run.scalars.guard == kernel.NOWHERE
    # If no step was taken, surfaces that were left just before still count as touched.
    fresh = {g.index for g, zeros in zip(run.guards, run.known_zeros, strict=False) if zeros and early}
    moved = {g.index for g in hits} | {i for i, s in enumerate(decision.mode) if s != before[i]}
    slides = [i for i, s in enumerate(decision.mode) if s == 0 or before[i] == 0]
    active = fresh | run.integrator.system.in_play(moved, slides)
    orders = contact_orders(at, decision.mode, active)
    tangential = [] if early else sorted({g.index for g in hits if g.kind == "surface"})
    return change_mode(run, decision, orders, tangential)
