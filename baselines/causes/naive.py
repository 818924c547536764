"""What people write first: friction with ``sign``, or smoothed."""

from __future__ import annotations

import numpy as np

from henon_ref.baselines.causes.base import Cause, holds
from henon_ref.baselines.causes.scipy_events import quiet

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


def smoothed_release_is_late() -> str:
    """v' = t - tanh(v / eps): pulled by t against a friction of 1, a body at rest lets go at t = 1."""
    from scipy.integrate import solve_ivp

    def beyond(t: float, v: np.ndarray) -> float:  # here the smoothed friction is 1 to the last digit
        return float(v[0]) - 20 * WIDTH

    beyond.terminal = True  # type: ignore[attr-defined]
    how = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-9, "events": beyond}
    late = float(solve_ivp(lambda t, v: [t - np.tanh(v[0] / WIDTH)], (0, 2), [0.0], **how).t[-1]) - 1.0
    exact = np.sqrt(2 * 20 * WIDTH)  # v = (t - 1)^2 / 2
    holds(0.5 * exact < late < 1.5 * exact, f"it is released {late} s late")
    return f"smoothed over {WIDTH:g}, a body is 20 widths fast {late:.3f} s after its release at 1 s"


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
    Cause(
        "smoothed-late",
        "scipy",
        "A smoothed release is late",
        "A body that lets go is told from one that creeps only when it has left the band, by a time that goes with the "
        "root of the smoothing's width: releases come late, and behind transitions that they come before.",
        smoothed_release_is_late,
    ),
)
