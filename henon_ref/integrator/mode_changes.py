"""What a run does from Python where its mode changes: the next mode, jumps of the state, and what is told of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from flint import arb
from numpy.typing import NDArray

from henon_ref.integrator.endings import ending_of, vanishing_guard
from henon_ref.integrator.entries import written
from henon_ref.integrator.records import RESET, STEP, STEP_PLACES, STICK, TRANSITION, TRANSITION_PLACES
from henon_ref.integrator.state_view import State
from henon_ref.integrator.transition_array import KINDS
from henon_ref.kernel.shared import LEVELS, doubles, kernel
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, numbered_mode, replaced, transition_kind
from henon_ref.modes.resets import resetting, rows_at
from henon_ref.modes.resting import REMAINING
from henon_ref.modes.selection import after_event, contact_orders
from henon_ref.precision import working_precision
from henon_ref.trajectory import Decisions, Status

if TYPE_CHECKING:
    from henon_ref.integrator.precise_motion import PreciseMotion

CLOSE_PART = 2.0**-40
"""Part of the horizon's time below which what is left of a run is next to nothing."""
Pair = tuple[float, float]
"""A number as its double and what that leaves."""


class Jumped(NamedTuple):
    """A jump of the state."""

    surfaces: tuple[int, ...]
    """Those that reset it, in order."""
    time: float
    """[s]."""
    before: tuple[float, ...]
    """State before it."""
    after: tuple[float, ...]
    """State after it."""
    mode: Mode
    """Before it."""


