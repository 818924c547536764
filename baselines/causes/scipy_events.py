"""SciPy's ``solve_ivp`` and its events."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

from henon_ref.baselines.causes.base import Cause, holds

ISSUES = "https://github.com/scipy/scipy/issues"


def terminal(function: Callable[..., float], direction: int = 0) -> Callable[..., float]:
    """Mark a function as a terminal event."""
    function.terminal = True  # type: ignore[attr-defined]
    function.direction = direction  # type: ignore[attr-defined]
    return function


def solve_ivp(*arguments: Any, **options: Any) -> Any:
    """SciPy's, loaded with the first call: most reports check nothing."""
    from scipy import integrate

    return integrate.solve_ivp(*arguments, **options)


def quiet(*arguments: Any, **options: Any) -> Any:
    """``solve_ivp`` without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return solve_ivp(*arguments, **options)


def pair_in_one_step() -> str:
    """x' = 1 through x^2 = d^2/4: two roots, and no step ends between them."""
    steps = []
    for method in ("RK45", "DOP853", "Radau", "BDF", "LSODA"):
        found = quiet(
            lambda t, x: [1.0], (0, 2), [-1.0], method=method, events=lambda t, x: x[0] ** 2 - 0.0025, rtol=1e-9
        )
        holds(found.t_events[0].size == 0, f"{method} reports a root at {found.t_events[0]}")
        holds(not any(abs(x) < 0.05 for x in found.y[0]), f"a step of {method} ends between the roots")
        steps.append(found.t.size - 1)
    return f"roots at t = 0.95 and 1.05 are not reported by any method; they take {min(steps)} to {max(steps)} steps"


def fires_where_it_starts() -> str:
    """A ball at its surface: x = 0, v = 1 upwards."""
    ball = (lambda t, x: [x[1], -1.0], (0, 3), [0.0, 1.0])
    without = solve_ivp(*ball, events=terminal(lambda t, x: x[0]))
    holds(without.t[-1] < 1e-6, f"it goes on to t = {without.t[-1]}")
    falling = solve_ivp(*ball, events=terminal(lambda t, x: x[0], -1))
    holds(abs(falling.t[-1] - 2) < 1e-2, f"with a direction it stops at t = {falling.t[-1]}")
    return (
        f"thrown up from its surface, a ball is stopped at t = {without.t[-1]:g}; with a direction it comes down at 2"
    )


def root_of_third_order() -> str:
    """x' = 1 through (x - 1)^3."""
    for method in ("RK45", "DOP853", "Radau", "BDF", "LSODA"):
        words = ""
        try:
            quiet(lambda t, x: [1.0], (0, 3), [0.0], method=method, events=lambda t, x: (x[0] - 1.0) ** 3)
        except RuntimeError as error:
            words = str(error)
        holds("100 iterations" in words, f"{method} raises {words or 'nothing'}")
    return "the root of (x - 1)³ at t = 1 ends a run of every method by an exception, after 100 iterations of brentq"


def bracket_without_a_sign_change() -> str:
    """The event function has one sign at the step's end and another on the dense output there.

    From -c to 0, for some c: which of them it is depends on the last bits of the linear algebra library.
    """
    words: list[str] = []
    for tenth in range(1, 31):
        c = tenth / 10
        try:
            solve_ivp(
                lambda t, x: [1.0], (0, c), [-c], method="Radau", events=terminal(lambda t, x: -x[0], -1), rtol=1e-6
            )
        except ValueError as error:
            holds("different signs" in str(error), str(error))
            words.append(f"ValueError, '{error}'")
    holds(bool(words), "no ValueError")
    return f"Radau on x' = 1 from -c, event -x, horizon c, for c = 0.1, 0.2, ..., 3: in {len(words)} of 30 {words[0]}"


def event_behind_a_pole() -> str:
    """v' = -1/(v + d), event v: a step that ends beyond the event has to come close to the pole at v = -d."""
    words = []
    for d in (1e-3, 1e-9):
        found = quiet(
            lambda t, v, d=d: [-1.0 / (v[0] + d)],
            (0, 3),
            [1.0],
            method="DOP853",
            events=terminal(lambda t, v: v[0], -1),
            rtol=1e-9,
            atol=1e-9,
        )
        words.append(f"d = {d:g}: {'found' if found.t_events[0].size else found.message}")
        holds((found.status == 1) == (d == 1e-3), words[-1])
    return "; ".join(words)


def late_start() -> str:
    """The same oscillator at t = 0 and at t = 1e9."""
    early, late = (
        quiet(lambda t, x: [x[1], -x[0]], (t, t + 10), [1.0, 0.0], method="BDF", rtol=1e-9, atol=1e-9)
        for t in (0.0, 1e9)
    )
    holds(early.status == 0 and late.status < 0, f"{early.message} / {late.message}")
    return f"BDF runs from t = 0 to 10; from t = 1e9 it ends at once: {late.message}"


def blow_up_is_a_failed_step() -> str:
    """x' = x^2 from 1 ends at t = 1."""
    found = quiet(lambda t, x: [x[0] ** 2], (0, 2), [1.0], method="BDF", rtol=1e-9, atol=1e-9)
    holds(found.status < 0, found.message)
    holds(found.y[0, -1] < 1e12, f"the state reached {found.y[0, -1]:g}")
    return f"BDF on x' = x² ends at t = {found.t[-1]:.9f} with x = {found.y[0, -1]:.1e}: {found.message}"


