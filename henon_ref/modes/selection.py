"""The mode that follows an event, or a run starts in: the one whose own field keeps it, found by trying the candidates.

One consistent mode (:mod:`henon_ref.modes.consistency`): the future is unique. Several: it is not (repelling
sliding, a spontaneous switch), and we say so. See Filippov (1988), Sec. 2.10, and Dieci and Lopez, *J. Comput. Appl.
Math.* 236 (2012) 3967-3991. Several surfaces at once some of which are held by static friction are decided by
:mod:`henon_ref.modes.held_groups`.

The rule is written once, over points of any arithmetic (:mod:`henon_ref.modes.arithmetic`): the reference decides in
doubles and in balls, the multiprecision truth in balls of its own series. :mod:`henon_ref.enclosure` shares nothing of
it. :func:`sign_after` is its case of one surface and two velocities that are clearly no zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, Protocol

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.arithmetic import CLEAR, NO_VALUE, Point
from henon_ref.modes.consistency import broken_in_groups, clear_signs, indeterminate, staying, violations
from henon_ref.modes.contact_loops import Relation, relations
from henon_ref.modes.decision import Decision, ended, explained, several, with_entries, without_indeterminate
from henon_ref.modes.equations import Guard
from henon_ref.modes.exact_numbers import exact_sign
from henon_ref.modes.held_groups import Numbers, by_groups, decide_groups, slipped_by
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.resting import impact_of, into_surface
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed

PLAIN = 1e-3
"""Part of the jump of a surface's rate between its sides from which on a rate is plainly no zero."""


class ExactStart(Protocol):
    """Modes of a system at points, exact ones among them."""

    @property
    def system(self) -> FilippovSystem: ...

    def exactly(self, start: sp.Expr, initial: Sequence[sp.Expr]) -> Point:
        """A point of exact numbers."""


def sign_after(below: float, above: float) -> int | None:
    """-1 or +1: the side on which a surface is left; 0: it is slid on; None where two signs do not decide.

    A surface that is reached from one side is left on the other where both fields point there, and slid on where each
    points at it (Filippov 1988, Sec. 4).

    Parameters
    ----------
    below, above : float
        dh/dt of the fields on the negative and on the positive side, at a point of the surface h = 0.

    Examples
    --------
    >>> sign_after(1.0, 2.0), sign_after(-1.0, -2.0), sign_after(1.0, -2.0)
    (1, -1, 0)
    >>> sign_after(-1.0, 2.0), sign_after(1.0, 1e-12)
    (None, None)
    """
    clear = CLEAR * (abs(below) + abs(above))
    if below > clear:
        return 1 if above > clear else 0 if above < -clear else None
    return -1 if below < -clear and above < -clear else None


def signs_at(system: FilippovSystem, start: sp.Expr, initial: Sequence[sp.Expr]) -> tuple[list[int], list[int]]:
    """Signs of the surfaces, and of the ``valid`` expressions, at a point in exact numbers."""
    at = {TIME: start, **dict(zip(system.states, initial, strict=True))}
    surfaces, valid = (
        [exact_sign(system.numeric(e).xreplace(at)) for e in expressions]
        for expressions in (system.surfaces, system.valid)
    )
    return surfaces, valid


def initial_mode(
    modes: ExactStart, start: sp.Expr, initial: Sequence[sp.Expr], given: Mapping[int, int] | None = None
) -> Decision:
    """Mode at the start, decided from exact numbers.

    Parameters
    ----------
    modes : ExactStart
    start, initial
        Exact time and state.
    given : mapping, optional
        Surface -> entry, for surfaces the start lies on; taken as it is.
    """
    return mode_by_signs(modes.exactly(start, initial), *signs_at(modes.system, start, initial), given or {})


def mode_by_signs(
    at: Point,
    surfaces: Sequence[int],
    valid: Sequence[int],
    given: Mapping[int, int] | None = None,
    where: str = "at the start",
) -> Decision:
    """Mode at a point where the surfaces, and the ``valid`` expressions, have these signs; ``where``: for messages."""
    system, given = at.system, given or {}
    for i, sign in enumerate(surfaces):
        if i in given and sign not in (0, given[i]):
            return Decision(
                "invalid", None, f"the start is off the surface of {system.signs[i]}: its mode is {sign:+d}"
            )
    for expression, sign in zip(system.valid, valid, strict=True):
        if sign < 0:
            return Decision("invalid", None, f"the model does not hold {where}: {expression} < 0")
    mode = tuple(given.get(i, sign) for i, sign in enumerate(surfaces))
    active = tuple(i for i, sign in enumerate(surfaces) if sign == 0 and i not in given)
    decision = _decided(at, mode, active) if active else _attracting(at, Decision("unique", mode))
    decision = _unless_into_surface(decision, system, active, lambda e: clear_signs(at, mode, [e])[0], at.when)
    edges = [i for i, sign in enumerate(valid) if sign == 0]
    refused = _rising(at, decision.mode, edges, where) if edges and decision.mode is not None else None
    return refused or decision


