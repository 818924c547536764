"""Status and reason of a run that the compiled loop cannot continue, or whose step overflow or underflow changed.

A run that stalls at a branch point of a guard can be continued if the motion itself is smooth there. The power series
of the guard does not converge past the branch point, but nothing is integrated from a guard. The states are therefore
expanded in multiprecision around this instant, and all guards are evaluated on both sides, increasingly close to it. If
each guard keeps its sign by a margin much larger than its variation, no event occurs at the branch point, and the run
continues after it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from flint import arb, arb_poly
from numpy.typing import NDArray

from henon_ref.integrator.multiprecision_roots import BITS
from henon_ref.integrator.precise_modes import PreciseModes, split
from henon_ref.integrator.run_result import Reason
from henon_ref.integrator.state_view import State
from henon_ref.kernel.library import EPS, LEVELS, kernel
from henon_ref.modes.decision import ended, explained, several
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision
from henon_ref.trajectory import Status


def ending_of(run: State, code: int) -> tuple[Status, Reason]:
    """Return status and reason for the codes DIVERGED, STALLED, EVENTS_ACCUMULATE, NOT_UNIQUE, LEFT_DOMAIN, BEYOND."""
    if code == kernel.NOT_UNIQUE:
        return _two_ways(run)
    if code == kernel.LEFT_DOMAIN:
        return _domain_ending(run, run.guards[run.scalars.guard])
    time = run.time
    largest = max(map(abs, run.x.tolist()))
    grown = largest > 1e8 * max(1.0, *(abs(v[0]) for v in run.start.x))
    if code == kernel.DIVERGED or (code == kernel.STALLED and grown):
        return "diverged", f"the state leaves every bound at t = {time:.17g}"
    singular = vanishing_guard(run) if code == kernel.STALLED else None
    if singular is not None:
        return _domain_ending(run, singular)
    if code == kernel.STALLED:
        system, guards = run.integrator.system, run.guards
        series = run.workspace.band[: run.x.size + len(guards), : run.integrator.order + 1].copy()
        at = f"the step size fell to zero at t = {time:.17g}"
        return "failed", lambda: f"{at}: {_singular(system, guards, series)} there"
    if code == kernel.BEYOND:
        return "failed", f"the state at t = {time:.17g} is beyond a surface of its mode; an event there was undecided"
    return "failed", f"transitions accumulate at t = {time:.17g}: no mode lasts longer than the resolution of time"


def _two_ways(run: State) -> tuple[Status, Reason]:
    """Return status and reason at a point where a surface with sliding has become repelling."""
    system, mode, time = run.integrator.system, run.mode, run.time
    index = run.integrator.mode_table.guards(mode)[run.scalars.guard].index

    def reason() -> str:
        refused = several(system, [replaced(mode, index, side) for side in (-1, 1)], f"{time:.17g}")
        return explained(refused, system, mode, (index,)).reason

    return "nonunique", reason


def _domain_ending(run: State, guard: Guard) -> tuple[Status, Reason]:
    """Return status and reason at a guard that ends the run."""
    system, mode, time = run.integrator.system, run.mode, run.time

    def reason() -> str:
        refused = ended(system, mode, [guard], f"{time:.17g}")
        assert refused is not None
        return refused.reason

    return guard.ends if guard.ends in ("nonunique", "invalid") else "failed", reason


def vanishing_guard(run: State) -> Guard | None:
    """Return a guard that ends the run and is nearly zero at the stalled point, where the field may be singular."""
    next_to_nothing = 1e-14 * max(1.0, abs(run.start.time[0]), abs(run.time))
    for g, guard in enumerate(run.guards):
        if guard.ends and abs(run.workspace.band.item(run.x.size + g, 0)) <= next_to_nothing:
            return guard
    return None


def _singular(system: FilippovSystem, guards: Sequence[Guard], rows: NDArray[np.float64]) -> str:
    """Return the name of the series that is not finite at the stalled point, or of the steepest one."""
    order, states, series = rows.shape[1] - 1, len(system.states), rows.tolist()
    finite = [len(row) if math.isfinite(sum(row)) else len(list(takewhile(math.isfinite, row))) for row in series]
    # A coefficient that is not finite spreads: to a state one order after the field from which it is integrated.
    at = finite.index(min(finite))
    singular = finite[at] > (1 if at < states else 0)
    if finite[at] > order:
        steep = [abs(row[order]) / (abs(row[0]) + abs(row[1]) + abs(row[2]) + 1e-300) for row in series]
        at = steep.index(max(steep))
    return f"{_row_name(system, guards, at)} is {'singular' if singular else 'not finite'}"


def _row_name(system: FilippovSystem, guards: Sequence[Guard], row: int) -> str:
    """Return the name of the quantity whose series is in this row of an expansion."""
    states = len(system.states)
    if row < states:
        return f"the field of {system.state_names[row]}"
    guard = guards[row - states]
    of = str(system.valid[guard.index]) if guard.kind == "valid" else system.sign_names[guard.index]
    words = {"valid": "", "surface": "the surface of ", "attracts": "whether sliding attracts on "}
    return f"{words.get(guard.kind, 'the release of ')}{of}"


def range_ending(run: State) -> tuple[Status, str] | None:
    """Return status and reason after an overflow or underflow; None if it does not matter.

    The step is compared with its series in ball arithmetic, whose exponent range is unbounded. The states and guards
    must agree within the tolerance, and the guards must have the same sign.
    """
    scalars, n = run.scalars, run.x.size
    places = run.integrator.mode_table.places(run.mode)
    with working_precision(BITS):
        unit, state = arb(float(scalars.unit)), [arb(x) for x in run.x.tolist()]
        theta, precise = arb(float(scalars.step_length)) / unit, run.start.constants.precise
        states, outputs = precise.motion(run.mode, run.exact_time, state, unit, scalars.order)
        exact = [*states, *(outputs[place] if place >= 0 else None for place in places)]
        level = max(float(scalars.tolerance), 1e3 * EPS)  # rounding alone may change a series by the second
        band = run.workspace.band
        rounding = band[n + scalars.guards + 1 :].ravel()
        for r, own in enumerate(exact):
            found = band[r, : scalars.order + 1].tolist()
            off = float(rounding[r]) * (float(scalars.step_length) if r < n else 1.0)
            if own is not None and not _same(found, own, theta, level, off if off < math.inf else 0.0, guard=r >= n):
                why = "an operation's result is no double, which changes it by more than the tolerance"
                what = _row_name(run.integrator.system, run.guards, r)
                return "failed", f"{what} overflows or underflows at t = {run.time:.17g}: {why}"
    return None


def _same(
    found: Sequence[float], exact: Sequence[arb], theta: arb, level: float, rounding: float, *, guard: bool
) -> bool:
    """Whether a series equals its exact value on a step of theta units, up to ``level`` and rounding."""
    powers = [theta**k for k in range(len(exact))]
    off = sum((abs(arb(c) - own) * p for c, own, p in zip(found, exact, powers, strict=True)), arb(0))
    size = sum((abs(own) * p for own, p in zip(exact, powers, strict=True)), arb(0))
    if off <= level * size + arb(rounding):
        return True
    same_sign = found[0] > 0 if exact[0] > 0 else found[0] < 0 if exact[0] < 0 else found[0] == 0
    return bool(off <= LEVELS.no_account and (same_sign or not guard))


def pass_branch_point(run: State) -> bool:
    """Continue the run past a branch point of a guard.

    The run has stalled next to the branch point. Returns False if there is no branch point, the model ends there, or
    the signs of the guards are not clear.
    """
    scalars = run.scalars
    code = run.integrator.mode_table.codes[int(scalars.mode)]
    guards_alone = any(code.guards_branch) and not code.field_branches
    if not guards_alone or run.passed_at == scalars.steps or vanishing_guard(run) is not None:
        return False
    left, whole = run.left(run.now), run.until[0] - run.start.time[0]
    with working_precision(BITS):
        time, state = run.exact_time, run.exact_state
        for length in (1e-5 * whole * 0.1**k for k in range(5)):  # distances to continue past the branch point
            end = _passed(run.start.constants.precise, run.mode, time, state, arb(length)) if length < left else None
            if end is not None:
                behind, there = split(time + arb(length)), [split(x) for x in end]
                break
        else:
            return False
    run.count("branch_points")
    highs = [high for high, _ in there]
    run.keep_line(length, highs)
    run.fill_samples_on_line(length, highs)
    run.put(behind, there)
    run.known_zeros[:] = 0
    scalars.steps += 1
    scalars.unit, scalars.longest_step, scalars.stalled = length, 1e3 * length, 0
    run.passed_at = int(scalars.steps)
    return True


def _passed(modes: PreciseModes, mode: Mode, time: arb, state: Sequence[arb], length: arb) -> list[arb] | None:
    """Return the state after ``length``, or None unless all guards clearly keep their signs from -length to length."""
    motion, _ = modes.motion(mode, time, state, length, 16)
    for sizes in ([abs(float(c)) for c in series] for series in motion):
        if not max(sizes[-4:]) <= 1e-40 * sum(sizes):  # not converged
            return None
    states = [arb_poly(series) for series in motion]
    values = []
    # Distances from the branch point on both sides, relative to ``length``.
    for place in (arb(side * part) for part in (1.0, 0.47, 0.22, 0.09, 0.03) for side in (1, -1)):
        at = modes.guard_values(mode, time + length * place, [series(place) for series in states])
        if not all(value.is_finite() for value in at):  # most branch points are ends of the domain
            return None
        values.append([float(value) for value in at])
    if not all(map(_clear, zip(*values, strict=True))):
        return None
    return [series(arb(1)) for series in states]


def _clear(values: Sequence[float]) -> bool:
    """Whether values have one sign and are eight times larger than their variation."""
    variation = 8.0 * (max(values) - min(values))
    return all(v > variation for v in values) or all(v < -variation for v in values)
