"""What is watched beside the events of a run.

How it ends before its horizon: blow-up, a field that ends, a model that ends, events that accumulate. And surfaces that
come close without being reached.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from flint import arb

from henon_ref.harness.truth.multiprecision.numbers import to_ball
from henon_ref.harness.truth.multiprecision.stepper import Step
from henon_ref.harness.truth.reference import NearGraze
from henon_ref.modes.equations import Guard
from henon_ref.trajectory import Status

HUGE = 1e100
"""A state beyond this has blown up."""
RESOLUTION = 2.0**-53
"""Events closer together than this part of the run are crowded."""
CROWD = 16
"""Crowded events in a row before transitions count as accumulating."""
CYCLE = 4
"""Gaps between crowded events fall geometrically from one to the next so many later (or a divisor of it)."""
GRAZE_DISTANCE, GRAZE_FACTOR = 1e-3, 0.1
"""A surface that is approached so closely is noted, and again where it is as much closer."""
MEMORY = 24
"""Steps looked back on to tell a blow-up (increments last) from a field that ends (they fade)."""


class EndedError(Exception):
    """The run is over before its horizon.

    Parameters
    ----------
    status : Status
    reason : str
    time : arb, optional
        Where it ends [s], if not where the run has got to.
    accumulates : bool
        There are infinitely many more events before that time.
    """

    def __init__(self, status: Status, reason: str, time: arb | None = None, *, accumulates: bool = False) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason
        self.time = time
        self.accumulates = accumulates


class Termination:
    """Watches one run for an early end.

    Parameters
    ----------
    span : float
        Length of the run [s].
    bits : int
        Precision; a step shorter than ``2**(-bits / 2)`` of the run has met a singularity.
    """

    def __init__(self, span: float, bits: int) -> None:
        self.span = span
        self.shortest = 2.0 ** (-bits // 2) * span
        self._increments: deque[float] = deque(maxlen=MEMORY)
        self._crowded = 0

    def event(self, times: Sequence[arb]) -> None:
        """Look at the times of the latest events (the last ``CROWD`` will do), the new one included.

        Raises
        ------
        EndedError
            Where events accumulate (Zeno); the limit is that of a geometric sequence.
        """
        self._increments.clear()
        if len(times) < 3 or float(times[-1] - times[-2]) > RESOLUTION * max(abs(float(times[-1])), self.span):
            self._crowded = 0
            return
        self._crowded += 1
        if self._crowded < CROWD:
            return
        first, second = times[-1 - CYCLE] - times[-1 - 2 * CYCLE], times[-1] - times[-1 - CYCLE]
        limit = (times[-1] + second**2 / (first - second) if second < first else times[-1]).mid()
        raise EndedError("failed", f"transitions accumulate at t = {written(limit)}", limit, accumulates=True)

    def step(self, step: Step, states: int, guards: Sequence[Guard], room: arb) -> None:
        """Look at a step without an event.

        Parameters
        ----------
        states : int
            How many rows of the step's coefficients are states; the guards' follow.
        room : arb
            Time left to the horizon [s].

        Raises
        ------
        EndedError
            Where the solution, or what its events are told from, does not go on.
        """
        rough = step.rough[:states]
        if np.abs(rough).max() > HUGE:
            raise EndedError("diverged", f"the state leaves every bound at t = {written(to_ball(step.time))}")
        self._increments.append(float(np.abs(rough[:, 1:].sum(axis=1)).max()))
        if float(step.length) > self.shortest or room < self.shortest:
            return
        row, ahead = step.rough[np.abs(step.rough[:, -1]).argmax()], 1.0
        if row[-1] and np.isfinite(row[-2] / row[-1]):  # the ratio test says how far the singularity is
            ahead = float(row[-2] / row[-1])
        limit = (to_ball(step.time) + arb(ahead) * to_ball(step.length)).mid()
        for guard, row in zip(guards, step.rough[states:], strict=True):
            if guard.kind == "valid" and row[0] + row[1] * ahead < 0.25 * row[0]:
                raise EndedError(
                    "invalid", f"the model ends: {guard.expression} fell to 0 at t = {written(limit)}", limit
                )
        if len(self._increments) == MEMORY and self._increments[-1] > 0.5 * self._increments[0]:
            raise EndedError("diverged", f"the state leaves every bound at t = {written(limit)}", limit)
        raise EndedError("failed", f"the field is singular at t = {written(limit)}: the solution ends there", limit)


class Approaches:
    """Surfaces that come closer for as long as a mode lasts.

    Parameters
    ----------
    found : list of NearGraze
        They are added to it as the mode ends.
    """

    def __init__(self, found: list[NearGraze]) -> None:
        self._found = found
        self._of: dict[int, list[NearGraze]] = {}
        """By surface, how close it has come since the mode began, as long as it comes no farther."""

    def step(self, end: float, values: Iterable[tuple[int, float]]) -> None:
        """Note how close surfaces are behind a step without an event: (surface, its value) of each."""
        for surface, value in values:
            distance, known = abs(value), self._of.setdefault(surface, [])
            while known and known[-1].distance <= distance:
                known.pop()
            if distance <= GRAZE_DISTANCE and (not known or distance <= GRAZE_FACTOR * known[-1].distance):
                known.append(NearGraze(end, surface, distance, lasts=True))

    def keep(self) -> None:
        """The mode ends."""
        self._found += [graze for known in self._of.values() for graze in known]
        self._of.clear()


def written(time: arb) -> str:
    """A time as reasons write it."""
    return str(time.mid().str(17, radius=False))
