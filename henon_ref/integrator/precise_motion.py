"""The motion from a run's start in multiprecision: more digits than doubles have kept of a state."""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb

from henon_ref.integrator.precise_modes import MOST_ORDER, PreciseModes
from henon_ref.modes.mode import Mode
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS

MOST_STEPS = 1000
"""Steps after which no more are taken: some seconds."""
SHORTEST_PART = 2.0**-20
"""Part of the length asked for that a step may be shortened to."""
SAME = 1e-2
"""Part of its size by which a double may be off the motion, for errors to have grown by no more than they seem to."""
START_ROUNDING = 2.0**-52
"""What two doubles lose of a number, to what one does; and so of what comes of it."""
Pair = tuple[float, float]
"""A number as its double and what that leaves."""


class PreciseMotion:
    """The motion of one mode from a point on, which is known to two doubles or exactly.

    Parameters
    ----------
    modes : PreciseModes
    mode : Mode
    time : Pair
        [s]
    state : sequence of Pair
        Taken as exact where what the doubles leave is 0 in all of them.
    """

    def __init__(self, modes: PreciseModes, mode: Mode, time: Pair, state: Sequence[Pair]) -> None:
        self._modes, self._mode, self._steps = modes, mode, 0
        self._exact = all(low == 0.0 for _, low in (time, *state))
        with working_precision(BITS):
            self._time, self._state = arb(time[0]) + arb(time[1]), [arb(high) + arb(low) for high, low in state]

    def at(self, time: Pair, near: Sequence[float], length: float) -> tuple[list[arb], list[float]] | None:
        """The state at a later time, and what each entry may be off; None where it is not to be had.

        Parameters
        ----------
        time : Pair
            [s]
        near : sequence of float
            The state there in doubles.
        length : float
            A step to begin with [s].
        """
        with working_precision(BITS):
            if not self._advance(arb(time[0]) + arb(time[1]), length):
                return None
            off = [abs(float(own - x)) for own, x in zip(self._state, near, strict=True)]
        sizes = [abs(x) for x in near]
        if not all(error <= SAME * max(size, SAME * max(sizes)) for error, size in zip(off, sizes, strict=True)):
            return None
        if self._exact:
            return list(self._state), [0.0] * len(off)
        return list(self._state), [START_ROUNDING * error for error in off]

    def _advance(self, time: arb, length: float) -> bool:
        """Go on to a time; False where that takes too many steps."""
        part = 1.0
        while self._time < time:
            if self._steps >= MOST_STEPS or part < SHORTEST_PART:
                return False
            self._steps += 1
            left = time - self._time
            unit = left if left <= part * length else arb(part * length)
            states, outputs, whole = self._modes.expand(self._mode, self._time, self._state, unit)
            if not whole and len(outputs[0]) > MOST_ORDER:  # not converged
                part /= 2
                continue
            self._state = [series(arb(1)).mid() for series in states]
            self._time = time if unit is left else (self._time + unit).mid()
        return True
