"""Table of the modes of one problem for one library, and selection of the mode after an event.

Modes are made at the first visit. After an ordinary event the signs of two normal velocities select the next mode in a
few microseconds. An event is ordinary if one guard alone has fallen, its surface and the sliding surfaces do not act
on each other, and neither normal velocity is near zero. Every other event is decided by
:mod:`henon_ref.modes.selection`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import sympy as sp

from henon_ref.baselines.library import Advance, Library, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh
from henon_ref.baselines.surface_functions import projected, surface
from henon_ref.jit.processor_time import compiling
from henon_ref.method_cache import cached_method
from henon_ref.modes.after_jump import after_jump
from henon_ref.modes.callables import ARITHMETIC, Scalar, scalar
from henon_ref.modes.consistency import stays
from henon_ref.modes.equations import Guard
from henon_ref.modes.impact_limit import without_speeds
from henon_ref.modes.mode import CLEAR, Mode, replaced, sign_after
from henon_ref.modes.mode_evaluation import ModeEvaluation, TapePoint, in_doubles
from henon_ref.modes.resets import REMAINING, impact_of, resetting
from henon_ref.modes.selection import after_event
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Status


class After(NamedTuple):
    """Mode and state after an event; ``mode`` is None if the run ends."""

    mode: Mode | None
    x: tuple[float, ...]
    """State, projected onto its surfaces."""
    fresh: tuple[Fresh, ...]
    """Guards of the new mode that start at zero."""
    drift: float
    """Largest abs(h) before the projection."""
    touched: tuple[int, ...] = ()
    """Surfaces that were hit and left on the same side."""
    status: Status = "ok"
    reason: str = ""
    applied: tuple[tuple[int, Sequence[float]], ...] = ()
    """Surfaces that reset the state, in order, each with the state after its reset; ``x`` is the last of these."""
    rests: tuple[tuple[Mode, float, tuple[float, ...]], ...] = ()
    """Mode, time [s] and state at which bodies come to rest after accumulating impacts, in order of time."""


Key = tuple[Mode, frozenset[int]]
"""A mode and its idle surfaces."""
Exit = Callable[[float, Sequence[float]], After | None]
"""Returns the mode and state after an ordinary event at (t, x); None if the two signs do not decide it."""


class ModeEntry:
    """One mode: its functions, the library prepared for it, and its ordinary exits."""

    def __init__(self, model: ModeFunctions, advance: Advance) -> None:
        self.model, self.advance, self.several = model, advance, len(model.guards) > 1
        self._exits: dict[int, Exit | None] = {}
        if self.several:
            model.rates  # noqa: B018  (made on first access)

    def exit(self, guard: int) -> Exit | None:
        """Return the exit of a guard that fell alone; None if signs alone never decide it."""
        if guard not in self._exits:
            with compiling():
                self._exits[guard] = None if self.resets(guard) else self._exit(self.model.guards[guard])
        return self._exits[guard]

    def resets(self, guard: int) -> bool:
        """Check whether a fall of this guard resets the state."""
        return bool(resetting(self.model.system, self.model.mode, [self.model.guards[guard]]))

    def still_fresh(self, before: ModeEntry, unsettled: Sequence[Fresh], fresh: Sequence[Fresh]) -> tuple[Fresh, ...]:
        """Guards of this mode for the surfaces whose guards were still at zero when the mode ``before`` ended."""
        known = {guard for guard, *_ in fresh}
        found = []
        for guard, speed, rate in unsettled:
            left = before.model.guards[guard]
            k = self.model.surface_guard.get(left.index) if left.kind == "surface" else None
            if k is not None and k not in known:
                found.append((k, speed, rate))
        return tuple(found)

    def _exit(self, guard: Guard) -> Exit | None:
        model, mode, i = self.model, self.model.mode, guard.index
        sliding = [j for j, s in enumerate(mode) if s == 0]
        if (
            guard.ends
            or (guard.kind == "release" and model.system.rests(i))
            or model.system.decided_together(guard, mode, sliding)
        ):
            return None
        landing = model.landing(i)
        stick, slip = replaced(mode, i, 0), {s: replaced(mode, i, s) for s in (-1, 1)}
        beyond = guard.to_sign
        hold = None
        """Release guards that decide whether surface i holds; None if its slip fields decide it."""
        if guard.kind == "surface" and model.system.held_inside(i):
            held = model.system.hold_guards(i, mode)
            hold = scalar(model.states, [model.system.numeric(g.expression) for g in held])
        released = slip[beyond] if guard.kind == "release" else None
        # Guards of the surfaces in slip come first, by index.
        position = sum(s != 0 for s in mode[:i])

        def take(t: float, x: Sequence[float]) -> After | None:
            try:
                values = landing(t, *x)
                room = hold(t, *values[3:]) if hold is not None else ()
            except ARITHMETIC:
                return None
            h, below, above = values[:3]
            point, drift, speed = values[3:], abs(h), abs(below) + abs(above)
            if released is not None:
                rate = beyond * (above if beyond > 0 else below)
                return After(released, point, ((position, speed, rate),), drift)
            sign = sign_after(below, above)
            sticks = sign == 0
            if room:
                # A single guard has no other value to compare with.
                if len(room) == 1 or abs(min(room)) <= CLEAR * max(map(abs, room)):
                    return None
                sticks = min(room) > 0
            if sticks:
                return After(stick, point, (), drift)
            return After(slip[beyond], point, ((position, speed, speed),), drift) if sign == beyond else None

        return take


class ModeTable:
    """Map from a mode to its :class:`ModeEntry`, made on first access, for a run of length ``horizon`` [s].

    ``known`` is a table of the same system for another library; its callables are used again.
    """

    rounding = 1e-13
    """A value below this part of the size of its terms is zero but for rounding."""

    def __init__(
        self, system: FilippovSystem, library: Library, work: Work, horizon: float, known: ModeTable | None = None
    ) -> None:
        self.system, self._library, self._work, self._horizon = system, library, work, horizon
        self.in_doubles: ModeEvaluation = known.in_doubles if known else in_doubles(system)
        self._entries: dict[Key, ModeEntry] = {}
        self._models: dict[Key, ModeFunctions] = known._models if known else {}

    def __getitem__(self, mode: Mode) -> ModeEntry:
        return self.entry(mode)

    def entry(self, mode: Mode, idle: frozenset[int] = frozenset()) -> ModeEntry:
        """Return a mode with some ``idle`` surfaces (:class:`~henon_ref.baselines.mode_functions.ModeFunctions`)."""
        key = mode, idle
        if key not in self._entries:
            with compiling():
                if key not in self._models:
                    self._models[key] = ModeFunctions(self.system, mode, self.in_doubles, idle)
                model = self._models[key]
                flow = self._library.flow(model, self._work, self._horizon)
                self._entries[key] = ModeEntry(model, flow.advance)
        return self._entries[key]

    @property
    def visited(self) -> tuple[Key, ...]:
        """Modes visited so far, each with its idle surfaces."""
        return tuple(self._entries)

    def entered(
        self, mode: Mode, t: float, x: Sequence[float], fresh: Sequence[Fresh], before: Collection[int] = ()
    ) -> tuple[ModeEntry, tuple[Fresh, ...], tuple[int, ...]]:
        """Enter a mode at (t, x), without the guards that stay at zero.

        ``fresh`` are the guards of the full mode that start at zero, ``before`` the surfaces that were idle until now.
        Return the mode, the guards that start at zero and leave it, and the guards that fall at once.
        """
        whole = self[mode]
        guards = whole.model.guards
        still = {guards[k].index for k, _, rate in fresh if guards[k].kind == "surface" and rate == 0.0}
        still.update(i for i in before if mode[i] != 0)
        if not still:
            return whole, tuple(fresh), ()
        idle = frozenset(i for i in still if self._stays(t, x, mode, i))
        moved = [whole.model.surface_guard[i] for i in sorted(set(before) & still - idle)]
        known = {k for k, *_ in fresh}
        fresh = (*fresh, *((k, *_speed(whole.model, guards[k].index, t, x)) for k in moved if k not in known))
        entry = self.entry(mode, idle) if idle else whole
        places = entry.model.places
        fresh = tuple((places[k], speed, rate) for k, speed, rate in fresh if k in places)
        return entry, fresh, tuple(k for k, _, rate in fresh if rate < 0.0 and k in {places[k] for k in moved})

    def _stays(self, t: float, x: Sequence[float], mode: Mode, index: int) -> bool:
        try:
            return stays(self.in_doubles.at(t, x), mode, index)
        except ARITHMETIC:
            return False

    def decided(self, entry: ModeEntry, hits: Sequence[int], t: float, x: tuple[float, ...]) -> After:
        """Select the mode and state after any event, by :func:`after_event`."""
        model = entry.model
        guards = [model.guards[k] for k in hits]
        sliding = {i for i, s in enumerate(model.mode) if s == 0}
        involved = self.system.closed({g.index for g in guards if g.ends is None}, sliding) | model.idle
        x, drift = projected(self.system, sorted(involved), t, x)
        # Errors may have given a body at rest a speed.
        at_rest = [impact_of(self.system, i) for i in sorted(sliding) if self.system.rests(i)]
        if impacts := [impact for impact in at_rest if impact]:
            x = tuple(without_speeds(self.system.states, self, t, x, impacts))
        if resets := resetting(self.system, model.mode, guards):
            return self._jumped(resets, guards, model.mode, t, x, drift)
        at = self.in_doubles.at(t, x)
        decision = after_event(at, model.mode, guards)
        if decision.mode is None:
            return After(None, x, (), drift, (), decision.ending, decision.reason)
        same = [g.index for g in guards if g.kind == "surface" and decision.mode[g.index] == model.mode[g.index]]
        touched = tuple(i for i in same if not stays(at, model.mode, i))
        fresh = self.fresh_at(self[decision.mode], t, x, tuple(involved))
        lifted = {i for i, entry in enumerate(model.mode) if entry == 0 and self.system.rests(i)}
        return After(decision.mode, x, self._without_rate(decision.mode, fresh, lifted), drift, touched)

    def _jumped(
        self, resets: tuple[int, ...], hits: Sequence[Guard], mode: Mode, t: float, x: tuple[float, ...], drift: float
    ) -> After:
        """Select the mode and state after a reset; the state is on all surfaces that are hit."""
        after = after_jump(self.system, self, mode, resets, hits, t, x, REMAINING * self._horizon)
        decision, state, applied = after.decision, tuple(after.state), after.applied
        if decision.mode is None:
            return After(None, state, (), drift, (), decision.ending, decision.reason)
        if after.rests:
            rests = tuple((rest.mode, t + rest.remaining, tuple(rest.state)) for rest in after.rests)
            on = after.rests[-1].on
            left = any(rests[-1][0][i] for i in on)  # another body may leave after the last rest
            fresh = self.fresh_at(self[rests[-1][0]], *rests[-1][1:], on) if left else ()
            return After(decision.mode, state, fresh, drift, applied=applied, rests=rests)
        fresh = self.fresh_at(self[decision.mode], t, state, after.on)
        fresh = self._without_rate(decision.mode, fresh, after.still)
        return After(decision.mode, state, fresh, drift, applied=applied)

    def _without_rate(self, mode: Mode, fresh: tuple[Fresh, ...], surfaces: Collection[int]) -> tuple[Fresh, ...]:
        """Return ``fresh`` with rate 0 for the guards of ``surfaces``, which the state leaves without a speed."""
        guards = self[mode].model.guards
        return tuple((k, s, 0.0 if guards[k].index in surfaces else rate) for k, s, rate in fresh)

    def values(self, expressions: tuple[sp.Expr, ...], t: float, x: Sequence[float]) -> list[float]:
        """Evaluate expressions in time and states at a point."""
        return list(self._function(expressions)(t, *x))

    @cached_method
    def _function(self, expressions: tuple[sp.Expr, ...]) -> Scalar:
        return scalar(self.system.states, [self.system.numeric(e) for e in expressions])

    def guard_series(self, mode: Mode, t: float, x: Sequence[float]) -> list[list[float]]:
        return self.in_doubles.guard_series(mode, t, x)

    def sign(self, value: float) -> int:
        return (value > 0.0) - (value < 0.0)

    def at(self, t: float, x: Sequence[float]) -> TapePoint:
        return self.in_doubles.at(t, x)

    def fresh_at(self, entry: ModeEntry, t: float, x: Sequence[float], involved: Collection[int]) -> tuple[Fresh, ...]:
        """Guards of a mode that start at zero: those of the ``involved`` surfaces, and others within rounding."""
        model, found = entry.model, []
        for k, guard in enumerate(model.guards):
            if guard.kind != "surface" or guard.index not in involved:
                try:
                    value = model.guard[k](t, *x)[0]
                    if abs(value) > 8.0 * model.size(k, t, x, EPSILON, 0.0):
                        continue
                    rate = model.rates(t, *x)[2 * k + 1] if guard.ends else 0.0
                except ARITHMETIC:
                    continue
            if guard.ends is None:
                found.append((k, *_speed(model, guard.index, t, x)))
            elif rate >= 0.0:  # a falling guard does not leave zero
                found.append((k, rate, rate))
        return tuple(found)

    def drift(self, entry: ModeEntry, t: float, x: Sequence[float]) -> float:
        """Largest abs(h) over the surfaces on which the mode slides."""
        sliding = [i for i, s in enumerate(entry.model.mode) if s == 0]
        return max((abs(surface(self.system, i)[0](t, *x)[0]) for i in sliding), default=0.0)


def _speed(model: ModeFunctions, index: int, t: float, x: Sequence[float]) -> tuple[float, float]:
    """Return abs(dh/dt) below plus above a surface, and the rate at which its guard rises in this mode."""
    try:
        below, above = model.landing(index)(t, *x)[1:3]
    except ARITHMETIC:
        return 0.0, 0.0
    speed = abs(below) + abs(above)
    return speed, {-1: -below, 0: speed, 1: above}[model.mode[index]]
