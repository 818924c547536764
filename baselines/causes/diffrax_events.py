"""diffrax's ``Event`` with a root finder. Each check runs in a new process, because jax starts threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from henon_ref.baselines.causes.base import cause, holds

shows = partial(cause, "diffrax", docs="https://docs.kidger.site/diffrax/api/events/", apart=True)
GITHUB = "https://github.com/patrick-kidger/diffrax"


def solve(
    field: Callable[..., Any],
    start: list[float],
    until: float,
    conditions: Any,
    *,
    finder: Any = None,
    direction: bool | None = None,
    step: float | None = None,
    solver: Any = None,
) -> Any:
    """Call ``diffeqsolve`` with an event. Defaults: Dopri8, adaptive steps, Newton's method as in the documentation.

    ``step`` is the length of constant steps.
    """
    import diffrax
    import jax
    import optimistix

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    tolerance = 1e-12
    controller = diffrax.PIDController(rtol=tolerance, atol=tolerance) if step is None else diffrax.ConstantStepSize()
    return diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: jax.numpy.array(field(t, y), dtype=float)),
        solver or diffrax.Dopri8(),
        0.0,
        until,
        step,
        jax.numpy.array(start),
        stepsize_controller=controller,
        event=diffrax.Event(conditions, finder or optimistix.Newton(tolerance, tolerance), direction),
        throw=False,
    )


def _one(t: Any, y: Any) -> list[float]:
    return [1.0]


def _oscillator(t: Any, y: Any) -> list[Any]:
    return [y[1], -y[0]]


def _ball(t: Any, y: Any) -> list[Any]:
    return [y[1], -1.0]


@shows("diffrax-last-root", "The last root of a step, not the first", f"{GITHUB}/pull/644")
def last_root() -> str:
    """The root finder starts at the end of the step: Newton's method converges to the last root, bisection to any root
    in the step. The adapter uses bisection; of three roots in a step it may find any.
    """

    def condition(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return (1.0 - y[0]) * (2.0 - y[0]) * (3.0 - y[0])

    newton = float(solve(_one, [0.0], 4.0, condition, step=4.0).ts[0])
    holds(abs(newton - 3) < 1e-9, f"Newton's method stops it at {newton}")
    return f"of roots at 1, 2 and 3 in a step from 0 to 4 Newton's method gives {newton:.6f}"


@shows("diffrax-pair", "diffrax: two roots within one step are not found")
def pair_in_one_step() -> str:
    """Signs of a condition are compared at the two ends of a step. An even number of roots in between leaves no
    trace."""
    found = solve(_one, [0.0], 2.0, lambda t, y, args, **_: (y[0] - 1.0) ** 2 - 2.5e-5, step=0.3)
    holds(float(found.ts[0]) == 2.0, f"it stops at {found.ts[0]}")
    return "roots at t = 0.995 and 1.005, in one of steps of 0.3, are not reported; the run ends at 2"


@shows("diffrax-list-order", "Of several conditions the first in the list counts", f"{GITHUB}/issues/639")
def first_in_the_list() -> str:
    """If two conditions change sign in one step, the run stops at the root of the condition that is listed first,
    although the other root may be earlier. The adapter passes one condition, the minimum of all guards.
    """
    late, early = (lambda t, y, args, **_: y[0] - 1.0), (lambda t, y, args, **_: y[0] - 0.5)
    one, other = (float(solve(_one, [0.0], 4.0, pair, step=2.0).ts[0]) for pair in ((late, early), (early, late)))
    holds(abs(one - 1) < 1e-9 and abs(other - 0.5) < 1e-9, f"it stops at {one} and {other}")
    return f"roots at t = 0.5 and 1 in one step: the run stops at {one:g} or {other:g}, by the order of the conditions"


@shows("diffrax-start", "A zero at the start is a change of sign")
def start_on_the_surface() -> str:
    """A condition that is exactly zero at the start counts as having changed its sign by the end of the first step. The
    adapter starts every guard clearly above zero, and counts falling roots only.
    """

    def height(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return y[0]

    either = solve(_ball, [0.0, 1.0], 3.0, height)
    falling = solve(_ball, [0.0, 1.0], 3.0, height, direction=False)
    lifted = solve(_ball, [1e-12, 1.0], 3.0, height, direction=False)
    stops = [float(found.ts[0]) for found in (either, falling, lifted)]
    steps = int(either.stats["num_steps"])
    holds(abs(stops[0]) < 1e-9 or steps == 1, f"without a direction it stops at {stops[0]} after {steps} steps")
    holds(abs(stops[2] - 2) < 1e-6, f"lifted, with a direction, it stops at {stops[2]}")
    return (
        f"thrown up from its surface at t = 0, a ball that comes down at 2 is stopped at {stops[0]:.3g} after {steps} "
        f"step without a direction, at {stops[1]:.6g} with one; started 1e-12 above it comes down at {stops[2]:.6f}"
    )


@shows("diffrax-pole", "diffrax: an event in front of a pole")
def event_in_front_of_a_pole() -> str:
    """An event is located in a step that has passed it. If the field has a pole, or no value, just after the surface,
    every such step is rejected, and the steps no longer move the time.
    """
    import diffrax

    events, steps = [], []
    for d in (1e-3, 1e-9):
        found = solve(lambda t, y, d=d: [-1.0 / (y[0] + d)], [1.0], 3.0, lambda t, y, args, **_: y[0], direction=False)
        events.append(bool(found.result == diffrax.RESULTS.event_occurred))
        steps.append(int(found.stats["num_steps"]))
    holds(events == [True, False], f"an event is reported: {events}")
    return f"1e-3 in front of the pole the event is found in {steps[0]} steps, 1e-9 in front of it not in {steps[1]}"


@shows(
    "diffrax-bisection-units",
    "Bisection ends by the size of the condition, too",
    "https://docs.kidger.site/optimistix/api/root_find/",
)
def bisection_has_units() -> str:
    """optimistix's bisection stops only if the interval is small and the condition is below the absolute tolerance. If
    rounding keeps the condition above the tolerance, the run fails. The adapter scales the condition down.
    """
    import diffrax
    import optimistix

    results = []
    for unit in (1.0, 1e6):
        found = solve(
            _one, [0.0], 3.0, lambda t, y, args, unit=unit, **_: unit * (1.0 - y[0]) + 0.1 * unit * (1.0 - y[0]) ** 3,
            finder=optimistix.Bisection(1e-13, 1e-13), step=0.7,
        )  # fmt: skip
        results.append(bool(found.result == diffrax.RESULTS.event_occurred))
    holds(results == [True, False], f"an event is reported: {results}")
    return "the root of a condition is found in one unit, and 1e6 times it ends the run with the root finder's failure"


@shows("diffrax-dense-output", "Events on a dense output of lower order")
def dense_output_of_lower_order() -> str:
    """An event is located on the step's dense output, whose order (5 for Dopri8, 3 for Kvaerno5) is below that of the
    step: the time of the event, and the state there, are less accurate than the steps.
    """
    import math

    quarter = math.pi / 2
    ended = solve(_oscillator, [1.0, 0.0], quarter, lambda t, y, args, **_: y[0] + 2.0)
    event = solve(_oscillator, [1.0, 0.0], 3.0, lambda t, y, args, **_: y[0])
    state, time = abs(float(ended.ys[0][0])), abs(float(event.ts[0]) - quarter)
    holds(time > 20 * state, f"error of the state {state}, of the event {time}")
    return f"cos(t) by Dopri8 at 1e-12: a step to pi/2 ends {state:.1e} off, an event finds the root {time:.1e} s off"
