"""Contacts with Coulomb's friction that act on each other: the theory, and who holds, slides and lets go.

**Contact.** A surface h = 0 between two bodies, h being their relative velocity, whose sign is the direction of a
friction force that acts against it. It *slips* (mode -1 or +1) where h is not zero, and is *held* (mode 0) where a
force within its limits keeps h at zero. The limit is static friction, or what it slides with once it has slipped in
this instant, as one has whose load has just reached its limit. A body at rest on a stop is a contact as well: its
velocity is h', its force the reaction, which does not pull.

**Group.** Contacts whose forces act on each other at once, through a body that they share. Their relative accelerations
are affine in their forces, N = a - W s, W being the inverse inertia that they see, symmetric but for units, positive
semidefinite (:mod:`~henon_ref.modes.contact_problem`).

**The problem.** The motion that follows is the one of Gauss's principle with Coulomb's friction: of all accelerations
those that make

    1/2 sum of m (a - F/m)^2 + sum of limit_i abs(N_i)

smallest over the contacts with h_i = 0; at a stop N_i >= 0 is a condition in place of a term. The sum is strictly
convex, so that the accelerations are unique, in loops and between drives that pull apart as well. The conditions of
the minimum are a complementarity problem in the forces, each in an interval, solved by pivoting
(:mod:`~henon_ref.modes.contact_problem`). What slips in the solution and had not slipped before falls to kinetic
friction, and the problem is solved again, at most once a contact.

**Ties.** What is zero at a limit (a load that equals what a contact holds, a reaction that vanishes) is decided by the
next derivatives: the mode found is expanded, and the guards that fall first say which contacts let go or hold instead,
until its own field keeps it.

**Loop.** Contacts whose surfaces depend on each other, so that W is singular: the motion is settled, the loads are not.
They hold while some distribution of the loads is within all limits, which ends where a cut is full
(:mod:`~henon_ref.modes.contact_loops`: guards that are smooth in time, as the largest load of a solution is not).

**Equations.** Of held contacts of a group: :mod:`~henon_ref.modes.held_contacts`; of all modes of contacts that do
not act on each other: :mod:`~henon_ref.modes.decoupled_contacts`; of rows and trees of bodies:
:mod:`~henon_ref.modes.coupled_contacts`; rest on a stop: :mod:`~henon_ref.modes.resets`.

Moreau, *Standard inelastic shocks and the dynamics of unilateral constraints* (1985), Sec. 2; Lötstedt, *SIAM J.
Appl. Math.* 42 (1982) 281-296; Glocker, *Set-Valued Force Laws* (2001), Ch. 6; Brogliato, *Nonsmooth Mechanics* (2016),
Ch. 5.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.bounds import exact_sign
from henon_ref.modes.contact_loops import closed
from henon_ref.modes.contact_problem import (
    Accelerations,
    Balance,
    ContactProblem,
    Negative,
    Settled,
    Values,
    balance_of,
    independent_of,
    solved,
)
from henon_ref.modes.decision import Decision, several, with_entries
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

EXHAUSTIVE = 4
"""With at most this many surfaces in play all candidate modes are tried where none has static friction."""
ROUNDS = 8
"""Modes a contact that are expanded before it counts as undecided."""
MOST_LOOSE = 8
"""Surfaces that are no contacts and are met without a speed, whose sides are tried."""
IDENTICALLY_ZERO = 1000
"""Order that stands for a guard that stays at zero."""
SMALL_ACCELERATION = 1e-5
"""Part of a relative acceleration's terms that stands for one that grows from zero."""

Broken = Sequence[tuple[Guard, int]]
"""Guards of a mode that do not hold just after a point, and the order of the derivative of the forces that tells."""


@dataclass(frozen=True)
class Numbers:
    """A point in some arithmetic."""

    values: Values
    negative: Negative
    broken: Callable[[Mode, Collection[int]], Broken | None]
    """(mode, surfaces in play) -> guards that do not hold; None where the mode has no equations."""
    same_motion: Callable[[Mode, Mode], bool]
    """Whether two modes have the same motion from the point."""
    time: str
    """For messages."""
    proof: Callable[[ContactProblem, Accelerations, Settled], bool] | None = None
    """Whether a solution is proven: a decision that rests on one which is not is refused."""


def by_groups(system: FilippovSystem, active: Sequence[int]) -> bool:
    """Whether surfaces in play are decided as groups: some have static friction, or they are many.

    Of a few others all modes are tried, for the fields of a system need not be those of friction.
    """
    return len(active) > EXHAUSTIVE or any(map(system.held_inside, active))


