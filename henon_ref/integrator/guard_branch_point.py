"""Past a branch point of a guard, which no power series of it leads over, where the motion itself is smooth.

A guard is only observed: nothing is integrated from it. Around the instant at which its series ends the states are
expanded in multiprecision, and all guards are looked at on both sides, ever closer to it. Where each of them keeps
its sign by much more than it varies there, nothing happens at the branch point, and the run goes on behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flint import arb, arb_poly

from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.precise_modes import PreciseModes
from henon_ref.modes.mode import Mode
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS

FARTHEST, NEARER, TRIES = 1e-5, 0.1, 5
"""Part of the run's length that is left behind at first; of that, in the next try; tries."""
ORDER = 16
"""Of the states' expansion, over so short a time."""
NEGLIGIBLE = 1e-40
"""Its last terms are no larger than this of all."""
SIDES = (1.0, 0.47, 0.22, 0.09, 0.03)
"""Where on either side the guards are looked at, in parts of what is left behind."""
CLEAR = 8.0
"""Size of a guard, at least, in units of its variation around the branch point."""


class Behind(NamedTuple):
    """A point behind a branch point."""

    length: float
    """From where the series ended [s]."""
    time: Pair
    """[s]."""
    state: tuple[Pair, ...]
    """State there."""


def behind_branch_point(
    modes: PreciseModes, mode: Mode, time: Pair, state: Sequence[Pair], span: float, left: float
) -> Behind | None:
    """A point of the same mode behind the branch point of a guard; None where something may happen next to it.

    Parameters
    ----------
    modes : PreciseModes
        Of a system whose field has no branch points in this mode.
    mode : Mode
    time, state
        Where no step leads on, which is next to the branch point.
    span : float
        Length of the whole run [s], the scale of what is left behind.
    left : float
        Time up to the horizon [s].
    """
    with working_precision(BITS):
        start, point = arb(time[0]) + arb(time[1]), [arb(high) + arb(low) for high, low in state]
        for k in range(TRIES):
            length = FARTHEST * NEARER**k * span
            if length < left and (end := _passed(modes, mode, start, point, arb(length))) is not None:
                return Behind(length, _split(start + arb(length)), tuple(map(_split, end)))
    return None


def _passed(modes: PreciseModes, mode: Mode, time: arb, state: Sequence[arb], length: arb) -> list[arb] | None:
    """The state after a time, if all guards keep their signs from as long before to then, by far."""
    motion, _ = modes.motion(mode, time, state, length, ORDER)
    if not all(_converged(series) for series in motion):
        return None
    states = [arb_poly(series) for series in motion]
    places = [arb(side * part) for part in SIDES for side in (-1, 1)]
    values = [modes.guard_values(mode, time + length * p, [series(p) for series in states]) for p in places]
    if not all(_clear([float(v) for v in guard]) for guard in zip(*values, strict=True)):
        return None
    return [series(arb(1)) for series in states]


def _converged(series: Sequence[arb]) -> bool:
    sizes = [abs(float(c)) for c in series]
    return max(sizes[-4:]) <= NEGLIGIBLE * sum(sizes)


def _clear(values: Sequence[float]) -> bool:
    """Whether values are of one sign and larger than they vary. (Not where one is no number.)"""
    variation = max(values) - min(values)
    return all(v > CLEAR * variation for v in values) or all(v < -CLEAR * variation for v in values)


def _split(number: arb) -> Pair:
    high = float(number)
    return high, float(number - high)
