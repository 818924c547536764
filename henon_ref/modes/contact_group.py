"""Contacts of one group at one point: which hold, slip and are released (:mod:`henon_ref.modes.held_groups`)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

from henon_ref.errors import ModelError
from henon_ref.modes.contact_loops import closed
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
from henon_ref.modes.decision import with_entries
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

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


def order_of(system: FilippovSystem, guard: Guard, derivative: int) -> int:
    """Return the order of the derivative of the forces that a guard's derivative contains; 0: an acceleration."""
    return derivative if guard.kind == "release" else derivative - 1 - system.rests(guard.index)


def released(guard: Guard) -> tuple[tuple[int, int], ...]:
    """Return the contacts that are released when a guard falls, with their sides: all contacts of the guard's cut."""
    return guard.cut or ((guard.index, guard.to_sign),)


class Group:
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
            over = {i for g in first if g.kind == "release" for i, _ in released(g)} & self.static - slipped
            if over:
                return self.settled(slipped | over)
            turned = first if mode not in seen else first[:1]
            seen.add(mode)
            for guard in turned:
                for i, side in released(guard) if guard.kind == "release" else ((guard.index, 0),):
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
