"""Contacts with Coulomb friction that act on each other: the theory, and which contacts hold, slip and are released.

**Contact.** A surface h = 0 between two bodies, where h is their relative velocity; the friction force acts against the
sign of h. A contact *slips* (mode -1 or +1) if h is not zero, and is *held* (mode 0) if a force within its limits keeps
h at zero. The limit is static friction, or kinetic friction once the contact has slipped at this instant, for example
because its load has just reached the static limit. A body at rest on a stop is also a contact: its relative velocity is
h' and its force is the reaction, which cannot pull.

**Group.** Contacts whose forces act on each other at one instant, through common bodies. Their relative accelerations
are affine in their forces, N = a - W s. W is their inverse inertia: symmetric up to units, and positive semidefinite
(:mod:`~henon_ref.modes.contact_problem`).

**The problem.** The motion follows from Gauss's principle with Coulomb friction: the accelerations minimize

    1/2 sum of m (a - F/m)^2 + sum of limit_i abs(N_i)

over the contacts with h_i = 0; a stop has the constraint N_i >= 0 instead of a term. The sum is strictly convex, so the
accelerations are unique, also in loops and between drives that pull a body apart. The conditions of the minimum are a
complementarity problem for the forces, each in an interval, solved by pivoting. A contact that slips in the solution
and had not slipped before gets kinetic friction as its limit, and the problem is solved again, at most once per
contact.

**Ties.** If a quantity is zero at its limit (a load equal to the largest load that a contact holds, a vanishing
reaction), the next derivatives decide: the mode found is expanded, and the entries of the guards that fall first are
changed, until the mode's own field keeps it.

**Loop.** Contacts whose surfaces depend on each other, so that W is singular: the motion is unique, the loads are not.
The contacts hold while some distribution of the loads is within all limits, until the load of a cut reaches its limit
(:mod:`~henon_ref.modes.contact_loops`: guards that are smooth in time, unlike the largest load of one solution).

**Equations.** Held contacts of a group: :mod:`~henon_ref.modes.held_contacts`; all modes of contacts that do not act on
each other: :mod:`~henon_ref.modes.decoupled_contacts`; rows and trees of bodies:
:mod:`~henon_ref.modes.coupled_contacts`; rest on a stop: :mod:`~henon_ref.modes.resets`.

Moreau, *Standard inelastic shocks and the dynamics of unilateral constraints* (1985), Sec. 2; Lötstedt, *SIAM J. Appl.
Math.* 42 (1982) 281-296; Glocker, *Set-Valued Force Laws* (2001), Ch. 6; Brogliato, *Nonsmooth Mechanics* (2016).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from itertools import product

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import exact_sign
from henon_ref.modes.contact_group import Group, Numbers, released
from henon_ref.modes.contact_loops import is_possible
from henon_ref.modes.contact_problem import Negative, Values
from henon_ref.modes.decision import Decision, kept_entries, several, with_entries
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

MOST_LOOSE = 8
"""Largest number of surfaces that are not contacts and are reached with zero speed; both sides of each are tried."""


def by_groups(system: FilippovSystem, active: Sequence[int]) -> bool:
    """Check whether active surfaces are decided as groups: some have static friction, several are stops on which bodies
    can rest, or there are more than four.

    For other surfaces all modes are tried, since the fields need not be those of friction.
    """
    return len(active) > 4 or any(map(system.held_inside, active)) or sum(map(system.rests, active)) > 1


def slipped_by(system: FilippovSystem, hits: Sequence[Guard]) -> frozenset[int]:
    """Return the contacts whose loads have reached their limits at these guards."""
    ends = [guard for guard in hits if guard.kind == "release" and system.held_inside(guard.index)]
    return frozenset(i for guard in ends for i, _ in released(guard))


def decide_groups(
    system: FilippovSystem, mode: Mode, active: Sequence[int], slipped: Collection[int], numbers: Numbers
) -> Decision:
    """Decide the mode that follows for the contacts of groups.

    ``mode``: entries of the surfaces that are not active; ``active``: surfaces on which the point is and whose entries
    are open; ``slipped``: contacts whose loads have just reached their limits.

    ModelError if forces at the contacts are not those of friction, or if a required proof is missing.
    """
    mode, left = _with_sections(system, mode, active, numbers)
    loose = [i for i in left if not _is_contact(system, mode, i, numbers)]
    if len(loose) > MOST_LOOSE:
        names = listed([system.sign_names[i] for i in loose])
        raise ModelError(
            f"more than {MOST_LOOSE} surfaces are reached with zero speed and undecided at t = {numbers.time}: {names}"
        )
    found: dict[Mode, frozenset[int]] = {}
    contacts = [i for i in left if i not in loose]
    for choice in product(*((-1, 1) for _ in loose)):
        own = _kept_modes(system, with_entries(mode, loose, choice), contacts, active, slipped, numbers)
        found |= {each: stays for each, stays in own.items() if not stays or is_possible(system, each, tuple(active))}
    if not found:
        return Decision("none", None, f"no mode is consistent at t = {numbers.time}")
    leaving = [each for each, stays in found.items() if not stays]
    first = leaving[0] if leaving else next(iter(found))
    exact = [m for m, own in found.items() if not (own and leaving and numbers.stays) or numbers.stays(m, own)]
    others = [each for each in exact if each != first and not numbers.same_motion(each, first)]
    if not others:
        stay = frozenset().union(*found.values()) if not leaving else ()
        return Decision("unique", kept_entries(mode, list(found), sorted(stay)) if stay else first)
    return several(system, sorted((first, *others)), numbers.time)


def _kept_modes(
    system: FilippovSystem,
    mode: Mode,
    contacts: Sequence[int],
    active: Sequence[int],
    slipped: Collection[int],
    numbers: Numbers,
) -> dict[Mode, frozenset[int]]:
    """Return the modes of contacts that are kept by their own fields, each with the surfaces on which it stays.

    There is at most one, unless a contact begins to push its bodies apart: it may slip to both sides.
    """
    group = Group(system, mode, contacts, active, numbers)
    settled = group.settled(frozenset(slipped))
    if group.pushing is None:
        return {} if settled is None else {settled: group.stays}
    others, found = [i for i in contacts if i != group.pushing], dict[Mode, frozenset[int]]()
    for side in (-1, 1):
        found |= _kept_modes(system, replaced(mode, group.pushing, side), others, active, slipped, numbers)
    return found


def _with_sections(
    system: FilippovSystem, mode: Mode, active: Sequence[int], numbers: Numbers
) -> tuple[Mode, list[int]]:
    """Return the mode with the surfaces decided that no force of a contact affects, and the surfaces that remain open.

    On a surface whose velocity depends on no sign (a prescribed instant, say) the sign of this velocity decides. A stop
    from which a body moves off has no reaction. A surface that is zero at all times is never left.
    """
    left = []
    for i in active:
        rests = system.rests(i)
        if not rests and _never_left(system, i):
            mode = replaced(mode, i, 0)
            continue
        if rests or (i not in system.overrides and system.normal_velocity(i).free_symbols.isdisjoint(system.signs)):
            speed = system.velocities.surfaces[i] if rests else system.normal_velocity(i)
            side = clear_sign(speed, mode, numbers.values, numbers.negative)
            if side:
                mode = replaced(mode, i, side)
                continue
        left.append(i)
    return mode, left


def clear_sign(expression: sp.Expr, signs: Mode, values: Values, negative: Negative) -> int:
    """Return the sign of an expression in time, states and signs at a point; 0 if its terms may cancel."""
    terms = values(sp.Add.make_args(sp.expand(expression)), signs)
    if not terms:
        return 0
    value, size = sum(terms[1:], terms[0]), sum(map(abs, terms[1:]), abs(terms[0]))
    return -1 if negative(value, size) else int(negative(-value, size))


@lru_cache(maxsize=1024)
def _never_left(system: FilippovSystem, index: int) -> bool:
    """Check whether a surface is zero at all times, as between two bodies with one prescribed velocity."""
    number = system.numeric(system.surfaces[index])
    return bool(number.is_number and exact_sign(number) == 0)


def _is_contact(system: FilippovSystem, mode: Mode, index: int, numbers: Numbers) -> bool:
    """Check whether a surface has a sliding override, or a force that acts against its velocity."""
    if index in system.overrides:
        return True
    speed = system.normal_velocity(index)
    below, above = (numbers.values((speed,), replaced(mode, index, side)) for side in (-1, 1))
    if below is None or above is None:
        return False
    return numbers.negative(above[0] - below[0], abs(above[0]) + abs(below[0]))