def _unless_into_surface(
    decision: Decision, system: FilippovSystem, on: Collection[int], sign: Callable[[sp.Expr], int], time: str
) -> Decision:
    """A decision at a point ``on`` some surfaces, unless the state moves into one that resets it.

    ``sign``: of an expression in time and states at the point.
    """
    for i in on:
        impact = impact_of(system, i) if system.rests(i) and decision.status == "none" else None
        if i in system.resets and (
            decision.mode[i] < 0 if decision.mode is not None else impact is not None and sign(impact.speed) < 0
        ):
            return Decision("invalid", None, into_surface(system.sign_names[i], time))
    return decision


def _rising(at: Point, mode: Mode, edges: Sequence[int], where: str) -> Decision | None:
    """Why a run in a mode cannot begin where some ``valid`` expressions are zero; None where they all rise."""
    system = at.system
    try:
        orders = contact_orders(at, mode, (), edges)
    except NO_VALUE:
        return Decision("none", None, f"a derivative is not finite {where}, where a valid expression is 0")
    for i, order in enumerate(orders[-len(system.valid) :]):  # their guards come last
        if i in edges and not order:
            return Decision("invalid", None, f"{system.valid[i]} is 0 {where} and does not rise")
    return None


def after_event(at: Point, mode: Mode, hits: Sequence[Guard], *, touched: bool = False) -> Decision:
    """Mode after guards of a mode fell to zero at a point, or ``touched`` it and turned.

    The states of the surfaces hit are taken to be on them, whatever rounding says.
    """
    system = at.system
    refused = ended(system, mode, hits, at.when)
    if refused is not None:
        return refused
    sliding = [i for i, s in enumerate(mode) if s == 0]
    alone = len(hits) == 1 and hits[0].kind == "release" and not touched
    if alone and not system.decided_together(hits[0], sliding):
        # The equivalent sign reaches +-1 continuously, so the field does not jump and nothing else changes.
        return _attracting(at, Decision("unique", replaced(mode, hits[0].index, hits[0].to_sign)))
    active = system.in_play([g.index for g in hits], sliding)
    return _decided(at, mode, tuple(sorted(active)), () if touched else slipped_by(system, hits))


def contact_orders(at: Point, mode: Mode, active: Iterable[int], edges: Iterable[int] = ()) -> list[int]:
    """Known zeros of each guard of a mode at a point: how often the surfaces in ``active`` are touched.

    For a surface just left: 1 where it is left with a speed, 2 where tangentially, and so on; 0 for
    guards of other surfaces and where nothing is zero. The same for the ``valid`` expressions in ``edges``,
    which are zero at the start; 0 for one that falls, or stays zero.
    """
    guards = at.system.guards(mode) if at.system.has_equations(mode) else ()
    active, edges, zero = set(active), set(edges), at.levels[0]
    asked = [g.index in active and not (g.ends or g.rising_only) for g in guards]
    if not edges:
        known = [_zeros_at_once(at, mode, k, guards[k]) if own else 0 for k, own in enumerate(asked)]
        if None not in known:
            return [order for order in known if order is not None]
    orders = []
    for place, (guard, wanted) in enumerate(zip(guards, asked, strict=True)):
        first = 1 if guard.kind == "surface" else 0
        if guard.kind == "valid" and guard.index in edges:
            term = at.leading(mode, place, 1, zero)
            orders.append(term[0] if term is not None and term[1] > 0 else 0)
        else:
            term = at.leading(mode, place, first, zero, guard.index) if wanted else (0, 0)
            orders.append(term[0] if term is not None else first)
    return orders


def _zeros_at_once(at: Point, mode: Mode, place: int, guard: Guard) -> int | None:
    """Known zeros of a guard, where no further derivatives are needed to tell what it is left with from zero.

    None where they are, or it falls.
    """
    slides = [i for i, s in enumerate(mode) if s == 0]
    number: Any
    try:
        below, above = at.sides(mode, guard.index)
        if guard.kind == "release":
            first, number, size = 0, at.first_order(mode)[place][0], abs(above) + abs(below)
        else:
            first, number, size = 1, above if mode[guard.index] > 0 else -below, abs(above - below)
            if len(at.system.together(guard.index, slides)) > 1:  # the signs of slides are others than 0
                number = at.first_order(mode)[place][1]
    except NO_VALUE:
        return None
    return first if number > PLAIN * size > 0 else None