class ModeChanges(State):
    """The part of a run that changes its mode.

    Attributes
    ----------
    blocks : list of ndarray
        Transitions that have left the loop's own memory.
    step_blocks : list of ndarray
        Full blocks of steps: rows of :func:`henon_ref.integrator.records.step_dtype`, as doubles.
    """

    __slots__ = ("_motion", "_passed_at", "_steps", "blocks", "decisions", "samples", "step_blocks")

    blocks: list[NDArray[np.float64]]
    step_blocks: list[NDArray[np.float64]]
    decisions: Decisions
    samples: NDArray[np.float64]
    """Times at which samples are wanted; states and mode there."""
    _motion: PreciseMotion | None
    """The motion from the start in more digits, where they have been asked for."""
    _passed_at: int
    """Steps taken when a branch point was last passed."""
    _steps: NDArray[np.float64] | None
    """The block of steps that is being filled; None where none is kept."""

    def _count(self, cause: str) -> None:
        """Note why Python was needed."""
        self.decisions = self.decisions._replace(**{cause: getattr(self.decisions, cause) + 1})

    def _close_block(self) -> None:
        self.blocks.append(self.workspace.transitions[: self.scalars.transitions].copy())
        self.scalars.transitions = 0

    def _close_steps(self) -> None:
        assert self._steps is not None
        self.step_blocks.append(self._steps[: self.scalars.dense_steps])
        self._steps = np.empty_like(self._steps)
        self.scalars.dense, self.scalars.dense_steps = doubles(self._steps), 0

    def _keep_step(self, length: float) -> None:
        """Keep the step that leads to an event located in multiprecision: the compiled loop has not taken it."""
        assert self._steps is not None
        scalars, columns, n = self.scalars, self.start.order + 1, self.x.size
        row = self._steps[scalars.dense_steps]
        row[STEP_PLACES:], step = self.workspace.band[:n, :columns].ravel(), row[:STEP_PLACES].view(STEP)[0]
        for name in ("time", "time_low", "unit", "mode"):
            step[name] = getattr(scalars, name)
        step["length"] = length
        scalars.dense_steps += 1

    def _keep_line(self, length: float, state: Sequence[float]) -> None:
        """Keep a step of which no series is there, as a straight line: impacts up to rest, or past a branch point."""
        if self._steps is None or length <= 0.0:
            return
        if self.scalars.dense_steps >= self.scalars.dense_capacity:
            self._close_steps()
        self._keep_step(length)
        n, columns = self.x.size, self.start.order + 1
        row = self._steps[self.scalars.dense_steps - 1]
        lines = row[STEP_PLACES:].reshape(n, columns)
        lines[:] = 0.0
        lines[:, 0] = self.x
        lines[:, 1] = (np.asarray(state) - self.x) * (row[:STEP_PLACES].view(STEP)[0]["unit"] / length)

    def _fill_samples_on_line(self, length: float, state: Sequence[float]) -> None:
        """Fill the samples on such a step."""
        scalars, samples, contacts = self.scalars, self.samples, self.integrator.mode_table.contacts
        while scalars.next_sample < len(samples):
            row = samples[scalars.next_sample]
            part = ((row[0] - scalars.time) - scalars.time_low) / length
            if part > 1.0:
                return
            states = slice(1, 1 + self.x.size)
            row[states] = self.x + max(part, 0.0) * (np.asarray(state) - self.x)
            if contacts:
                row[states.stop :].view(np.int64)[:] = self._entries
            else:
                row[-1] = scalars.mode
            scalars.next_sample += 1

    def _put(self, time: Pair, state: Sequence[Pair]) -> None:
        """Set time and state."""
        self.scalars.time, self.scalars.time_low = time
        self.x[:] = [high for high, _ in state]
        self.x_low[:] = [low for _, low in state]

    def _digits(self) -> tuple[list[arb], list[float]]:
        """The state in as many digits as there are, and what each entry may be off.

        More than doubles have kept are there as long as the first mode lasts, and neither a jump nor a caller has
        changed the state.
        """
        from henon_ref.integrator.precise_motion import PreciseMotion
        from henon_ref.roots.multiprecision import BITS

        scalars, start, state = self.scalars, self.start, self.x.tolist()
        time, length = (float(scalars.time), float(scalars.time_low)), float(scalars.step_length)
        if scalars.more_digits and scalars.remembered == 1:
            if self._motion is None:
                self._motion = PreciseMotion(start.constants.precise, self.mode, start.time, start.x)
            found = self._motion.at(time, state, length)
            if found is not None:
                return found
        scalars.more_digits = 0
        with working_precision(BITS):
            exact = [arb(high) + arb(low) for high, low in zip(state, self.x_low.tolist(), strict=True)]
        return exact, [LEVELS.state_rounding * abs(x) for x in state]

    def _passed_over(self, guard: Guard) -> None:
        """Note that a guard is below its rounding here (``henon_ref/kernel/below_rounding.c``)."""
        place = kernel.rounding_place(guard.kind == "valid", guard.index, len(self.since))
        if not self.since[place] <= self.scalars.time:
            self.since[place] = self.scalars.time
            self.scalars.below_rounding += 1

    def _since(self) -> tuple[tuple[int, float], ...]:
        """Surfaces that have been below their rounding, and since when [s]; -1 for an expression of the model's end."""
        surfaces = len(self.integrator.system.surfaces)
        return tuple((i if i < surfaces else -1, t) for i, t in enumerate(self.since.tolist()) if t < math.inf)

    def _set_known_zeros(self, mode: Mode, zeros: Sequence[int]) -> None:
        """Set the known zeros of the present mode's guards, given in the order of its equations."""
        for g, place in enumerate(self.integrator.mode_table.places(mode)):
            self.known_zeros[g] = zeros[place] if place >= 0 else 0

    def _change_mode(
        self,
        decision: Decision,
        zeros: Sequence[int],
        tangential: Sequence[int],
        applied: Sequence[tuple[int, Sequence[float]]] = (),
    ) -> tuple[Status, str] | None:
        """Go over to the mode that follows.

        ``tangential``: surfaces at zero, told of where none changes its sign; ``applied``: those that have reset the
        state, in order, each with the state that its map has left.
        """
        if decision.mode is None:
            return decision.ending, decision.reason
        before, source = self.mode, self.row
        row = self.integrator.mode_table.row(decision.mode)
        if row is None:
            return self._without_equations()
        self.row = row
        self._set_known_zeros(decision.mode, zeros)
        if applied:
            changed = rows_at(before, decision.mode, [i for i, _ in applied])
        else:
            changed = [(i, None) for i, s in enumerate(decision.mode) if s != before[i]]
        for i, place in changed:
            if place is None:
                self._record(KINDS.index(transition_kind(before[i], decision.mode[i])), i, source, row, side=before[i])
            else:
                self._record(RESET, i, source, row, side=1, state=applied[place][1])
        for i in () if changed else tangential:
            self._record(KINDS.index(transition_kind(before[i], decision.mode[i])), i, source, row, side=0)
        return ending_of(self, kernel.EVENTS_ACCUMULATE) if kernel.events_accumulate(self.workspace.run) else None

    def _without_equations(self) -> tuple[Status, str]:
        return "failed", f"the mode after t = {self.time:.17g} has no equations"

    def _jump(self, surfaces: tuple[int, ...], hits: Sequence[Guard]) -> tuple[Status, str] | None:
        """Let the state jump where surfaces reset it, ``hits`` being all guards at zero; None if the run goes on."""
        self._count("jumps")
        state = list(zip(self.x.tolist(), self.x_low.tolist(), strict=True))
        time = float(self.scalars.time), float(self.scalars.time_low)
        until, until_low = self.until
        most = REMAINING * (until - self.start.time[0])
        after = self.start.constants.jumps.after(surfaces, hits, self.mode, time, state, most)
        self.before_jump[:] = self.x
        self._put(time, after.state)
        self.scalars.more_digits = 0
        if not all(abs(high) < LEVELS.blown_up for high, _ in after.state):
            return ending_of(self, kernel.DIVERGED)
        ended, rest = self._change_mode(after.decision, after.known_zeros, (), after.applied), after.rest
        if ended is not None or rest is None:
            return ended
        length = (rest.time[0] - time[0]) + (rest.time[1] - time[1])
        self._keep_line(length, [high for high, _ in rest.state])
        late = (until - rest.time[0]) + (until_low - rest.time[1]) < 0.0
        self._put((until, until_low) if late else rest.time, rest.state)
        return None if late else self._change_mode(rest.decision, rest.known_zeros, ())

    def _pass_branch_point(self) -> bool:
        """Go on behind a branch point of a guard; False where there is none, the model ends, or it is not clear."""
        scalars = self.scalars
        code = self.integrator.mode_table.codes[int(scalars.mode)]
        if not code.guards_branch_alone or self._passed_at == scalars.steps or vanishing_guard(self) is not None:
            return False
        from henon_ref.integrator.guard_branch_point import behind_branch_point

        until, until_low = self.until
        behind = behind_branch_point(
            self.start.constants.precise,
            self.mode,
            (float(scalars.time), float(scalars.time_low)),
            list(zip(self.x.tolist(), self.x_low.tolist(), strict=True)),
            until - self.start.time[0],
            (until - float(scalars.time)) + (until_low - float(scalars.time_low)),
        )
        if behind is None:
            return False
        self._count("branch_points")
        end = [high for high, _ in behind.state]
        self._keep_line(behind.length, end)
        self._fill_samples_on_line(behind.length, end)
        self._put(behind.time, behind.state)
        self.known_zeros[:] = 0
        scalars.steps += 1
        scalars.unit, scalars.longest_step, scalars.stalled = behind.length, 1e3 * behind.length, 0
        self._passed_at = int(scalars.steps)
        return True

    def _close_to_horizon(self) -> bool:
        """Ask for a step to the horizon in multiprecision, where so little is left that double precision cannot tell.

        Over a time that moves guards by less than the states' rounding nothing confirms a step there.
        """
        scalars, (until, until_low) = self.scalars, self.until
        left = (until - float(scalars.time)) + (until_low - float(scalars.time_low))
        if not (self.guards and left <= CLOSE_PART * abs(until)):
            return False
        scalars.suspect = scalars.step_length = left
        scalars.guard, scalars.stalled = kernel.NOWHERE, 0
        return True

    def _record(
        self, kind: int, surface: int, source: int, target: int, *, side: int, state: Sequence[float] | None = None
    ) -> None:
        """Write a transition down, at a state other than the run's where one is given."""
        if self.scalars.below_rounding and self.since[surface] <= self.scalars.time:
            return
        if self.scalars.transitions >= self.scalars.transition_capacity:
            self._close_block()
        scalars = self.scalars
        row, last = self.workspace.transitions[scalars.transitions], TRANSITION_PLACES + self.x.size
        row[TRANSITION_PLACES:last] = self.x if state is None else state
        made, contacts = row[:TRANSITION_PLACES].view(TRANSITION)[0], self.integrator.mode_table.contacts
        made["time"], made["time_low"] = scalars.time, scalars.time_low
        made["kind"], made["surface"], made["landing"] = kind, surface, scalars.landing
        if contacts:
            made["from_mode"] = made["to_mode"] = 0
            row[last:].view(np.int64)[:] = [*written(source, contacts), *written(target, contacts)]
        else:
            made["from_mode"], made["to_mode"] = source, target
        scalars.transitions += 1
        ends_here = scalars.stop_falling if side > 0 else scalars.stop_rising if side < 0 else 0
        scalars.stopped |= int(ends_here) >> surface & 1

    def _enter_new_mode(self) -> tuple[Status, str] | None:
        """Compile the mode that an event leads to; the loop goes through the event anew."""
        mode, hit, what = self.mode, int(self.scalars.guard), int(self.scalars.pending_kind)
        number = int(self.scalars.pending_mode)
        if number >= 0:
            if self.integrator.mode_table.row(numbered_mode(number, len(mode))) is not None:
                self._count("new_modes")
                return None
            self.scalars.event_pending = 0
            return self._without_equations() if what == RESET else self._select_mode()
        entry = 0 if what == STICK else self.integrator.mode_table.guards(mode)[hit].to_sign
        if self._compiled_behind(mode, hit, entry):
            return None
        return self._select_mode()  # there is no such mode, or zeros have to be measured

    def _compiled_behind(self, mode: Mode, hit: int, entry: int) -> bool:
        """Whether the loop can now be led to the mode behind a guard: it then goes through the event anew."""
        mode_table, row = self.integrator.mode_table, int(self.scalars.mode)
        guard = mode_table.guards(mode)[hit]
        if mode_table.row(replaced(mode, guard.index, entry)) is None or mode_table.leads_to(row, hit, entry) < 0:
            return False
        self._count("new_modes")
        if guard.kind == "surface":
            self.scalars.expansions -= 1  # its normal velocities are counted anew
        self.scalars.event_pending = 1
        return True

    def _select_mode(self) -> tuple[Status, str] | None:
        """Settle an event that signs alone do not decide; None if the run goes on."""
        before = self.mode
        hits: list[Guard] = [g for g, hit in zip(self.guards, self.hits, strict=False) if hit]
        if surfaces := resetting(self.integrator.system, before, hits):
            return self._jump(surfaces, hits)
        if self._misses_stick(hits):
            return None
        at = self.start.constants.in_doubles.at(self.time, self.x.tolist())
        decision = after_event(at, before, hits)
        seen = decision.mode is not None and self.integrator.mode_table.known(decision.mode) is not None
        self._count("mode_selections" if seen else "new_modes")
        if decision.mode is None:
            return decision.ending, decision.reason
        early = self.scalars.guard == kernel.NOWHERE
        # Where no step was taken, surfaces left a moment ago are still as good as touched.
        fresh = {g.index for g, zeros in zip(self.guards, self.known_zeros, strict=False) if zeros and early}
        moved = {g.index for g in hits} | {i for i, s in enumerate(decision.mode) if s != before[i]}
        slides = [i for i, s in enumerate(decision.mode) if s == 0 or before[i] == 0]
        active = fresh | self.integrator.system.in_play(moved, slides)
        orders = contact_orders(at, decision.mode, active)
        tangential = [] if early else sorted({g.index for g in hits if g.kind == "surface"})
        return self._change_mode(decision, orders, tangential)

    def _misses_stick(self, hits: Sequence[Guard]) -> bool:
        """Whether the loop wants the mode in which a contact is held, to see whether it is, and now goes on with it."""
        hit = int(self.scalars.guard)
        if len(hits) != 1 or hit == kernel.NOWHERE or self.integrator.mode_table.contacts:
            return False
        guard = self.integrator.mode_table.compiled.records["guards"][int(self.scalars.mode), hit]
        missing = guard["hold_zone"] and not guard["coupled"] and guard["mode_stuck"] < 0
        return bool(missing) and self._compiled_behind(self.mode, hit, 0)
