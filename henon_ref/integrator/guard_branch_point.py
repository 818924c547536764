"""Past a branch point of a guard, which no power series of it leads over, where the motion itself is smooth.

A guard is only observed: nothing is integrated from it. Around the instant at which its series ends the states are
expanded in multiprecision, and all guards are looked at on both sides, ever closer to it. Where each of them keeps
its sign by much more than it varies there, nothing happens at the branch point, and the run goes on behind it.
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
"""Part of the run's length that is left behind at first; of that, in the next try; tries."""
ORDER = 16
"""Of the states' expansion, over so short a time."""
NEGLIGIBLE = 1e-40
"""Its last terms are no larger than this of all."""
SIDES = (1.0, 0.47, 0.22, 0.09, 0.03)
"""Where on either side the guards are looked at, in parts of what is left behind."""
CLEAR = 8.0
"""Size of a guard, at least, in units of its variation around the branch point."""


def pass_branch_point(run: State) -> bool:
    """Go on behind a branch point of a guard; False where there is none, the model ends, or it is not clear.

    The run stands where no step leads on, which is next to the branch point; what is left behind is in the scale of the
    whole run.
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
