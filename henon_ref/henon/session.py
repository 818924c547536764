"""One run: the conversation with the compiled mode loop, and what it cannot decide."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon import registers as k
from henon_ref.henon.blocks import KINDS, TransitionBlock
from henon_ref.henon.kernel import advance
from henon_ref.henon.recording import crowded
from henon_ref.model.modes import Mode, replaced, transition_kind
from henon_ref.model.switching import ZERO, Decision
from henon_ref.model.system import Guard
from henon_ref.trajectory import Counts, Status, Trajectory, Transition

if TYPE_CHECKING:
    from henon_ref.henon.engine import Engine, Start

PROVEN = 1e-15
"""Relative size below which a derivative counts as zero at a root that was found in multiprecision."""
_BUDGET = 50_000
"""Steps between two looks at the clock."""
_NO_TIMES, _NO_SAMPLES, _NO_MODES = np.zeros(0), np.zeros((0, 1)), np.zeros(0, dtype=np.int64)
_CHUNK = 1024
"""Transitions kept in one block of memory."""


@dataclass
class Session:
    """One run: the arrays the compiled loop works on, and the conversation with it.

    :meth:`run` goes to the horizon; :meth:`next_event` stops after each transition, so that whoever asks may
    read and change :attr:`x` there (saltation of variational equations, say) before going on.
    """

    engine: Engine
    start: Start
    tolerance: float
    method: int
    sample_times: NDArray[np.float64] | None = None
    deadline: float | None = None
    block: int = _CHUNK
    """Transitions kept in one block of memory; 1 to stop at each."""
    ended: Trajectory | None = field(init=False, default=None)
    """How the run ended, once :meth:`stream` is through."""
    floats: NDArray[np.float64] = field(init=False)
    integers: NDArray[np.int64] = field(init=False)
    x: NDArray[np.float64] = field(init=False)
    """Present state, shape (n,)."""
    x_low: NDArray[np.float64] = field(init=False)
    """What rounding it lost; whoever changes ``x`` sets it to 0 there."""

    def __post_init__(self) -> None:
        self.floats, self.integers, self.x, self.x_low, self.multiplicity = [a.copy() for a in self.start.arrays]
        self.scratch = self.engine.scratch
        if self.sample_times is None:
            self.wanted, self.sample_modes = _NO_TIMES, _NO_MODES
            self.samples = _NO_SAMPLES
        else:
            self.wanted = np.ascontiguousarray(self.sample_times, dtype=float)
            self.samples = np.full((self.wanted.size, self.x.size), np.nan)
            self.sample_modes = np.zeros(self.wanted.size, dtype=np.int64)
        self.blocks: list[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]] = []
        self._new_block()

    def _new_block(self) -> None:
        self.times = np.empty((self.block, 2))
        self.marks = np.empty((self.block, 5), dtype=np.int64)
        self.states = np.empty((self.block, self.x.size))
        self.integers[k.I_COUNT] = 0

    def _close_block(self) -> None:
        self._keep_block()
        self._new_block()

    def _keep_block(self) -> None:
        count = self.integers[k.I_COUNT]
        self.blocks.append((self.times[:count], self.marks[:count], self.states[:count]))

    def run(self) -> Trajectory:
        """Go to the horizon (or to where the run ends before it)."""
        began = time.perf_counter()
        while (end := self._advance()) is None:
            if self.deadline is not None and time.perf_counter() - began > self.deadline:
                return self._end("timeout", f"stopped after {self.deadline:g} s at t = {self.time:.17g}")
        return end

    def stream(self) -> Iterator[TransitionBlock]:
        """Go to the horizon, handing transitions out as they come: memory does not grow with the run.

        What ended the run is :attr:`ended` afterwards; its transitions are those not handed out before.
        """
        while (end := self._advance()) is None:
            for times, marks, states in self.blocks:
                yield TransitionBlock(times, marks, states, self.engine.compiled.modes)
            self.blocks.clear()
        self.ended = end
        if len(end.transitions):
            yield cast(TransitionBlock, end.transitions)

    def next_event(self) -> Transition | Trajectory:
        """Go to the next transition; the trajectory instead where the run ends before one."""
        self.integers[k.I_COUNT] = 0
        while (end := self._advance(stop=True)) is None:
            if self.integers[k.I_COUNT]:
                return self._block()[0]
        return end

    def _enter(self, mode: Mode, active: Sequence[int], zero: float) -> bool:
        """Make a mode the present one; ``active`` are the surfaces the state is on."""
        row = self.engine.compiled.compile(mode)
        if row is None:
            return False
        self.integers[k.I_MODE] = row
        orders = self.engine.known_zeros(self.time, self.x.tolist(), mode, active, zero)
        self.multiplicity[: len(orders)] = orders
        return True

    @property
    def _guards(self) -> tuple[Guard, ...]:
        return self.engine.compiled.guards(self.mode)

    @property
    def time(self) -> float:
        """Present time [s], rounded to double."""
        return float(self.floats[k.F_TIME])

    @property
    def mode(self) -> Mode:
        """Present mode."""
        return self.engine.compiled.modes[self.integers[k.I_MODE]]

    def _advance(self, *, stop: bool = False) -> Trajectory | None:
        """Let the compiled loop run until it needs something; None if the run goes on."""
        start = self.start
        if start.decision.mode is None:
            return self._end(*_refusal(start.decision))
        if start.row is None:
            return self._end("failed", "the mode at the start has no equations")
        compiled, scratch = self.engine.compiled, self.scratch
        code = advance(
            self.floats, self.integers, self.x, self.x_low, self.multiplicity, scratch.hits,
            *start.until, self.engine.order, self.tolerance, self.method, _BUDGET,
            compiled.addresses, compiled.constants, compiled.probes, compiled.layouts, compiled.targets,
            (*compiled.normals, compiled.signs, compiled.rows, *scratch.room) if compiled.rows.size else None,
            scratch.c, scratch.ahead, scratch.change, scratch.point, scratch.speeds, scratch.table, scratch.work,
            scratch.bounds,
            self.times, self.marks, self.states,
            self.wanted, self.samples, self.sample_modes,
        )  # fmt: skip
        if code == k.HORIZON:
            return self._end("ok", "")
        if code == k.FULL and not stop:
            self._close_block()
        elif code in (k.RESOLVE, k.DOUBTFUL, k.UNKNOWN):
            refused = None
            if code == k.UNKNOWN:
                refused = self._go_on()
            elif code == k.RESOLVE:
                refused = self._resolve()
            elif self._closer_look():
                refused = self._resolve(zero=PROVEN)
            return None if refused is None else self._end(*refused)
        elif code not in (k.FULL, k.PAUSE):
            return self._end(*self._why(code))
        return None

    def _closer_look(self) -> bool:
        """Decide a doubtful event in multiprecision; True if there is one to resolve."""
        guard, floats = int(self.integers[k.I_GUARD]), self.floats
        finding = self.engine.closer.look(
            self.mode,
            self.engine.compiled.places(self.mode)[guard],
            int(self.multiplicity[guard]),
            (floats[k.F_TIME], floats[k.F_LOW]),
            list(zip(self.x.tolist(), self.x_low.tolist(), strict=True)),
            floats[k.F_NEAR],
            floats[k.F_REACH],
        )
        floats[k.F_TIME], floats[k.F_LOW] = finding.time
        late = _later(finding.time, self.start.until)
        if late:  # the guard reaches zero just behind the horizon
            floats[k.F_TIME], floats[k.F_LOW] = self.start.until
        self.x[:] = [high for high, _ in finding.state]
        self.x_low[:] = [low for _, low in finding.state]
        self.integers[k.I_STEPS] += 1
        self.multiplicity[:] = 0
        self.scratch.hits[:] = 0
        if late:
            return False
        touched = self._guards[guard]
        # A hold zone holds what only touches its surface.
        caught = finding.what == "touch" and touched.kind == "surface" and self.engine.system.held_inside(touched.index)
        if finding.what == "root" or caught:
            self.scratch.hits[guard] = 1
            return True
        if finding.lowest:
            orders = self.engine.known_zeros(self.time, self.x.tolist(), self.mode, [touched.index])
            self.multiplicity[guard] = max(2, orders[guard])
        if finding.what == "touch" and touched.kind == "surface":  # a stick whose own end is touched goes on
            row = int(self.integers[k.I_MODE])
            self._record(KINDS.index("graze"), touched.index, row, row)
        return False

    def _record(self, kind: int, surface: int, source: int, target: int) -> None:
        if self.integers[k.I_COUNT] >= self.block:
            self._close_block()
        n = self.integers[k.I_COUNT]
        self.times[n] = self.floats[k.F_TIME], self.floats[k.F_LOW]
        self.marks[n] = kind, surface, source, target, self.integers[k.I_LANDING]
        self.states[n] = self.x
        self.integers[k.I_COUNT] = n + 1

    def _go_on(self) -> tuple[Status, str] | None:
        """Complete a transition that is decided, into a mode that has no row yet."""
        compiled, row, hit = self.engine.compiled, int(self.integers[k.I_MODE]), int(self.integers[k.I_GUARD])
        guard, what = self._guards[hit], int(self.integers[k.I_WHAT])
        after = replaced(self.mode, guard.index, 0 if what == k.STICK else guard.to_sign)
        zeros = {k.STICK: 0, k.CROSS: 1}.get(what, int(compiled.targets[row, hit, 1]))
        target = compiled.compile(after)
        if target is None or (what == k.FREE and zeros == 0):  # no such mode, or zeros that have to be measured
            return self._resolve()
        compiled.targets[row, hit, int(what == k.STICK)] = target
        self._record(what, guard.index, row, target)
        self.integers[k.I_MODE] = target
        self.multiplicity[:] = 0
        for g, own in enumerate(compiled.guards(after)):
            if own.kind == "surface" and own.index == guard.index:
                self.multiplicity[g] = zeros
        return self._why(k.ACCUMULATED) if crowded(self.floats, self.integers) else None

    def _resolve(self, zero: float = ZERO) -> tuple[Status, str] | None:
        """Settle an event that signs alone do not decide; None if the run goes on."""
        before = self.mode
        hits: list[Guard] = [g for g, hit in zip(self._guards, self.scratch.hits, strict=False) if hit]
        x = self.x.tolist()
        decision = self.engine.switching.after_event(self.time, x, before, hits, zero=zero)
        if decision.mode is None:
            return _refusal(decision)
        early = self.integers[k.I_GUARD] == k.NOWHERE
        # Where no step was taken, surfaces left a moment ago are still as good as touched.
        fresh = {g.index for g, zeros in zip(self._guards, self.multiplicity, strict=False) if zeros and early}
        active = sorted(
            fresh | {g.index for g in hits} | {i for i, s in enumerate(decision.mode) if s == 0 or before[i] == 0}
        )
        source = self.integers[k.I_MODE]
        if not self._enter(decision.mode, active, zero):
            return "failed", f"the mode after t = {self.time:.17g} has no equations"
        changed = [i for i in active if decision.mode[i] != before[i]]
        touched = changed or ([] if early else sorted({g.index for g in hits}))
        for i in touched:
            kind = KINDS.index(transition_kind(before[i], decision.mode[i]))
            self._record(kind, i, int(source), int(self.integers[k.I_MODE]))
        if crowded(self.floats, self.integers):
            return self._why(k.ACCUMULATED)
        return None

    def _ended(self) -> int | None:
        """A ``valid`` expression that has shrunk to nothing where the run stalled (the field may be singular there)."""
        for g, guard in enumerate(self._guards):
            row = self.scratch.c[self.x.size + g]
            if guard.kind == "valid" and abs(row[0]) <= 1e-14 * max(1.0, abs(self.start.time[0]), abs(self.time)):
                return guard.index
        return None

    def _why(self, code: int) -> tuple[Status, str]:
        at = f"t = {self.time:.17g}"
        grown = np.abs(self.x).max() > 1e8 * max(1.0, *(abs(v[0]) for v in self.start.x))
        if code == k.DIVERGED or (code == k.STALLED and grown):
            return "diverged", f"the state leaves every bound at {at}"
        ended = self._ended() if code == k.STALLED else None
        if ended is not None:
            return "invalid", f"the model ends: {self.engine.system.valid[ended]} fell to 0 at {at}"
        if code == k.STALLED:
            return "failed", f"the step size fell to zero at {at}: the field is singular there"
        if code == k.ACCUMULATED:
            return "failed", f"transitions accumulate at {at}: no mode lasts longer than the resolution of time"
        guard = self._guards[self.integers[k.I_GUARD]]
        return "invalid", f"the model ends: {self.engine.system.valid[guard.index]} fell to 0 at {at}"

    def _block(self) -> TransitionBlock:
        count = self.integers[k.I_COUNT]
        return TransitionBlock(self.times[:count], self.marks[:count], self.states[:count], self.engine.compiled.modes)

    def _end(self, status: Status, reason: str) -> Trajectory:
        transitions = self._block()
        if self.blocks:
            self._keep_block()
            times, marks, states = (np.concatenate(parts) for parts in zip(*self.blocks, strict=True))
            transitions = TransitionBlock(times, marks, states, transitions.modes)
        modes = transitions.modes
        asked = self.sample_times is not None
        return Trajectory(
            status=status,
            transitions=transitions,
            end_time=self.time,
            end_state=tuple(self.x.tolist()),
            end_mode=self.mode if modes else (0,) * len(self.engine.system.surfaces),
            reason=reason,
            counts=Counts(*self.integers[k.I_STEPS : k.I_EVENTS + 1].tolist()),
            samples=self.samples if asked else None,
            sample_modes=tuple(modes[m] for m in self.sample_modes[: self.integers[k.I_SAMPLE]]) if asked else None,
        )


def _later(time: tuple[float, float], horizon: tuple[float, float]) -> bool:
    """True if a time lies behind the horizon by more than the rounding of a compensated sum."""
    return (time[0] - horizon[0]) + (time[1] - horizon[1]) > 2e-17 * abs(horizon[0])


def _refusal(decision: Decision) -> tuple[Status, str]:
    if decision.status == "nonunique":
        return "nonunique", decision.reason
    return ("invalid" if decision.status == "invalid" else "failed"), decision.reason
