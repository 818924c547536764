"""Which contacts of a group hold, slide and let go: all assignments tried, and of those that fit the one that counts.

Contacts whose forces act on each other at once, through a body that they share, form a group. At a point the normal
velocities of surfaces in play are affine in their signs, N = a + B s; a contact that holds has what sign keeps it on
its surface (its load over its friction in sliding), one that slips has -1 or +1. An assignment is consistent where
every load is at most what its contact holds and every slip moves off along its sign: the complementarity problem of
Coulomb's friction between rigid bodies. See Lötstedt, *SIAM J. Appl. Math.* 42 (1982) 281-296; Pfeiffer and Glocker,
*Multibody Dynamics with Unilateral Contacts* (1996); Stewart and Trinkle, *Int. J. Numer. Methods Eng.* 39 (1996)
2673-2691. What is clear from these few numbers is not tried any further; the rest is looked at with its derivatives.

Where static friction is above kinetic friction several assignments may fit. Holding wins: of all sets of contacts that
can hold, the one that contains all others counts; where there is none the future is not unique.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from math import prod
from typing import Any, NamedTuple

from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.filippov.contact_loops import closed, relations
from henon_ref.filippov.decision import Decision, with_entries
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.modes import Mode, mode_text
from henon_ref.filippov.system import FilippovSystem
from henon_ref.text import listed

MOST = 8
"""Contacts of a group: its assignments are 3^8 = 6561."""
MOST_OPEN = 3**MOST
"""Assignments of all groups together whose derivatives are looked at."""

Row = list[Any]
"""Numbers by which a function is affine in the signs of a group: its value at no sign, and the slope in each."""


class Balance(NamedTuple):
    """A group's normal velocities and hold zones at a point, affine in the group's signs."""

    speeds: list[Row]
    """A row a surface."""
    ends: list[list[Row]]
    """For each surface the ends of its hold zone, positive inside; empty for one without static friction."""


Evaluate = Callable[[tuple[int, ...], Mode], tuple[list[Any], list[list[Any]]] | None]
"""(group, signs of all surfaces) -> normal velocities and ends of hold zones of its surfaces; None if not finite."""
Negative = Callable[[Any, Any], bool]
"""(value, size of its terms) -> whether it is clearly below zero."""


def check_groups(system: FilippovSystem) -> None:
    """Refuse a system in which more contacts than :data:`MOST` form a group, one of them with static friction.

    Raises
    ------
    UnsupportedError
    """
    contacts = [i for i, s in enumerate(system.signs) if i in system.overrides or system.normal_velocity(i).has(s)]
    for i in system.overrides:
        group = system.together(i, contacts) if system.held_inside(i) else ()
        if len(group) > MOST:
            names = listed([system.sign_names[k] for k in sorted(group)])
            raise UnsupportedError(
                f"a group of {len(group)} contacts that act on each other at once, some with static friction; "
                f"at most {MOST} are tried: {names}"
            )


def by_groups(system: FilippovSystem, active: Sequence[int]) -> bool:
    """Whether surfaces in play are decided as groups: some have static friction, none attracts by its own rule."""
    own = [i for i in active if i in system.overrides and not system.rests(i)]
    return bool(own) and all(system.held_inside(i) for i in own)


def decide_groups(
    system: FilippovSystem,
    mode: Mode,
    active: Sequence[int],
    evaluate: Evaluate,
    negative: Negative,
    consistent: Callable[[Mode], bool],
    time: str,
) -> Decision:
    """The mode in which the contacts hold that can.

    Parameters
    ----------
    system : FilippovSystem
    mode : Mode
        Entries of the surfaces that are not in play.
    active : sequence of int
        Surfaces in play.
    evaluate, negative
        Numbers at the point.
    consistent : callable
        Whether a mode's own field keeps it, with all derivatives that are needed.
    time : str
        For messages.

    Raises
    ------
    ModelError
        Where more than :data:`MOST_OPEN` assignments are open.
    """
    mode, active = _with_sections(system, mode, active, evaluate, negative)
    groups = _groups(system, active)
    options = [_possible(system, mode, group, evaluate, negative) for group in groups]
    if all(len(found) == 1 and clear for found, clear in options):
        return Decision("unique", _joined(mode, groups, [found[0] for found, _ in options]))
    if prod(len(found) for found, _ in options) > MOST_OPEN:
        raise ModelError(f"too many assignments of {len(active)} contacts are open at t = {time}")
    tried = (_joined(mode, groups, choices) for choices in product(*(found for found, _ in options)))
    return largest_hold(system, [candidate for candidate in tried if consistent(candidate)], active, time)


def _with_sections(
    system: FilippovSystem, mode: Mode, active: Sequence[int], evaluate: Evaluate, negative: Negative
) -> tuple[Mode, list[int]]:
    """The mode behind surfaces on whose velocity no sign acts, an instant say; and the surfaces that are left open."""
    left = []
    for i in active:
        if i not in system.overrides and not system.normal_velocity(i).has(*system.signs):
            found = evaluate((i,), mode)
            speed = found[0][0] if found is not None else None
            side = 0 if speed is None else -1 if negative(speed, abs(speed)) else int(negative(-speed, abs(speed)))
            if side:
                mode = with_entries(mode, (i,), (side,))
                continue
        left.append(i)
    return mode, left


def largest_hold(system: FilippovSystem, found: Sequence[Mode], active: Sequence[int], time: str) -> Decision:
    """Of consistent modes the one whose set of held contacts contains those of all others."""
    if not found:
        return Decision("none", None, f"no mode is consistent at t = {time}")
    contacts = [i for i in active if system.held_inside(i)]
    sets = {mode: frozenset(i for i in contacts if mode[i] == 0) for mode in found}
    largest = [mode for mode in found if all(other <= sets[mode] for other in sets.values())]
    if len(largest) == 1:
        return Decision("unique", largest[0])
    names = system.sign_names
    if largest:
        modes = " or ".join(mode_text(m, names) for m in largest)
        return Decision("nonunique", None, f"the future is not unique at t = {time}: {modes}")
    maximal = sorted({tuple(sorted(own)) for own in sets.values() if not any(own < other for other in sets.values())})
    texts = " or ".join("{" + ", ".join(names[i] for i in own) + "}" for own in maximal)
    message = f"the future is not unique at t = {time}: of the sets of contacts that can hold none contains all others"
    return Decision("nonunique", None, f"{message}: {texts}")


def _groups(system: FilippovSystem, active: Sequence[int]) -> list[tuple[int, ...]]:
    """Surfaces in play, parted into those that act on each other at once."""
    found: list[tuple[int, ...]] = []
    left = set(active)
    while left:
        group = system.together(min(left), left)
        found.append(tuple(sorted(group)))
        left -= group
    return found


def _joined(mode: Mode, groups: Sequence[tuple[int, ...]], choices: Sequence[tuple[int, ...]]) -> Mode:
    for group, choice in zip(groups, choices, strict=True):
        mode = with_entries(mode, group, choice)
    return mode


def _possible(
    system: FilippovSystem, mode: Mode, group: tuple[int, ...], evaluate: Evaluate, negative: Negative
) -> tuple[list[tuple[int, ...]], bool]:
    """Assignments of a group that are not clearly refused, and whether the first is the one that counts."""
    entries = [(0,) if _never_left(system, i) else system.entries_from(mode[i], i) for i in group]
    choices = sorted(product(*entries), key=lambda choice: -choice.count(0))
    if system.has_loops:
        choices = [choice for choice in choices if _may_slip(system, group, choice)]
    # A reaction is in no normal velocity: where a body rests, derivatives tell.
    balance = None if any(map(system.rests, group)) else _balance(mode, group, evaluate, negative)
    if balance is None:
        return choices, False
    open_ones, settled = [], []
    for choice in choices:
        values = _margins(balance, choice, [i in system.overrides for i in group], _shared(system, group, choice))
        clear = values is not None and all(negative(-value, size) for value, size in values)
        if clear and not any(choice):
            return [choice], True  # all of them hold
        if values is None or not any(negative(value, size) for value, size in values):
            open_ones.append(choice)
            settled.append(clear)
    return open_ones, settled == [True]


def _never_left(system: FilippovSystem, index: int) -> bool:
    """Whether a surface is zero at all times, as between two bodies that are given one velocity."""
    number = system.numeric(system.surfaces[index])
    return bool(number.is_number and exact_sign(number) == 0)


def _may_slip(system: FilippovSystem, group: tuple[int, ...], choice: tuple[int, ...]) -> bool:
    """Whether no contact that slips, nor a body that lifts off, stays wherever those do that are held."""
    held = frozenset(i for i, entry in zip(group, choice, strict=True) if entry == 0)
    return closed(system.velocities, held, tuple(i for i in group if i in system.overrides)) == held


def _shared(system: FilippovSystem, group: tuple[int, ...], choice: tuple[int, ...]) -> dict[int, bool]:
    """Of the contacts of an assignment that are held in loops, by their places, whether others settle its surface."""
    held = tuple(i for i, entry in zip(group, choice, strict=True) if entry == 0)
    found = relations(system.velocities, held) if system.has_loops else ()
    settled = {max(relation) for relation in found}
    return {k: i in settled for k, i in enumerate(group) if any(i in relation for relation in found)}


def _balance(mode: Mode, group: tuple[int, ...], evaluate: Evaluate, negative: Negative) -> Balance | None:
    """Affine parts at a point; None where they are not finite, or not affine."""
    count = len(group)
    corners = [(0,) * count, *(tuple(int(j == k) for j in range(count)) for k in range(count)), (1,) * count]
    values = [evaluate(group, with_entries(mode, group, corner)) for corner in corners]
    if any(value is None for value in values):
        return None
    tables = [[*speeds, *(end for own in ends for end in own)] for speeds, ends in values if speeds]  # type: ignore[misc]
    rows: list[Row] = []
    for function in zip(*tables, strict=True):
        first, *steps, last = function
        row = [first, *(step - first for step in steps)]
        rest = last - sum(row[1:], first)
        size = sum((abs(v) for v in row), 0 * first)
        if negative(rest, size) or negative(-rest, size):
            return None
        rows.append(row)
    lengths = [len(own) for own in values[0][1]]  # type: ignore[index]
    ends, at = [], count
    for length in lengths:
        ends.append(rows[at : at + length])
        at += length
    return Balance(rows[:count], ends)


def _margins(
    balance: Balance, choice: tuple[int, ...], own: Sequence[bool], shared: Mapping[int, bool]
) -> list[tuple[Any, Any]] | None:
    """What has to be positive in an assignment, with the sizes of its terms; None where loads are not settled.

    How loads are shared in a loop moves nothing. Whether they can be carried is left open here.

    Parameters
    ----------
    balance : Balance
    choice : tuple of int
    own : sequence of bool
        Whether each surface has a hold zone.
    shared : mapping
        Places of contacts that are held in loops; whether it is one whose load can be anything.
    """
    signs: list[Any] = list(choice)
    held = [k for k, entry in enumerate(choice) if entry == 0 and not shared.get(k, False)]
    if held:
        matrix = [[*(balance.speeds[k][1 + j] for j in held), -_value(balance.speeds[k], signs)[0]] for k in held]
        found = _solved(matrix)
        if found is None:
            return None
        for k, sign in zip(held, found, strict=True):
            signs[k] = sign
    margins = []
    for k, entry in enumerate(choice):
        if entry:
            value, size = _value(balance.speeds[k], signs)
            margins.append((entry * value, size))
        elif k in shared:
            margins.append((0, 1))
        elif own[k]:
            margins += [_value(end, signs) for end in balance.ends[k]]
        else:
            margins += [(1 - signs[k], 1 + abs(signs[k])), (1 + signs[k], 1 + abs(signs[k]))]
    return margins


def _value(row: Row, signs: Sequence[Any]) -> tuple[Any, Any]:
    """An affine function at some signs, and the sum of the sizes of its terms."""
    terms = [row[0], *(slope * sign for slope, sign in zip(row[1:], signs, strict=True))]
    return sum(terms[1:], terms[0]), sum((abs(term) for term in terms[1:]), abs(terms[0]))


def _solved(matrix: list[Row]) -> list[Any] | None:
    """Solution of a linear system, its right side the last column; None where a pivot may be zero."""
    count = len(matrix)
    for k in range(count):
        pivot = max(range(k, count), key=lambda r: abs(float(matrix[r][k])))
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        largest = max(abs(float(entry)) for entry in matrix[k][:count])
        if not abs(matrix[k][k]) > 1e-9 * largest:
            return None
        for r in range(count):
            if r != k:
                factor = matrix[r][k] / matrix[k][k]
                matrix[r] = [entry - factor * top for entry, top in zip(matrix[r], matrix[k], strict=True)]
    return [row[count] / row[k] for k, row in enumerate(matrix)]