def order_of(system: FilippovSystem, guard: Guard, derivative: int) -> int:
    """The derivative of the forces that a derivative of a guard tells of: a velocity's first one is an acceleration."""
    return derivative if guard.kind == "release" else derivative - 1 - system.rests(guard.index)


def slipped_by(system: FilippovSystem, hits: Sequence[Guard]) -> frozenset[int]:
    """Contacts whose loads have reached their limits where guards have fallen."""
    ends = [guard for guard in hits if guard.kind == "release" and system.held_inside(guard.index)]
    return frozenset(i for guard in ends for i, _ in _released(guard))


def decide_groups(
    system: FilippovSystem, mode: Mode, active: Sequence[int], slipped: Collection[int], numbers: Numbers
) -> Decision:
    """The mode that follows for the contacts of groups.

    ``mode``: entries of the surfaces that are not in play; ``active``: those in play; ``slipped``: contacts whose loads
    have just reached their limits.

    Raises
    ------
    ModelError
        Where forces at the contacts are not those of friction; where a proof is asked for and there is none.
    """
    mode, left = _with_sections(system, mode, active, numbers)
    loose = [i for i in left if not _is_contact(system, mode, i, numbers)]
    if len(loose) > MOST_LOOSE:
        names = listed([system.sign_names[i] for i in loose])
        raise ModelError(f"too many surfaces that are met without a speed are open at t = {numbers.time}: {names}")
    found: dict[Mode, frozenset[int]] = {}
    for choice in product(*((-1, 1) for _ in loose)):
        group = _Group(system, with_entries(mode, loose, choice), [i for i in left if i not in loose], active, numbers)
        settled = group.settled(frozenset(slipped))
        if settled is not None:
            found[settled] = group.stays
    leaving = [each for each, stays in found.items() if not stays]
    options = leaving or list(found)
    if not options:
        return Decision("none", None, f"no mode is consistent at t = {numbers.time}")
    if len(options) == 1 or (not leaving and all(numbers.same_motion(options[0], other) for other in options[1:])):
        own = sorted(frozenset().union(*found.values()) if not leaving else ())
        return Decision("unique", with_entries(options[0], own, [mode[i] or 1 for i in own]))
    return several(system, options, numbers.time)


