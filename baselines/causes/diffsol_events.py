"""diffsol by pydiffsol and its stop functions. Some checks run in a process of their own, which the library ends."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import Cause, ClaimError, holds

DIFFSL = "https://martinjrobins.github.io/diffsl"


def solve(text: str, until: float, method: str = "tsit45") -> Any:
    """A model in DiffSL to its horizon or its first stop, at 1e-10."""
    import pydiffsol

    ode = pydiffsol.Ode(text, ode_solver=getattr(pydiffsol, method))
    ode.rtol = ode.atol = 1e-10
    return ode.solve(np.array([]), until)


def pair_in_one_step() -> str:
    """y' = 1 through y^2 = d^2/4: two roots, and no step ends between them; another function with the same roots."""
    for method in ("tsit45", "bdf"):
        for stops in ("y * y - 1e-12", "y * y - 1e-12, 2.0 * y * y - 2e-12"):
            found = solve(f"u_i {{ y = -1.0 }} F_i {{ 1.0 }} stop_i {{ {stops} }}", 2.0, method)
            holds(found.ts[-1] == 2.0, f"{method} stops at {found.ts[-1]}")
    return (
        "roots at t = 1 - 1e-6 and 1 + 1e-6, of one stop function or of two, are reported neither by tsit45 nor by "
        "bdf; the run ends at 2"
    )


def any_direction() -> str:
    """A ball that starts one rounding below its surface, upwards, and one exactly on it."""
    below = solve("u_i { x = -1e-15, v = 1.0 } F_i { v, -1.0 } stop_i { x }", 3.0)
    on = solve("u_i { x = 0.0, v = 1.0 } F_i { v, -1.0 } stop_i { x }", 3.0)
    holds(below.ts[-1] < 1e-9 and abs(on.ts[-1] - 2) < 1e-9, f"they stop at {below.ts[-1]} and {on.ts[-1]}")
    return (
        f"thrown up from 1e-15 below its surface a ball is stopped at t = {below.ts[-1]:.1e}; from the surface itself "
        f"it comes down at {on.ts[-1]:.6f}"
    )


def bounce_falls_through() -> str:
    """A ball dropped from 1, with ``reset_i { x, -0.8 * v }`` at ``stop_i { x }``."""
    text = "u_i { x = 1.0, v = 0.0 } F_i { v, -9.81 } stop_i { x } reset_i { x, -0.8 * v }"
    found = solve(text, 4.0, "bdf")
    lowest = float(np.asarray(found.ys)[0].min())
    holds(lowest < -1.0, f"its lowest point is {lowest}")
    return f"a ball dropped from 1 m onto a floor at 0, restitution 0.8, is at {lowest:.1f} m by t = 4 s"


TAN = "import pydiffsol; pydiffsol.Ode('u_i { y = 0.5 } F_i { tan(y) }'); print('made')"


def tangent_ends_the_process() -> str:
    """A model with ``tan``, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", TAN], capture_output=True, text=True, check=False, timeout=120)
    holds(done.returncode != 0 and "made" not in done.stdout, f"exit status {done.returncode}")
    said = next((line.strip() for line in done.stderr.splitlines() if "Enzyme" in line), "")
    holds(bool(said), f"it says {done.stderr[-200:]}")
    return f"`F_i {{ tan(y) }}` ends the process with status {done.returncode}: {said.rpartition(': ')[2]}"


def number_that_is_none() -> str:
    """h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2."""
    found = solve("u_i { h = 1.0 } F_i { -sqrt(h) } stop_i { h + 1.0 }", 4.0)
    heights = np.asarray(found.ys)[0]
    holds(found.ts[-1] == 4.0 and not np.isfinite(heights[-1]), f"h({found.ts[-1]}) = {heights[-1]}")
    try:
        solve("u_i { h = 1.0 } F_i { -sqrt(h) } stop_i { h + 1.0 }", 4.0, "bdf")
    except RuntimeError as error:
        return f"tsit45 goes on to t = 4 with h = nan and reports nothing; bdf ends: {error}"
    raise ClaimError("bdf says nothing")


def small_steps() -> str:
    """x' = x^2 from 1 ends at t = 1; sqrt(1 - y) does, too; v' = -1/(v + 1e-9) has its pole behind the root."""
    said = {}
    for text, end in (
        ("u_i { x = 1.0 } F_i { x * x }", 1.0),
        ("u_i { y = 0.0, z = 0.0 } F_i { 1.0, sqrt(1.0 - y) } stop_i { 1.0 - y }", 1.0),
        ("u_i { v = 1.0 } F_i { -1.0 / (v + 1e-9) } stop_i { v }", 0.5 + 1e-9),
    ):
        try:
            found = solve(text, 3.0, "bdf")
        except RuntimeError as error:
            words, _, time = str(error).partition(" at time = ")
            holds("Step size is too small" in words and abs(float(time) - end) < 1e-6, str(error))
            said[end] = error
        else:
            raise ClaimError(f"{text} goes on to {found.ts[-1]}")
    return f"bdf on x' = x²: {said[1.0]}; on a pole 1e-9 behind the root at 0.500000001: {said[0.5 + 1e-9]}"


def late_times() -> str:
    """x' = 1 from -1 at t = 1e9 through x = -1/2, and many steps to a horizon one second away, at 1e-12."""
    import pydiffsol

    def late(text: str, start: float) -> Any:
        ode = pydiffsol.Ode(text, ode_solver=pydiffsol.tsit45)
        ode.rtol = ode.atol = 1e-12
        ode.t0 = start
        return ode.solve(np.array([]), 1e9 + 1.0)

    error = float(late("u_i { x = -1.0 } F_i { 1.0 } stop_i { x + 0.5 }", 1e9).ts[-1]) - 1e9 - 0.5
    holds(1e-6 < error < 1e-4, f"an error of {error} s")
    try:
        found = late("u_i { x = 0.0 } F_i { 4.0 * (0.25 + t - 1000000000.0) }", 1e9 + 1 / 3)
    except RuntimeError as refused:
        holds("Stop time is at the current state time" in str(refused), str(refused))
        return f"at t = 1e9 a root of x' = 1 is late by {error:.1e} s; in front of the horizon: {refused}"
    raise ClaimError(f"it goes on to {found.ts[-1]}")


