"""SciPy's ``solve_ivp`` and its events, and friction without events: ``sign`` in the right-hand side, or smoothed."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import cause, error_message, holds

shows = partial(cause, "scipy")
ISSUES = "https://github.com/scipy/scipy/issues"
WIDTH = 1e-4
"""Width of the smoothing."""
METHODS = ("RK45", "DOP853", "Radau", "BDF", "LSODA")


def run(field: Any, until: float, start: list[float], method: str = "RK45", rtol: float = 1e-9, **options: Any) -> Any:
    """Call ``solve_ivp`` from t = 0 without its warnings; ``atol`` is ``rtol``."""
    from scipy import integrate  # imported here, because most commands check no cause

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return integrate.solve_ivp(field, (0, until), start, method=method, rtol=rtol, atol=rtol, **options)


def terminal(function: Callable[..., float], direction: int = 0) -> Callable[..., float]:
    """Mark a function as a terminal event."""
    function.terminal = True  # type: ignore[attr-defined]
    function.direction = direction  # type: ignore[attr-defined]
    return function


def unit_speed(t: float, x: Any) -> list[float]:
    return [1.0]


@shows("scipy-pair", "Two roots in one step cancel", f"{ISSUES}/9228", f"{ISSUES}/18039")
def pair_in_one_step() -> str:
    """`solve_ivp` compares the signs of an event function at the two ends of a step. An even number of roots in between
    leaves no trace.
    """
    steps = []
    for method in METHODS:
        found = run(unit_speed, 2, [-1.0], method, 1e-6, events=lambda t, x: x[0] ** 2 - 0.0025)
        holds(found.t_events[0].size == 0, f"{method} reports a root at {found.t_events[0]}")
        holds(not any(abs(x) < 0.05 for x in found.y[0]), f"a step of {method} ends between the roots")
        steps.append(found.t.size - 1)
    return f"roots at t = 0.95 and 1.05 are not reported by any method; they take {min(steps)} to {max(steps)} steps"


@shows("scipy-fires-at-start", "A root at the starting point counts")
def fires_where_it_starts() -> str:
    """A run that starts on its event surface stops there at once, unless a direction excludes the root."""
    ends = [
        run(lambda t, x: [x[1], -1.0], 3, [0.0, 1.0], events=terminal(lambda t, x: x[0], direction)).t[-1]
        for direction in (0, -1)
    ]
    holds(ends[0] < 1e-6 and abs(ends[1] - 2) < 1e-2, f"without and with a direction it stops at {ends}")
    return f"thrown up from its surface, a ball is stopped at t = {ends[0]:g}; with a direction it comes down at 2"


@shows("scipy-flat-root", "A root of third order ends the run")
def root_of_third_order() -> str:
    """`solve_ivp` calls `brentq` with a tolerance of four roundings and the default of 100 iterations, which do not
    suffice for a root of third order. The exception ends `solve_ivp`, and the solution so far is lost.
    """
    for method in METHODS:
        words = error_message(partial(run, unit_speed, 3, [0.0], method, events=lambda t, x: (x[0] - 1.0) ** 3))
        holds("100 iterations" in words, f"{method} raises {words or 'nothing'}")
    return "the root of (x - 1)³ at t = 1 ends a run of every method by an exception, after 100 iterations of brentq"


@shows("scipy-bracket", "The event's bracket has no sign change")
def bracket_without_a_sign_change() -> str:
    """The sign at the end of a step is that of the step's state, but the root is located on the dense output. If both
    differ by a rounding, `brentq` gets a bracket without a sign change and raises.

    From -c to 0, for some c; the last bits of the linear algebra library determine for which.
    """
    event = terminal(lambda t, x: -x[0], -1)
    every = [
        error_message(partial(run, unit_speed, k / 10, [-k / 10], "Radau", 1e-6, events=event)) for k in range(1, 31)
    ]
    messages = [message for message in every if message]
    holds(messages and all("different signs" in m for m in messages), f"{messages or 'no ValueError'}")
    return (
        f"Radau on x' = 1 from -c, event -x, horizon c, for c = 0.1, 0.2, ..., 3: in {len(messages)} of 30 ValueError, "
        f"'{messages[0]}'"
    )


@shows("scipy-pole", "An event in front of a pole")
def event_behind_a_pole() -> str:
    """An event is located in a step that has passed it. If the field has a pole, or no value, just after the surface,
    every such step is rejected, until the step size is below the spacing of the time.
    """
    words = []
    for d in (1e-3, 1e-9):
        found = run(lambda t, v, d=d: [-1.0 / (v[0] + d)], 3, [1.0], "DOP853", events=terminal(lambda t, v: v[0], -1))
        words.append(f"d = {d:g}: {'found' if found.t_events[0].size else found.message}")
        holds((found.status == 1) == (d == 1e-3), words[-1])
    return "; ".join(words)


@shows("scipy-late", "Steps must be at least ten roundings of the time")
def late_start() -> str:
    """The least step is ten units in the last place of the time. At t = 1e9 that is 1e-6, and BDF's first steps at a
    tight tolerance are shorter.
    """
    from scipy.integrate import BDF

    steps = [BDF(lambda t, x: [x[1], -x[0]], t, [1.0, 0.0], t + 10, rtol=1e-9, atol=1e-9) for t in (0.0, 1e9)]
    early, late = (own.step() for own in steps)
    holds(early is None and bool(late), f"{early} / {late}")
    return f"BDF runs from t = 0; from t = 1e9 it ends at once: {late}"


@shows("scipy-blow-up", "A blow-up is reported as a step that is too small")
def blow_up_is_a_failed_step() -> str:
    """`solve_ivp` has no status for divergence: the step size shrinks until the run fails, with BDF long before the
    state is large.
    """
    found = run(lambda t, x: [x[0] ** 2], 2, [1.0], "BDF")
    holds(found.status < 0 and found.y[0, -1] < 1e12, f"the state reached {found.y[0, -1]:g}: {found.message}")
    return f"BDF on x' = x² ends at t = {found.t[-1]:.9f} with x = {found.y[0, -1]:.1e}: {found.message}"


def steps_of_a_period(method: str) -> list[int]:
    """Number of steps of one period of x'' = -x at 1e-6 and 1e-12."""
    found = (run(lambda t, x: [x[1], -x[0]], 6.28, [1.0, 0.0], method, rtol) for rtol in (1e-6, 1e-12))
    return [own.t.size - 1 for own in found]


@shows("scipy-radau-order", "Radau is of order 5, its error estimate of order 3")
def low_order_at_a_tight_tolerance() -> str:
    """The number of steps grows with the inverse third root of the tolerance, or faster: at 1e-12 a run of ordinary
    length exceeds every deadline of this project.
    """
    (dop, fine), (radau, more) = steps_of_a_period("DOP853"), steps_of_a_period("Radau")
    holds(more / radau > 4 * fine / dop, f"steps {dop}, {fine}; {radau}, {more}")
    return (
        f"from 1e-6 to 1e-12 the steps of one period grow from {dop} to {fine} with DOP853, from {radau} to {more} "
        "with Radau"
    )


@shows("scipy-bdf-order", "BDF is of order 5 at most")
def bdf_at_a_tight_tolerance() -> str:
    """At tight tolerances the steps of BDF are short, and each step is plain Python with a linear solve."""
    coarse, fine = steps_of_a_period("BDF")
    holds(fine > 5 * coarse, f"steps {coarse}, {fine}")
    return f"from 1e-6 to 1e-12 the steps of one period of an oscillator grow from {coarse} to {fine}"


@shows("scipy-lsoda-nan", "LSODA takes a NaN for a state")
def number_that_is_none() -> str:
    """If the field has no value at a trial point, RK45 and DOP853 shorten the step, and Radau and BDF fail or raise.
    LSODA continues to the horizon with a NaN state and reports success.

    h' = -sqrt(h) from 1, Torricelli's law: h = (1 - t/2)^2, and nothing is left at t = 2.
    """

    def tank(method: str) -> Any:
        return run(lambda t, h: -np.sqrt(h), 4, [1.0], method)

    lsoda = tank("LSODA")
    numbers = np.isfinite(lsoda.y[0])
    last = lsoda.t[numbers][-1]
    seen = f"LSODA: status {lsoda.status}, h(4) = {lsoda.y[0, -1]:g}, no number after t = {last:.3f}"
    holds(lsoda.status == 0 and last < 2.0 and not numbers[-1], seen)
    for method in ("RK45", "DOP853"):
        found = tank(method)
        holds(found.status < 0 and np.isfinite(found.y).all(), f"{method}: {found.message}")
    for method in ("Radau", "BDF"):
        holds(error_message(partial(tank, method)) or tank(method).status < 0, f"{method} says nothing")
    return f"{seen}, where h = {lsoda.y[0, numbers][-1]:.2f}; no other method reports success"


def stuck(tolerance: float) -> tuple[float, int]:
    """Solve v' = 0.5 - sign(v) from 0.1, which is at rest from t = 0.2 on.

    Return the greatest speed after t = 0.21 and the number of evaluations up to t = 0.3.
    """
    found = run(lambda t, v: 0.5 - np.sign(v), 0.3, [0.1], rtol=tolerance)
    return float(np.abs(found.y[0, found.t > 0.21]).max()), found.nfev


@shows("sign-chatter", "A stick is a jump at every step")
def sign_in_a_stick() -> str:
    """With `sign` in the right-hand side the field jumps back and forth in a stick, and the error control accepts only
    steps of about the tolerance divided by the jump.
    """
    counts = [evaluations for _, evaluations in (stuck(1e-3), stuck(1e-5))]
    holds(counts[1] > 20 * counts[0], f"evaluations {counts}")
    return (
        f"a stick of 0.1 s costs RK45 {counts[0]} evaluations at 1e-3 and {counts[1]} at 1e-5: it goes with the "
        "inverse of the tolerance"
    )


@shows("sign-hops", "Error control does not detect a jump within a step")
def sign_hops() -> str:
    """With `sign` in the right-hand side a step over the jump is accepted with an error of tens of tolerances. The
    surface is located with this error only, and closer events cannot be distinguished.
    """
    hops = {rtol: stuck(rtol)[0] / rtol for rtol in (1e-3, 1e-4)}
    holds(all(10 < hop < 200 for hop in hops.values()), f"it hops by {hops} tolerances")
    words = " and ".join(f"{hop:.0f} tolerances at {rtol:g}" for rtol, hop in hops.items())
    return f"a body at rest is seen to move by up to {words}: accepted steps go over the jump"


@shows("smoothed-creep", "A smoothed stick creeps", "https://github.com/google-deepmind/mujoco/issues/3328")
def smoothed_stick_creeps() -> str:
    """With tanh(v/eps) there is no rest: a body that should stick creeps. Events within the band of the smoothing
    cannot be distinguished, and the error of a state is the width of the band instead of the tolerance.

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