def _with_sections(
    system: FilippovSystem, mode: Mode, active: Sequence[int], numbers: Numbers
) -> tuple[Mode, list[int]]:
    """The mode behind surfaces on whose velocity no force acts, an instant say; and the surfaces that are left open.

    A stop that a body moves off has no reaction. A surface that is zero at all times is never left.
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
    """Sign of an expression in time, states and signs at a point; 0 where its terms may cancel."""
    terms = values(sp.Add.make_args(sp.expand(expression)), signs)
    if not terms:
        return 0
    value, size = sum(terms[1:], terms[0]), sum(map(abs, terms[1:]), abs(terms[0]))
    return -1 if negative(value, size) else int(negative(-value, size))


@lru_cache(maxsize=1024)
def _never_left(system: FilippovSystem, index: int) -> bool:
    """Whether a surface is zero at all times, as between two bodies that are given one velocity."""
    number = system.numeric(system.surfaces[index])
    return bool(number.is_number and exact_sign(number) == 0)


def _is_contact(system: FilippovSystem, mode: Mode, index: int, numbers: Numbers) -> bool:
    """Whether a surface has a rule of its own, or a force that acts against its velocity."""
    if index in system.overrides:
        return True
    speed = system.normal_velocity(index)
    below, above = (numbers.values((speed,), replaced(mode, index, side)) for side in (-1, 1))
    if below is None or above is None:
        return False
    return numbers.negative(above[0] - below[0], abs(above[0]) + abs(below[0]))


def _released(guard: Guard) -> tuple[tuple[int, int], ...]:
    """Contacts that let go where a guard falls, and their sides: all of a cut."""
    return guard.cut or ((guard.index, guard.to_sign),)


class _Group:
    """Surfaces in play at one point, those that are no contacts settled already."""

    def __init__(
        self, system: FilippovSystem, mode: Mode, contacts: Sequence[int], active: Sequence[int], numbers: Numbers
    ) -> None:
        self.system, self.mode, self.contacts, self.active = system, mode, tuple(contacts), tuple(active)
        self.numbers = numbers
        self.static = frozenset(i for i in contacts if system.held_inside(i))
        self.separating: dict[int, int] = {}
        """Contacts that others at rest keep from holding, and the way in which these part from them."""
        self.stays: frozenset[int] = frozenset()
        """Surfaces, no contacts, that the mode found does not leave."""

    @cached_property
    def _balance(self) -> Balance | None:
        return balance_of(self.system, self.mode, self.contacts, self.numbers.values, self.numbers.negative)

    def settled(self, slipped: frozenset[int]) -> Mode | None:
        """The mode that follows; None where no mode is kept by its own field."""
        balance = self._balance
        if balance is None:  # no numbers tell: derivatives do
            return self._kept(with_entries(self.mode, self.contacts, [0] * len(self.contacts)), slipped)
        while True:
            problem = self._limited(balance, slipped)
            found = solved(problem)
            new = {i for k, i in enumerate(self.contacts) if found.slips[k]} & self.static - slipped
            if not new:
                break
            self._need_proof(problem, found, f"whether {self._names(new)} slip")
            slipped |= new
        # A load that equals what a contact holds is held, unless derivatives tell otherwise.
        entries = [
            0 if i in self.static - slipped else entry for i, entry in zip(self.contacts, found.entries, strict=True)
        ]
        mode = with_entries(self.mode, self.contacts, entries)
        if found.clear and self._tells_all(mode, slipped):
            return mode
        kept = self._kept(mode, slipped)
        if kept is not None and any(kept[i] == 0 for i in slipped & self.static):
            self._need_proof(problem, found, f"whether {self._names(slipped)} hold by kinetic friction")
        return kept

    def _tells_all(self, mode: Mode, slipped: frozenset[int]) -> bool:
        """Whether forces that are clear of their limits say that a mode is kept, without derivatives or a proof."""
        system = self.system
        simple = all(i in self.static or i not in system.overrides for i in self.contacts)
        if self.numbers.proof or system.has_loops or self.contacts != self.active or not simple:
            return False
        # What holds by friction in sliding is below static friction where that is larger, as it need not be.
        return not any(mode[i] == 0 for i in slipped & self.static) and system.has_equations(mode)

    def _kept(self, mode: Mode, slipped: frozenset[int]) -> Mode | None:
        """A mode that its own field keeps, from one in which all but what is zero at a limit is decided."""
        seen: set[Mode] = set()
        for _ in range(ROUNDS * (len(self.contacts) + 1)):
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
        """The mode with the contacts at rest that those which hold keep at rest."""
        if not self.system.has_loops:
            return mode
        held = frozenset(i for i in self.contacts if mode[i] == 0)
        more = closed(self.system.velocities, held, tuple(i for i in self.contacts if i in self.system.overrides))
        return with_entries(mode, sorted(more), [0] * len(more))

    def _separated(self, mode: Mode, slipped: frozenset[int]) -> Mode | None:
        """What follows where contacts are held that cannot hold together: their drives part from each other later on.

        Which way, the first derivative tells that is not zero; an acceleration as small as can be stands for it.
        """
        balance = self._balance
        if balance is None or self.separating:
            return None
        held = [k for k, i in enumerate(self.contacts) if mode[i] == 0]
        chosen = {self.contacts[k] for k in independent_of(balance.problem, held)}
        kept = closed(self.system.velocities, frozenset(chosen), self.contacts)
        separated = [self.contacts[k] for k in held if self.contacts[k] not in kept]
        if not separated:
            return None
        broken = self.numbers.broken(with_entries(mode, separated, [1] * len(separated)), self.active)
        if broken is None:
            return None
        back = {guard.index for guard, _ in broken if guard.kind == "surface"}
        self.separating = {i: -1 if i in back else 1 for i in separated}
        return self.settled(slipped)

    def _limited(self, balance: Balance, slipped: frozenset[int]) -> ContactProblem:
        """The contact problem with the limits of contacts that have not slipped."""
        free, matrix, lower, upper = (list(part) for part in balance.problem)
        for k, (least, most) in balance.static.items():
            if self.contacts[k] not in slipped:
                lower[k], upper[k] = least, most
        for i, way in self.separating.items():
            k = self.contacts.index(i)
            free[k] += way * SMALL_ACCELERATION * (abs(free[k]) + sum(map(abs, matrix[k])))
        return ContactProblem(free, matrix, lower, upper)

    def _need_proof(self, problem: ContactProblem, found: Accelerations, what: str) -> None:
        def settled(chosen: list[int], k: int) -> bool:
            own = frozenset(self.contacts[j] for j in chosen)
            return self.contacts[k] in closed(self.system.velocities, own, self.contacts)

        if self.numbers.proof and (self.separating or not self.numbers.proof(problem, found, settled)):
            raise ModelError(f"{what} cannot be told at t = {self.numbers.time}")

    def _names(self, contacts: Collection[int]) -> str:
        return listed([self.system.sign_names[i] for i in sorted(contacts)])