def low_order_at_a_tight_tolerance() -> str:
    """One period of x'' = -x."""
    counts = {}
    for method in ("DOP853", "Radau"):
        for rtol in (1e-6, 1e-12):
            found = quiet(lambda t, x: [x[1], -x[0]], (0, 6.28), [1.0, 0.0], method=method, rtol=rtol, atol=rtol)
            counts[method, rtol] = found.t.size - 1
    growth = {method: counts[method, 1e-12] / counts[method, 1e-6] for method in ("DOP853", "Radau")}
    holds(growth["Radau"] > 4 * growth["DOP853"], f"growth of the number of steps {growth}")
    return (
        f"from 1e-6 to 1e-12 the steps of one period grow from {counts['DOP853', 1e-6]} to {counts['DOP853', 1e-12]} "
        f"with DOP853, from {counts['Radau', 1e-6]} to {counts['Radau', 1e-12]} with Radau"
    )


def bdf_at_a_tight_tolerance() -> str:
    """One period of x'' = -x with BDF, order 5 at most."""
    steps = [
        quiet(lambda t, x: [x[1], -x[0]], (0, 6.28), [1.0, 0.0], method="BDF", rtol=rtol, atol=rtol).t.size - 1
        for rtol in (1e-6, 1e-12)
    ]
    holds(steps[1] > 5 * steps[0], f"steps {steps}")
    return f"from 1e-6 to 1e-12 the steps of one period of an oscillator grow from {steps[0]} to {steps[1]}"


def number_that_is_none() -> str:
    """h' = -sqrt(h) from 1, Torricelli's law: h = (1 - t/2)^2, and nothing is left at t = 2."""
    import numpy as np

    def tank(method: str) -> Any:
        return quiet(lambda t, h: -np.sqrt(h), (0, 4), [1.0], method=method, rtol=1e-9, atol=1e-9)

    lsoda = tank("LSODA")
    numbers = np.isfinite(lsoda.y[0])
    last = lsoda.t[numbers][-1]
    seen = f"LSODA: status {lsoda.status}, h(4) = {lsoda.y[0, -1]:g}, no number after t = {last:.3f}"
    holds(lsoda.status == 0 and last < 2.0 and not numbers[-1], seen)
    for method in ("RK45", "DOP853"):
        found = tank(method)
        holds(found.status < 0 and np.isfinite(found.y).all(), f"{method}: {found.message}")
    for method in ("Radau", "BDF"):
        try:
            holds(tank(method).status < 0, f"{method} says nothing")
        except ValueError:
            continue
    return f"{seen}, where h = {lsoda.y[0, numbers][-1]:.2f}; no other method reports success"


SCIPY = (
    Cause(
        "scipy-pair",
        "scipy",
        "Two roots in one step cancel",
        "`solve_ivp` compares the signs of an event function at the two ends of a step. An even number of roots in "
        "between leaves no trace.",
        pair_in_one_step,
        (f"{ISSUES}/9228", f"{ISSUES}/18039"),
    ),
    Cause(
        "scipy-fires-at-start",
        "scipy",
        "A root at the starting point counts",
        "A run that starts on its event surface is stopped there again unless a direction excludes it.",
        fires_where_it_starts,
    ),
    Cause(
        "scipy-bracket",
        "scipy",
        "The event's bracket has no sign change",
        "The sign at a step's end is taken from the step, the root is sought on its dense output. Where the two differ "
        "by a rounding, `brentq` gets a bracket without a sign change and raises.",
        bracket_without_a_sign_change,
    ),
    Cause(
        "scipy-flat-root",
        "scipy",
        "A root of third order ends the run",
        "`brentq` is called with a tolerance of four roundings and its default of 100 iterations, which a root of "
        "third order uses up; its exception ends `solve_ivp`, and all that was computed is lost.",
        root_of_third_order,
    ),
    Cause(
        "scipy-pole",
        "scipy",
        "An event in front of a pole",
        "An event is located in a step that has passed it. Where the field has a pole, or no value, just behind the "
        "surface, every such step is refused, until it is too small for the time.",
        event_behind_a_pole,
    ),
    Cause(
        "scipy-late",
        "scipy",
        "Steps have to be ten roundings of the time",
        "The least step is ten units in the last place of the time. At t = 1e9 that is 1e-6, and BDF's first steps at "
        "a tight tolerance are shorter.",
        late_start,
    ),
    Cause(
        "scipy-blow-up",
        "scipy",
        "A blow-up is a step that is too small",
        "`solve_ivp` has no word for divergence: the step shrinks until it is refused, with BDF long before the state "
        "is large.",
        blow_up_is_a_failed_step,
    ),
    Cause(
        "scipy-radau-order",
        "scipy",
        "Radau is of order 5, its error estimate of order 3",
        "From tolerance to tolerance the number of steps grows by the third root or more: at 1e-12 a run of ordinary "
        "length takes longer than any deadline here.",
        low_order_at_a_tight_tolerance,
    ),
    Cause(
        "scipy-bdf-order",
        "scipy",
        "BDF is of order 5 at most",
        "At tight tolerances its steps are short, and each one is plain Python with a linear solve.",
        bdf_at_a_tight_tolerance,
    ),
    Cause(
        "scipy-lsoda-nan",
        "scipy",
        "LSODA takes a NaN for a state",
        "Where the field has no value at a trial point RK45 and DOP853 make the step shorter, and Radau and BDF fail "
        "or raise. LSODA goes on with a state that is no number, to the horizon, and reports success.",
        number_that_is_none,
    ),
)
