"""Whether what no double holds has changed a step: operations that overflow or underflow, where doubles cannot tell."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flint import arb

from henon_ref.integrator.endings import row_name
from henon_ref.integrator.state_view import State
from henon_ref.kernel.shared import EPS, LEVELS
from henon_ref.precision import working_precision
from henon_ref.roots.multiprecision import BITS
from henon_ref.trajectory import Status

ROUNDING = 1e3 * EPS
"""Part of its size by which rounding alone may move a series."""


def range_ending(run: State) -> tuple[Status, str] | None:
    """How the run ends where it stands; None where all that has left the range of doubles is of no account.

    The step ahead is held against its series in balls, whose exponents have no end: no state may be off by more than
    the tolerance, no guard by more than that, nor have another sign.
    """
    scalars, n = run.scalars, run.x.size
    places = run.integrator.mode_table.places(run.mode)
    with working_precision(BITS):
        time, unit = arb(float(scalars.time)) + arb(float(scalars.time_low)), arb(float(scalars.unit))
        state, theta = [arb(x) for x in run.x.tolist()], arb(float(scalars.step_length)) / unit
        states, outputs = run.start.constants.precise.motion(run.mode, time, state, unit, run.start.order)
        exact = [*states, *(outputs[place] if place >= 0 else None for place in places)]
        level, band = max(float(scalars.tolerance), ROUNDING), run.workspace.band
        rounding = band[n + len(run.start.zeros) + 1 :].ravel()
        for r, own in enumerate(exact):
            found = band[r, : run.start.order + 1].tolist()
            off = float(rounding[r]) * (float(scalars.step_length) if r < n else 1.0)
            if own is not None and not _same(found, own, theta, level, off if off < math.inf else 0.0, guard=r >= n):
                why = "an operation's result is no double, which changes it by more than the tolerance"
                return "failed", f"{row_name(run, r)} overflows or underflows at t = {run.time:.17g}: {why}"
    return None


def _same(
    found: Sequence[float], exact: Sequence[arb], theta: arb, level: float, rounding: float, *, guard: bool
) -> bool:
    """Whether a series is what it should be on a step of theta units, as far as rounding goes."""
    powers = [theta**k for k in range(len(exact))]
    off = sum((abs(arb(c) - own) * p for c, own, p in zip(found, exact, powers, strict=True)), arb(0))
    size = sum((abs(own) * p for own, p in zip(exact[:3], powers, strict=False)), arb(0))
    if off <= level * size + arb(rounding):
        return True
    same_sign = found[0] > 0 if exact[0] > 0 else found[0] < 0 if exact[0] < 0 else found[0] == 0
    return bool(off <= LEVELS.no_account and (same_sign or not guard))
