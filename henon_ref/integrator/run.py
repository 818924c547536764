"""One run from Python: call the compiled mode loop, handle its return codes, and end the run.

The loop (``kernel/loop.c``) integrates one mode after another while double precision decides the next mode. It returns
a code if double precision does not decide, a mode has no machine code yet, or the run ends. :mod:`mode_changes
<henon_ref.integrator.mode_changes>` handles the codes after which the run continues.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.constants import LoopData
from henon_ref.integrator.integrator import NO_LIMIT, Integrator, Start, local_error, order_for, out_of_steps
from henon_ref.integrator.records import numbered, step_dtype
from henon_ref.integrator.run_result import Reason, RunResult, TransitionArray, shown
from henon_ref.integrator.state_view import MOST_KEPT, NO_DECISIONS, NO_SAMPLES, State
from henon_ref.jit.processor_time import Deadline
from henon_ref.kernel.library import kernel
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Status, Trajectory, Transition

_whole_run, _loop, _HORIZON = kernel.whole_run, kernel.advance, kernel.HORIZON  # a library's names take longer to find
_WITHOUT_DECISION = frozenset({_HORIZON, kernel.STOPPED, kernel.BLOCK_FULL, kernel.STEPS_FULL, kernel.BUDGET_SPENT})


def run_to_horizon(
    integrator: Integrator,
    start: Start,
    sample_times: NDArray[np.float64] | None = None,
    deadline: float | None = None,
    kinked: FilippovSystem | None = None,
) -> Trajectory:
    """Run to the horizon, or to an earlier end; leave out transitions on hidden kinks of the system ``kinked``.

    Most runs end in one call of the loop. They need no :class:`Run`, which costs as much as a short run itself.
    """
    if sample_times is not None:
        return shown(Run(integrator, start, sample_times, deadline).to_horizon(), kinked)
    if start.refused is not None:
        return shown(start.refused, kinked)
    try:  # as Integrator.workspace, whose call would cost some percent of a short run
        workspace = integrator.free.pop()
    except IndexError:
        workspace = integrator.workspace()
    data = start.constants.latest  # kept until the loop returns, because another thread may replace it
    code = _whole_run(workspace.run, start.scalars, data.tables)
    if code == _HORIZON:  # all modes of the run are in the data
        end: Trajectory = RunResult(integrator.mode_table, workspace, kinked)
        integrator.free.append(workspace)
    else:
        end = shown(Run(integrator, start, deadline=deadline, begun=workspace).to_horizon(code), kinked)
        _loop_data(integrator, start)  # later runs may need the modes compiled in this one
    return end


def prepared_run(
    problem: Problem,
    *,
    rtol: float,
    landing: int = kernel.HENON,
    sample_times: NDArray[np.float64] | None = None,
    deadline: float | None = None,
) -> Callable[[], Trajectory]:
    """Compile a problem, decide its start, and return a function that does the entire run at each call.

    ``rtol``: tolerance; the local error of a step is a tenth of it (:func:`local_error`). ``landing``: index of
    :data:`henon_ref.integrator.records.LANDINGS`. ``sample_times``, ``deadline``: see :class:`State`.
    """
    error = local_error(rtol)
    integrator = Integrator(problem.system, order_for(error))
    # The deadline, not a number of steps, limits the run.
    start = integrator.start(problem, tolerance=error, landing=landing, most_steps=NO_LIMIT)
    kinked = problem.system if problem.system.kinks else None
    return partial(run_to_horizon, integrator, start, sample_times, deadline, kinked)


def _loop_data(integrator: Integrator, start: Start) -> LoopData:
    """Return the data of all modes that have been compiled; the caller keeps them until the loop returns, because
    another thread may replace them.
    """
    data = start.constants.latest
    return data if data.compiled is integrator.mode_table.compiled else start.constants.update()


def _out_of_memory(time: float) -> str:
    """Return the reason of a run that ends at its limit on memory."""
    return (
        f"stopped at t = {time:.17g}: the transitions and steps of the run take {MOST_KEPT / 2**30:g} GiB, the most "
        "that is kept; give an earlier horizon or dense_output=False, or read the transitions from henon_ref.stream"
    )


class Jumped(NamedTuple):
    """Jump of the state."""

    surfaces: tuple[int, ...]
    """Surfaces whose resets were applied, in order."""
    time: float
    """Time [s]."""
    before: tuple[float, ...]
    """State before the jump."""
    after: tuple[float, ...]
    """State after the jump."""
    mode: Mode
    """Mode before the jump."""


class Run(State):
    """One run: calls the compiled loop until the horizon, and handles its return codes.

    :meth:`to_horizon` runs to the horizon; :meth:`next_event` stops after each transition, so that the caller may read
    and change :attr:`x` there (for example, for variational equations) before the run continues.
    """

    @property
    def steps(self) -> NDArray[Any]:
        """Kept steps so far, shape (k,) of :func:`.records.step_dtype`, in order of time.

        The polynomial of a step holds from its time over its length, up to the next step or an event.
        """
        kept = self.step_blocks if self._steps is None else [*self.step_blocks, self._steps[: self.scalars.dense_steps]]
        kind = step_dtype(len(self.start.x), self.scalars.order)
        return np.concatenate(kept).view(kind)[:, 0] if kept else np.zeros(0, dtype=kind)

    def go_back(self, state: NDArray[np.float64]) -> None:
        """Return to an earlier :attr:`state`; transitions and steps since then are invalid."""
        self.state[:] = state
        self.passed_at = -1

    def to_horizon(self, code: int | None = None) -> Trajectory:
        """Run to the horizon, or to an earlier end of the run. ``code``: of the last call of the loop, if any."""
        end = self._advance() if code is None else self._answered(code)
        if end is not None:  # most runs are short and need no clock
            return end
        deadline = Deadline(self.deadline)
        while (end := self._advance()) is None:
            if deadline.passed():
                return self._end("timeout", f"stopped after {self.deadline:g} s at t = {self.time:.17g}")
        return end

    def stream(self) -> Iterator[TransitionArray]:
        """Run to the horizon and yield the transitions in blocks, so that memory does not grow with the run.

        Afterwards :attr:`ended` is the result; its transitions are those of the last block.
        """
        while (end := self._advance()) is None:
            for records in self.blocks:
                yield self._array(records)
            self.blocks.clear()
        self.ended = end
        if end.transitions:
            yield cast(TransitionArray, end.transitions)

    def next_event(self) -> Transition | Trajectory:
        """Run to the next transition and return it; if the run ends before, return the trajectory."""
        self.blocks.clear()  # transitions returned before
        self.scalars.transitions = 0
        if self.scalars.steps > 0:  # the caller may have changed the state
            self.scalars.more_digits = 0
        while (end := self._advance(stop=True)) is None:
            if self.scalars.transitions:
                last = slice(self.scalars.transitions - 1, self.scalars.transitions)
                return self._array(self.workspace.transitions[last])[0]
        return end

    def last_jump(self) -> Jumped | None:
        """Return the jump at the last event of :meth:`next_event`; None if the state did not jump there."""
        records = np.concatenate([*self.blocks, self.workspace.transitions[: self.scalars.transitions]])
        resets = [t for t in self._array(records) if t.kind == "reset"]
        if not resets:
            return None
        surfaces, before = tuple(t.surface for t in resets), tuple(self.before_jump.tolist())
        return Jumped(surfaces, resets[0].time, before, resets[-1].state, resets[0].from_mode)

    def _advance(self, *, stop: bool = False) -> Trajectory | None:
        """Call the compiled loop once and handle its return code; None if the run continues."""
        refused = self.start.refused
        if refused is not None:
            unasked = self.samples is NO_SAMPLES
            return refused if unasked else refused._replace(samples=self._sampled_states(), sample_modes=())
        data = _loop_data(self.integrator, self.start)
        return self._answered(_loop(self.scalars, data.tables, self._sampled, len(self.samples)), stop=stop)

    def _answered(self, code: int, *, stop: bool = False) -> Trajectory | None:
        """Handle a return code of the loop; None if the run continues."""
        if code not in _WITHOUT_DECISION:
            from henon_ref.integrator.mode_changes import answered  # most runs do not need it

            ending = answered(self, code)
            return None if ending is None else self._end(*ending)
        if code == kernel.HORIZON or code == kernel.STOPPED:
            return self._end("ok", "")
        if code == kernel.BLOCK_FULL and not stop:
            self.close_block()
        elif code == kernel.STEPS_FULL:
            self.close_steps()
        elif code == kernel.BUDGET_SPENT and self.scalars.steps >= self.scalars.most_steps:
            return self._end("failed", out_of_steps(self.scalars.most_steps, self.time))
        if self.memory_full():
            return self._end("failed", _out_of_memory(self.time))
        return None

    def _array(self, records: NDArray[np.float64]) -> TransitionArray:
        table = self.integrator.mode_table
        return TransitionArray(records, table.modes, table.contacts)

    def _sampled_states(self) -> NDArray[np.float64]:
        return self.samples[:, 1 : 1 + len(self.start.x)]

    def _sampled_modes(self) -> tuple[Mode, ...]:
        table, found = self.integrator.mode_table, self.samples[: self.scalars.next_sample, 1 + len(self.start.x) :]
        if not table.contacts:
            return tuple(table.modes[int(row)] for row in found[:, 0])
        modes, places = numbered(np.ascontiguousarray(found).view(np.int64), table.contacts)
        return tuple(modes[place] for place in places)

    def _end(self, status: Status, reason: Reason) -> Trajectory:
        if status == "ok" and self.scalars.stopped:
            name = self.integrator.system.sign_names[self.scalars.stopped - 1]
            reason = f"the run stopped at a transition of the surface of {name}, as requested"
        end: Trajectory = RunResult(self.integrator.mode_table, self.workspace, None, status, reason)
        if self.decisions is not NO_DECISIONS:
            end.counts.decisions = self.decisions
        if self.blocks:
            self.close_block()
            end = end._replace(transitions=self._array(np.concatenate(self.blocks)))
        if self.samples is not NO_SAMPLES:
            end = end._replace(samples=self._sampled_states(), sample_modes=self._sampled_modes())
        return end
