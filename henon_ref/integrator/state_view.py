"""Python view of a run's memory block, and the data that the run keeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from flint import arb
from numpy.typing import NDArray

from henon_ref.integrator.integrator import Integrator, Start
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.records import CHUNK, STATE_PLACE, STEP, STEP_PLACES, Workspace, read, words_of, written
from henon_ref.kernel.library import doubles, ffi
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Decisions, Trajectory

if TYPE_CHECKING:
    from henon_ref.integrator.precise_modes import PreciseMotion

NO_SAMPLES = np.zeros((0, 2))
NO_DECISIONS = Decisions()
MOST_KEPT = 2 * 2**30
"""Limit on the memory of the transitions and steps that a run keeps [bytes].

With n states a transition takes 8 (4 + n) bytes, and a step at order p, if steps are kept, 8 (5 + n (p + 1)) bytes. At
the end of the run they are copied into one array each.
"""


class State:
    """Memory block of a run, views of its parts, and the data that the run keeps.

    During its lifetime a run has a workspace of some 100 kB. (:class:`henon_ref.integrator.run.Run` has no ``__init__``
    of its own: a second call would cost a tenth of a short run.)

    ``sample_times``, shape (k,): increasing times at which the state is sampled [s]; ``deadline``: processor time,
    without compiling, after which the run stops with status ``timeout`` [s]; ``block``: number of transitions in one
    block of memory, at most CHUNK, 1 to stop at each transition; ``dense``: number of steps in one block of memory, for
    dense output, 0 if steps are not kept; ``begun``: memory of the run, if the loop has been called before.
    """

    def __init__(
        self,
        integrator: Integrator,
        start: Start,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
        block: int = CHUNK,
        dense: int = 0,
        begun: Workspace | None = None,
    ) -> None:
        self.workspace = workspace = begun or integrator.workspace()
        if begun is None:
            workspace.memory[:] = start.block
        self.integrator, self.start, self.deadline = integrator, start, deadline
        self.scalars, self.state = workspace.run, workspace.state
        if block != CHUNK:
            self.scalars.transition_capacity = block
        self.samples, self._sampled = NO_SAMPLES, ffi.NULL
        """Sample times, with the states and mode there; and a pointer to them."""
        if sample_times is not None:
            words = max(1, words_of(integrator.mode_table.contacts))
            self.samples = np.full((sample_times.size, 1 + len(start.x) + words), np.nan)
            self.samples[:, 0], self._sampled = sample_times, doubles(self.samples)
        self.blocks: list[NDArray[np.float64]] = []
        """Blocks of transitions that were moved out of the loop's memory."""
        self.step_blocks: list[NDArray[np.float64]] = []
        """Full blocks of steps: rows of :func:`henon_ref.integrator.records.step_dtype`, as doubles."""
        self._steps: NDArray[np.float64] | None = None
        """Current block of steps; None if steps are not kept."""
        self.passed_at = -1
        """Number of steps at the last branch point that was passed."""
        self.motion: PreciseMotion | None = None
        """Motion from the start in multiprecision, once it has been needed."""
        self.decisions = NO_DECISIONS
        """Number of calls of Python so far, by cause."""
        self.ended: Trajectory | None = None
        """Result of the run, after it has been streamed."""
        if dense:
            self._steps = np.empty((dense, STEP_PLACES + len(start.x) * (self.scalars.order + 1)))
            self.scalars.dense, self.scalars.dense_capacity = doubles(self._steps), dense

    def __del__(self) -> None:
        self.integrator.free.append(self.workspace)

    @property
    def guards(self) -> tuple[Guard, ...]:
        """Guards of the current mode, in the order of its row."""
        return self.integrator.mode_table.guards(self.mode)

    @property
    def mode(self) -> Mode:
        """Current mode."""
        return self.integrator.mode_table.mode(self.row)

    @property
    def row(self) -> int:
        """Row or number of the current mode (:meth:`henon_ref.integrator.mode_table.ModeTable.row`)."""
        return read(self.workspace.entries.tobytes()) if self.integrator.mode_table.contacts else int(self.scalars.mode)

    @row.setter
    def row(self, row: int) -> None:
        if not self.integrator.mode_table.contacts:
            self.scalars.mode = row
        elif row != self.row:
            self.workspace.entries[:] = written(row, self.integrator.mode_table.contacts)
            self.scalars.stepped_mode = -1  # makes the loop look up the mode

    @property
    def until(self) -> tuple[float, float]:
        """Horizon as a pair of doubles [s]; a later horizon may be set to continue the run."""
        return float(self.scalars.horizon), float(self.scalars.horizon_low)

    @until.setter
    def until(self, until: tuple[float, float]) -> None:
        self.scalars.horizon, self.scalars.horizon_low = until

    def _vector(self, k: int) -> NDArray[np.float64]:
        n = len(self.start.x)
        return self.state[STATE_PLACE + k * n : STATE_PLACE + (k + 1) * n]

    @property
    def x(self) -> NDArray[np.float64]:
        """View: current state, shape (n,)."""
        return self._vector(0)

    @property
    def x_low(self) -> NDArray[np.float64]:
        """View: remainder of the state's rounding; set it to 0 where ``x`` is changed."""
        return self._vector(1)

    @property
    def before_jump(self) -> NDArray[np.float64]:
        """View: state before the last jump, shape (n,)."""
        return self._vector(2)

    def _of_guards(self, k: int) -> NDArray[np.int64]:
        first, count = STATE_PLACE + 3 * len(self.start.x), self.scalars.guards
        return self.state[first + k * count : first + (k + 1) * count].view(np.int64)

    @property
    def known_zeros(self) -> NDArray[np.int64]:
        """View: number of known zeros of each guard at the current point."""
        return self._of_guards(0)

    @property
    def hits(self) -> NDArray[np.int64]:
        """View: 1 for each guard that is at zero."""
        return self._of_guards(1)

    @property
    def time(self) -> float:
        """Current time [s], rounded to double."""
        return float(self.scalars.time)

    @property
    def now(self) -> Pair:
        """Current time as a pair of doubles [s]."""
        return float(self.scalars.time), float(self.scalars.time_low)

    @property
    def exact_time(self) -> arb:
        """Current time as a ball [s]."""
        high, low = self.now
        return arb(high) + arb(low)

    def left(self, time: Pair) -> float:
        """Return the time left to the horizon [s]."""
        until, until_low = self.until
        return (until - time[0]) + (until_low - time[1])

    @property
    def exact_state(self) -> list[arb]:
        """Current state as balls."""
        return [arb(high) + arb(low) for high, low in zip(self.x.tolist(), self.x_low.tolist(), strict=True)]

    def count(self, cause: str) -> None:
        """Count a call of Python by its cause."""
        self.decisions = self.decisions._replace(**{cause: getattr(self.decisions, cause) + 1})

    def close_block(self) -> None:
        """Move the transitions out of the loop's memory."""
        self.blocks.append(self.workspace.transitions[: self.scalars.transitions].copy())
        self.scalars.transitions = 0

    def close_steps(self) -> None:
        """Keep a full block of steps, and start another block."""
        assert self._steps is not None
        self.step_blocks.append(self._steps[: self.scalars.dense_steps])
        self._steps = np.empty_like(self._steps)
        self.scalars.dense, self.scalars.dense_steps = doubles(self._steps), 0

    def memory_full(self) -> bool:
        """Check whether the blocks of transitions and steps have reached :data:`MOST_KEPT`."""
        steps = 0 if self._steps is None else len(self.step_blocks) * self._steps.nbytes
        return steps + len(self.blocks) * self.workspace.transitions.nbytes >= MOST_KEPT

    def keep_step(self, length: float) -> NDArray[np.float64] | None:
        """Keep a step that Python takes, such as the step to an event located in multiprecision.

        Returns a view of its coefficients; None if steps are not kept.
        """
        scalars, shape = self.scalars, (self.x.size, self.scalars.order + 1)
        if self._steps is None:
            return None
        if scalars.dense_steps >= scalars.dense_capacity:
            self.close_steps()
        row = self._steps[scalars.dense_steps]
        coefficients, step = row[STEP_PLACES:].reshape(shape), row[:STEP_PLACES].view(STEP)[0]
        coefficients[:] = self.workspace.band[: shape[0], : shape[1]]
        for name in ("time", "time_low", "unit", "mode"):
            step[name] = getattr(scalars, name)
        step["length"] = length
        scalars.dense_steps += 1
        return coefficients

    def keep_line(self, length: float, state: Sequence[float]) -> None:
        """Keep a step without a series as a straight line: accumulating impacts, or a branch point."""
        lines = self.keep_step(length) if length > 0.0 else None
        if lines is not None:
            lines[:, 0], lines[:, 2:] = self.x, 0.0
            lines[:, 1] = (np.asarray(state) - self.x) * (self.scalars.unit / length)

    def fill_samples_on_line(self, length: float, state: Sequence[float]) -> None:
        """Fill the samples on a step that is kept as a straight line."""
        scalars, samples, contacts = self.scalars, self.samples, self.integrator.mode_table.contacts
        while scalars.next_sample < len(samples):
            row = samples[scalars.next_sample]
            part = ((row[0] - scalars.time) - scalars.time_low) / length
            if part > 1.0:
                return
            states = slice(1, 1 + self.x.size)
            row[states] = self.x + max(part, 0.0) * (np.asarray(state) - self.x)
            if contacts:
                row[states.stop :].view(np.int64)[:] = self.workspace.entries
            else:
                row[-1] = scalars.mode
            scalars.next_sample += 1

    def put(self, time: Pair, state: Sequence[Pair]) -> None:
        """Set time and state."""
        self.scalars.time, self.scalars.time_low = time
        self.x[:] = [high for high, _ in state]
        self.x_low[:] = [low for _, low in state]
