"""Loops of contacts some of which have no static friction: these hold as well, at most what they slide with.

A stop that a body rests on may be in a loop: of the contacts that a block has with a wall and with that body, say.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.contact_loops import circuits, loops, relations
from henon_ref.modes.overrides import Release, SlidingOverride
from henon_ref.modes.sliding import filippov_sliding
from henon_ref.modes.system import FilippovSystem


def with_held_loops(system: FilippovSystem) -> FilippovSystem:
    """The system with contacts that are in loops held by the loads that their loops share.

    Filippov's combination has no single equivalent signs where surfaces depend on each other, and the motion may be
    settled all the same. A contact's own two ends, both fields pointing at its surface, are those of a hold zone, by
    which it is decided like one with static friction. Surfaces that are only multiples of one are left to
    :func:`henon_ref.modes.sliding.filippov_sliding`, which takes them for one contact.
    """
    acting = [i for i, s in enumerate(system.signs) if i in system.overrides or system.normal_velocity(i).has(s)]
    if not relations(system.velocities, tuple(acting)):
        return system
    lone = {i: _held(system, i) for i in acting if i not in system.overrides and i not in system.resets}
    plain = {i: override for i, override in lone.items() if override is not None}
    contacts = tuple(i for i in acting if i in plain or system.held_inside(i) or system.rests(i))
    found = loops(relations(system.velocities, contacts))
    members = [sorted(set().union(*loop)) for loop in found]
    multiples = {k for k, loop in enumerate(found) if all(len(relation) == 2 for relation in loop)}
    held = set(system.overrides).union(*(own for k, own in enumerate(members) if k not in multiples))
    own: dict[int, SlidingOverride] = {}
    for k, surfaces in enumerate(members):
        if k in multiples and not held & system.together(surfaces[0], contacts):
            continue
        more = {i: plain[i] for i in surfaces if i in plain}
        whole = replace(system, overrides={**system.overrides, **own, **more})
        if whole.can_slide(frozenset(surfaces)):
            own |= more
            continue
        # Drives that part from each other do not hold together; some of the loops beside them may.
        for circuit in circuits(found[k]):
            if not more.keys().isdisjoint(circuit) and whole.can_slide(frozenset(circuit)):
                own |= {i: more[i] for i in circuit if i in more}
    return replace(system, overrides={**system.overrides, **own}) if own else system


def _held(system: FilippovSystem, index: int) -> SlidingOverride | None:
    """A contact without static friction as one that is held; None where its surface cannot be slid on by itself."""
    try:
        field, guards, _ = filippov_sliding(system, (index,))
    except ModelError:
        return None
    ends = tuple(Release(guard.expression, "falling", guard.to_sign) for guard in guards)
    return SlidingOverride(field, ends, "inside", sp.S.One)
