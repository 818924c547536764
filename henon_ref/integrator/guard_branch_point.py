"""Continuation past a branch point of a guard at which the motion itself is smooth.

The power series of the guard does not converge past the branch point, but nothing is integrated from a guard. The
states are therefore expanded in multiprecision around this instant, and all guards are evaluated on both sides,
increasingly close to it. If each guard keeps its sign by a margin much larger than its variation, no event occurs at
the branch point, and the run continues after it.
"""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb, arb_poly

from henon_ref.integrator.endings import vanishing_guard
from henon_ref.integrator.precise_modes import PreciseModes, split
from henon_ref.integrator.state_view import State
from henon_ref.modes.mode import Mode
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS

FARTHEST, NEARER, TRIES = 1e-5, 0.1, 5
"""First distance to continue past the branch point, relative to the run's length; its factor per try; tries."""
ORDER = 16
"""Order of the states' expansion over this short time."""
NEGLIGIBLE = 1e-40
"""Largest size of the last terms relative to the sum of all terms."""
SIDES = (1.0, 0.47, 0.22, 0.09, 0.03)
"""Distances from the branch point at which the guards are evaluated on both sides, relative to that distance."""
CLEAR = 8.0
"""Smallest size of a guard in units of its variation around the branch point."""


def pass_branch_point(run: State) -> bool:
    """Continue the run past a branch point of a guard.

    The run has stalled next to the branch point. Returns False if there is no branch point, the model ends there, or
    the signs of the guards are not clear.
    """
    scalars = run.scalars
    code = run.integrator.mode_table.codes[int(scalars.mode)]
    if not code.guards_branch_alone or run.passed_at == scalars.steps or vanishing_guard(run) is not None:
        return False
    left, longest = run.left(run.now), FARTHEST * (run.until[0] - run.start.time[0])
    with working_precision(BITS):
        time, state = run.exact_time, run.exact_state
        for length in (longest * NEARER**k for k in range(TRIES)):
            end = _passed(run.start.constants.precise, run.mode, time, state, arb(length)) if length < left else None
            if end is not None:
                behind, there = split(time + arb(length)), [split(x) for x in end]
                break
        else:
            return False
    run.count("branch_points")
    highs = [high for high, _ in there]
    run.keep_line(length, highs)
    run.fill_samples_on_line(length, highs)
    run.put(behind, there)
    run.known_zeros[:] = 0
    scalars.steps += 1
    scalars.unit, scalars.longest_step, scalars.stalled = length, 1e3 * length, 0
    run.passed_at = int(scalars.steps)
    return True


def _passed(modes: PreciseModes, mode: Mode, time: arb, state: Sequence[arb], length: arb) -> list[arb] | None:
    """Return the state after ``length``, or None unless all guards clearly keep their signs from -length to length."""
    motion, _ = modes.motion(mode, time, state, length, ORDER)
    if not all(_converged(series) for series in motion):
        return None
    states = [arb_poly(series) for series in motion]
    values = []
    for place in (arb(side * part) for part in SIDES for side in (1, -1)):
        at = modes.guard_values(mode, time + length * place, [series(place) for series in states])
        if not all(value.is_finite() for value in at):  # most branch points are ends of the domain
            return None
        values.append([float(value) for value in at])
    if not all(map(_clear, zip(*values, strict=True))):
        return None
    return [series(arb(1)) for series in states]


def _converged(series: Sequence[arb]) -> bool:
    sizes = [abs(float(c)) for c in series]
    return max(sizes[-4:]) <= NEGLIGIBLE * sum(sizes)


def _clear(values: Sequence[float]) -> bool:
    """Whether values have one sign and are CLEAR times larger than their variation."""
    variation = max(values) - min(values)
    return all(v > CLEAR * variation for v in values) or all(v < -CLEAR * variation for v in values)
