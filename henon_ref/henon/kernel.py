"""The compiled mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.

Whatever needs more thought than a sign (several events at once, a tangency, a mode not compiled yet) is
handed back to Python (:mod:`henon_ref.henon.session`) with a code; after the answer the loop goes on.
"""

from __future__ import annotations

from henon_ref.henon.calls import call_closing, call_expand
from henon_ref.henon.events import at_zero, ends_at_zero, first_event, silent, zeros_at_release, zeros_when_leaving
from henon_ref.henon.holding import held
from henon_ref.henon.polynomial import BRACKET
from henon_ref.henon.recording import crowded, record, sample, settle, start
from henon_ref.henon.registers import (
    ACCUMULATED,
    CROSS,
    DIVERGED,
    DOUBTFUL,
    F_CAP,
    F_LOW,
    F_NEAR,
    F_REACH,
    F_SIGMA,
    F_SIZE,
    F_TIME,
    FREE,
    FULL,
    HORIZON,
    I_COUNT,
    I_GUARD,
    I_LANDING,
    I_MODE,
    I_RHS,
    I_SAMPLE,
    I_STEPPED,
    I_STEPS,
    I_WHAT,
    INVALID,
    NOWHERE,
    PAUSE,
    RELEASE,
    REMEMBERED,
    RESOLVE,
    STALLED,
    STICK,
    SURFACE,
    TANGENT,
    UNKNOWN,
    VALID,
)  # fmt: skip
from henon_ref.henon.settling import decided
from henon_ref.henon.stepping import LEAP, add_time, glide, move, polish, trusted
from henon_ref.jit import njit


