"""Preparation of a system for the derivation of its modes: numeric exponents, and held contacts in loops."""

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
    """Return the system with numbers substituted for parameters in every exponent that becomes rational.

    An exponent decides which function a power is (a product, a root), and no rule for a symbolic exponent holds for all
    its values: x**3 is smooth at x = 0, x**n only for some n. Powers of numbers and parameters, and parameters outside
    exponents, are left as written.
    """
    constant = set(system.parameters)

    def is_open(e: sp.Basic) -> bool:
        return (
            isinstance(e, sp.Pow)
            and bool(e.exp.free_symbols & constant)
            and not e.base.free_symbols <= constant
            and bool(system.numeric(e.exp).is_Rational)
        )

    @cache  # overrides repeat most rates of the field
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
    """Return the parameters whose values :func:`with_rational_exponents` uses: other values give another system."""
    exponents = (power.exp for e in set(system.expressions) for power in e.atoms(sp.Pow))
    return {symbol for exponent in exponents for symbol in exponent.free_symbols} & set(system.parameters)


def with_held_loops(system: FilippovSystem) -> FilippovSystem:
    """Return the system in which contacts in loops are held by the loads that their loops share.

    If surfaces depend on each other, Filippov's combination has no unique equivalent signs, although the motion may be
    unique. The two guards of a contact's sliding (each field points at its surface) then become the ends of a hold
    zone, and the contact is decided like a contact with static friction. Surfaces that are only multiples of one
    surface are one contact for :func:`henon_ref.modes.sliding.filippov_sliding` and are not changed here. A stop on
    which a body rests may be part of a loop, for example with the contacts of a block with a wall and with that body.
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
        # Contacts between drives of different speeds do not hold together; the remaining loops may.
        for circuit in circuits(found[k]):
            if not more.keys().isdisjoint(circuit) and whole.can_slide(frozenset(circuit)):
                own |= {i: more[i] for i in circuit if i in more}
    return replace(system, overrides={**system.overrides, **own}) if own else system


def _held(system: FilippovSystem, index: int) -> SlidingOverride | None:
    """Return the override that holds a contact without static friction; None if it cannot slide on its own."""
    try:
        field, guards, _ = filippov_sliding(system, (index,))
    except ModelError:
        return None
    ends = tuple(Release(guard.expression, "falling", guard.to_sign) for guard in guards)
    return SlidingOverride(field, ends, "inside", sp.S.One)