@shows("smoothed-convergence", "LSODA's iteration does not converge where a narrow smoothing ends")
def smoothed_release_may_not_converge() -> str:
    """At a release the slope of the smoothed friction vanishes suddenly, and Newton's iteration does not converge
    across this point: after ten cuts of the step LSODA ends the run with repeated convergence failures.

    v' = 1.1 sin(t) - tanh(v / eps): the amplitude of the force is larger than the friction.
    """
    eps = 1e-10
    found = run(
        lambda t, v: [1.1 * np.sin(t) - np.tanh(v[0] / eps)], 20, [0.0], "LSODA", 1e-11,
        jac=lambda t, v: [[-(1 - np.tanh(v[0] / eps) ** 2) / eps]],
    )  # fmt: skip
    holds(found.status == -1, f"it ends at {found.t[-1]}")
    release = float(np.arcsin(1 / 1.1))
    return f"with a width of {eps:g} LSODA gives up at t = {found.t[-1]:.3f}; the body is released at {release:.3f} s"


@shows("smoothed-late", "A smoothed release is late")
def smoothed_release_is_late() -> str:
    """A release is detected only when the body has left the band of the smoothing. The delay is proportional to the
    square root of the width, so that a release may be reported after transitions that it precedes.

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
    "Hénon's landing with one step of RK4 is accurate only for a short step",
    "https://doi.org/10.1016/0167-2789(82)90034-3",
)
def landing_within_a_step() -> str:
    """The step back to the surface solves the swapped equations, which divide by the rate of the surface function. If
    the rate changes much within the step, as it does when events accumulate, the relative error is of order one.

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
