"""Consistent modes at one point, decided on balls: by strict signs, exact zeros, or not at all.

A solution of a contact problem is proven by the conditions of the minimum. Gauss's sum is strictly convex in the
accelerations, so accelerations that satisfy these conditions are the unique minimum, regardless of the method that
found them (:mod:`henon_ref.modes.contact_problem`). The conditions: the force of each holding contact is within its
bounds, and every other contact slips against its force, which is at a bound.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf
from typing import Any

import sympy as sp
from flint import arb, arb_mat, ctx

from henon_ref.enclosure.balls import enclose, sign_of
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.model import Identities, ModeModel, SystemModel
from henon_ref.errors import ModelError
from henon_ref.modes.contact_group import Broken, Numbers, order_of
from henon_ref.modes.contact_problem import Accelerations, ContactProblem, Row, Settled, independent_of
from henon_ref.modes.equations import Guard, Refusal
from henon_ref.modes.held_groups import by_groups, decide_groups
from henon_ref.modes.mode import Mode, mode_text, replaced

ORDER = 6
"""Highest derivative examined for the sign of a guard."""


@dataclass(frozen=True)
class Entry:
    """A mode to enter, and the exact zeros of its guards there."""

    mode: Mode
    zeros: tuple[int, ...]
    """For every guard, the number of its leading Taylor coefficients that are exactly zero at the entry."""


class EndedError(Exception):
    """The run provably ends here: a property of the problem, not of the precision."""

    def __init__(self, reason: str, ended: Refusal) -> None:
        super().__init__(reason)
        self.reason = reason
        self.ended = ended


class Judge:
    """Consistency checks of modes at one point."""

    def __init__(
        self,
        model: SystemModel,
        box: Sequence[arb],
        on: tuple[int, ...],
        identities: Identities,
        smooth: int | None = None,
    ) -> None:
        self.model, self.box, self.on, self.identities = model, list(box), on, identities
        self.values = model.at(box)
        self.smooth = smooth
        """Surface that was just released, so that its normal velocity is exactly zero."""

    def fixed(self, mode: Mode, refusal: str, *, attracting: bool = True) -> Entry:
        """Return the entry into a mode that is already known; raise EndedError if the mode's field does not keep it."""
        zeros = self._entry_zeros(mode, self.on if attracting else ())
        if zeros is None:
            raise EndedError(refusal + self._where(), "none")
        return self._attracting(Entry(mode, zeros))

    def unique(self, mode: Mode, active: tuple[int, ...], slipped: Collection[int] = ()) -> Entry:
        """Return the one consistent mode among all choices for the active surfaces.

        ``slipped``: contacts whose loads have just reached their limits.
        """
        names = self.model.system.sign_names
        if by_groups(self.model.system, active):
            return self._grouped(mode, active, slipped)
        found: list[Entry] = []
        for choice in product(*(self.model.system.entries_from(mode[i], i) for i in active)):
            candidate = mode
            for index, value in zip(active, choice, strict=True):
                candidate = replaced(candidate, index, value)
            zeros = self._entry_zeros(candidate, active)
            if zeros is not None:
                found.append(Entry(candidate, zeros))
        if len(found) == 1:
            return self._attracting(found[0])
        if not found:
            raise EndedError("no mode is consistent" + self._where(), "none")
        modes = " or ".join(mode_text(e.mode, names) for e in found)
        raise EndedError(f"the future is not unique{self._where()}: {modes}", "nonunique")

    def _grouped(self, mode: Mode, active: tuple[int, ...], slipped: Collection[int]) -> Entry:
        """Return the entry into the mode that Gauss's principle selects."""
        numbers = Numbers(
            self._values,
            lambda value, size: bool(value < 0),
            self._broken,
            lambda one, other: False,  # balls cannot prove that two modes have the same motion
            self.box[0].str(17, radius=False),
            proof=is_proven,
        )
        if not any(map(self.model.system.held_inside, active)):  # Gauss's principle may not hold for general fields
            raise UndecidedError(f"{len(active)} surfaces in play at once: too many modes to try", "mode")
        try:
            decision = decide_groups(self.model.system, mode, active, slipped, numbers)
        except ModelError as error:
            raise UndecidedError(str(error), "mode") from None
        if decision.status == "nonunique":
            raise EndedError(decision.reason, decision.status)
        if decision.mode is None:  # pivoting without a result does not prove that no mode is consistent
            raise UndecidedError(decision.reason, "mode")
        terms = self._leading_terms(self.model.mode(decision.mode), self.on, by_groups=True)
        return self._attracting(Entry(decision.mode, tuple(count for count, _ in terms)))

    def _values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> list[arb] | None:
        """Evaluate expressions in time, states and signs at the point; None if a value is not finite."""
        system = self.model.system
        entries = system.entries(signs)
        values = [enclose(system.numeric(e).xreplace(entries), self.values) for e in expressions]
        return values if all(v.is_finite() for v in values) else None

    def _broken(self, mode: Mode, active: Collection[int]) -> Broken | None:
        """Guards of grouped contacts that are proven not to hold; None if the mode has no equations."""
        try:
            made = self.model.mode(mode)
        except ModelError:
            return None
        terms = zip(made.guards, self._leading_terms(made, self.on, by_groups=True), strict=True)
        return [(g, order_of(self.model.system, g, k)) for g, (k, sign) in terms if sign < 0]

    def _attracting(self, entry: Entry) -> Entry:
        """Return the entry; raise UndecidedError if sliding on an intersection is not proven to attract."""
        for guard in self.model.mode(entry.mode).guards:
            if guard.kind == "attracts" and not enclose(guard.expression, self.values) > 0:
                names = ", ".join(n for n, s in zip(self.model.system.sign_names, entry.mode, strict=True) if s == 0)
                raise UndecidedError(f"whether sliding on {names} attracts{self._where()} cannot be decided", "mode")
        return entry

    def _where(self) -> str:
        return f" at t = {self.box[0].str(17, radius=False)}"

    def _entry_zeros(self, mode: Mode, active: Sequence[int]) -> tuple[int, ...] | None:
        """Number of exact leading zeros of every guard; None if the mode is proven to be inconsistent."""
        try:
            made = self.model.mode(mode)
        except ModelError:
            return None
        zeros: list[int] = []
        for count, sign in self._leading_terms(made, active):
            if sign < 0:
                return None
            zeros.append(count)
        return tuple(zeros)

    def _series(self, made: ModeModel) -> list[tuple[Guard, list[arb]]]:
        """Guards of a mode with their Taylor coefficients at the point."""
        series = made.flow.run(ctx.prec, self.box[0], self.box[1:], ORDER, arb(1))
        return [(guard, series[i]) for guard, i in zip(made.guards, made.flow.outputs, strict=True)]

    def _leading_terms(
        self, made: ModeModel, active: Collection[int], *, by_groups: bool = False
    ) -> Iterator[tuple[int, int]]:
        """For each guard, its number of exact zeros and the sign of the next coefficient; (0, 1) off its surface.

        The sign is -1 also if another rule excludes the mode: a slip that starts inside the hold zone of an active
        surface (not ``by_groups``: Gauss's principle decides), or sliding on an active surface that does not attract.
        """
        system = self.model.system
        for guard, row in self._series(made):
            index = guard.index
            if guard.ends or index not in self.on:
                yield 0, 1
                continue
            inside = index in active and (system.held_inside(index) or system.rests(index))
            if inside and not by_groups and guard.kind == "surface" and self._held(made.mode, index):
                yield 0, -1
            elif guard.rising_only and not inside:
                yield 0, 1 if index not in active or self._attracts(made.mode, index) else -1
            else:
                yield self._leading(made, guard, row)

    def _held(self, mode: Mode, index: int) -> bool:
        """Check whether every release guard of an override is positive in the stick just after the point."""
        stick = replaced(mode, index, 0)
        try:
            made = self.model.mode(stick)
        except ModelError as error:  # the stick has no equations next to another sliding surface
            names = self.model.system.sign_names
            raise UndecidedError(
                f"whether {names[index]} is held{self._where()} cannot be decided: {error}", "mode"
            ) from None
        guards = ((g, row) for g, row in self._series(made) if g.kind == "release" and g.index == index)
        return all(self._leading(made, guard, row)[1] > 0 for guard, row in guards)

    def _leading(self, made: ModeModel, guard: Guard, row: Sequence[arb]) -> tuple[int, int]:
        """Number of exactly zero coefficients, and the sign of the first nonzero one."""
        known = 0 if guard.kind == "release" else 2 if guard.index == self.smooth else 1
        expression = guard.expression
        for k in range(ORDER + 1):
            if k >= known:
                sign = sign_of(row[k])
                if sign:
                    return k, sign
                if not row[k].is_finite():
                    break
                if not self.identities.vanishes(expression):
                    break
            expression = made.lie_derivative(expression)
        names = self.model.system.sign_names
        raise UndecidedError(
            f"whether {mode_text(made.mode, names)} is kept{self._where()} hangs on a sign that cannot be told "
            f"(derivative {k} of the guard of {names[guard.index]} is zero to all digits)",
            "mode",
        )

    def _attracts(self, mode: Mode, index: int) -> bool:
        """Check whether both fields point at a surface whose sliding is overridden, or are exactly tangent to it."""
        system = self.model.system
        normal = system.numeric(system.normal_velocity(index))
        for side in (-1, 1):
            signs = system.entries(replaced(mode, index, side))
            velocity = normal.xreplace(signs)
            sign = sign_of(enclose(velocity, self.values))
            if sign == 0 and not self.identities.vanishes(velocity):
                raise UndecidedError(f"the sign of the normal velocity of surface {index} cannot be decided", "mode")
            if sign == side:
                return False
        return True


