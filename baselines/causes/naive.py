"""What people write first: friction with ``sign``, or smoothed."""

from __future__ import annotations

import numpy as np

from henon_ref.baselines.causes.base import cause, holds
from henon_ref.baselines.causes.scipy_events import run, terminal

WIDTH = 1e-4


def stuck(tolerance: float) -> tuple[float, int]:
    """v' = 0.5 - sign(v) from 0.1, at rest from t = 0.2 on: its greatest speed after 0.21, and evaluations to 0.3."""
    found = run(lambda t, v: 0.5 - np.sign(v), 0.3, [0.1], rtol=tolerance)
    return float(np.abs(found.y[0, found.t > 0.21]).max()), found.nfev


@cause("scipy", "sign-chatter", "A stick is a jump at every step")
def sign_in_a_stick() -> str:
    """With `sign` in the right-hand side the field jumps to and fro in a stick, and the error control lets through
    steps of about the tolerance over the jump only.

    v' = 0.5 - sign(v) from v = 0.1: it stops at t = 0.2 and stays.
    """
    counts = [evaluations for _, evaluations in (stuck(1e-3), stuck(1e-5))]
    holds(counts[1] > 20 * counts[0], f"evaluations {counts}")
    return (
        f"a stick of 0.1 s costs RK45 {counts[0]} evaluations at 1e-3 and {counts[1]} at 1e-5: it goes with the "
        "inverse of the tolerance"
    )


@cause("scipy", "sign-hops", "A jump within a step is not seen by error control")
def sign_hops() -> str:
    """With `sign` in the right-hand side a step over the jump is accepted with an error of tens of tolerances: the
    surface is known no better, and what is closer together than that is not told apart.

    v' = 0.5 - sign(v) from v = 0.1: from t = 0.2 on it is at rest.
    """
    hops = {rtol: stuck(rtol)[0] / rtol for rtol in (1e-3, 1e-4)}
    holds(all(10 < hop < 200 for hop in hops.values()), f"it hops by {hops} tolerances")
    words = " and ".join(f"{hop:.0f} tolerances at {rtol:g}" for rtol, hop in hops.items())
    return f"a body at rest is seen to move by up to {words}: accepted steps go over the jump"


@cause("scipy", "smoothed-creep", "A smoothed stick creeps", "https://github.com/google-deepmind/mujoco/issues/3328")
def smoothed_stick_creeps() -> str:
    """With tanh(v/eps) there is no rest, and nothing happens faster than the smoothing allows: what goes on within its
    band is not told apart, and a state is off by the band, not by the tolerance.

    v' = 0.5 - tanh(v / eps): at rest it is held by a creep at v = eps artanh(0.5).
    """
    found = run(lambda t, y: [y[1], 0.5 - np.tanh(y[1] / WIDTH)], 10, [0.0, 0.0], "LSODA")
    moved, creep = found.y[:, -1]
    holds(abs(creep / (WIDTH * np.arctanh(0.5)) - 1) < 1e-3, f"it ends at v = {creep}")
    holds(abs(moved / (10 * creep) - 1) < 1e-2, f"it has moved by {moved}")
    return (
        f"smoothed over {WIDTH:g}, a body that should stick creeps at {creep:.2e} for good, and is {moved:.1e} off "
        "after 10 s, at a tolerance of 1e-9"
    )


@cause("scipy", "smoothed-convergence", "LSODA's iteration does not converge where a narrow smoothing ends")
def smoothed_release_may_not_converge() -> str:
    """At a release the smoothed friction is flat all of a sudden, and Newton's iteration does not converge over it:
    after ten cuts of the step LSODA ends the run with repeated convergence failures.

    v' = 1.1 sin(t) - tanh(v / eps): pulled to and fro, now and then by more than the friction.
    """
    eps = 1e-10
    found = run(
        lambda t, v: [1.1 * np.sin(t) - np.tanh(v[0] / eps)], 20, [0.0], "LSODA", 1e-11,
        jac=lambda t, v: [[-(1 - np.tanh(v[0] / eps) ** 2) / eps]],
    )  # fmt: skip
    holds(found.status == -1, f"it ends at {found.t[-1]}")
    release = float(np.arcsin(1 / 1.1))
    return f"with a width of {eps:g} LSODA gives up at t = {found.t[-1]:.3f}; the body is released at {release:.3f} s"


@cause("scipy", "smoothed-late", "A smoothed release is late")
def smoothed_release_is_late() -> str:
    """A body that lets go is told from one that creeps only when it has left the band, by a time that goes with the
    root of the smoothing's width: releases come late, and behind transitions that they come before.

    v' = t - tanh(v / eps): pulled by t against a friction of 1, a body at rest lets go at t = 1.
    """
    beyond = terminal(lambda t, v: v[0] - 20 * WIDTH)  # there the smoothed friction is 1 to the last digit
    late = float(run(lambda t, v: [t - np.tanh(v[0] / WIDTH)], 2, [0.0], "LSODA", events=beyond).t[-1]) - 1.0
    exact = np.sqrt(2 * 20 * WIDTH)  # v = (t - 1)^2 / 2
    holds(0.5 * exact < late < 1.5 * exact, f"it is released {late} s late")
    return f"smoothed over {WIDTH:g}, a body is 20 widths fast {late:.3f} s after its release at 1 s"


@cause(
    "henon-ref",
    "rk4-landing",
    "Hénon's landing with one step of RK4 is no better than the step is short",
    "https://doi.org/10.1016/0167-2789(82)90034-3",
)
def landing_within_a_step() -> str:
    """The step back to the surface is one of the swapped equations, which divide by the rate of the surface function.
    Where that changes much within the step, as where events accumulate, its error is of order one.

    v' = -1 from x = 0, v > 0: back at x = 0 with -v; a step of 1e-3 s of RK4 and one of the swapped equations.
    """
    off = {}
    for speed in (4e-4, 1e-4, 1e-5):
        x, v = speed * 1e-3 - 1e-6 / 2, speed - 1e-3  # RK4 is exact here
        slopes = [-1 / v]
        for part in (0.5, 0.5, 1.0):  # dv/dx = -1/v, a step of -x
            slopes.append(-1 / (v - part * x * slopes[-1]))
        first, second, third, last = slopes
        off[speed] = abs(v - x * (first + 2 * second + 2 * third + last) / 6 + speed) / speed
    holds(off[4e-4] < 1e-3 and off[1e-4] > 0.1 and off[1e-5] > 1.0, f"relative errors {off}")
    words = ", ".join(f"{error:.1g} where it comes back after {2 * speed:g} s" for speed, error in off.items())
    return f"landed after a step of 0.001 s, the speed has a relative error of {words}"
