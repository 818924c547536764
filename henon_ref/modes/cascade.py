"""Resets at one instant: the maps that are applied, and their order.

A surface that has fallen to zero is due: its map is to be applied, to the state after the previous map. If a map moves
another surface from positive to zero or negative, that surface becomes due at the same instant. For a surface on which
the state stays, the rate h' decides: an impact becomes due if a map turns the rate inward, and is no longer due if a
map turns it outward. A surface that has fired becomes due again only after a map has raised it, or its rate, above
zero.

Impacts without end have a limit (:mod:`henon_ref.modes.impact_limit`); of these impacts the first of each surface is
kept.

Of several surfaces due, the one with the lowest priority is first. If several share this priority and act on each
other, all orders are followed; if they lead to different states, the future is not unique.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.utilities.iterables import connected_components

from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import gradient
from henon_ref.modes.impact_limit import PERIOD, recurring, without_speeds
from henon_ref.modes.instant import Instant, Numbers, Rate
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import Impact, impact_of, jump_of, stops
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

MAX_MAPS = 1000
"""Largest number of maps at one instant."""
SHRUNK = 2.0**-10
"""Part of the size of its terms below which a speed that impacts have reduced cannot be distinguished from zero."""


class Cascade:
    """Resets at one instant, time t [s], from the mode before them."""

    def __init__(self, system: FilippovSystem, numbers: Numbers, mode: Mode, t: Any) -> None:
        self._system, self._numbers, self._mode, self._t = system, numbers, mode, t
        self._signs = system.entries(mode)
        self._groups = acting_groups(system)
        self._count, self._endless = 0, False

    def end(self, x: Sequence[Any], hit: Collection[int], due: Iterable[int]) -> Instant | Decision:
        """Return the instant after all resets, or the decision that ends the run.

        ``hit``: surfaces that have fallen to zero; ``due``: those of them that reset the state ``x``.
        """
        sides = tuple(0 if i in hit or entry == 0 else entry for i, entry in enumerate(self._mode))
        first = self._followed(Instant(x, sides, frozenset(due), [abs(v) for v in x]))
        if isinstance(first, Decision):
            return first
        if first[-1].limit:
            return first[-1]
        known, alternatives = list(first), self._alternatives(first)
        while alternatives:
            made = self._followed(alternatives.pop(), known)
            if isinstance(made, Decision):
                return made
            if not (made[-1].due or self._alike(made[-1], first[-1])):
                count = len(made[0].applied)
                either = [instant.applied[-1][0] for instant in (first[min(count, len(first) - 1)], made[0])]
                return self._not_unique(either, made[0])
            known += made
            alternatives += self._alternatives(made)
        return first[-1]

    def _followed(self, start: Instant, known: Sequence[Instant] = (), *, turns: int = 0) -> list[Instant] | Decision:
        """Return the instants from ``start``, with one possible map each time, until none is due or known.

        ``turns``: 0 for the first possible map, 1 or -1 for the one applied least recently; of those never applied, 1
        stands for the first, -1 for the last.
        """
        made = [start]
        while self._endless or (made[-1].due and not any(self._alike(made[-1], other) for other in known)):
            bodies = self._bodies(made[-1])
            own = recurring(made[-1 - PERIOD :]) if bodies else frozenset()
            if bodies and not turns and (self._endless or len(made) > PERIOD or own):
                return self._in_turn(start)
            if bodies and (self._endless or own):
                limit = self._limit(made[-1], made[-1].fired if self._endless else own)
                if not limit.due:
                    made.append(limit)
                    break
            if self._endless or self._count >= MAX_MAPS:
                names = listed([self._system.sign_names[i] for i in sorted(made[-1].fired)])
                when = self._numbers.at(self._t, made[-1].state).when
                reason = f"more than {MAX_MAPS} maps at one instant, t = {when}: resets of {names}"
                return Decision("none", None, reason)
            made.append(self._after(made[-1], self._next(made[-1], turns)[0]))
        return made

    def _in_turn(self, start: Instant) -> list[Instant] | Decision:
        """Return the instants of impacts that may have no end, with the maps in turn, so that none stays due for ever.

        All such orders have the same limit; two are compared.
        """
        found: list[list[Instant]] = []
        for turns in (1, -1):
            self._count, self._endless = 0, False
            made = self._followed(start, turns=turns)
            if isinstance(made, Decision):
                return made
            found.append(made)
        self._endless = False
        one, other = found
        return one if self._alike(one[-1], other[-1]) else self._not_unique(sorted(one[-1].fired), other[-1])

    def _bodies(self, now: Instant) -> bool:
        """Return whether all surfaces that have fired or are due are impacts of bodies, with the state on them."""
        return all(i in stops(self._system) and i in now.rates for i in now.fired | now.due)

    def at_rest(self, x: Sequence[Any], surfaces: Collection[int]) -> Instant:
        """Return the limit of impacts on surfaces from a state close to it."""
        return self._limit(Instant(x, self._mode, frozenset(), [abs(v) for v in x]), surfaces)

    def _limit(self, now: Instant, surfaces: Collection[int]) -> Instant:
        impacts = {i: stops(self._system)[i] for i in sorted(surfaces)}
        x = without_speeds(self._system.states, self._numbers, self._t, now.state, [*impacts.values()])
        zero, end = 0 * self._t, replace(now, state=x)
        rates = {i: Rate(zero, zero, 0) for i in impacts}
        rates |= {i: self._other_map(i, stops(self._system)[i], now, end) for i in now.rates.keys() - impacts.keys()}
        sides = tuple(0 if i in impacts else side for i, side in enumerate(now.sides))
        first = dict(reversed(now.applied))
        applied = tuple((i, first[i]) for i in dict.fromkeys(i for i, _ in now.applied))
        due = frozenset(i for i in rates if rates[i].sign < 0)
        return Instant(x, sides, due, now.sizes, rates, applied, limit=True)

    def _next(self, now: Instant, turns: int = 0) -> list[int]:
        """Return the surfaces that may be next: of the lowest priority, and acting on each other."""
        resets = self._system.resets
        lowest = min(resets[i].priority for i in now.due)
        own = sorted(i for i in now.due if resets[i].priority == lowest)
        found = [i for i in own if self._groups[i] == self._groups[own[0]]]
        fired = {i: place for place, (i, _) in enumerate(now.applied)}
        return sorted(found, key=lambda i: (fired.get(i, -1), turns * i)) if turns else found

    def _alternatives(self, instants: Sequence[Instant]) -> list[Instant]:
        return [self._after(now, i) for now in instants if now.due for i in self._next(now)[1:]]

    def _alike(self, one: Instant, other: Instant) -> bool:
        if (one.due, one.sides) != (other.due, other.sides):
            return False
        numbers, states = self._numbers, zip(one.state, other.state, one.sizes, other.sizes, strict=True)
        return all(
            numbers.sign(a - b) == 0 or abs(a - b) <= numbers.rounding * max(size, other_size, key=float)
            for a, b, size, other_size in states
        )

    def _not_unique(self, surfaces: Iterable[int], now: Instant) -> Decision:
        """Return the decision if the order of these surfaces' maps matters."""
        own = list(dict.fromkeys(surfaces))
        names = listed([self._system.sign_names[i] for i in own])
        bodies = all(i in stops(self._system) for i in own)
        what = "impacts at one instant that share a body" if bodies else "resets at one instant whose order matters"
        when = self._numbers.at(self._t, now.state).when
        return Decision("nonunique", None, f"the future is not unique at t = {when}: {what}: {names}")

    def _after(self, now: Instant, index: int) -> Instant:
        self._count += 1
        system, numbers, x = self._system, self._numbers, now.state
        jump = jump_of(system, index)
        known = [jump.side(j, side) for j, side in enumerate(now.sides)]
        places = [j for j, side in enumerate(known) if side is None]
        values = numbers.values((*jump.states, *(jump.guards[j] for j in places)), self._t, x)
        after, sides = values[: len(x)], [side or 0 for side in known]
        for j, value in zip(places, values[len(x) :], strict=True):
            sides[j] = numbers.sign(value)
        made = replace(now, state=after, sizes=self._grown(now, index, after))
        for j in places:
            if j in system.resets and sides[j] > 0:  # the run may not see that the surface is still ahead
                sides[j] = self._clear_sign(*self._with_size(system.surfaces[j], made))
        carried = {j for j in places if j in system.resets and now.sides[j] > 0 >= sides[j]}
        due = (now.due - {index}) | carried
        rates = {j: rate for j, rate in now.rates.items() if j in jump.kept}
        moved = {system.states[k] for k in jump.moved}
        for j in sorted(system.resets):
            impact = impact_of(system, j)
            slides = self._mode[j] == 0 and not system.rests(j)  # the surface was reached from below
            if impact is None or j in places or slides:
                continue
            if not (j == index or self._speed(impact).free_symbols & moved):
                continue
            # The state may be on the surface only up to rounding, if its speed was zero before this map.
            if sides[j] > 0 and self._clear_sign(*self._with_size(system.surfaces[j], made)) == 0:
                sides[j] = 0
            if sides[j] == 0:
                rates[j] = self._own_map(impact, now, made) if j == index else self._other_map(j, impact, now, made)
                due = self._due_by_rate(j, impact, now, due, rates[j]) if j != index else due
        return Instant(after, tuple(sides), due, made.sizes, rates, (*now.applied, (index, after)))

    @staticmethod
    def _due_by_rate(index: int, impact: Impact, now: Instant, due: frozenset[int], rate: Rate) -> frozenset[int]:
        """Return the surfaces due after a map has changed the rate of a surface on which the state is."""
        if rate.sign < 0:
            turned = index in now.rates and now.rates[index].sign < 0
            return due if turned and index in now.fired else due | {index}
        return due if impact.refusal else due - {index}

    def _own_map(self, impact: Impact, now: Instant, made: Instant) -> Rate:
        """Return the rate of a surface after its own map."""
        numbers, speed = self._numbers, self._speed(impact)
        if impact.refusal:
            before, then = (numbers.values((speed,), self._t, own.state)[0] for own in (now, made))
        else:
            before, ratio = numbers.values((speed, impact.ratio), self._t, now.state)
            before = 0 * before if numbers.sign(before) > 0 else before  # > 0 by rounding only: it was reached
            then = ratio * before
        return Rate(before, then, numbers.sign(then))

    def _other_map(self, index: int, impact: Impact, now: Instant, made: Instant) -> Rate:
        """Return the rate of a surface after the map of another surface."""
        speed = self._speed(impact)
        if index in now.rates:
            before = now.rates[index].before
        else:
            (before,) = self._numbers.values((speed,), self._t, now.state)
        then, size = self._with_size(speed, made)
        sign = self._clear_sign(then, size)
        self._endless |= sign == 0 and index in now.fired and bool(abs(before) <= SHRUNK * size)
        return Rate(before, then, sign)

    def _speed(self, impact: Impact) -> sp.Expr:
        return impact.speed.xreplace(self._signs)

    def _with_size(self, expression: sp.Expr, now: Instant) -> tuple[Any, Any]:
        slopes = gradient(expression, self._system.states)
        value, *own = self._numbers.values((expression, *slopes), self._t, now.state)
        return value, sum((abs(slope) * part for slope, part in zip(own, now.sizes, strict=True)), 0 * value)

    def _clear_sign(self, value: Any, size: Any) -> int:
        """Sign of a value; 0 if the value may be rounding of zero."""
        return 0 if abs(value) <= self._numbers.rounding * size else self._numbers.sign(value)

    def _grown(self, now: Instant, index: int, after: Sequence[Any]) -> Sequence[Any]:
        """Return the scales of rounding errors after a map."""
        if self._groups.count(self._groups[index]) == 1:  # one reset only: no orders are compared
            return now.sizes
        jump, states, sizes = jump_of(self._system, index), self._system.states, list(now.sizes)
        slopes = tuple(slope for k in jump.moved for slope in gradient(jump.states[k], states))
        values = iter(self._numbers.values(slopes, self._t, now.state))
        for k in jump.moved:
            whole = sum((abs(next(values)) * part for part in now.sizes), 0 * after[k])
            sizes[k] = max(sizes[k], whole, key=float)
        return sizes


