"""Selection of the mode at the start of a run and after each event: the candidate that its own field keeps.

The active surfaces are those on which the state is and whose mode entries are open. Each candidate for these entries is
tested for consistency, that is, whether its own field keeps it just after the point: every surface in slip is left on
the mode's side (first non-zero derivative of h), and on every sliding surface the equivalent sign stays inside [-1, 1]
and both fields point at the surface. A surface whose sliding override has ``entry: inside`` can be held if every
release guard is positive just after the point (first non-zero derivative; a guard that stays at zero holds).

A slip whose field keeps the state on its surface is a solution as well. One motion: the future is unique. Several
(repelling sliding, a spontaneous switch, a slip that may stay or leave): it is not unique, and the run ends with this
status. See Filippov (1988), Sec. 2.10, and Dieci and Lopez, *J. Comput. Appl. Math.* 236 (2012)
3967-3991. If static friction holds some of several active surfaces, :mod:`henon_ref.modes.held_groups` decides.

The selection is written once, over points of any arithmetic (:mod:`henon_ref.modes.arithmetic`): the reference decides
in doubles and in balls, the multiprecision truth in balls of its own series. :mod:`henon_ref.enclosure` shares no code
with it. The special case of one surface and two velocities that are clearly not zero is
:func:`henon_ref.modes.mode.sign_after`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import exact_sign
from henon_ref.modes.arithmetic import Point, size_of_ends
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.consistency import broken_guards, exactly_stays, indeterminate
from henon_ref.modes.contact_group import IDENTICALLY_ZERO, Broken, Numbers
from henon_ref.modes.contact_loops import is_possible, relations
from henon_ref.modes.decision import Decision, ended, explained, kept_entries, several, with_entries
from henon_ref.modes.equations import Guard
from henon_ref.modes.held_groups import by_groups, clear_sign, decide_groups, slipped_by
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import impact_of, into_surface
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed


def initial_signs(problem: Problem) -> tuple[list[int], list[int]]:
    """Return the signs of the surfaces and of the ``valid`` expressions at a problem's start."""
    system = problem.system
    at = {TIME: problem.start, **dict(zip(system.states, problem.initial, strict=True))}
    surfaces, valid = (
        [exact_sign(system.numeric(e).xreplace(at)) for e in expressions]
        for expressions in (system.surfaces, system.valid)
    )
    return surfaces, valid


def initial_mode(at: Point, problem: Problem) -> Decision:
    """Decide the mode at a problem's start, which is the point ``at``."""
    return mode_at_start(at, *initial_signs(problem), problem.initial_mode)[0]


def mode_at_start(
    at: Point, surfaces: Sequence[int], valid: Sequence[int], given: Mapping[int, int]
) -> tuple[Decision, frozenset[int]]:
    """Decide the mode at a start as :func:`mode_by_signs`, and return the stops that the state leaves with a speed.

    A speed at a start is compared with its own terms only: an acceleration is no measure of it, since their ratio
    depends on the unit of time. (Where the mode is given, the speed may be an error of the run that ended there.)
    """
    left = set()
    for i, sign in enumerate(surfaces):
        impact = impact_of(at.system, i) if sign == 0 and i not in given and at.system.rests(i) else None
        if impact is None:
            continue
        side = clear_sign(impact.speed, tuple(surfaces), at.values, at.arithmetic.negative)
        if side < 0:
            return Decision("invalid", None, into_surface(at.system.sign_names[i], at.when)), frozenset()
        left |= {i} if side > 0 else set()
    return mode_by_signs(at, surfaces, valid, {**given, **dict.fromkeys(left, 1)}), frozenset(left)


def mode_by_signs(
    at: Point,
    surfaces: Sequence[int],
    valid: Sequence[int],
    given: Mapping[int, int] | None = None,
    where: str = "at the start",
) -> Decision:
    """Decide the mode at a point from the signs of surfaces and ``valid`` expressions; ``where``: for messages."""
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
    for i in active:
        impact = impact_of(system, i) if system.rests(i) and decision.status == "none" else None
        inward = impact is not None and clear_sign(impact.speed, mode, at.values, at.arithmetic.negative) < 0
        if i in system.resets and (inward if decision.mode is None else decision.mode[i] < 0):
            decision = Decision("invalid", None, into_surface(system.sign_names[i], at.when))
            break
    edges = [i for i, sign in enumerate(valid) if sign == 0]
    refused = _rising(at, decision.mode, edges, where) if edges and decision.mode is not None else None
    return refused or decision


