"""A system as it is written made ready for its modes: exponents in numbers, contacts in loops that hold."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.contact_loops import circuits, loops, relations
from henon_ref.modes.sliding import filippov_sliding
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem


def with_rational_exponents(system: FilippovSystem) -> FilippovSystem:
    """The system with the numbers of its parameters in every exponent that they make rational.

    An exponent decides what function a power is (a product, a root), and nothing that holds for the symbol holds
    for all its values: x**3 is smooth where x is 0, x**n is so for some n only. Powers of numbers and parameters, and
    parameters everywhere else, stay as they are written.
    """
    constant = set(system.parameters)

    def is_open(e: sp.Basic) -> bool:
        return (
            isinstance(e, sp.Pow)
            and bool(e.exp.free_symbols & constant)
            and not e.base.free_symbols <= constant
            and bool(system.numeric(e.exp).is_Rational)
        )

    @cache  # overrides hold the field's own rates again and again
    def written(expression: sp.Expr) -> sp.Expr:
        return expression.replace(is_open, lambda e: sp.Pow(e.base, system.numeric(e.exp)), simultaneous=False)

    overrides = {
        index: replace(
            override,
            field=tuple(map(written, override.field)),
            release=tuple(replace(r, when=written(r.when)) for r in override.release),
        )
        for index, override in system.overrides.items()
    }
    resets = {
        index: replace(reset, map={x: written(value) for x, value in reset.map.items()})
        for index, reset in system.resets.items()
    }
    surfaces, field, valid = (tuple(map(written, own)) for own in (system.surfaces, system.field, system.valid))
    return replace(system, surfaces=surfaces, field=field, valid=valid, overrides=overrides, resets=resets)


def parameters_in_exponents(system: FilippovSystem) -> set[sp.Symbol]:
    """Parameters whose values :func:`with_rational_exponents` looks at: with others the system is another one."""
    expressions = [*system.surfaces, *system.field, *system.valid]
    for override in system.overrides.values():
        expressions += [*override.field, *(r.when for r in override.release)]
    exponents = (power.exp for e in set(expressions) for power in e.atoms(sp.Pow))
    return {symbol for exponent in exponents for symbol in exponent.free_symbols} & set(system.parameters)


def with_held_loops(system: FilippovSystem) -> FilippovSystem:
    """The system with contacts that are in loops held by the loads that their loops share.

    Filippov's combination has no single equivalent signs where surfaces depend on each other, and the motion may be
    settled all the same. A contact's own two ends, both fields pointing at its surface, are those of a hold zone, by
    which it is decided like one with static friction. Surfaces that are only multiples of one are left to
    :func:`henon_ref.modes.sliding.filippov_sliding`, which takes them for one contact. A stop that a body rests on may
    be in a loop: of the contacts that a block has with a wall and with that body, say.
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
