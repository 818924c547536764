"""Ends of a run before its horizon, and near grazes.

A run ends early by a blow-up, a singularity of the field, the end of the model, or accumulating events. Near grazes are
surfaces that come close without being reached.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from flint import arb

from henon_ref.harness.truth.multiprecision.stepper import Step
from henon_ref.harness.truth.reference import NearGraze, to_ball
from henon_ref.modes.equations import Guard
from henon_ref.trajectory import Status

CROWD = 16
"""Number of successive crowded events from which on transitions count as accumulating."""
CYCLE = 4
"""Number of events, a multiple of a cycle's, after which the gaps between crowded events shrink by one factor."""
STEPS_COMPARED = 24
"""Number of steps compared to distinguish a blow-up (increments persist) from a singular field (they decrease)."""


class EndedError(Exception):
    """The run ends before its horizon.

    ``time``: end of the run [s], if it is not the time that the run has reached. ``accumulates``: infinitely many
    further events are before that time.
    """

    def __init__(self, status: Status, reason: str, time: arb | None = None, *, accumulates: bool = False) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason
        self.time = time
        self.accumulates = accumulates


class Termination:
    """Detector of an early end of one run of length ``span`` [s].

    A step shorter than ``2**(-bits / 2)`` of the run indicates a singularity.
    """

    def __init__(self, span: float, bits: int) -> None:
        self.span = span
        self.shortest = 2.0 ** (-bits // 2) * span
        self._increments: deque[float] = deque(maxlen=STEPS_COMPARED)
        self._crowded = 0

    def event(self, times: Sequence[arb]) -> None:
        """Check the times of the latest events (the last ``CROWD`` are enough), including the new event.

        EndedError if events accumulate (Zeno); their limit is extrapolated by Aitken's delta-squared process.
        """
        self._increments.clear()
        if len(times) < 3 or float(times[-1] - times[-2]) > 2.0**-53 * max(abs(float(times[-1])), self.span):
            self._crowded = 0
            return
        self._crowded += 1
        if self._crowded < CROWD:
            return
        first, second = times[-1 - CYCLE] - times[-1 - 2 * CYCLE], times[-1] - times[-1 - CYCLE]
        limit = (times[-1] + second**2 / (first - second) if second < first else times[-1]).mid()
        raise EndedError("failed", f"transitions accumulate at t = {written(limit)}", limit, accumulates=True)

    def step(self, step: Step, states: int, guards: Sequence[Guard], room: arb) -> None:
        """Check a step without an event; EndedError if the solution, or a function that its events depend on, ends.

        ``states``: number of states, the first rows of the step's coefficients; the guards' rows follow. ``room``: time
        left to the horizon [s].
        """
        rough = step.rough[:states]
        if np.abs(rough).max() > 1e100:
            raise EndedError("diverged", f"the state leaves every bound at t = {written(to_ball(step.time))}")
        self._increments.append(float(np.abs(rough[:, 1:].sum(axis=1)).max()))
        if float(step.length) > self.shortest or room < self.shortest:
            return
        row, ahead = step.rough[np.abs(step.rough[:, -1]).argmax()], 1.0
        if row[-1] and np.isfinite(row[-2] / row[-1]):  # distance to the singularity by the ratio test
            ahead = float(row[-2] / row[-1])
        limit = (to_ball(step.time) + arb(ahead) * to_ball(step.length)).mid()
        for guard, row in zip(guards, step.rough[states:], strict=True):
            if guard.kind == "valid" and row[0] + row[1] * ahead < 0.25 * row[0]:
                raise EndedError(
                    "invalid", f"the model ends: {guard.expression} fell to 0 at t = {written(limit)}", limit
                )
        if len(self._increments) == STEPS_COMPARED and self._increments[-1] > 0.5 * self._increments[0]:
            raise EndedError("diverged", f"the state leaves every bound at t = {written(limit)}", limit)
        raise EndedError("failed", f"the field is singular at t = {written(limit)}: the solution ends there", limit)


class Approaches:
    """Near grazes: surfaces that come closer during a mode without being reached; appended to a list when it ends."""

    def __init__(self, found: list[NearGraze]) -> None:
        self._found = found
        self._of: dict[int, list[NearGraze]] = {}
        """Closest approaches per surface since the mode began, in order of decreasing distance."""

    def step(self, end: float, values: Iterable[tuple[int, float]]) -> None:
        """Record the distances of surfaces after a step without an event, from pairs (surface, its value).

        Distances below 1e-3 are recorded, each at most a tenth of the one before.
        """
        for surface, value in values:
            distance, known = abs(value), self._of.setdefault(surface, [])
            while known and known[-1].distance <= distance:
                known.pop()
            if distance <= 1e-3 and (not known or distance <= 0.1 * known[-1].distance):
                known.append(NearGraze(end, surface, distance, lasts=True))

    def keep(self) -> None:
        """End the mode: move its near grazes to the list."""
        self._found += [graze for known in self._of.values() for graze in known]
        self._of.clear()


def written(time: arb) -> str:
    """Time as written in reasons."""
    return str(time.mid().str(17, radius=False))