@lru_cache(maxsize=64)
def acting_groups(system: FilippovSystem) -> tuple[int, ...]:
    """Return, for each surface, the lowest index of a surface in its group: surfaces whose resets act on each other.

    Two resets act on each other if the map of one moves a state on which the surface, rate or map of the other depends.
    """
    touched = {i: _touched(system, i) for i in system.resets}
    moved = {i: {system.states[k] for k in jump_of(system, i).moved} for i in system.resets}
    edges = [(i, j) for i in moved for j in touched if moved[i] & touched[j]]
    lowest = {i: min(part) for part in connected_components((list(touched), edges)) for i in part}
    return tuple(lowest.get(i, i) for i in range(len(system.surfaces)))


def _touched(system: FilippovSystem, index: int) -> set[sp.Basic]:
    """Return the symbols on which a surface, its rate and its map depend, and the states that the map moves."""
    jump, impact = jump_of(system, index), impact_of(system, index)
    expressions = [system.surfaces[index], *(jump.states[k] for k in jump.moved)]
    found: set[sp.Basic] = {system.states[k] for k in jump.moved}
    if impact is not None:
        expressions.append(impact.speed)
        signs = [i for i, s in enumerate(system.signs) if impact.speed.has(s)]
        expressions += [system.surfaces[i] for i in signs]
    return found.union(*(e.free_symbols for e in expressions))
