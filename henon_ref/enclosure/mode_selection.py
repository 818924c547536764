"""The mode after an event or at the start, decided on balls: by strict signs, exact zeros, or not at all.

The rule (exactly one mode is kept by its own field) is implemented independently of
:mod:`henon_ref.modes.selection`, so that a proof checks it. A sign counts only if a ball excludes zero. A zero counts
only if it is proven: by algebra (the start is given in exact numbers; after an event the surface is exactly zero), or
by structure (the field is continuous across a Filippov release, so the normal velocity is exactly zero there).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose, sign_of
from henon_ref.enclosure.consistency import EndedError, Entry, Judge
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.model import Identities, SystemModel
from henon_ref.modes.decision import ended
from henon_ref.modes.equations import Guard
from henon_ref.modes.held_groups import slipped_by
from henon_ref.modes.mode import Mode, mode_text, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import impact_of, into_surface, kept_zero


def initial_entry(model: SystemModel, problem: Problem) -> Entry:
    """Select the mode at the start.

    UndecidedError if a sign cannot be proven; EndedError if the start provably has no future or several, or is outside
    the model.
    """
    system = problem.system
    numbers = [system.numeric(e) for e in (problem.start, *problem.initial)]
    at = Identities(model.at(numbers))
    box = [enclose(e) for e in numbers]
    for expression in system.valid:
        if enclose(system.numeric(expression), model.at(box)) < 0:
            raise EndedError(f"the model does not hold at the start: {expression} < 0", "invalid")
    mode: list[int] = []
    on: list[int] = []
    without_value: list[int] = []
    for i, h in enumerate(model.surfaces):
        value = enclose(h, model.at(box))
        sign = 1 if i in system.kinks and not value.is_finite() else sign_of(value)
        if sign == 0:
            if not at.vanishes(h):
                raise UndecidedError(f"the start's side of {system.sign_names[i]} cannot be decided", "start")
            on.append(i)
            sign = problem.initial_mode.get(i, 0)
        elif problem.initial_mode.get(i, sign) != sign:
            raise EndedError(
                f"the start is off the surface of {system.sign_names[i]}: its mode is {sign:+d}", "invalid"
            )
        mode.append(sign)
        if not value.is_finite():
            without_value.append(i)
    if not set(without_value) <= system.unused_kinks(tuple(mode)):
        name = system.sign_names[without_value[0]]
        raise UndecidedError(f"the surface of {name} has no value at the start", "start")
    open_ones = tuple(i for i in on if i not in problem.initial_mode)
    for i in open_ones:
        impact = impact_of(system, i) if system.rests(i) else None
        speed = sp.Integer(0) if impact is None else system.numeric(impact.speed)
        if at.vanishes(speed):
            continue
        mode[i] = sign_of(enclose(speed, model.at(box)))
        if mode[i] == 0:
            raise UndecidedError(f"whether the start leaves {system.sign_names[i]} cannot be decided", "start")
        refuse_into_surface(model, mode, (i,), box)
    open_ones = tuple(i for i in open_ones if mode[i] == 0)
    judge = Judge(model, box, tuple(on), at)
    if open_ones:
        entry = judge.unique(tuple(mode), open_ones)
        refuse_into_surface(model, entry.mode, open_ones, box)
        return entry
    refusal = "the mode given for the start is not kept by its own field"
    return judge.fixed(tuple(mode), refusal, attracting=False)


def refuse_into_surface(model: SystemModel, mode: Sequence[int], on: Sequence[int], box: Sequence[arb]) -> None:
    """Raise EndedError if a mode moves the state across a surface that it is on and that resets the state."""
    for i in on:
        if i in model.system.resets and mode[i] < 0:
            raise EndedError(into_surface(model.system.sign_names[i], box[0].str(17, radius=False)), "invalid")


def entry_after(model: SystemModel, box: Sequence[arb], mode: Mode, hit: Guard) -> Entry:
    """Select the mode after one guard, with exact numbers, fell through zero in a mode at an enclosure of (t, x)."""
    system = model.system
    refused = ended(system, mode, [hit], box[0].str(17, radius=False))
    if refused is not None:
        if hit.ends is None or hit.ends == "none":  # an undecided case is not proven
            raise UndecidedError(refused.reason, "mode")
        raise EndedError(refused.reason, hit.ends)
    on = tuple(sorted(system.closed({hit.index}, {i for i, s in enumerate(mode) if s == 0})))
    if hit.kind == "surface" or system.decided_together(hit, mode, on):
        moving = [hit.index] if hit.kind == "surface" and mode[hit.index] else []
        released_by = [hit.expression] if hit.kind == "release" else []
        judge = Judge(model, box, on, _identities(model, [i for i in on if i not in moving], moving, *released_by))
        if hit.kind == "surface" and system.rests(hit.index):  # reached from the side on which no body can rest
            return judge.fixed(replaced(mode, hit.index, hit.to_sign), "the surface is not left")
        return judge.unique(mode, tuple(sorted(system.in_play([hit.index], on))), slipped_by(system, [hit]))
    released = replaced(mode, hit.index, hit.to_sign)
    identities = _identities(model, on, (), hit.expression)
    smooth = None if hit.index in system.overrides else hit.index
    judge = Judge(model, box, on, identities, smooth)
    return judge.fixed(released, f"the release into {mode_text(released, system.sign_names)} leads back at once")


def entry_after_jump(model: SystemModel, box: Sequence[arb], sides: Sequence[int], speeds: Mapping[int, arb]) -> Entry:
    """Select the mode after the last jump of an instant, at an enclosure of (t, x).

    ``sides``: signs of the surfaces, 0 for a surface that the state is on. ``speeds``: h' of the surfaces of which a
    map has changed h'; exactly 0 after an impact without rebound.
    """
    system, at = model.system, model.at(box)
    for expression in system.valid:
        value = enclose(system.numeric(expression), at)
        if value < 0:
            raise EndedError(f"the model does not hold after the reset: {expression} < 0", "invalid")
        if not value > 0:
            raise UndecidedError(f"whether the model holds after the reset cannot be decided: {expression}", "mode")
    on = tuple(i for i, side in enumerate(sides) if side == 0)
    still = [i for i in on if i not in speeds or speeds[i] == 0]
    identities = _identities(model, still, [i for i in on if i in speeds])
    entries = tuple(sign_of(speeds[i]) if i in speeds else side for i, side in enumerate(sides))
    return Judge(model, box, on, identities).unique(entries, tuple(i for i in on if entries[i] == 0))


def entry_at_rest(model: SystemModel, box: Sequence[arb], mode: Mode) -> Entry:
    """Return the entry into the mode in which a body has come to rest."""
    on = tuple(i for i, s in enumerate(mode) if s == 0)
    return Judge(model, box, on, _identities(model, on)).fixed(mode, "the body does not stay at rest")


def _identities(model: SystemModel, on: Sequence[int], moving: Sequence[int] = (), *more: sp.Expr) -> Identities:
    """Collect the exact zeros: the surfaces, and h' of those in ``on`` that bodies rest on (not of ``moving``)."""
    system = model.system
    zeros = [model.surfaces[i] for i in (*on, *moving)]
    zeros += [system.numeric(speed) for i in on for speed in kept_zero(system, i)[1:]]
    return Identities.of([*zeros, *more], system.states)