def _rising(at: Point, mode: Mode, edges: Sequence[int], where: str) -> Decision | None:
    """Return the refusal of a start at which ``valid`` expressions are zero; None if all of them rise."""
    system = at.system
    try:
        orders = contact_orders(at, mode, (), edges)
    except ARITHMETIC:
        return Decision("none", None, f"a derivative is not finite {where}, where a valid expression is 0")
    for i, order in enumerate(orders[-len(system.valid) :]):  # their guards come last
        if i in edges and not order:
            return Decision("invalid", None, f"{system.valid[i]} is 0 {where} and does not rise")
    return None


def after_event(at: Point, mode: Mode, hits: Sequence[Guard], *, touched: bool = False) -> Decision:
    """Decide the mode after guards of a mode fell to zero at a point or, if ``touched``, reached zero and turned back.

    The surfaces of these guards count as exactly zero at the point; their computed values may differ by rounding.
    """
    system = at.system
    refused = ended(system, mode, hits, at.when)
    if refused is not None:
        return refused
    sliding = [i for i, s in enumerate(mode) if s == 0]
    alone = len(hits) == 1 and hits[0].kind == "release" and not touched
    if alone and not system.decided_together(hits[0], mode, sliding):
        # The equivalent sign reaches +-1 continuously: the field does not jump, and no other entry changes.
        return _attracting(at, Decision("unique", replaced(mode, hits[0].index, hits[0].to_sign)))
    active = system.in_play([g.index for g in hits], sliding)
    # A load that reaches its limit where a kink is crossed need not exceed it: its derivatives behind the kink decide.
    bent = any(g.kind == "surface" and g.index in system.kinks for g in hits)
    return _decided(at, mode, tuple(sorted(active)), () if touched or bent else slipped_by(system, hits))


def contact_orders(at: Point, mode: Mode, active: Iterable[int], edges: Iterable[int] = ()) -> list[int]:
    """Return, for each guard of a mode, the multiplicity of its zero at a point on the ``active`` surfaces.

    For a surface just left: 1 if with non-zero speed, 2 if tangentially, and so on; 0 for all other guards. Likewise
    for the ``valid`` expressions in ``edges``, which are zero at the start; 0 for one that falls or stays zero.
    """
    guards = at.system.guards(mode) if at.system.has_equations(mode) else ()
    active, edges = set(active), set(edges)
    orders = []
    for place, guard in enumerate(guards):
        order = 0
        if guard.kind == "valid" and guard.index in edges:
            term = at.leading(mode, place, 1, at.levels[0])
            order = term[0] if term is not None and term[1] > 0 else 0
        elif guard.index in active and not (guard.ends or guard.rising_only):
            order = _known_zeros(at, mode, place, guard)
        orders.append(order)
    return orders


def _known_zeros(at: Point, mode: Mode, place: int, guard: Guard) -> int:
    """Return the multiplicity of a guard's zero; from the first derivative alone if that is clearly not zero."""
    slides = [i for i, s in enumerate(mode) if s == 0]
    first = 0 if guard.kind == "release" else 1
    number: Any
    try:
        if guard.kind == "release" and guard.index not in at.system.overrides:
            number, size = at.first_order(mode)[place][0], size_of_ends(at, mode, guard.index)
        else:
            below, above = at.sides(mode, guard.index)
            number, size = above if mode[guard.index] > 0 else -below, abs(above - below)
            if guard.kind == "release":
                number, size = at.first_order(mode)[place][0], abs(above) + abs(below)
            elif len(at.system.together(guard.index, slides)) > 1:  # the equivalent signs of the slides are not 0
                number = at.first_order(mode)[place][1]
        if number > 1e-3 * size > 0:  # a part of the jump of the surface's rate between its sides
            return first
    except ARITHMETIC:
        pass
    term = at.leading(mode, place, first, at.levels[0], guard.index)
    return first if term is None else term[0]


def _decided(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int] = ()) -> Decision:
    """Decide with the first relative size below which a derivative is zero; if no mode is consistent, try the next."""
    system = at.system
    one_of = _in_groups if by_groups(system, active) or system.shared is not None else _of_all
    for level in at.levels:
        decision = one_of(at, mode, active, slipped, level)
        if decision.status != "none":
            break
    if decision.status == "none" and one_of is _of_all:
        decision = _staying_mode(at, mode, active) or decision
    if decision.mode is None and system.observed.issuperset(active):  # no motion depends on these entries
        kept = with_entries(mode, active, [mode[i] or 1 for i in active])
        if broken_guards(at, kept, active, at.levels[0], alone=True) is not None:  # there is a motion
            return Decision("unique", kept)
    rates = zip(system.state_names, system.field, strict=True) if decision.status == "none" else ()
    if names := [name for name, rate in rates if at.values((rate,), mode) is None]:
        reason = f"no mode is consistent at t = {at.when}: the field of {listed(names)} is not finite there"
        return Decision("none", None, reason)
    return explained(decision, system, mode, active) if decision.mode is None else _attracting(at, decision)


