"""Continuation after a jump of the state: the mode, the limit of accumulating impacts, and the rest that follows it.

The rules are written once for all arithmetics: doubles, or balls of some precision.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from henon_ref.errors import ModelError
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.cascade import SHRUNK, Cascade, acting_groups
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard, gradient
from henon_ref.modes.impact_limit import moved_to_zero, without_speeds
from henon_ref.modes.inelastic_collapse import Flight, collapse, meets_another, moved
from henon_ref.modes.instant import Instant, Numbers
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.resets import impact_of, never_pressed, stops, time_to_rest, turning_in_flight
from henon_ref.modes.selection import mode_by_signs
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed

SEVERAL_RESETS = "several surfaces reset the state at once"
CLOSE = "another event is as close"
Terms = Sequence[tuple[Guard, Sequence[Any]]]
"""Guards of a mode, each with its Taylor coefficients in time."""


@dataclass(frozen=True)
class Rest:
    remaining: Any
    """Time from the impact until rest [s]; 0 if the impact takes all speed."""
    state: Sequence[Any]
    mode: Mode
    on: Collection[int]
    """Surfaces on which the state is then; a body may still fly, or leave one."""


@dataclass(frozen=True)
class AfterJump:
    decision: Decision
    """Decision about the mode just after the jump."""
    state: Sequence[Any]
    applied: tuple[tuple[int, Sequence[Any]], ...] = ()
    """Surfaces that reset the state, in order, each with the state after its map."""
    on: tuple[int, ...] = ()
    """Surfaces on which the state is."""
    rests: tuple[Rest, ...] = ()
    """Rests after accumulating impacts: a body may come to rest at once, and others later."""
    still: tuple[int, ...] = ()
    """Surfaces at which the impact has left zero speed and that only the acceleration makes the state leave."""
    left: tuple[int, ...] = ()
    """Surfaces that the state leaves with a speed, however small."""


def after_jump(
    system: FilippovSystem,
    numbers: Numbers,
    mode: Mode,
    surfaces: tuple[int, ...],
    hits: Sequence[Guard],
    t: Any,
    x: Sequence[Any],
    most: Any,
) -> AfterJump:
    """Return the continuation after ``surfaces`` reset the state.

    ``mode``, ``t``, ``x``: mode, time [s] and state before the jump; ``hits``: all guards of the mode that are at zero;
    ``most``: largest duration of all later impacts together that is replaced by rest [s].
    """
    hit = {g.index for g in hits if g.kind == "surface"}
    try:
        end = Cascade(system, numbers, mode, t).end(x, hit, surfaces)
    except ARITHMETIC:
        return AfterJump(_not_finite(numbers, t, x), x)
    if isinstance(end, Decision):
        return AfterJump(end, x)
    rule = _Rule(system, numbers, mode, end, t)
    left = tuple(i for i, rate in rule.rates.items() if rate.sign)
    return replace(rule.after(most), applied=end.applied, left=left)


def _refused(reason: str) -> Decision:
    return Decision("none", None, reason)


def _not_finite(numbers: Numbers, t: Any, x: Sequence[Any]) -> Decision:
    return _refused(f"the state after the reset at t = {numbers.at(t, x).when} is not finite")


class _Rule:
    """Continuation after the last map of an instant."""

    def __init__(self, system: FilippovSystem, numbers: Numbers, mode: Mode, end: Instant, t: Any) -> None:
        self.system, self.numbers, self.mode, self.t = system, numbers, mode, t
        self.state, self.sides = end.state, list(end.sides)
        self.several = len(end.fired) > 1
        # A body at rest whose speed no map has changed stays at rest.
        self.rates = {i: rate for i, rate in end.rates.items() if rate.sign or i in end.fired or mode[i] != 0}
        self.impacts = {i: impact for i in self.rates if (impact := impact_of(system, i)) is not None}

    def after(self, most: Any, *, together: bool = True) -> AfterJump:
        """Return the continuation; ``together``: with the rest of several bodies whose impacts accumulate."""
        system, numbers, t, after, sides = self.system, self.numbers, self.t, self.state, self.sides
        try:
            valid = [numbers.sign(value) for value in numbers.values(system.valid, t, after)]
        except ARITHMETIC:
            return AfterJump(_not_finite(numbers, t, after), after)
        on = tuple(i for i, side in enumerate(sides) if side == 0)
        for i, rate in self.rates.items():
            sides[i] = -1 if rate.sign < 0 else 1
        decision = self._decided(after, sides, valid)
        if decision.mode is None or not self.rates:
            return AfterJump(decision, after, on=on)
        try:
            found, why = self._followed(decision, on, most, valid)
            if not why and self.several and found.rests and self._accumulating(found.rests[0].mode, most):
                why = SEVERAL_RESETS
            if together and not (why or found.rests) and stops(system).keys() >= self.rates.keys():
                why = CLOSE if meets_another(system, numbers, self._flight(found), most) else ""
            if why in (SEVERAL_RESETS, CLOSE):
                return self._collapsed(found, most) if together else found
            return self._no_rest(self.impacts, why) if why else found
        except ARITHMETIC:
            return AfterJump(_refused(f"a derivative after t = {numbers.at(t, after).when} is not finite"), after)

    def _decided(self, x: Sequence[Any], sides: Sequence[int], valid: Sequence[int]) -> Decision:
        """Decide the mode at a state at which surfaces and ``valid`` expressions have these signs."""
        return mode_by_signs(self.numbers.at(self.t, x), sides, valid, where="after the reset")

    def _followed(
        self, decision: Decision, on: tuple[int, ...], most: Any, valid: Sequence[int]
    ) -> tuple[AfterJump, str]:
        """Return the continuation, and why a rest after accumulating impacts cannot be derived (empty if it can)."""
        assert decision.mode is not None
        system, mode, after, sides = self.system, decision.mode, self.state, self.sides
        terms, light = self._terms(mode, self.state), never_pressed(system)
        times: dict[int, Any] = {}
        for guard, own in terms:
            i = guard.index
            if guard.kind != "surface" or i not in self.rates or mode[i] < 0:
                continue
            rate = self.rates[i]
            falling = self._falling(i, mode, after) if rate.sign else None
            time = time_to_rest(rate.before, rate.now, 2 * own[2], most, falling)
            if time is not None:
                times[i] = time
            elif rate.sign == 0 and i not in light:  # without speed and acceleration: higher derivatives decide
                sides[i] = 0
        still = [i for i, rate in self.rates.items() if rate.sign == 0 and i not in light]
        groups = acting_groups(system)
        for i in still:  # contacts, or bodies on other stops, may come to rest with the body
            if len(system.together(i, on)) > 1 or [groups[j] for j in still].count(groups[i]) > 1:
                sides[i] = 0
        zero = [i for i in self.rates if sides[i] == 0]
        if zero:
            bodies = [i for i in zero if i in stops(system)]
            x = Cascade(system, self.numbers, self.mode, self.t).at_rest(after, bodies).state
            decision = self._decided(x, sides, valid)
            stuck = decision.mode
            stays = tuple(i for i in self.rates if stuck is not None and stuck[i] == 0)
            if stuck is None or not stays:
                return AfterJump(decision, after, on=on, still=tuple(i for i in self.rates if sides[i] == 0)), ""
            now = 0 * self.t
            rest = Rest(now, self._at_rest(stays, after, stuck, now), stuck, on)
            return AfterJump(Decision("unique", mode), after, on=on, rests=(rest,)), ""
        if not times:
            quiet = tuple(i for i, rate in self.rates.items() if rate.sign == 0)
            return AfterJump(decision, after, on=on, still=quiet), ""
        at_rest = self._mode_at_rest(times, mode, after, sides, valid)
        stuck = at_rest.mode or mode
        if why := self._refusal(times, mode, at_rest, terms):
            return AfterJump(decision, after, on=on), why
        time = next(iter(times.values()))  # several times are all 0
        at_end = self._at_rest(tuple(times), after, stuck, time)
        rest = Rest(time, at_end, self._past_sections(stuck, terms, time, at_end), on)
        return AfterJump(decision, after, on=on, rests=(rest,)), ""

    def _collapsed(self, found: AfterJump, most: Any) -> AfterJump:
        """Add the rest of several bodies if their impacts end within ``most`` [s]."""
        system, numbers = self.system, self.numbers
        first = self._flight(found)
        ended = collapse(system, numbers, first, most, partial(self._impacts, most), self._limit)
        if ended is None:
            return found
        last, fired = ended
        terms, passed = self._terms(first.mode, first.state), system.observed | system.resets.keys()
        if self._met(terms, last.time - self.t, passed):
            return self._no_rest(fired, CLOSE)
        return replace(found, rests=(*found.rests, Rest(last.time - self.t, last.state, last.mode, last.left)))

    def _impacts(self, most: Any, at: Flight, hit: Collection[int]) -> Flight | None:
        """Return the flight after impacts, or after a rest of one body to which they lead."""
        end = Cascade(self.system, self.numbers, at.mode, at.time).end(at.state, hit, hit)
        if isinstance(end, Decision) or not stops(self.system).keys() >= end.fired:
            return None
        rule = _Rule(self.system, self.numbers, at.mode, end, at.time)
        found = rule.after(most, together=False)
        return None if found.decision.mode is None else rule._flight(found, end.fired, limit=end.limit)

    def _limit(self, at: Flight, fired: Collection[int]) -> Flight | None:
        """Return the flight that begins with the rest on surfaces, close to which the state is."""
        mode = tuple(1 if i in fired else entry for i, entry in enumerate(at.mode))
        end = Cascade(self.system, self.numbers, mode, at.time).at_rest(at.state, fired)
        found = _Rule(self.system, self.numbers, mode, end, at.time).after(0 * self.t, together=False)
        if not found.rests or any(found.rests[-1].mode[i] for i in fired):
            return None
        return Flight(found.rests[-1].mode, at.time, found.rests[-1].state, found.on)

    def _flight(self, found: AfterJump, fired: Collection[int] = (), *, limit: bool = False) -> Flight:
        """Return the flight that follows the last impact, or the rest after it."""
        mode, state, time = found.decision.mode, found.state, self.t
        if found.rests:
            mode, state, time = found.rests[-1].mode, found.rests[-1].state, time + found.rests[-1].remaining
        assert mode is not None
        return Flight(mode, time, state, found.on, fired, limit)

    def _met(self, terms: Terms, time: Any, passed: Collection[int]) -> bool:
        """Return whether a guard may reach zero within a time [s]; the surfaces ``passed`` may."""
        for guard, own in terms:
            value, rate, bend, *_ = own
            stays = not any(map(self.numbers.sign, own))  # rest on a kink, say
            may = stays or (guard.kind == "surface" and guard.index in passed)
            if not may and not abs(value) > abs(rate) * time + abs(bend) * time * time:
                return True
        return False

    def _falls(self, terms: Terms, time: Any) -> bool:
        """Return whether a body may reach a stop within a time [s]."""
        for guard, (value, rate, bend, *_) in terms:
            least = value + min(rate, 0 * rate) * time + min(bend, 0 * bend) * time * time
            if guard.kind == "surface" and guard.index in self.system.resets and not least > 0:
                return True
        return False

    def _accumulating(self, mode: Mode, most: Any) -> list[int]:
        """Return the surfaces whose impacts accumulate, in addition to those on which bodies rest at once."""
        found = []
        for guard, own in self._terms(mode, self.state):
            rate = self.rates.get(guard.index) if guard.kind == "surface" else None
            if rate is not None and rate.sign > 0 and time_to_rest(rate.before, rate.now, 2 * own[2], most) is not None:
                found.append(guard.index)
        return found

    def _terms(self, mode: Mode, x: Sequence[Any]) -> Terms:
        series = self.numbers.guard_series(mode, self.t, x)
        return list(zip(self.system.equations(mode).guards, series, strict=True))

    def _no_rest(self, surfaces: Iterable[int], why: str) -> AfterJump:
        names, at = listed([self.system.sign_names[i] for i in surfaces]), self.numbers.at(self.t, self.state)
        reason = f"impacts on {names} accumulate after t = {at.when}, and no rest is derived: {why}"
        return AfterJump(_refused(reason), self.state)

    def _turned(self, index: int, mode: Mode) -> list[int]:
        """Return the surfaces whose side the impact changed and whose signs are in the acceleration."""
        acceleration, signs = self.impacts[index].acceleration, self.system.signs
        return [j for j, s in enumerate(signs) if mode[j] != self.mode[j] and j != index and acceleration.has(s)]

    def _falling(self, index: int, mode: Mode, after: Sequence[Any]) -> Any:
        """Return h'' on the way back to a surface, if a sign in it changes at the apex of the flight; else None."""
        turned = self._turned(index, mode)
        if not turned or not turning_in_flight(self.system, index).issuperset(turned):
            return None
        acceleration = self.impacts[index].acceleration.xreplace(self.system.entries(self.mode))
        return self.numbers.values((acceleration,), self.t, after)[0]

    def _mode_at_rest(
        self, times: Mapping[int, Any], mode: Mode, after: Sequence[Any], sides: Sequence[int], valid: Sequence[int]
    ) -> Decision:
        """Decide the mode at rest; surfaces whose sign changed in flight are decided with zero speed."""
        stuck, x = mode, after
        undecided: set[int] = set()
        for i in times:
            stuck, impact = replaced(stuck, i, 0), self.impacts[i]
            if not impact.refusal:
                x = without_speeds(self.system.states, self.numbers, self.t, x, [impact])
                undecided |= turning_in_flight(self.system, i).intersection(self._turned(i, mode))
        if not undecided:
            return Decision("unique", stuck)
        still = [0 if i in times or i in undecided else side for i, side in enumerate(sides)]
        return self._decided(x, still, valid)

    def _refusal(self, times: Mapping[int, Any], mode: Mode, at_rest: Decision, terms: Terms) -> str:
        """Return why rest after accumulating impacts cannot be derived; empty if it can."""
        system, numbers = self.system, self.numbers
        for i in times:
            impact = self.impacts[i]
            if impact.refusal:
                return impact.refusal
            turned = set(self._turned(i, mode)) - set(times) - turning_in_flight(system, i)
            if turned and numbers.sign(times[i]):
                signs = listed([system.sign_names[j] for j in sorted(turned)])
                return f"the force towards the surface changes with the sign of {signs} in flight"
        lasting = [time for time in times.values() if numbers.sign(time)]
        if lasting and self.several:
            return SEVERAL_RESETS
        if at_rest.mode is None:
            return at_rest.reason
        try:
            system.equations(at_rest.mode)
        except ModelError as error:
            return str(error)
        if not lasting:
            return ""
        passed = system.observed | system.resets.keys() | {j for i in times for j in turning_in_flight(system, i)}
        still = self._at_rest(tuple(times), self.state, at_rest.mode, 0 * self.t)
        met = self._met(terms, lasting[0], passed) or self._falls(self._terms(at_rest.mode, still), lasting[0])
        return CLOSE if met else ""

    def _past_sections(self, mode: Mode, terms: Terms, time: Any, rest: Sequence[Any]) -> Mode:
        """Return the mode at rest, in which sections are crossed that change their side during the last flights.

        A section that ends near zero, relative to its change, keeps its entry: the rest is on it, within rounding.
        """
        for guard, (_, rate, bend, *_) in terms:
            if guard.kind == "surface" and guard.index in self.system.observed:
                (end,) = self.numbers.values((self.system.surfaces[guard.index],), self.t + time, rest)
                if abs(end) > SHRUNK * (abs(rate) * time + abs(bend) * time * time):
                    mode = replaced(mode, guard.index, 1 if end > 0 else -1)
        return mode

    def _at_rest(self, surfaces: tuple[int, ...], after: Sequence[Any], stuck: Mode, time: Any) -> list[Any]:
        """Return the state at rest, projected onto the surfaces; its error is about the cube of ``time``."""
        system, numbers = self.system, self.numbers
        impacts = [self.impacts[i] for i in surfaces]
        x = without_speeds(system.states, numbers, self.t, after, impacts)
        x = moved(numbers, system.equations(stuck).field, self.t, x, time)
        own = [system.surfaces[i] for i in surfaces]
        x = moved_to_zero(system.states, numbers, self.t + time, x, own, [gradient(h, system.states) for h in own])
        return without_speeds(system.states, numbers, self.t + time, x, impacts)
