"""The modes of one problem on one library, made when first visited, and what follows an event in each.

Where one guard alone has fallen, no other surface slides, and neither normal velocity is near zero, what
follows is settled by two signs, and costs a few microseconds; every other event is
:class:`~henon_ref.model.switching.Switching`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import sympy as sp

from baselines.flow import Flow, Library
from baselines.functions import ARITHMETIC, Scalar, scalar
from baselines.mode_functions import EPSILON, Landing, ModeFunctions, projected
from baselines.restart import Fresh
from baselines.work import Work
from henon_ref.model.modes import Mode, replaced
from henon_ref.model.switching import Switching
from henon_ref.model.system import FilippovSystem, Guard
from henon_ref.trajectory import Status

CLEAR = 1e-9
"""A normal velocity below this part of the two together is a matter for higher derivatives."""
ON = 8.0
"""A guard whose value is within so many roundings of its terms starts at zero."""


class After(NamedTuple):
    """What follows an event."""

    mode: Mode | None
    x: tuple[float, ...]
    """The state, put on its surfaces."""
    fresh: tuple[Fresh, ...]
    """Guards of the new mode that start at zero."""
    drift: float
    """Largest abs(h) before the state was put on its surfaces."""
    touched: tuple[int, ...] = ()
    """Surfaces that were hit and left on the same side."""
    status: Status = "ok"
    reason: str = ""


class ModeEntry:
    """One mode: its functions, its flow, and its ordinary exits."""

    def __init__(self, model: ModeFunctions, flow: Flow) -> None:
        self.model = model
        self.flow = flow
        self.several = len(model.guards) > 1
        self._exits = [self._exit(guard) for guard in model.guards]
        if self.several:
            model.rates  # noqa: B018  (made on first access)

    def ordinary(self, hits: Sequence[int], t: float, x: Sequence[float]) -> After | None:
        """What follows where one guard fell and two signs settle it; None elsewhere."""
        take = self._exits[hits[0]]
        return None if take is None else take(t, x)

    def still_fresh(self, before: ModeEntry, unsettled: Sequence[Fresh], fresh: Sequence[Fresh]) -> tuple[Fresh, ...]:
        """Guards of this mode for the surfaces whose guards had not left zero when the mode before ended."""
        known = {item.guard for item in fresh}
        found = []
        for item in unsettled:
            guard = before.model.guards[item.guard]
            k = self.model.surface_guard.get(guard.index) if guard.kind == "surface" else None
            if k is not None and k not in known:
                found.append(Fresh(k, item.speed))
        return tuple(found)

    def _exit(self, guard: Guard) -> Callable[[float, Sequence[float]], After | None] | None:
        mode, i = self.model.mode, guard.index
        sliding = [j for j, s in enumerate(mode) if s == 0]
        if guard.kind == "valid" or sliding != ([i] if guard.kind == "release" else []):
            return None
        system = self.model.system
        landing = Landing(system, mode, i).values
        slip = {s: replaced(mode, i, s) for s in (-1, 1)}
        stick = replaced(mode, i, 0)
        # Guards of surfaces come first, by index: with no other surface sliding, surface i's is number i.
        beyond = guard.to_sign
        released = slip[beyond] if guard.kind == "release" else None

        def take(t: float, x: Sequence[float]) -> After | None:
            try:
                h, below, above, *point = landing(t, *x)
            except ARITHMETIC:
                return None
            speed = abs(below) + abs(above)
            clear = CLEAR * speed
            if released is not None:
                return After(released, tuple(point), (Fresh(i, speed),), abs(h))
            if below > clear and above < -clear:
                return After(stick, tuple(point), (), abs(h))
            if below * beyond > clear and above * beyond > clear:
                return After(slip[beyond], tuple(point), (Fresh(i, speed),), abs(h))
            return None

        return take


class ModeTable:
    """Mode -> :class:`ModeEntry`, made on first access.

    Parameters
    ----------
    system : FilippovSystem
    library : Library
    work : Work
    horizon : float
        Length of the whole run [s].
    """

    def __init__(self, system: FilippovSystem, library: Library, work: Work, horizon: float) -> None:
        self.system = system
        self.switching = Switching(system)
        self._library = library
        self._work = work
        self._horizon = horizon
        self._entries: dict[Mode, ModeEntry] = {}
        self._landings: dict[tuple[Mode, int], Landing] = {}
        self._surfaces: dict[int, tuple[Scalar, Scalar]] = {}

    def __getitem__(self, mode: Mode) -> ModeEntry:
        if mode not in self._entries:
            model = ModeFunctions(self.system, mode)
            self._entries[mode] = ModeEntry(model, self._library.flow(model, self._work, self._horizon))
        return self._entries[mode]

    @property
    def visited(self) -> tuple[Mode, ...]:
        """Modes made so far."""
        return tuple(self._entries)

    def decided(self, entry: ModeEntry, hits: Sequence[int], t: float, x: tuple[float, ...]) -> After:
        """What follows any event, by :class:`Switching`."""
        model = entry.model
        guards = [model.guards[k] for k in hits]
        involved = {g.index for g in guards if g.kind != "valid"} | {i for i, s in enumerate(model.mode) if s == 0}
        x, drift = projected([self._surface(i) for i in sorted(involved)], t, x)
        decision = self.switching.after_event(t, x, model.mode, guards)
        if decision.mode is None:
            status: Status = "failed" if decision.status == "none" else decision.status  # type: ignore[assignment]
            return After(None, x, (), drift, (), status, decision.reason)
        touched = tuple(g.index for g in guards if g.kind == "surface" and decision.mode[g.index] == model.mode[g.index])
        fresh = self.fresh_at(self[decision.mode], t, x, tuple(involved))
        return After(decision.mode, x, fresh, drift, touched)

    def fresh_at(
        self, entry: ModeEntry, t: float, x: Sequence[float], involved: Sequence[int]
    ) -> tuple[Fresh, ...]:
        """Guards of a mode that start at zero: of the surfaces just left, and any other within rounding of it."""
        model, found = entry.model, []
        for k, guard in enumerate(model.guards):
            if guard.kind == "valid":
                continue
            if guard.kind != "surface" or guard.index not in involved:
                try:
                    value = model.guard[k](t, *x)[0]
                except ARITHMETIC:
                    continue
                if abs(value) > ON * model.size(k, t, x, EPSILON, 0.0):
                    continue
            found.append(Fresh(k, self._speed(model.mode, guard.index, t, x)))
        return tuple(found)

    def drift(self, entry: ModeEntry, t: float, x: Sequence[float]) -> float:
        """Largest abs(h) over the surfaces a mode slides on."""
        sliding = [i for i, s in enumerate(entry.model.mode) if s == 0]
        return max((abs(self._surface(i)[0](t, *x)[0]) for i in sliding), default=0.0)

    def _speed(self, mode: Mode, index: int, t: float, x: Sequence[float]) -> float:
        key = (mode, index)
        if key not in self._landings:
            self._landings[key] = Landing(self.system, mode, index)
        try:
            _, below, above, *_ = self._landings[key].values(t, *x)
        except ARITHMETIC:
            return 0.0
        return abs(below) + abs(above)

    def _surface(self, index: int) -> tuple[Scalar, Scalar]:
        if index not in self._surfaces:
            h = self.system.numeric(self.system.surfaces[index])
            gradient = [sp.diff(h, x) for x in self.system.states]
            self._surfaces[index] = (scalar(self.system.states, [h]), scalar(self.system.states, gradient))
        return self._surfaces[index]