def stop_function_that_is_none() -> str:
    """y' = 1 from 0, stop function sqrt(1 - y) + 1/2."""
    for method in ("tsit45", "bdf"):
        found = solve("u_i { y = 0.0 } F_i { 1.0 } stop_i { sqrt(1.0 - y) + 0.5 }", 2.0, method)
        holds(found.ts[-1] == 2.0, f"{method} stops at {found.ts[-1]}")
    return "a stop function that is NaN from t = 1 on is passed over by tsit45 and bdf; the run ends at 2"


def first_step_too_short() -> str:
    """y' = 3 from 4e-14 by BDF at 1e-9, with the shortest step of its own and with a shorter one."""
    import pydiffsol

    ode = pydiffsol.Ode("u_i { x = 0.0, y = 4e-14 } F_i { 1.0, 3.0 }", ode_solver=pydiffsol.bdf)
    ode.rtol = ode.atol = 1e-9
    own = ode.options.min_timestep
    try:
        ode.solve(np.array([]), 3.0)
    except RuntimeError as error:
        words, _, time = str(error).partition(" at time = ")
    else:
        raise ClaimError("it ends at 3")
    holds("Step size is too small" in words and 0 < float(time) < own, f"{words} at {time}")
    ode.options.min_timestep = 1e-16
    end = float(ode.solve(np.array([]), 3.0).ts[-1])
    holds(end == 3.0, f"with a shorter one it ends at {end}")
    return (
        f"x' = 1, y' = 3 from (0, 4e-14) ends at t = {float(time):.1e}, {words}; with `options.min_timestep` 1e-16 in "
        f"place of {own:g} it comes to 3"
    )


DIFFSOL = (
    Cause(
        "diffsol-pair",
        "pydiffsol",
        "diffsol: two roots in one step cancel",
        "Signs of a stop function are compared at the two ends of a step. An even number of roots in between leaves "
        "no trace.",
        pair_in_one_step,
    ),
    Cause(
        "diffsol-any-direction",
        "pydiffsol",
        "A stop at every change of sign, and by nobody knows which",
        "A stop function has no direction, and the result does not say which of several stopped the run. One that is "
        "exactly zero at the start is out of play; a rounding below it stops the run as it rises. The adapter starts "
        "guards above zero and goes on where one has risen.",
        any_direction,
        (f"{DIFFSL}/odes.html",),
    ),
    Cause(
        "diffsol-reset",
        "pydiffsol",
        "A bounce falls through the floor",
        "`reset_i` leaves the state where the stop was found, a rounding beyond the surface: the stop function is "
        "negative from there on, and changes its sign no more. The adapter resets nothing: the driver puts the state "
        "on the surface and starts another mode.",
        bounce_falls_through,
        (f"{DIFFSL}/odes.html",),
    ),
    Cause(
        "diffsol-tan",
        "pydiffsol",
        "tan ends the process",
        "Enzyme, which differentiates the model, does not know LLVM's intrinsic for the tangent, and aborts. The "
        "adapter writes a quotient.",
        tangent_ends_the_process,
        (f"{DIFFSL}/functions.html",),
    ),
    Cause(
        "diffsol-nan",
        "pydiffsol",
        "tsit45 takes a NaN for a state",
        "Where the field has no value, tsit45 goes on with a state that is no number, to the horizon, and reports "
        "success.",
        number_that_is_none,
    ),
    Cause(
        "diffsol-small-step",
        "pydiffsol",
        "A blow-up, the end of a field, a pole behind a surface: a step that is too small",
        "diffsol has no word for divergence or for a field without a value, which it meets behind a surface, too; the "
        "error holds the time and nothing of what was computed before.",
        small_steps,
    ),
    Cause(
        "diffsol-first-step",
        "pydiffsol",
        "A first step that is shorter than the shortest step",
        "The first step is estimated as a hundredth of the state over its rate, whatever `h0` says. From a state that "
        "is nearly zero that is below the shortest step, 1e-13 s whatever the time, and the run fails. The adapter "
        "makes the shortest step the rounding of the horizon.",
        first_step_too_short,
    ),
    Cause(
        "diffsol-late",
        "pydiffsol",
        "Times are told apart to 100 roundings",
        "Roots are located to 100 eps |t|, and a step that ends so close to the horizon is an error in place of the "
        "run's end. At t = 1e9 that is 2e-5 s.",
        late_times,
    ),
    Cause(
        "diffsol-stop-nan",
        "pydiffsol",
        "A stop function without a value is no stop",
        "A NaN is no change of sign: the run goes on beyond the end of its stop function, and reports success.",
        stop_function_that_is_none,
    ),
)
