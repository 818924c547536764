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

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import exact_sign
from henon_ref.modes.contact_loops import closed, is_possible
from henon_ref.modes.contact_problem import (
    Accelerations,
    ContactProblem,
    Negative,
    Settled,
    Values,
    independent_of,
    problem_of,
    solved,
)
from henon_ref.modes.decision import Decision, kept_entries, several, with_entries
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

MOST_LOOSE = 8
"""Largest number of surfaces that are not contacts and are reached with zero speed; both sides of each are tried."""
IDENTICALLY_ZERO = 1000
"""Order assigned to a guard that stays at zero."""

Broken = Sequence[tuple[Guard, int]]
"""Guards of a mode that become negative just after a point, each with the deciding order (:func:`order_of`)."""


@dataclass(frozen=True)
class Numbers:
    """A point in some arithmetic."""

    values: Values
    negative: Negative
    broken: Callable[[Mode, Collection[int]], Broken | None]
    """(mode, active surfaces) -> guards that become negative; None if the mode has no equations."""
    same_motion: Callable[[Mode, Mode], bool]
    """Whether two modes have the same motion after the point."""
    time: str
    """Time of the point as error messages name it."""
    stays: Callable[[Mode, Collection[int]], bool] | None = None
    """Whether slips stay on surfaces without rounding (:func:`henon_ref.modes.consistency.exactly_stays`); None: all
    of those found."""
    proof: Callable[[ContactProblem, Accelerations, Settled], bool] | None = None
    """Whether a solution is proven; a decision that depends on an unproven solution is refused."""


def by_groups(system: FilippovSystem, active: Sequence[int]) -> bool:
    """Check whether active surfaces are decided as groups: some have static friction, several are stops on which bodies
    can rest, or there are more than four.

    For other surfaces all modes are tried, since the fields need not be those of friction.
    """
    return len(active) > 4 or any(map(system.held_inside, active)) or sum(map(system.rests, active)) > 1


def order_of(system: FilippovSystem, guard: Guard, derivative: int) -> int:
    """Return the order of the derivative of the forces that a guard's derivative contains; 0: an acceleration."""
    return derivative if guard.kind == "release" else derivative - 1 - system.rests(guard.index)


def slipped_by(system: FilippovSystem, hits: Sequence[Guard]) -> frozenset[int]:
    """Return the contacts whose loads have reached their limits at these guards."""
    ends = [guard for guard in hits if guard.kind == "release" and system.held_inside(guard.index)]
    return frozenset(i for guard in ends for i, _ in _released(guard))


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
    group = _Group(system, mode, contacts, active, numbers)
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


def _released(guard: Guard) -> tuple[tuple[int, int], ...]:
    """Return the contacts that are released when a guard falls, with their sides: all contacts of the guard's cut."""
    return guard.cut or ((guard.index, guard.to_sign),)