@njit()
def advance(  # type: ignore[no-untyped-def]
    floats, integers, x, x_low, multiplicity, hits,
    until, until_low, order, tolerance, method, budget,
    addresses, constants, probes, layouts, targets, settling,
    c, ahead, change, point, speeds, table, work, bounds,
    times, marks, states,
    sample_times, samples, sample_modes,
):  # fmt: skip
    """Run until the horizon, or until Python is needed.

    Parameters
    ----------
    floats, integers : ndarray
        State of the run (F_..., I_...).
    x, x_low : ndarray, shape (n,)
        State, and what rounding it lost.
    multiplicity : ndarray of int, shape (G,)
        Known zeros of each guard at the present point (the surface just left), divided out.
    hits : ndarray of int, shape (G,)
        Guards at zero when the loop comes back with RESOLVE.
    until, until_low : float
        Horizon.
    budget : int
        Steps before it comes back with PAUSE.
    addresses : ndarray of int, shape (M, 3)
        Machine code of each mode: expansion, closing and probe.
    constants, probes : ndarray, shape (M, K)
        Their constants.
    layouts : ndarray of int, shape (M, 1 + G, 5)
        (guards, 0 ...), then (kind, index, rising only, has a hold zone, acts on a sliding surface) a guard.
    targets : ndarray of int, shape (M, G, 2)
        Mode after a crossing and after a stick; for a release the mode after it and the zeros it leaves
        with; -1 where not known yet.
    settling : tuple or None
        What :func:`henon_ref.henon.settling.decided` needs; None where there is nothing for it to decide (it is
        then not compiled).
    c : ndarray, shape (n + G + 1, row length)
        Taylor coefficients of states and guards in units of sigma, then the norms of the last ones.
    ahead, point : ndarray, shapes of c and x
        Work space: the expansion at the end of a step that is checked.
    change : ndarray, shape (n + G,)
        Change of the states over a step, bounds of the guards from below.

    Returns
    -------
    int
        HORIZON, RESOLVE, FULL, DIVERGED, STALLED, PAUSE, INVALID, ACCUMULATED, DOUBTFUL or UNKNOWN.
    """
    n = x.size
    stop_at = integers[I_STEPS] + budget
    while True:
        mode = integers[I_MODE]
        slot = F_SIZE + min(mode, REMEMBERED - 1)
        if mode != integers[I_STEPPED] and floats[slot] > 0.0:
            floats[F_SIGMA] = min(floats[slot], floats[F_CAP])
        integers[I_STEPPED] = mode
        layout = layouts[mode]
        guards = layout[0, 0]
        if integers[I_COUNT] + 1 > times.shape[0]:
            return FULL
        remaining = (until - floats[F_TIME]) + (until_low - floats[F_LOW])
        if remaining <= 0.0:
            return HORIZON
        alone = integers[I_SAMPLE] < sample_times.size
        for g in range(guards):
            alone = alone or multiplicity[g] > 0
        theta = glide(
            floats, integers, x, x_low, addresses[mode, 0], addresses[mode, 1], constants[mode], c, change,
            guards, until, until_low, order, tolerance, alone, stop_at,
        )  # fmt: skip
        if theta == 0.0:
            return PAUSE
        if theta < 0.0:
            return STALLED if theta > -1.5 else DIVERGED
        sigma = floats[F_SIGMA]
        natural = theta * sigma
        remaining = (until - floats[F_TIME]) + (until_low - floats[F_LOW])
        final = natural >= remaining
        if final:
            theta = remaining / sigma
        if natural > LEAP * sigma:
            believed = trusted(
                floats, integers, x, addresses[mode, 0], addresses[mode, 1], constants[mode], c, ahead, change, point,
                guards, order, theta,
            )  # fmt: skip
            if believed < theta:
                theta, final = believed, False
                natural = theta * sigma
        call_closing(addresses[mode, 1], theta, c, change)
        early = False
        for g in range(guards):
            low = c[n + g, multiplicity[g]] <= 0.0 and layout[1 + g, 2] == 0
            if low and multiplicity[g] == 0 and layout[1 + g, 0] == SURFACE:
                multiplicity[g] = zeros_when_leaving(c[n + g], order)
                low = multiplicity[g] == 0
            hits[g] = 1 if low and not silent(c[n + g], order) else 0
            early = early or hits[g] == 1
        if early:  # on a surface and not leaving it: Python looks closer
            integers[I_GUARD] = NOWHERE
            return RESOLVE
        best, hit, doubtful, used = first_event(
            integers, c, n, order, layout, multiplicity, change[n:], theta, method, table, work, bounds
        )
        if final and hit < 0:  # the horizon belongs to the run: an event at it counts
            for g in range(guards):
                if ends_at_zero(c[n + g], multiplicity[g], order, theta):
                    best, hit, doubtful = 1.0, g, True
        part = theta if hit < 0 else best * theta
        if doubtful:
            integers[I_GUARD], integers[I_LANDING] = hit, BRACKET
            floats[F_NEAR], floats[F_REACH] = part * sigma, theta * sigma
            return DOUBTFUL
        if integers[I_SAMPLE] < sample_times.size:
            sample(floats, integers, c, order, part, sigma, mode, sample_times, samples, sample_modes)
        together = False
        if hit >= 0:
            for g in range(guards):
                hits[g] = 1 if g == hit or at_zero(c[n + g], multiplicity[g], order, part, layout[1 + g, 2]) else 0
                together = together or (hits[g] == 1 and g != hit)
            call_closing(addresses[mode, 1], part, c, change)
        bounded = move(x, x_low, change)
        add_time(floats, part * sigma)
        integers[I_STEPS] += 1
        floats[F_CAP] = 1e3 * part * sigma if part > 0.0 else sigma
        floats[F_SIGMA] = min(natural, floats[F_CAP]) if part > 0.0 else sigma
        floats[slot] = natural
        if not bounded:
            return DIVERGED
        if hit < 0:
            multiplicity[:guards] = 0
            if final:
                floats[F_TIME], floats[F_LOW] = until, until_low
                return HORIZON
            continue
        kind, index = layout[1 + hit, 0], layout[1 + hit, 1]
        integers[I_GUARD] = hit
        integers[I_LANDING] = used
        if kind == VALID:
            return INVALID
        if kind == RELEASE:
            polish(
                floats, integers, x, x_low, addresses[mode, 0], addresses[mode, 1], constants[mode], ahead, change,
                n + hit, sigma, theta, until,
            )  # fmt: skip
        which, zeros, what = 0, 1, CROSS
        if kind == SURFACE:
            if together or layout[1 + hit, 4] == 1:
                if settling is None:
                    return RESOLVE
                target = decided(floats[F_TIME], floats[F_LOW], x, mode, layout, hits, settling)
                if target < 0 or not settle(
                    floats, integers, x, times, marks, states, multiplicity, mode, target, layout, layouts[target],
                    hits, settling[2], used,
                ):  # fmt: skip
                    return RESOLVE
                if crowded(floats, integers):
                    return ACCUMULATED
                continue
            call_expand(addresses[mode, 2], floats[F_TIME], floats[F_LOW], 1.0, x, probes[mode], speeds)
            integers[I_RHS] += 1
            inside, beyond = speeds[n + 2 * hit, 0], speeds[n + 2 * hit + 1, 0]
            if not (inside > 0.0 and abs(beyond) > TANGENT * inside):
                return RESOLVE
            stuck = beyond < 0.0
            if layout[1 + hit, 3] == 1:
                stick = targets[mode, hit, 1]
                zone = 0 if stick < 0 else held(
                    floats[F_TIME], floats[F_LOW], floats[F_SIGMA], x, index, layouts[stick], addresses[stick, 0],
                    constants[stick], ahead, order,
                )  # fmt: skip
                if zone == 0 or (stuck and zone < 0):
                    return RESOLVE
                stuck = zone > 0
            if stuck:
                which, zeros, what = 1, 0, STICK
        else:
            what, zeros = FREE, targets[mode, hit, 1]
        target = targets[mode, hit, which]
        if together:
            return RESOLVE
        if target < 0:
            integers[I_WHAT] = what
            return UNKNOWN
        if zeros == 0 and what == FREE:
            call_expand(addresses[target, 2], floats[F_TIME], floats[F_LOW], 1.0, x, probes[target], speeds)
            integers[I_RHS] += 1
            zeros = zeros_at_release(layouts[target], index, speeds[n:, 0])
            if zeros == 0:
                return RESOLVE
        record(floats, integers, x, times, marks, states, what, index, mode, target, used)
        integers[I_MODE] = target
        start(multiplicity, layouts[target], index, zeros)
        if crowded(floats, integers):
            return ACCUMULATED
