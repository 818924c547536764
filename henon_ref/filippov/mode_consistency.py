"""Whether a mode is consistent at a point: whether its own field keeps it just after.

A mode is *consistent* when every surface in slip is left on the mode's side (first non-zero derivative of h), and on
every sliding surface the equivalent sign stays inside [-1, 1] and the two fields point at the surface. A surface whose
sliding is overridden with ``entry: inside`` is held wherever every release guard is positive just after the point
(first non-zero derivative; one that stays at zero holds); whether it is, :mod:`henon_ref.filippov.held_groups` decides.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.held_groups import IDENTICALLY_ZERO, Broken, order_of
from henon_ref.filippov.mode_evaluation import ZERO, ModeEvaluation
from henon_ref.filippov.modes import Mode, replaced


class ModeConsistency(ModeEvaluation):
    """Tells which guards of a candidate mode do not hold just after a point; see :class:`ModeEvaluation`."""

    def _indeterminate(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float) -> bool:
        """Whether no end of a slide on a surface is anything but zero, so far as its derivatives tell."""
        made = self._equations(mode)
        assert made is not None
        outputs, rate = self._expanded(mode, t, x)
        size = self._size(t, x, mode, index)
        ends = [c for g, c in zip(made[0].guards, outputs, strict=True) if g.kind == "release" and g.index == index]
        return index not in self.system.overrides and all(not self._sign(c, 0, rate, size, zero) for c in ends)

    def _violations(
        self, t: float, x: Sequence[float], mode: Mode, active: Iterable[int], zero: float
    ) -> tuple[Guard, ...] | None:
        """Guards of the mode that do not hold just after (t, x); None where the mode has no equations."""
        made = self._equations(mode)
        if made is None:
            return None
        try:
            outputs, rate = self._expanded(mode, t, x)
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        active = set(active)
        broken: list[Guard] = []
        for guard, series in zip(made[0].guards, outputs, strict=True):
            if guard.ends or guard.index not in active:
                continue
            if guard.index in self.system.overrides:
                sticks = self._sticks(t, x, mode, guard.index, zero)
                # No slip starts where a body rests.
                refused = not sticks if guard.kind == "release" else sticks and self.system.rests(guard.index)
                if refused:
                    broken.append(guard)
                if refused or guard.kind == "release":
                    continue
            first = 1 if guard.kind == "surface" else 0
            size = self._size(t, x, mode, guard.index)
            head = self._sign(series, first, rate, size, zero)
            # A surface that is never left is no slip; an equivalent sign that stays at its limit still holds.
            if head < 0 or (head == 0 and guard.kind == "surface"):
                broken.append(guard)
        return tuple(broken)

    def _broken(self, t: float, x: Sequence[float], mode: Mode, active: Iterable[int], zero: float) -> Broken | None:
        """Guards of contacts in groups that do not hold just after (t, x); None where the mode has no equations."""
        made = self._equations(mode)
        if made is None:
            return None
        try:
            outputs, rate = self._expanded(mode, t, x)
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        system, active, broken = self.system, set(active), list[tuple[Guard, int]]()
        pairs = list(zip(made[0].guards, outputs, strict=True))
        for guard, series in pairs:
            i = guard.index
            if guard.ends or i not in active:
                continue
            if guard.kind == "release" and i in system.overrides and not (system.held_inside(i) or system.rests(i)):
                if self._way(t, x, mode, i) == guard.to_sign:
                    broken.append((guard, 0))
            elif guard.kind == "release" and i in system.overrides:
                ways = [c for other, c in pairs if other.kind == "release" and other.index == i]
                k = self._end_order(series, ways, rate, zero)
                broken += [(guard, k)] if k is not None and series[k] < 0 else []
            else:
                first = 1 if guard.kind == "surface" else 0
                size = 0.0 if system.rests(i) else self._size(t, x, mode, i)
                k = self._leading(series, first, rate, size, zero)
                if (k is None and first) or (k is not None and series[k] < 0):
                    broken.append((guard, IDENTICALLY_ZERO if k is None else order_of(system, guard, k)))
        return broken

    def _staying(
        self, t: float, x: Sequence[float], mode: Mode, active: Iterable[int], zero: float
    ) -> frozenset[int] | None:
        """Surfaces that a slip does not leave, where nothing else keeps the mode out; else None."""
        broken = self._violations(t, x, mode, active, zero)
        if broken is None:
            return None
        kept = {
            guard.index for guard in broken if guard.kind == "surface" and self.stays(t, x, mode, guard.index, zero)
        }
        return frozenset(kept) if len(kept) == len(broken) else None

    def _same_motion(self, t: float, x: Sequence[float], first: Mode, second: Mode) -> bool:
        """Whether two modes that have equations have the same motion, so far as its derivatives tell."""
        made = [self._equations(mode) for mode in (first, second)]
        motions = [self._motion(own[1], own[2], t, x) for own in made if own is not None]
        return all(self._equal(one, other) for one, other in zip(*motions, strict=True))

    def stays(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float = ZERO) -> bool:
        """Whether a slip stays on a surface, so far as its derivatives tell, at a point that is on it."""
        made = self._equations(mode)
        assert made is not None
        outputs, rate = self._expanded(mode, t, x)
        own = [c for g, c in zip(made[0].guards, outputs, strict=True) if g.kind == "surface" and g.index == index]
        return not any(self._sign(c, 1, rate, self._size(t, x, mode, index), zero) for c in own)

    def _sticks(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float) -> bool:
        """Whether a surface whose sliding is overridden is slid on from here."""
        rests = self.system.rests(index)
        return self._rests(t, x, mode, index, zero) if rests else self._attracts(t, x, mode, index)

    def _rests(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float) -> bool:
        """Whether a body on a surface stays there: off it, h would neither rise at once nor fall with a speed."""
        free = replaced(mode, index, 1)
        made = self._equations(free)
        if made is None:
            return False
        try:
            outputs, rate = self._expanded(free, t, x)
        except (ZeroDivisionError, ValueError, OverflowError):
            return False
        own = next(k for k, g in enumerate(made[0].guards) if g.kind == "surface" and g.index == index)
        first = self._leading(outputs[own], 1, rate, 0.0, zero)
        return first is None or (first > 1 and outputs[own][first] < 0)
