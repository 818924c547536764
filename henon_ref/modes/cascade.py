"""Resets of one instant: which maps are applied, and in which order.

A surface that has fallen to zero is due. Its map is applied to the state that the last one has left; a map whose value
carries another surface from above zero to zero or below makes that one due at the same instant. So do impacts: of a
surface that the state stays on, what counts is its rate, and an impact is due where a map has turned that inward; it is
no longer, where a map has turned it outward. A surface that has fired is due again only after a map has lifted it, or
its rate, above zero.

Of several that are due the lowest priority goes first. Of those that share it, and that act on each other, all orders
are followed: where they end in different states, the future is not unique.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol

import sympy as sp

from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import gradient
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import Impact, impact_of, jump_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

MOST = 1000
"""Maps at one instant after which a run is given up."""
SHRUNK = 2.0**-10
"""Part of the sizes of its terms: what impacts have shrunk a speed to before it can no longer be told from zero."""


class Numbers(Protocol):
    """How numbers are computed and told from zero; a state is a sequence of them."""

    rounding: float
    """Part of the sizes of a value's terms below which it is what rounding has left of zero."""

    def values(self, expressions: tuple[sp.Expr, ...], t: Any, x: Sequence[Any]) -> list[Any]:
        """Expressions in time and states at a point; ValueError and the like where one has none."""

    def sign(self, value: Any) -> int:
        """0 where it cannot be told from zero."""

    def text(self, t: Any) -> str:
        """A time as messages have it."""

    def guard_series(self, mode: Mode, t: Any, x: Sequence[Any]) -> Sequence[Sequence[Any]]:
        """Taylor coefficients in time of a mode's guards."""

    def decide(self, t: Any, x: Sequence[Any], surfaces: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point where surfaces and ``valid`` expressions have these signs."""


@dataclass(frozen=True)
class Rate:
    """h' of a surface that the state stays on."""

    before: Any
    """Before its last impact; where there was none, before the last map."""
    now: Any
    sign: int
    """Of ``now``."""


@dataclass(frozen=True)
class Instant:
    """What the maps applied so far have made of an instant."""

    state: Sequence[Any]
    sides: tuple[int, ...]
    """Signs of the surfaces; 0 for one that the state is on."""
    due: frozenset[int]
    """Surfaces whose resets have to be applied."""
    sizes: Sequence[Any]
    """What rounding is a part of in each state: the sizes of what it was made of."""
    rates: Mapping[int, Rate] = field(default_factory=dict)
    """Of surfaces that the state is on and whose rate a map has changed."""
    applied: tuple[tuple[int, Sequence[Any]], ...] = ()
    """Surfaces whose maps have been applied, each with the state that its map has left."""

    @property
    def fired(self) -> set[int]:
        """These surfaces."""
        return {i for i, _ in self.applied}


class Cascade:
    """The resets of one instant, the time t [s], in the mode before them."""

    def __init__(self, system: FilippovSystem, numbers: Numbers, mode: Mode, t: Any) -> None:
        self._system, self._numbers, self._mode, self._t = system, numbers, mode, t
        self._signs = {s: sp.Integer(entry) for s, entry in zip(system.signs, mode, strict=True)}
        self._groups = acting_groups(system)
        self._count, self._endless = 0, False

    def end(self, x: Sequence[Any], hit: Collection[int], due: Iterable[int]) -> Instant | Decision:
        """The instant after all resets, or why there is none.

        ``hit``: surfaces that have fallen to zero; ``due``: those of them that reset the state ``x``.
        """
        sides = tuple(0 if i in hit or entry == 0 else entry for i, entry in enumerate(self._mode))
        first = self._followed(Instant(x, sides, frozenset(due), [abs(v) for v in x]))
        if isinstance(first, Decision):
            return first
        known, open_ones = list(first), self._alternatives(first)
        while open_ones:
            made = self._followed(open_ones.pop(), known)
            if isinstance(made, Decision):
                return made
            if not (made[-1].due or self._alike(made[-1], first[-1])):
                return self._not_unique(first, made[0])
            known += made
            open_ones += self._alternatives(made)
        return first[-1]

    def _followed(self, start: Instant, known: Sequence[Instant] = ()) -> list[Instant] | Decision:
        """The instants from one on, the first of those that may go first taken; up to one that is known."""
        made = [start]
        while self._endless or (made[-1].due and not any(self._alike(made[-1], other) for other in known)):
            if self._endless or self._count >= MOST:
                names = listed([self._system.sign_names[i] for i in sorted(made[-1].fired)])
                reason = f"more than {MOST} maps at one instant, t = {self._numbers.text(self._t)}: resets of {names}"
                return Decision("none", None, reason)
            made.append(self._after(made[-1], self._next(made[-1])[0]))
        return made

    def _next(self, now: Instant) -> list[int]:
        """Surfaces any of which may go first: of the lowest priority, and acting on each other."""
        resets = self._system.resets
        lowest = min(resets[i].priority for i in now.due)
        own = sorted(i for i in now.due if resets[i].priority == lowest)
        return [i for i in own if self._groups[i] == self._groups[own[0]]]

    def _alternatives(self, instants: Sequence[Instant]) -> list[Instant]:
        """What follows where another one goes first."""
        return [self._after(now, i) for now in instants if now.due for i in self._next(now)[1:]]

    def _alike(self, one: Instant, other: Instant) -> bool:
        """Whether two instants cannot be told apart."""
        if (one.due, one.sides) != (other.due, other.sides):
            return False
        numbers, states = self._numbers, zip(one.state, other.state, one.sizes, other.sizes, strict=True)
        return all(
            numbers.sign(a - b) == 0 or abs(a - b) <= numbers.rounding * max(size, other_size, key=float)
            for a, b, size, other_size in states
        )

    def _not_unique(self, first: Sequence[Instant], other: Instant) -> Decision:
        """The decision where it matters which one goes first; ``other``: the first instant of another order."""
        count = len(other.applied)
        either = [first[min(count, len(first) - 1)].applied[count - 1][0], other.applied[-1][0]]
        names = listed([self._system.sign_names[i] for i in dict.fromkeys(either)])
        impacts = [impact_of(self._system, i) for i in either]
        bodies = all(impact is not None and not impact.refusal for impact in impacts)
        what = "impacts at one instant that share a body" if bodies else "resets at one instant whose order matters"
        reason = f"the future is not unique at t = {self._numbers.text(self._t)}: {what}: {names}"
        return Decision("nonunique", None, reason)

    def _after(self, now: Instant, index: int) -> Instant:
        """The instant after the map of one surface."""
        self._count += 1
        system, numbers, x = self._system, self._numbers, now.state
        jump = jump_of(system, index)
        places = [j for j in range(len(system.surfaces)) if j not in jump.kept]
        values = numbers.values((*jump.states, *(jump.guards[j] for j in places)), self._t, x)
        after, sides = values[: len(x)], list(now.sides)
        for j, value in zip(places, values[len(x) :], strict=True):
            sides[j] = numbers.sign(value)
        carried = {j for j in places if j in system.resets and now.sides[j] > 0 >= sides[j]}
        due = (now.due - {index}) | carried
        made = Instant(after, tuple(sides), due, self._grown(now, index, after))
        rates = {j: rate for j, rate in now.rates.items() if j in jump.kept}
        moved = {system.states[k] for k in jump.moved}
        for j in sorted(system.resets):
            impact = impact_of(system, j)
            slides = self._mode[j] == 0 and not system.rests(j)  # it came from below
            if impact is None or j not in jump.kept or slides:
                continue
            if not (j == index or self._speed(impact).free_symbols & moved):
                continue
            if (
                sides[j] > 0 and self._clear_sign(*self._with_size(system.surfaces[j], made)) == 0
            ):  # touched, with no speed until now
                sides[j] = 0
            if sides[j] == 0:
                rates[j] = self._thrown_back(impact, now, made) if j == index else self._turned(j, impact, now, made)
                due = self._due_by_rate(j, impact, now, due, rates[j]) if j != index else due
        return Instant(after, tuple(sides), due, made.sizes, rates, (*now.applied, (index, after)))

    @staticmethod
    def _due_by_rate(index: int, impact: Impact, now: Instant, due: frozenset[int], rate: Rate) -> frozenset[int]:
        """Surfaces that are due where a map has changed the rate of one that the state is on."""
        if rate.sign < 0:
            turned = index in now.rates and now.rates[index].sign < 0
            return due if turned and index in now.fired else due | {index}
        return due if impact.refusal else due - {index}

    def _thrown_back(self, impact: Impact, now: Instant, made: Instant) -> Rate:
        """The rate of a surface after its own map."""
        numbers, speed = self._numbers, self._speed(impact)
        if impact.refusal:
            before, then = (numbers.values((speed,), self._t, own.state)[0] for own in (now, made))
        else:
            before, ratio = numbers.values((speed, impact.ratio), self._t, now.state)
            before = 0 * before if numbers.sign(before) > 0 else before  # rounding: the surface was reached
            then = ratio * before
        return Rate(before, then, numbers.sign(then))

    def _turned(self, index: int, impact: Impact, now: Instant, made: Instant) -> Rate:
        """The rate of a surface after another one's map."""
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
        """An expression in time and states, and the size of its terms."""
        slopes = gradient(expression, self._system.states)
        value, *own = self._numbers.values((expression, *slopes), self._t, now.state)
        return value, sum((abs(slope) * part for slope, part in zip(own, now.sizes, strict=True)), 0 * value)

    def _clear_sign(self, value: Any, size: Any) -> int:
        """0 for what rounding may have left of zero."""
        return 0 if abs(value) <= self._numbers.rounding * size else self._numbers.sign(value)

    def _grown(self, now: Instant, index: int, after: Sequence[Any]) -> Sequence[Any]:
        """Sizes of what a map's values are made of."""
        if self._groups.count(self._groups[index]) == 1:  # nobody asks
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
    """For each surface the first one of those whose resets act on each other; itself where it has none.

    They do where a map moves a state that the other one's surface, its rate or its map depends on.
    """
    groups = list(range(len(system.surfaces)))
    touched = {i: _touched(system, i) for i in sorted(system.resets)}
    for i in touched:
        moved = {system.states[k] for k in jump_of(system, i).moved}
        for j, own in touched.items():
            if moved & own:
                first, last = sorted((groups[i], groups[j]))
                groups = [first if group == last else group for group in groups]
    return tuple(groups)


def _touched(system: FilippovSystem, index: int) -> set[sp.Basic]:
    """Symbols that a surface, its rate and its map depend on, and states that the map moves."""
    jump, impact = jump_of(system, index), impact_of(system, index)
    expressions = [system.surfaces[index], *(jump.states[k] for k in jump.moved)]
    found: set[sp.Basic] = {system.states[k] for k in jump.moved}
    if impact is not None:
        expressions.append(impact.speed)
        signs = [i for i, s in enumerate(system.signs) if impact.speed.has(s)]
        expressions += [system.surfaces[i] for i in signs]
    return found.union(*(e.free_symbols for e in expressions))
