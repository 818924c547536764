"""What people write first: friction with ``sign``, or smoothed."""

from __future__ import annotations

import numpy as np

from baselines.causes.base import Cause, holds
from baselines.causes.scipy_events import quiet

WIDTH = 1e-4


def sign_in_a_stick() -> str:
    """v' = 0.5 - sign(v) from v = 0.1: it stops at t = 0.2 and stays."""
    from scipy.integrate import RK45

    counts = []
    for rtol in (1e-3, 1e-5):
        solver = RK45(lambda t, v: 0.5 - np.sign(v), 0.0, np.array([0.1]), 0.3, rtol=rtol, atol=rtol)
        while solver.status == "running":
            solver.step()
        counts.append(solver.nfev)
    holds(counts[1] > 20 * counts[0], f"evaluations {counts}")
    return (
        f"a stick of 0.1 s costs RK45 {counts[0]} evaluations at 1e-3 and {counts[1]} at 1e-5: it goes with the "
        "inverse of the tolerance"
    )


def smoothed_stick_creeps() -> str:
    """v' = 0.5 - tanh(v / eps): at rest it is held by a creep at v = eps artanh(0.5)."""
    found = quiet(lambda t, v: [0.5 - np.tanh(v[0] / WIDTH)], (0, 10), [0.1], method="LSODA", rtol=1e-9, atol=1e-9)
    creep = found.y[0, -1]
    holds(abs(creep / (WIDTH * np.arctanh(0.5)) - 1) < 1e-3, f"it ends at v = {creep}")
    return f"smoothed over {WIDTH:g}, a body that should stick creeps at {creep:.2e} for good"


NAIVE = (
    Cause(
        "sign-chatter",
        "scipy",
        "A stick is a jump at every step",
        "With `sign` in the right-hand side the field jumps to and fro in a stick, and the error control lets through "
        "steps of about the tolerance over the jump only.",
        sign_in_a_stick,
    ),
    Cause(
        "smoothed-creep",
        "scipy",
        "A smoothed stick creeps",
        "With tanh(v/eps) there is no rest, and nothing happens faster than the smoothing allows: what goes on within "
        "its band is not told apart.",
        smoothed_stick_creeps,
        ("https://github.com/google-deepmind/mujoco/issues/3328",),
    ),
)