class _Group:
    """Contacts that are decided together at one point; surfaces that are not contacts have fixed entries."""

    def __init__(
        self, system: FilippovSystem, mode: Mode, contacts: Sequence[int], active: Sequence[int], numbers: Numbers
    ) -> None:
        self.system, self.mode, self.contacts, self.active = system, mode, tuple(contacts), tuple(active)
        self.numbers = numbers
        self.static = frozenset(i for i in contacts if system.held_inside(i))
        self.separating: dict[int, int] = {}
        """Contact -> direction of its slip, for contacts that cannot hold because their drives separate."""
        self.stays: frozenset[int] = frozenset()
        """Surfaces, not contacts, on which the mode found stays."""
        self.pushing: int | None = None
        """Contact whose hold zone vanishes: its force is about to act along its velocity (a negative normal force)."""

    @cached_property
    def _problem(self) -> ContactProblem | None:
        return problem_of(self.system, self.mode, self.contacts, self.numbers.values, self.numbers.negative)

    def settled(self, slipped: frozenset[int]) -> Mode | None:
        """Return the mode that follows; None if no mode is kept by its own field."""
        whole = self._problem
        if whole is None:  # the forces cannot be computed: derivatives decide
            return self._kept(with_entries(self.mode, self.contacts, [0] * len(self.contacts)), slipped)
        while True:
            problem = self._limited(whole, slipped)
            found = solved(problem)
            new = {i for k, i in enumerate(self.contacts) if found.slips[k]} & self.static - slipped
            if not new:
                break
            self._need_proof(problem, found, f"whether {self._names(new)} slip")
            slipped |= new
        # A load equal to the largest load that a contact holds is held, unless derivatives show otherwise.
        entries = [
            0 if i in self.static - slipped else entry for i, entry in zip(self.contacts, found.entries, strict=True)
        ]
        mode = with_entries(self.mode, self.contacts, entries)
        if found.clear and self._needs_no_derivatives(mode, slipped):
            return mode
        kept = self._kept(mode, slipped)
        if kept is not None and any(kept[i] == 0 for i in slipped & self.static):
            self._need_proof(problem, found, f"whether {self._names(slipped)} hold by kinetic friction")
        return kept

    def _needs_no_derivatives(self, mode: Mode, slipped: frozenset[int]) -> bool:
        """Check whether forces clear of their limits show that a mode is kept, without derivatives or a proof."""
        system = self.system
        simple = all(i in self.static or i not in system.overrides for i in self.contacts)
        if self.numbers.proof or system.has_loops or self.contacts != self.active or not simple:
            return False
        # A contact held by kinetic friction is below the static limit only if that limit is larger: not guaranteed.
        return not any(mode[i] == 0 for i in slipped & self.static) and system.has_equations(mode)

    def _kept(self, mode: Mode, slipped: frozenset[int]) -> Mode | None:
        """Return a mode kept by its own field, starting from a mode in which only ties are undecided."""
        seen: set[Mode] = set()
        for _ in range(8 * (len(self.contacts) + 1)):  # the group counts as undecided after so many modes
            mode = self._closed(mode)
            broken = self.numbers.broken(mode, self.active)
            if broken is None:
                return self._separated(mode, slipped)
            self.stays = frozenset(
                g.index for g, order in broken if order == IDENTICALLY_ZERO and g.index not in self.contacts
            )
            if all(guard.index in self.stays for guard, _ in broken):
                return mode
            own = [(guard, order) for guard, order in broken if guard.index in self.contacts]
            if not own:
                return None
            first = [guard for guard, order in own if order == min(order for _, order in own)]
            ends = [guard.index for guard in first if guard.kind == "release"]
            if len(own) == len(broken) and len(ends) == len(first) == 2 and ends[0] == ends[1]:
                self.pushing = ends[0]
                return None
            over = {i for g in first if g.kind == "release" for i, _ in _released(g)} & self.static - slipped
            if over:
                return self.settled(slipped | over)
            turned = first if mode not in seen else first[:1]
            seen.add(mode)
            for guard in turned:
                for i, side in _released(guard) if guard.kind == "release" else ((guard.index, 0),):
                    mode = replaced(mode, i, side)
        return None

    def _closed(self, mode: Mode) -> Mode:
        """Return the mode with 0 also for the contacts that the held contacts of their loops keep at rest."""
        if not self.system.has_loops:
            return mode
        held = frozenset(i for i in self.contacts if mode[i] == 0)
        more = closed(self.system.velocities, held, tuple(i for i in self.contacts if i in self.system.overrides))
        return with_entries(mode, sorted(more), [0] * len(more))

    def _separated(self, mode: Mode, slipped: frozenset[int]) -> Mode | None:
        """Return the mode after contacts separate that cannot hold together, since their drives differ later.

        The first non-zero derivative gives the direction of slip; a small acceleration represents it in the problem.
        None if a contact never separates: it depends on the others by its parameters' values, not by its equations.
        """
        if self._problem is None or self.separating:
            return None
        held = [k for k, i in enumerate(self.contacts) if mode[i] == 0]
        chosen = {self.contacts[k] for k in independent_of(self._problem, held)}
        kept = closed(self.system.velocities, frozenset(chosen), self.contacts)
        separated = [self.contacts[k] for k in held if self.contacts[k] not in kept]
        if not separated:
            return None
        broken = self.numbers.broken(with_entries(mode, separated, [1] * len(separated)), self.active)
        if broken is None or any(order == IDENTICALLY_ZERO for _, order in broken):
            return None
        back = {guard.index for guard, _ in broken if guard.kind == "surface"}
        self.separating = {i: -1 if i in back else 1 for i in separated}
        return self.settled(slipped)

    def _limited(self, whole: ContactProblem, slipped: frozenset[int]) -> ContactProblem:
        """Return the problem with static friction for contacts that have not slipped, and with separating drives."""
        free, lower, upper = list(whole.free), list(whole.lower), list(whole.upper)
        for k, (least, most) in whole.static.items():
            if self.contacts[k] not in slipped:
                lower[k], upper[k] = least, most
        for i, way in self.separating.items():
            k = self.contacts.index(i)
            free[k] += way * 1e-5 * (abs(free[k]) + sum(map(abs, whole.matrix[k])))  # as if it grew from zero
        return ContactProblem(free, whole.matrix, lower, upper)

    def _need_proof(self, problem: ContactProblem, found: Accelerations, what: str) -> None:
        def settled(chosen: list[int], k: int) -> bool:
            own = frozenset(self.contacts[j] for j in chosen)
            return self.contacts[k] in closed(self.system.velocities, own, self.contacts)

        if self.numbers.proof and (self.separating or not self.numbers.proof(problem, found, settled)):
            raise ModelError(f"{what} cannot be decided at t = {self.numbers.time}")

    def _names(self, contacts: Collection[int]) -> str:
        return listed([self.system.sign_names[i] for i in sorted(contacts)])
