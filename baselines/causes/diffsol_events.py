"""diffsol (by pydiffsol) and its stop functions. The check of ``tan`` runs in a new process, which diffsol aborts."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import cause, error_message, holds

shows = partial(cause, "pydiffsol")
DIFFSL = "https://martinjrobins.github.io/diffsl"


def model(text: str, tolerance: float, method: str = "tsit45", start: float = 0.0) -> Any:
    """Compile a model in DiffSL; ``tolerance`` is the relative and absolute one."""
    import pydiffsol

    ode = pydiffsol.Ode(text, ode_solver=getattr(pydiffsol, method))
    ode.rtol = ode.atol = tolerance
    ode.t0 = start
    return ode


def solve(text: str, until: float, method: str = "tsit45", tolerance: float = 1e-10, start: float = 0.0) -> Any:
    """Solve a model in DiffSL to its horizon or its first stop."""
    return model(text, tolerance, method, start).solve(np.array([]), until)


@shows("diffsol-pair", "diffsol: two roots within one step are not found")
def pair_in_one_step() -> str:
    """Signs of a stop function are compared at the two ends of a step. An even number of roots in between leaves no
    trace.
    """
    for method in ("tsit45", "bdf"):
        for stops in ("y * y - 1e-12", "y * y - 1e-12, 2.0 * y * y - 2e-12"):
            found = solve(f"u_i {{ y = -1.0 }} F_i {{ 1.0 }} stop_i {{ {stops} }}", 2.0, method)
            holds(found.ts[-1] == 2.0, f"{method} stops at {found.ts[-1]}")
    return (
        "roots at t = 1 - 1e-6 and 1 + 1e-6, of one stop function or of two, are reported neither by tsit45 nor by "
        "bdf; the run ends at 2"
    )


@shows("diffsol-any-direction", "Every change of sign stops, and the result does not name it", f"{DIFFSL}/odes.html")
def any_direction() -> str:
    """A stop function has no direction, and the result does not contain which of several stop functions stopped the
    run. A stop function that is exactly zero at the start is ignored until it has left zero; if it starts one rounding
    below zero, it stops the run as it rises. The adapter starts guards above zero and continues if one has risen.
    """
    below = solve("u_i { x = -1e-15, v = 1.0 } F_i { v, -1.0 } stop_i { x }", 3.0)
    on = solve("u_i { x = 0.0, v = 1.0 } F_i { v, -1.0 } stop_i { x }", 3.0)
    holds(below.ts[-1] < 1e-9 and abs(on.ts[-1] - 2) < 1e-9, f"they stop at {below.ts[-1]} and {on.ts[-1]}")
    return (
        f"thrown up from 1e-15 below its surface a ball is stopped at t = {below.ts[-1]:.1e}; from the surface itself "
        f"it comes down at {on.ts[-1]:.6f}"
    )


@shows("diffsol-reset", "A bounce falls through the floor", f"{DIFFSL}/odes.html")
def bounce_falls_through() -> str:
    """`reset_i` starts from the located stop, whose state is one rounding beyond the surface: the stop function is
    negative from there on and does not change its sign again. The adapter does not use `reset_i`: the driver projects
    the state onto the surface and starts the next mode.
    """
    text = "u_i { x = 1.0, v = 0.0 } F_i { v, -9.81 } stop_i { x } reset_i { x, -0.8 * v }"
    found = solve(text, 4.0, "bdf")
    lowest = float(np.asarray(found.ys)[0].min())
    holds(lowest < -1.0, f"its lowest point is {lowest}")
    return f"a ball dropped from 1 m onto a floor at 0, restitution 0.8, is at {lowest:.1f} m by t = 4 s"


@shows("diffsol-tan", "tan ends the process", f"{DIFFSL}/functions.html")
def tangent_ends_the_process() -> str:
    """Enzyme, which differentiates the model, does not know LLVM's intrinsic for the tangent, and aborts. The adapter
    writes a quotient.
    """
    text = "import pydiffsol; pydiffsol.Ode('u_i { y = 0.5 } F_i { tan(y) }'); print('made')"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False, timeout=120)
    holds(done.returncode != 0 and "made" not in done.stdout, f"exit status {done.returncode}")
    said = next((line.strip() for line in done.stderr.splitlines() if "Enzyme" in line), "")
    holds(bool(said), f"it says {done.stderr[-200:]}")
    return f"`F_i {{ tan(y) }}` ends the process with status {done.returncode}: {said.rpartition(': ')[2]}"


@shows("diffsol-nan", "tsit45 takes a NaN for a state")
def number_that_is_none() -> str:
    """If the field has no value, tsit45 continues to the horizon with a NaN state and reports success.

    h' = -sqrt(h) from 1: h = (1 - t/2)^2, and nothing is left at t = 2.
    """
    text = "u_i { h = 1.0 } F_i { -sqrt(h) } stop_i { h + 1.0 }"
    found = solve(text, 4.0)
    heights = np.asarray(found.ys)[0]
    holds(found.ts[-1] == 4.0 and not np.isfinite(heights[-1]), f"h({found.ts[-1]}) = {heights[-1]}")
    words = error_message(lambda: solve(text, 4.0, "bdf"))
    holds(words, "bdf says nothing")
    return f"tsit45 goes on to t = 4 with h = nan and reports nothing; bdf ends: {words}"


@shows("diffsol-small-step", "Blow-up, end of a field, pole just after a surface: all are a step that is too small")
def small_steps() -> str:
    """diffsol reports divergence, and a field without a value (which a step may also reach just after a surface), as a
    step size that is too small. The error contains the time; the solution up to that time is lost.

    x' = x^2 from 1 ends at t = 1; sqrt(1 - y) does, too; v' = -1/(v + 1e-9) has its pole behind the root.
    """
    ends = {
        "u_i { x = 1.0 } F_i { x * x }": 1.0,
        "u_i { y = 0.0, z = 0.0 } F_i { 1.0, sqrt(1.0 - y) } stop_i { 1.0 - y }": 1.0,
        "u_i { v = 1.0 } F_i { -1.0 / (v + 1e-9) } stop_i { v }": 0.5 + 1e-9,
    }
    every = [error_message(partial(solve, text, 3.0, "bdf")) for text in ends]
    for words, end in zip(every, ends.values(), strict=True):
        small, _, time = words.partition(" at time = ")
        holds("Step size is too small" in small and abs(float(time) - end) < 1e-6, words or "nothing is said")
    return f"bdf on x' = x²: {every[0]}; on a pole 1e-9 behind the root at 0.500000001: {every[2]}"


@shows("diffsol-late", "Times are resolved to 100 roundings only")
def late_times() -> str:
    """Roots are located to 100 eps |t|, which is 2e-5 s at t = 1e9. A step that ends this close to the horizon raises
    an error instead of ending the run.
    """

    def late(text: str, start: float) -> Any:
        return solve(text, 1e9 + 1.0, tolerance=1e-12, start=start)

    error = float(late("u_i { x = -1.0 } F_i { 1.0 } stop_i { x + 0.5 }", 1e9).ts[-1]) - 1e9 - 0.5
    holds(1e-6 < error < 1e-4, f"an error of {error} s")
    refused = error_message(lambda: late("u_i { x = 0.0 } F_i { 4.0 * (0.25 + t - 1000000000.0) }", 1e9 + 1 / 3))
    holds("Stop time is at the current state time" in refused, refused or "it goes on")
    return f"at t = 1e9 a root of x' = 1 is late by {error:.1e} s; in front of the horizon: {refused}"


@shows("diffsol-stop-nan", "A stop function without a value is no stop")
def stop_function_that_is_none() -> str:
    """NaN does not count as a change of sign: the run continues after its stop function has become NaN, and reports
    success.
    """
    for method in ("tsit45", "bdf"):
        found = solve("u_i { y = 0.0 } F_i { 1.0 } stop_i { sqrt(1.0 - y) + 0.5 }", 2.0, method)
        holds(found.ts[-1] == 2.0, f"{method} stops at {found.ts[-1]}")
    return "a stop function that is NaN from t = 1 on is passed over by tsit45 and bdf; the run ends at 2"


@shows("diffsol-first-step", "A first step that is shorter than the shortest step")
def first_step_too_short() -> str:
    """The first step is estimated as a hundredth of the state divided by its rate; `h0` is not used. For a state near
    zero the estimate is below the shortest allowed step (`min_timestep`, 1e-13 s at any time), and the run fails. The
    adapter sets `min_timestep` to the rounding of the horizon.
    """
    ode = model("u_i { x = 0.0, y = 4e-14 } F_i { 1.0, 3.0 }", 1e-9, "bdf")
    default = ode.options.min_timestep
    words, _, time = error_message(lambda: ode.solve(np.array([]), 3.0)).partition(" at time = ")
    holds("Step size is too small" in words and 0 < float(time) < default, f"{words} at {time}")
    ode.options.min_timestep = 1e-16
    end = float(ode.solve(np.array([]), 3.0).ts[-1])
    holds(end == 3.0, f"with a shorter one it ends at {end}")
    return (
        f"x' = 1, y' = 3 from (0, 4e-14) ends at t = {float(time):.1e}, {words}; with `options.min_timestep` 1e-16 in "
        f"place of {default:g} it comes to 3"
    )
