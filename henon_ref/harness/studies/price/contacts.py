"""Many contacts: a run that enters new modes, the same run again, and SciPy with the signs as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from henon_ref.harness.campaign.timing import timed
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.price.states import chain
from henon_ref.harness.table import Table, duration
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution

BLOCKS = (4, 8, 16, 64)
BELT = 0.5
"""Velocity of the belt [m/s]."""
UNTIL = 20.0
"""Horizon of all runs [s]."""
RTOL = 1e-9
READY = 1e-6
"""Horizon of the run that prepares a system [s]: it has only the initial mode."""
LIFT = 1e-12
"""Sliding velocity that SciPy's loop gives to a released block [m/s]."""
AGREED = 1e-6
"""Largest difference of transition times [s] at which SciPy's wall time is reported."""


@dataclass(frozen=True)
class ManyContacts(Row):
    """Measurement of a chain with a random initial state."""

    blocks: int
    transitions: int
    new_s: float
    """Wall time of the first run, with only its initial mode prepared [s]."""
    again_s: float
    """Median wall time of five further runs [s]."""
    by_hand_s: float | None
    """Wall time of a loop over SciPy's DOP853 [s]; None if its transitions differ."""


def many_contacts(blocks: Sequence[int] = BLOCKS) -> list[ManyContacts]:
    """Measure chains with these numbers of blocks."""
    return [_measured(count) for count in blocks]


def _measured(blocks: int) -> ManyContacts:
    system = chain(blocks, BELT)
    x, v = np.random.default_rng(blocks).uniform(-1, 1, (2, blocks)).round(3)

    def run(until: float = UNTIL) -> Solution:
        start = np.column_stack([2 * x, v]).ravel().tolist()
        return simulate(system, start, until=until, rtol=RTOL, dense_output=False)

    run(READY)
    new, *again = (timed(run) for _ in range(6))
    exact = run().transitions["time_s"].to_numpy()
    times: list[float] = []
    by_hand = timed(lambda: times.extend(switching_by_hand(2 * x, v)))
    agrees = len(times) == len(exact) and bool(np.abs(exact - times).max() <= AGREED)
    return ManyContacts(blocks, len(exact), new, median(again), by_hand if agrees else None)


def switching_by_hand(x: NDArray[np.float64], v: NDArray[np.float64]) -> list[float]:
    """Transition times of the chain [s] by ``solve_ivp`` with one right-hand side for all modes.

    A block has the sign -1 or 1 in slip, and 0 in stick.
    """
    count = len(x)
    between = 1.2 * (np.diag([2.0] * count) - np.eye(count, k=1) - np.eye(count, k=-1))
    between[[0, -1], [0, -1]] = 1.2
    stiffness = np.eye(count) + between
    signs, t, y, times = np.sign(v - BELT), 0.0, np.concatenate([x, v]), []

    def field(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        slip = y[count:] - BELT
        return np.concatenate([y[count:], (signs != 0) * (-stiffness @ y[:count] - signs / (1 + 3 * signs * slip))])

    def guard(i: int):  # type: ignore[no-untyped-def]
        def value(t: float, y: NDArray[np.float64]) -> float:
            """Positive while the block slides in its direction, or sticks."""
            return signs[i] * (y[count + i] - BELT) if signs[i] else 1 - abs(stiffness[i] @ y[:count])

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    guards = [guard(i) for i in range(count)]
    while t < UNTIL:
        run = solve_ivp(field, (t, UNTIL), y, "DOP853", events=guards, rtol=RTOL, atol=RTOL)
        t, y = run.t[-1], run.y[:, -1]
        for i in (i for i, own in enumerate(run.t_events) if own.size):
            pull = -stiffness[i] @ y[:count]
            signs[i] = np.sign(pull) if signs[i] == 0 or abs(pull) > 1 else 0
            y[count + i] = BELT + signs[i] * LIFT  # otherwise the contact would stick again at once
            times.append(t)
    return times


def contact_table(found: Sequence[ManyContacts]) -> Table:
    """Table of transitions and times over the number of blocks."""
    headings = ("blocks", "transitions", "first run", "second run", "SciPy DOP853 by hand")
    lines = []
    for own in found:
        by_hand = "other result" if own.by_hand_s is None else duration(own.by_hand_s)
        lines.append((f"{own.blocks}", f"{own.transitions}", duration(own.new_s), duration(own.again_s), by_hand))
    return Table(headings, "rrrrr", lines)
