"""What follows an event: the one mode whose own field keeps it, found by trying the candidates.

A mode is *consistent* at a point when its field leads into it (:mod:`henon_ref.filippov.mode_consistency`). One
consistent mode: the future is unique. Several: it is not (repelling sliding, a spontaneous switch), and we say so. See
Filippov (1988), Sec. 2.10, and Dieci and Lopez, *J. Comput. Appl. Math.* 236 (2012) 3967-3991.

Several surfaces at once whose sliding is overridden with ``entry: inside`` are decided by
:mod:`henon_ref.filippov.held_groups`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.decision import Decision, ended, explained, several, with_entries, without_indeterminate
from henon_ref.filippov.decoupled_contacts import Contact
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.held_groups import Numbers, by_groups, decide_groups, slipped_by
from henon_ref.filippov.mode_consistency import ModeConsistency
from henon_ref.filippov.mode_evaluation import ZERO
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.resting import unless_into_surface
from henon_ref.filippov.staying import staying_mode

OTHERS = (1e-11, 1e-15, 0.0)
"""What is tried in its place where no mode fits: rounding may be larger, or the derivative as small."""
PLAIN = 1e-3
"""Part of the jump of a surface's rate between its sides from which on a rate is plainly no zero."""


class Switching(ModeConsistency):
    """Decides the modes of one system in double precision, from any thread; see :class:`ModeEvaluation`."""

    def initial_mode(
        self, start: sp.Expr, initial: Sequence[sp.Expr], given: Mapping[int, int] | None = None
    ) -> Decision:
        """Mode at the start, decided from exact numbers.

        Parameters
        ----------
        start, initial
            Exact time and state.
        given : mapping, optional
            Surface -> entry, for surfaces the start lies on; taken as it is.
        """
        surfaces, valid = self.signs_at(start, initial)
        return self.mode_by_signs(float(start), [float(v) for v in initial], surfaces, valid, given or {})

    def mode_by_signs(
        self, t: float, x: list[float], surfaces: Sequence[int], valid: Sequence[int], given: Mapping[int, int]
    ) -> Decision:
        """Mode at a start where the surfaces, and the ``valid`` expressions, have these signs."""
        system = self.system
        mode: list[int] = []
        active: list[int] = []
        for i, exact in enumerate(surfaces):
            sign = exact
            if i in given and sign in (0, given[i]):
                sign = given[i]
            elif i in given:
                return Decision(
                    "invalid", None, f"the start is off the surface of {system.signs[i]}: its mode is {sign:+d}"
                )
            elif sign == 0:
                active.append(i)
            mode.append(sign)
        edges = []
        for i, (expression, sign) in enumerate(zip(system.valid, valid, strict=True)):
            if sign < 0:
                return Decision("invalid", None, f"the model does not hold at the start: {expression} < 0")
            if sign == 0:
                edges.append(i)
        settled = Decision("unique", tuple(mode))
        decision = self._decide(t, x, tuple(mode), tuple(active)) if active else self._attracting(t, x, settled)
        decision = unless_into_surface(decision, system, active, partial(self._sign_at, t, x), _digits(t))
        refused = self._rising(t, x, decision.mode, edges) if edges and decision.mode is not None else None
        return refused or decision

    def _rising(self, t: float, x: Sequence[float], mode: Mode, edges: Sequence[int]) -> Decision | None:
        """Why a run in a mode cannot begin where some ``valid`` expressions are zero; None where they all rise."""
        try:
            orders = self.contact_orders(t, x, mode, (), edges)
        except (ZeroDivisionError, ValueError, OverflowError):
            return Decision("none", None, "a derivative is not finite at the start, where a valid expression is 0")
        for i, order in enumerate(orders[-len(self.system.valid) :]):  # their guards come last
            if i in edges and not order:
                return Decision("invalid", None, f"{self.system.valid[i]} is 0 at the start and does not rise")
        return None

    def after_event(
        self, t: float, x: Sequence[float], mode: Mode, hits: Sequence[Guard], *, zero: float = ZERO
    ) -> Decision:
        """Mode after the guards ``hits`` of ``mode`` fell to zero at (t, x).

        The states of the surfaces hit are taken to be on them, whatever rounding says. ``zero`` is the relative
        size below which a derivative counts as zero.
        """
        refused = ended(self.system, mode, hits, _digits(t))
        if refused is not None:
            return refused
        sliding = [i for i, s in enumerate(mode) if s == 0]
        if len(hits) == 1 and hits[0].kind == "release" and not self.system.decided_together(hits[0], sliding):
            # The equivalent sign reaches +-1 continuously, so the field does not jump and nothing else changes.
            return self._attracting(t, x, Decision("unique", replaced(mode, hits[0].index, hits[0].to_sign)))
        active = self.system.in_play([g.index for g in hits], sliding)
        return self._decide(t, list(x), mode, tuple(sorted(active)), slipped_by(self.system, hits), zero)

    def contact_orders(
        self,
        t: float,
        x: Sequence[float],
        mode: Mode,
        active: Iterable[int],
        edges: Iterable[int] = (),
        *,
        zero: float = ZERO,
    ) -> list[int]:
        """Known zeros of each guard of a mode at (t, x): how often the surfaces in ``active`` are touched.

        For a surface just left: 1 where it is left with a speed, 2 where tangentially, and so on; 0 for
        guards of other surfaces and where nothing is zero. The same for the ``valid`` expressions in ``edges``,
        which are zero at the start; 0 for one that falls, or stays zero.
        """
        guards = self._guards(mode)
        active, edges = set(active), set(edges)
        asked = [g.index in active and not (g.ends or g.rising_only) for g in guards]
        if not edges:
            known = [
                self._zeros_at_once(t, x, mode, k, g) if own else 0
                for k, (g, own) in enumerate(zip(guards, asked, strict=True))
            ]
            if None not in known:
                return [order for order in known if order is not None]
        outputs, rate = self._expanded(mode, t, x)
        orders = []
        for guard, wanted, series in zip(guards, asked, outputs, strict=True):
            first = 1 if guard.kind == "surface" else 0
            if guard.kind == "valid" and guard.index in edges:
                found = self._leading(series, 1, rate, 0.0, zero)
                orders.append(found if found is not None and series[found] > 0.0 else 0)
            elif not wanted:
                orders.append(0)
            else:
                found = self._leading(series, first, rate, self._size(t, x, mode, guard.index), zero)
                orders.append(found if found is not None else first)
        return orders

    def _zeros_at_once(self, t: float, x: Sequence[float], mode: Mode, place: int, guard: Guard) -> int | None:
        """Known zeros of a guard, where no further derivatives are needed to tell what it is left with from zero.

        None where they are, or it falls.
        """
        slides = [i for i, s in enumerate(mode) if s == 0]
        try:
            below, above = self._both_sides(t, x, mode, guard.index)
            if guard.kind == "release":
                first, number, size = 0, self._first_order(mode, t, x)[place][0], abs(above) + abs(below)
            else:
                first, number, size = 1, above if mode[guard.index] > 0 else -below, abs(above - below)
                if len(self.system.together(guard.index, slides)) > 1:  # the signs of slides are others than 0
                    number = self._first_order(mode, t, x)[place][1]
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        return first if number > PLAIN * size > 0 else None

    def _decide(
        self,
        t: float,
        x: list[float],
        mode: Mode,
        active: tuple[int, ...],
        slipped: Collection[int] = (),
        zero: float = ZERO,
    ) -> Decision:
        """Try with what rounding may have made of a zero first; then, where no mode fits, with more and with less."""
        alone = self._decided_alone(t, x, mode, active, slipped)
        if alone is not None:
            return Decision("unique", alone)
        decision = self._decided(t, x, mode, active, slipped, zero)
        for other in OTHERS:
            if decision.status == "none" and (other < zero or zero == ZERO):
                decision = self._decided(t, x, mode, active, slipped, other)
        if decision.status == "none" and not by_groups(self.system, active):
            staying, same = partial(self._staying, t, x, active=active, zero=zero), partial(self._same_motion, t, x)
            decision = staying_mode(self.system, mode, active, staying, same, f"at t = {_digits(t)}") or decision
        if decision.mode is None:
            return explained(decision, self.system, mode, active)
        return self._attracting(t, x, decision)

    def _decided_alone(
        self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], slipped: Collection[int]
    ) -> Mode | None:
        """The mode that follows where contacts do not act on each other, and each is clear of its limits; else None."""
        switched = self.system.switched
        if switched is None or switched.coupled:
            return None
        contacts = [contact for i in active if (contact := switched.contacts[i]) is not None]
        if len(contacts) < len(active):
            return None
        ends = self._clear_signs(t, x, mode, [end.expression for contact in contacts for end in contact.ends])
        entries = [
            self._entry_alone(t, x, mode, contact, i, ends[2 * k : 2 * k + 2], i in slipped)
            for k, (i, contact) in enumerate(zip(active, contacts, strict=True))
        ]
        found = [entry for entry in entries if entry is not None]
        return with_entries(mode, active, found) if len(found) == len(entries) else None

    def _entry_alone(
        self, t: float, x: list[float], mode: Mode, contact: Contact, index: int, inside: list[int], slipped: bool
    ) -> int | None:
        """What becomes of a surface's entry by numbers that are clearly no zeros; None where some are.

        ``inside``: signs of the ends of its slide.
        """
        held, normal, sign = (
            index in self.system.overrides,
            self.system.normal_velocity(index),
            self.system.signs[index],
        )
        if held and slipped:  # by friction in sliding
            sides = self._clear_signs(t, x, mode, [normal.xreplace({sign: sp.Integer(side)}) for side in (-1, 1)])
            return sides[0] if sides[0] == sides[1] != 0 else None
        if inside == [1, 1]:
            return 0
        if sorted(inside) != [-1, 1]:
            return None
        side = contact.ends[inside.index(-1)].to_sign
        leaves = not held or self._clear_signs(t, x, mode, [normal.xreplace({sign: sp.Integer(side)})]) == [side]
        return side if leaves else None

    def _attracting(self, t: float, x: Sequence[float], decision: Decision) -> Decision:
        """A decision for a mode, unless that slides on an intersection which is not sure to attract."""
        mode = decision.mode
        guards = () if mode is None else self._guards(mode)
        if mode is None or all(guard.kind != "attracts" for guard in guards):
            return decision
        outputs, rate = self._expanded(mode, t, x)
        falling = [
            guard
            for guard, series in zip(guards, outputs, strict=True)
            if guard.kind == "attracts" and self._sign(series, 0, rate, 0.0, ZERO) <= 0
        ]
        return ended(self.system, mode, falling, _digits(t)) or decision

    def _decided(
        self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float
    ) -> Decision:
        if by_groups(self.system, active):
            return self._decided_in_groups(t, x, mode, active, slipped, zero)
        found = [
            candidate
            for choice in product(*(self.system.entries_from(mode[i], i) for i in active))
            if self._violations(t, x, candidate := with_entries(mode, active, choice), active, zero) == ()
        ]
        if len(found) > 1:
            found = without_indeterminate(found, active, lambda mode, i: self._indeterminate(t, x, mode, i, zero))
        if len(found) == 1:
            return Decision("unique", found[0])
        if not found:
            return Decision("none", None, f"no mode is consistent at t = {_digits(t)}, x = {[float(v) for v in x]}")
        return several(self.system, found, _digits(t))

    def _decided_in_groups(
        self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float
    ) -> Decision:
        numbers = Numbers(
            partial(self._values_at, t, x),
            self._negative,
            lambda candidate, surfaces: self._broken(t, x, candidate, surfaces, zero),
            partial(self._same_motion, t, x),
            _digits(t),
        )
        try:
            return decide_groups(self.system, mode, active, slipped, numbers)
        except ModelError as error:
            return Decision("none", None, str(error))


def _digits(t: Any) -> str:
    """A time as messages have it."""
    return f"{float(t):.17g}"