def is_proven(problem: ContactProblem, found: Accelerations, settled: Settled) -> bool:
    """Check whether a double-precision solution is proven for a problem in balls, with no force at its limit.

    In loops, where some holding contacts determine the remaining ones, those farthest from their bounds are chosen.
    """
    held = [k for k, slips in enumerate(found.slips) if not slips]
    room = {k: min(map(float, _distances(problem, k, float(found.forces[k]))), default=inf) for k in held}
    chosen = independent_of(problem, sorted(held, key=lambda k: -room[k]))
    if not all(settled(chosen, k) for k in held if k not in chosen):
        return False
    bounds = zip(found.entries, problem.lower, problem.upper, found.forces.tolist(), strict=True)
    forces: Row = [upper if entry > 0 else lower if entry < 0 else force for entry, lower, upper, force in bounds]
    if chosen:
        matrix = arb_mat([[problem.matrix[k][j] for j in chosen] for k in chosen])
        try:
            values = matrix.solve(arb_mat([[_acceleration(problem, k, forces, skipped=chosen)] for k in chosen]))
        except ZeroDivisionError:  # the matrix is not proven to be regular
            return False
        for k, value in zip(chosen, values.entries(), strict=True):
            forces[k] = value
            if not all(distance > 0 for distance in _distances(problem, k, value)):
                return False
    slipping = ((k, entry) for k, (entry, slips) in enumerate(zip(found.entries, found.slips, strict=True)) if slips)
    return all(entry * _acceleration(problem, k, forces) > 0 for k, entry in slipping)


def _distances(problem: ContactProblem, k: int, force: Any) -> list[Any]:
    """Distances of a force from its bounds; negative beyond them."""
    bounds = ((problem.lower[k], 1), (problem.upper[k], -1))
    return [way * (force - bound) for bound, way in bounds if bound is not None]


def _acceleration(problem: ContactProblem, k: int, forces: Row, skipped: Sequence[int] = ()) -> Any:
    """Relative acceleration of a contact, without the forces of the skipped contacts."""
    row = enumerate(zip(problem.matrix[k], forces, strict=True))
    return problem.free[k] - sum((slope * force for j, (slope, force) in row if j not in skipped), 0 * problem.free[k])