def _attracting(at: Point, decision: Decision) -> Decision:
    """Return a decision unless its mode slides on an intersection that may not attract; then the refusal."""
    mode, system = decision.mode, at.system
    if mode is None or not system.has_equations(mode):
        return decision
    places = [k for k, guard in enumerate(system.guards(mode)) if guard.kind == "attracts"]
    terms = {k: at.leading(mode, k, 0, at.levels[0]) for k in places}
    falling = [system.guards(mode)[k] for k, term in terms.items() if term is None or term[1] < 0]
    return ended(system, mode, falling, at.when) or decision


def _of_all(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float) -> Decision:
    """Return the one consistent mode among all candidates for the active surfaces.

    All are tried, without pivoting, since the fields need not be those of friction: the first consistent mode is the
    only one only if the slopes of the normal velocities are a P-matrix (:mod:`henon_ref.modes.sliding`).

    A slip that stays on its surface (x' = 1 + s at x = 0, with s = -1) is another solution, unless a consistent mode
    slides with the same motion.
    """
    tested = [(own, broken_guards(at, own, active, zero, alone=True)) for own in _candidates(at, mode, active)]
    system, kept = at.system, [own for own, broken in tested if broken == []]
    if not kept:
        return Decision("none", None, f"no mode is consistent at t = {at.when}")
    staying = [
        own
        for own, broken in tested
        if (surfaces := _staying(system, broken))
        and is_possible(system, own, active)
        and exactly_stays(at, own, surfaces)
    ]
    found = kept
    if len(kept) + len(staying) > 1:
        # If a slip leaves a surface on which the gradient vanishes ((x - 1)^3 instead of x - 1), both fields cross the
        # surface in one direction. No convex combination is tangent to it, so there is no sliding (Filippov 1988).
        left = [i for i in active if any(own[i] for own in kept)]
        found, staying = (
            [own for own in some if not any(not own[i] and indeterminate(at, own, i, zero) for i in left)]
            for some in (kept, staying)
        )
    found += [own for own in staying if not any(at.same_motion(own, other) for other in found)]
    return Decision("unique", found[0]) if len(found) == 1 else several(system, sorted(found), at.when)


def _staying(system: FilippovSystem, broken: Broken | None) -> frozenset[int]:
    """Return the surfaces on which a candidate stays in slip, if it is not consistent for this reason alone.

    A body that does not leave its stop rests, which is another candidate.
    """
    surfaces = frozenset(guard.index for guard, _ in broken or ())
    alone = all(order == IDENTICALLY_ZERO for _, order in broken or ()) and not any(map(system.rests, surfaces))
    return surfaces if alone else frozenset()


def _candidates(at: Point, mode: Mode, active: tuple[int, ...]) -> Iterator[Mode]:
    entries = product(*(at.system.entries_from(mode[i], i) for i in active))
    return (with_entries(mode, active, choice) for choice in entries)


def _staying_mode(at: Point, mode: Mode, active: tuple[int, ...]) -> Decision | None:
    """Decide the mode if no candidate leaves some surfaces, as at rest exactly on a kink; None if this does not apply.

    If all slips that stay on the surfaces have the same motion, in all computed derivatives, this motion is the run's,
    without a transition if the present slip is one of them (:func:`~henon_ref.modes.decision.kept_entries`). If their
    motions differ, every convex combination of the fields is also a solution (Filippov, 1988, Sec. 4), and the future
    is not unique.
    """
    system, stay, found = at.system, set[int](), list[Mode]()
    for relation in relations(system, active):
        plain = [i for i in relation if i not in system.overrides]
        # Neither a loop of contacts nor multiples, and without a lone continuous kink.
        if len(relation) > 2 and plain and all(system.can_slide(frozenset((i,))) for i in plain):
            names = listed([system.sign_names[i] for i in sorted(relation)])
            reason = f"no mode is consistent at t = {at.when}: the surfaces of {names} depend on each other, and "
            return Decision("none", None, reason + "their signs do not act as action and reaction")
    for candidate in _candidates(at, mode, active):
        if surfaces := _staying(system, broken_guards(at, candidate, active, at.levels[0], alone=True)):
            stay |= surfaces
            found.append(candidate)
    if not found:
        return None
    if not all(at.same_motion(found[0], other) for other in found[1:]):
        return several(system, found, at.when)
    return Decision("unique", kept_entries(mode, found, sorted(stay)))


def _in_groups(at: Point, mode: Mode, active: tuple[int, ...], slipped: Collection[int], zero: float) -> Decision:
    broken = partial(broken_guards, at, zero=zero, alone=False)
    stays = partial(exactly_stays, at)
    numbers = Numbers(at.values, at.arithmetic.negative, broken, at.same_motion, at.when, stays)
    try:
        return decide_groups(at.system, mode, active, slipped, numbers)
    except ModelError as error:
        return Decision("none", None, str(error))