def _decided(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int] = ()) -> Decision:
    """Try with what rounding may have made of a zero first; then, where no mode fits, with more and with less."""
    system = at.system
    one_of = _in_groups if by_groups(system, active) or system.shared is not None else _of_all
    for level in at.levels:
        decision = one_of(at, mode, active, slipped, level)
        if decision.status != "none":
            break
    if decision.status == "none" and one_of is _of_all:
        decision = _staying_mode(at, mode, active) or decision
    return explained(decision, system, mode, active) if decision.mode is None else _attracting(at, decision)


def _attracting(at: Point, decision: Decision) -> Decision:
    """A decision for a mode, unless that slides on an intersection which is not sure to attract."""
    mode, system = decision.mode, at.system
    if mode is None or not system.has_equations(mode):
        return decision
    places = [k for k, guard in enumerate(system.guards(mode)) if guard.kind == "attracts"]
    terms = {k: at.leading(mode, k, 0, at.levels[0]) for k in places}
    falling = [system.guards(mode)[k] for k, term in terms.items() if term is None or term[1] < 0]
    return ended(system, mode, falling, at.when) or decision


def _of_all(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float) -> Decision:
    """The one consistent mode of all that surfaces in play allow."""
    found = [candidate for candidate in _candidates(at, mode, active) if violations(at, candidate, active, zero) == []]
    if len(found) > 1:
        found = without_indeterminate(found, active, lambda mode, i: indeterminate(at, mode, i, zero))
    if len(found) == 1:
        return Decision("unique", found[0])
    if not found:
        return Decision("none", None, f"no mode is consistent at t = {at.when}")
    return several(at.system, found, at.when)


def _candidates(at: Point, mode: Mode, active: tuple[int, ...]) -> Iterator[Mode]:
    """All modes that surfaces in play allow."""
    entries = product(*(at.system.entries_from(mode[i], i) for i in active))
    return (with_entries(mode, active, choice) for choice in entries)


def _staying_mode(at: Point, mode: Mode, active: tuple[int, ...]) -> Decision | None:
    """What follows where no mode leaves some surfaces, as at rest exactly on a kink; None where something else is it.

    Where the slips that stay have the same motion, to all derivatives that are looked at, it is the run's, in either of
    them: no transition; the sign of a surface that the run stays on is kept, +1 where it has none. Where they have not,
    so that the field jumps along the motion, every mean of the two sides is one as well (Filippov, 1988, Sec. 4), and
    the future is not unique.
    """
    system, stay, found = at.system, set[int](), list[Mode]()
    tied = [relation for relation in relations(system, active) if _unsettled(system, relation)]
    if tied:
        names = listed([system.sign_names[i] for i in sorted(tied[0])])
        reason = f"no mode is consistent at t = {at.when}: the surfaces of {names} depend on each other, and "
        return Decision("none", None, reason + "their signs do not act on them as forces and counterforces do")
    for candidate in _candidates(at, mode, active):
        surfaces = staying(at, candidate, active, at.levels[0])
        if surfaces and not any(map(system.rests, surfaces)):  # a body on such a surface rests, and that is a mode
            stay |= surfaces
            found.append(candidate)
    if not found:
        return None
    if not all(at.same_motion(found[0], other) for other in found[1:]):
        return several(system, found, at.when)
    own = [i for i in active if i in stay]
    return Decision("unique", with_entries(found[0], own, [mode[i] or 1 for i in own]))


def _unsettled(system: FilippovSystem, relation: Relation) -> bool:
    """Whether surfaces that depend on each other are no loop of contacts, and more than one surface written twice.

    A continuous kink cannot be slid on by itself.
    """
    plain = [i for i in relation if i not in system.overrides]
    return len(relation) > 2 and bool(plain) and all(system.can_slide(frozenset((i,))) for i in plain)


def _in_groups(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float) -> Decision:
    """The mode of Gauss's principle with Coulomb's friction."""
    broken = partial(broken_in_groups, at, zero=zero)
    numbers = Numbers(at.values, at.arithmetic.negative, broken, at.same_motion, at.when)
    try:
        return decide_groups(at.system, mode, active, slipped, numbers)
    except ModelError as error:
        return Decision("none", None, str(error))
