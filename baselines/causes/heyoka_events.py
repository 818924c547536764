"""heyoka, its steps and its terminal events, by minimal runs of heyoka alone."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from henon_ref.baselines.causes.base import cause, holds

shows = partial(cause, "heyoka", docs="https://bluescarni.github.io/heyoka.py/notebooks/Event%20detection.html")


def run(guard: Any, field: Any, start: list[float], until: float, *, any_direction: bool = False) -> float:
    """Return the time at which a terminal event stops a run, or the horizon."""
    import heyoka

    heyoka.set_logger_level_error()
    directions = heyoka.event_direction
    event = heyoka.t_event(guard, direction=directions.any if any_direction else directions.negative, cooldown=0.0)
    integrator = heyoka.taylor_adaptive(field, start, tol=1e-15, t_events=[event])
    integrator.propagate_until(until)
    return float(integrator.time)


def _unit_speed() -> tuple[Any, list[tuple[Any, Any]]]:
    import heyoka

    x = heyoka.make_vars("x")
    return x, [(x, heyoka.expression(1.0))]


def _ball() -> tuple[Any, list[tuple[Any, Any]]]:
    import heyoka

    x, v = heyoka.make_vars("x", "v")
    return x, [(x, v), (v, heyoka.expression(-1.0))]


@shows("heyoka-double-root", "Two roots that rounding makes one")
def pair_below_rounding() -> str:
    """heyoka isolates the roots of the event's Taylor polynomial in double precision. If the event function between two
    roots is not larger than its rounding, the roots are a double root, which is not reported.

    x' = 1 through x^2 = d^2/4: with d = 1e-8 the constant is lost in the rounding of 1.
    """
    x, field = _unit_speed()
    wide = run(x * x - 1e-6**2 / 4, field, [-1.0], 2.0)
    close = run(x * x - 1e-8**2 / 4, field, [-1.0], 2.0)
    holds(abs(wide - 1) < 1e-6, f"roots 1e-6 apart: it stops at {wide}")
    holds(close == 2.0, f"roots 1e-8 apart: it stops at {close}")
    return f"roots 1e-6 apart are found (t = {wide:.8f}), roots 1e-8 apart are stepped over"


@shows("heyoka-event-polynomial", "The event is its Taylor polynomial")
def event_is_its_taylor_polynomial() -> str:
    """Roots are located on the Taylor polynomial of the event function over the step. The last two coefficients of the
    state and of this function determine the step size. If those of the function are zero or rounding where the step
    begins, its polynomial is wrong at the end of the step.

    x' = 1 from 0: 1 - x^50 is of higher degree than the expansion, and tanh(50 (x - 1)) is constant up to rounding.
    """
    import heyoka

    x, field = _unit_speed()
    power = run(1.0 - x**50.0, field, [0.0], 2.0)
    steep = run(-heyoka.tanh(50.0 * (x - 1.0)), field, [0.0], 2.0)
    plain = run(1.0 - x, field, [0.0], 2.0)
    holds(abs(plain - 1) < 1e-12, f"1 - x stops it at {plain}")
    holds(power == 2.0 and steep == 2.0, f"it stops at {power} and {steep}")
    return "the root of 1 - x at t = 1 is found; those of 1 - x^50 and -tanh(50 (x - 1)) at the same time are not"


@cause(
    "heyoka",
    "heyoka-gap",
    "The last two coefficients of a series determine the step size",
    "https://bluescarni.github.io/heyoka.py/notebooks/Customising%20the%20adaptive%20integrator.html",
    "https://doi.org/10.1080/10586458.2005.10128904",
)
def gap_at_the_end_of_a_series() -> str:
    """If the last two Taylor coefficients are zero or rounding and others are not, as at a symmetric state, the step is
    many times too long for the tolerance. At a tolerance with another order it may be right. The series is that of a
    state, or of an event function: a run that misses all transitions does not show which.

    A pendulum at rest at a right angle, whose energy is zero: only every fourth coefficient is more than rounding.
    """
    import heyoka

    heyoka.set_logger_level_error()
    x, v = heyoka.make_vars("x", "v")
    steps, errors = [], []
    for tolerance in (1e-6, 1e-7):
        pendulum = heyoka.taylor_adaptive([(x, v), (v, -heyoka.sin(x))], [math.pi / 2, 0.0], tol=tolerance)
        steps.append(pendulum.step(write_tc=True)[1])
        errors.append(abs(pendulum.state[1] ** 2 / 2 - math.cos(pendulum.state[0])))
        sizes = abs(pendulum.tc).max(axis=0)
        is_gap = max(sizes[-2:]) < 1e-15 < 1e-4 < max(sizes[-4:-2])
        holds(is_gap == (tolerance == 1e-6), f"largest coefficients at {tolerance:g}: {sizes}")
    holds(steps[0] > 20 * steps[1], f"first steps {steps}")
    holds(errors[0] > 1.0 and errors[1] < 1e-7, f"errors of the energy {errors}")
    return (
        f"the first step of x'' = -sin(x) from (pi/2, 0) is {steps[0]:.1f} s at 1e-6 and {steps[1]:.2f} s at 1e-7, and "
        f"the error of the energy after it {errors[0]:.0e} and {errors[1]:.0e}"
    )


@shows("heyoka-flat-root", "A direction is the sign of the derivative")
def root_of_third_order() -> str:
    """The direction of a root is the sign of the event's derivative at the root. At a root of third order the
    derivative is zero, and an event with a direction does not count.
    """
    x, field = _unit_speed()
    plain, flat = (run(guard, field, [0.0], 2.0) for guard in (1.0 - x, (1.0 - x) ** 3.0))
    either = run((1.0 - x) ** 3.0, field, [0.0], 2.0, any_direction=True)
    holds(abs(plain - 1) < 1e-12 and abs(either - 1) < 1e-4, f"it stops at {plain} and {either}")
    holds(flat == 2.0, f"with a direction (1 - x)^3 stops it at {flat}")
    return "falling roots of 1 - x and (1 - x)³ at t = 1: the first is found, the other without a direction alone"


@shows("heyoka-hidden-drive", "A pulse between two expansions is stepped over")
def drive_between_expansions() -> str:
    """The Taylor coefficients of a pulse in time are below rounding at the start of a step that is far from the pulse:
    the step leads over the pulse to the horizon.
    """
    import heyoka

    x = heyoka.make_vars("x")
    pulse = heyoka.exp(-100.0 * (heyoka.time - 10.0) ** 2.0)
    seen = run(1.0 - 20.0 * pulse, [(x, heyoka.expression(0.0))], [0.0], 20.0)
    holds(seen == 20.0, f"it stops at {seen}")
    return "1 - 20 exp(-100 (t - 10)²), which is negative from 9.83 to 10.17, has no root for a run from 0 to 20"


@shows("heyoka-start", "A zero at the start stops the run, or hides the next root")
def start_on_the_surface() -> str:
    """An event that is exactly zero at the start stops the run at once. With a direction it does not, but then the next
    true root in the first step is lost.
    """
    x, field = _ball()
    either = run(x, field, [0.0, 1.0], 3.0, any_direction=True)
    falling = run(x, field, [0.0, 1.0], 3.0)
    lifted = run(x, field, [1e-15, 1.0], 3.0)
    holds(either == 0.0, f"without a direction it stops at {either}")
    holds(falling == 3.0, f"with a direction it stops at {falling}")
    holds(abs(lifted - 2) < 1e-12, f"a rounding above the surface it stops at {lifted}")
    return (
        "thrown up from its surface, a ball is stopped at t = 0 without a direction, and never comes down with one; "
        f"started 1e-15 above it comes down at t = {lifted:.6f}"
    )


@shows("heyoka-past-end", "A Taylor polynomial continues after the end of the function")
def end_of_a_square_root() -> str:
    """The last Taylor coefficients determine the step size. If the motion is a polynomial up to the point at which the
    field, or the event function, ceases to have a value, the step leads past this point without an error.

    h' = -sqrt(h) from 1: h is a parabola up to t = 2, where it is zero and stays so.
    """
    import heyoka

    h = heyoka.make_vars("h")
    integrator = heyoka.taylor_adaptive([(h, -heyoka.sqrt(h))], [1.0], tol=1e-15)
    outcome, *_, steps, _, _ = integrator.propagate_until(4.0)
    end = float(integrator.state[0])
    holds(outcome == heyoka.taylor_outcome.time_limit and abs(end - 1.0) < 1e-9, f"{outcome}, h(4) = {end}")
    return f"h' = -sqrt(h) from h(0) = 1 to t = 4: {steps} step, outcome time_limit, and h(4) = {end:g}"
