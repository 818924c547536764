"""The compiled mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.

Whatever needs more thought than a sign (several events at once, a tangency, a mode not compiled yet) is
handed back to Python (:mod:`henon_ref.henon.engine`) with a code; after the answer the loop goes on.
"""

from __future__ import annotations

import numpy as np

from henon_ref.henon.calls import bits, call_closing, call_expand, from_bits
from henon_ref.henon.holding import held
from henon_ref.henon.polynomial import BRACKET, NONE, ROOT, TOUCH, excluded, first_falling_root, land, steepness, value
from henon_ref.henon.settling import decided
from henon_ref.jit import inner, njit

# Why the loop came back.
HORIZON, RESOLVE, FULL, DIVERGED, STALLED, PAUSE, INVALID, ACCUMULATED, DOUBTFUL, UNKNOWN = range(10)
# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, FREE, CROSS = 0, 1, 2
# Floats kept between calls: t and what rounding it lost, sigma, time of the last event and what it lost;
# where on the step a doubtful event is, and the step's end, both counted from its start; the largest sigma
# that a mode just entered may begin with.
F_TIME, F_LOW, F_SIGMA, F_LAST, F_LAST_LOW, F_NEAR, F_REACH, F_CAP, F_SIZE = range(9)
REMEMBERED = 64
"""Modes of which the last step is kept, in the floats behind those above: a mode seen before begins with it."""
# Integers kept between calls: mode; counts; last guard hit and its landing; steps that time cannot tell apart,
# events that it cannot tell apart; next sample; mode of the last step; kind of the event that leads to a mode
# not known yet.
(
    I_MODE,
    I_STEPS,
    I_RHS,
    I_EVENTS,
    I_COUNT,
    I_GUARD,
    I_LANDING,
    I_STALLED,
    I_CROWDED,
    I_SAMPLE,
    I_STEPPED,
    I_WHAT,
    I_SIZE,
) = range(13)

NOWHERE = -1
"""In place of the guard last hit: nothing was hit, a guard is at zero where a step begins."""
_EPS = 2.220446049250313e-16
TANGENT = 1e-9
"""Relative normal velocity below which a contact is left to Python's closer look."""
FLAT = 1e-5
"""Relative steepness of a guard at its root below which the root is left to a closer look in multiprecision."""
HUGE = 1e100
"""A state beyond this has blown up (no smaller bound is safe whatever the units)."""
LEAP = 4.0
"""A step this many times longer than the last is checked at its end before it is believed."""
FAR = 1e30
"""A step, in units of sigma, that no coefficient limits."""
STALL = 1000
"""Steps in a row too short to move a double's time before the run counts as stalled."""
CROWD = 64
"""Events in a row, each closer to the last than the resolution of time, before they count as accumulating."""


@inner()
def _add_time(floats, step):  # type: ignore[no-untyped-def]
    """t += step as a compensated sum (Neumaier), so that late times lose no digits of a duration."""
    t = floats[F_TIME]
    total = t + step
    part = total - t
    lost = (t - (total - part)) + (step - part)
    low = floats[F_LOW] + lost
    floats[F_TIME] = total + low
    floats[F_LOW] = low - (floats[F_TIME] - total)


@inner()
def _root(above, below, power):  # type: ignore[no-untyped-def]
    """(above / below) ** power to about one part in 100: a step size needs no more. Both positive.

    The exponent and the leading bits of a double are a piecewise linear logarithm to base 2.
    """
    exponent = (bits(above) - bits(below)) * (2.220446049250313e-16 * power)
    shifted = exponent + 6755399441055744.0  # 1.5 * 2^52: rounds to a whole number, which the low bits then hold
    part = exponent - (shifted - 6755399441055744.0)
    return from_bits((bits(shifted) + 1023) << 52) * (1.0 + part * (0.6931471805599453 + 0.24022650695910072 * part))


@inner(fastmath={"contract", "nsz"})
def _error_norms(c, rows, order, theta):  # type: ignore[no-untyped-def]
    """Largest relative size of the last two coefficients over states and guards on a step of theta sigma."""
    last, before = 0.0, 0.0
    for r in range(rows):
        row = c[r]
        scale = abs(row[0]) + theta * (abs(row[1]) + theta * abs(row[2])) + 1e-300
        last = max(last, abs(row[order]) / scale)
        before = max(before, abs(row[order - 1]) / scale)
    return last, before


@inner()
def _step_size(c, rows, order, tolerance):  # type: ignore[no-untyped-def]
    """Step in units of sigma at which the last two terms fall below the tolerance (Jorba and Zou 2005, Sec. 3).

    0 where a coefficient is not finite.
    """
    last, before = c[rows, 0], c[rows, 1]
    if not c[rows, 2] < np.inf:
        return 0.0
    theta = 1.0
    longest = min(c[rows, 3], FAR)
    power, other = 1.0 / order, 1.0 / (order - 1)
    for _ in range(4):
        new = FAR
        if last > 0.0:
            new = min(new, _root(tolerance, last, power))
        if before > 0.0:
            new = min(new, _root(tolerance, before, other))
        if new >= 0.5 * theta:
            return min(new, longest)
        theta = new
        last, before = _error_norms(c, rows, order, theta)
    return min(theta, longest)


@inner()
def _record(floats, integers, x, times, marks, states, kind, index, source, target, landing):  # type: ignore[no-untyped-def]
    n = integers[I_COUNT]
    times[n, 0], times[n, 1] = floats[F_TIME], floats[F_LOW]
    marks[n, 0], marks[n, 1], marks[n, 2], marks[n, 3], marks[n, 4] = kind, index, source, target, landing
    for i in range(x.size):
        states[n, i] = x[i]
    integers[I_COUNT] = n + 1


@njit()
def crowded(floats, integers):  # type: ignore[no-untyped-def]
    """Count events that time cannot tell apart; True once there are too many in a row."""
    gap = (floats[F_TIME] - floats[F_LAST]) + (floats[F_LOW] - floats[F_LAST_LOW])
    integers[I_CROWDED] = integers[I_CROWDED] + 1 if gap <= 2.0 * _EPS * abs(floats[F_TIME]) else 0
    floats[F_LAST], floats[F_LAST_LOW] = floats[F_TIME], floats[F_LOW]
    return integers[I_CROWDED] >= CROWD


@inner()
def _sample(floats, integers, c, order, part, sigma, mode, sample_times, samples, sample_modes):  # type: ignore[no-untyped-def]
    """Fill the samples that lie on the step just taken, up to ``part`` (in units of sigma)."""
    while integers[I_SAMPLE] < sample_times.size:
        k = integers[I_SAMPLE]
        at = ((sample_times[k] - floats[F_TIME]) - floats[F_LOW]) / sigma
        if at > part:
            return
        for i in range(samples.shape[1]):
            samples[k, i] = value(c[i], order, max(at, 0.0))
        sample_modes[k] = mode
        integers[I_SAMPLE] = k + 1


@inner()
def _trusted(floats, integers, x, expansion, closing, constants, c, ahead, change, point, guards, order, theta):  # type: ignore[no-untyped-def]
    """A step no longer than where the expansion still tells what lies there, ``theta`` if that is so.

    Coefficients that are zero promise an endless step (a high power seen from where it is flat). The
    expansion is made anew on the step and at its end: guards and slopes must be what was foretold. A step no
    longer than the last needs no such trust (and where a guard is next to zero rounding alone may disagree).
    """
    n = x.size
    sigma = floats[F_SIGMA]
    for _ in range(200):
        agreed = True
        for part in (0.37, 1.0):
            at = part * theta
            call_closing(closing, at, c, change)
            for i in range(n):
                point[i] = x[i] + change[i]
            call_expand(expansion, floats[F_TIME] + at * sigma, floats[F_LOW], sigma, point, constants, ahead)
            integers[I_RHS] += 1
            for r in range(n + guards):
                first = 1 if r < n else 0  # slopes of states, values of guards
                foretold, size, power = 0.0, abs(ahead[r, first]), 1.0
                for k in range(first, order + 1):
                    term = c[r, k] * power * (k if first == 1 else 1)
                    foretold += term
                    size += abs(term)
                    power *= at
                # A slope that moves its state by no more than rounding over the step is none, whatever its digits.
                dust = 4.0 * _EPS * abs(x[r]) / at if first == 1 else 0.0
                agreed = agreed and abs(foretold - ahead[r, first]) <= max(1e-6 * size, dust)
        if agreed:
            return theta
        theta *= 0.25
        if theta <= 1.0:
            return theta
    return theta


@inner()
def _first_event(integers, c, n, order, layout, multiplicity, lower, theta, method, table, work, bounds):  # type: ignore[no-untyped-def]
    """Earliest event on (0, theta]: (fraction of the step or 2, guard or -1, doubtful, landing used)."""
    powers, scaled, stack = work[0], work[1], work[2:]
    best, hit, doubtful, used = 2.0, -1, False, 0
    powers[0] = 0.0
    for g in range(layout[0, 0]):
        zeros = multiplicity[g]
        if zeros == 0 and lower[g] > 0.0:
            continue
        if powers[0] == 0.0:
            powers[0], powers[1] = 1.0, theta
            square = theta * theta
            for k in range(2, order + 1):
                powers[k] = powers[k - 2] * square
        q = c[n + g, zeros:]
        degree = order - zeros
        if zeros > 0 and q[0] > 0.0 and excluded(q, powers, degree):
            continue
        steepest = 0.0
        end = 0.0
        for k in range(degree + 1):
            scaled[k] = q[k] * powers[k]
            end += scaled[k]
            if k > 0:
                steepest += k * scaled[k] if k == 1 else max(k * scaled[k], 0.0)
        if steepest < 0.0 and q[0] > 0.0:  # falls all the way: one root or none
            outcome, low, high = ROOT if end < 0.0 else NONE, 0.0, 1.0
        else:
            outcome, low, high = first_falling_root(scaled, degree, table, stack, bounds)
        if outcome == NONE:
            continue
        if outcome == TOUCH:
            tau, landing, evaluations = 0.5 * (low + high), BRACKET, 0
        else:
            tau, landing, evaluations = land(scaled, degree, low, high, method)
        integers[I_EVENTS] += evaluations
        if tau < best:
            flat = outcome == TOUCH or steepness(scaled, degree, tau) < FLAT
            best, hit, doubtful, used = tau, g, flat, landing
    return best, hit, doubtful, used


@inner()
def _move(x, x_low, change):  # type: ignore[no-untyped-def]
    """x += change as a compensated sum; False where the state has blown up."""
    bounded = True
    for i in range(x.size):
        step = change[i] + x_low[i]
        total = x[i] + step
        part = total - x[i]
        x_low[i] = (x[i] - (total - part)) + (step - part)
        x[i] = total
        bounded = bounded and abs(total) < HUGE
    return bounded


@inner()
def _glide(  # type: ignore[no-untyped-def]
    floats, integers, x, x_low, expansion, closing, constants, c, change,
    guards, until, until_low, order, tolerance, alone, stop_at,
):  # fmt: skip
    """Take steps on which no guard can reach zero; come back with the coefficients of one that needs a look.

    ``alone``: look at the very first one. Returns the step proposed in units of sigma; 0 where the budget of
    steps is used up, -1 where the step size fell to zero, -2 where the state blew up.
    """
    n = x.size
    while True:
        if integers[I_STEPS] >= stop_at:
            return 0.0
        remaining = (until - floats[F_TIME]) + (until_low - floats[F_LOW])
        sigma = floats[F_SIGMA]
        call_expand(expansion, floats[F_TIME], floats[F_LOW], sigma, x, constants, c)
        integers[I_RHS] += 1
        theta = _step_size(c, n + guards, order, tolerance)
        if theta < 1e-6 or (theta > 1e6 and sigma < remaining):
            # sigma is far from the step: bring it there and expand again before anything is read off.
            new = sigma * 1e-4 if theta == 0.0 else max(min(sigma * theta, remaining), 1e-290)
            if sigma <= 1e-280 and new <= sigma:
                return -1.0
            if new < 0.5 * sigma or new > 2.0 * sigma:
                floats[F_SIGMA] = new
                continue
        step = theta * sigma
        integers[I_STALLED] = integers[I_STALLED] + 1 if step <= 0.25 * _EPS * abs(floats[F_TIME]) else 0
        if integers[I_STALLED] > STALL:
            return -1.0
        if alone or step >= remaining or theta > LEAP:
            return theta
        call_closing(closing, theta, c, change)
        for g in range(guards):
            if not change[n + g] > 0.0:
                return theta
        if not _move(x, x_low, change):
            return -2.0
        _add_time(floats, step)
        integers[I_STEPS] += 1
        floats[F_SIGMA] = min(step, 1e3 * sigma)


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
        theta = _glide(
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
            trusted = _trusted(
                floats, integers, x, addresses[mode, 0], addresses[mode, 1], constants[mode], c, ahead, change, point,
                guards, order, theta,
            )  # fmt: skip
            if trusted < theta:
                theta, final = trusted, False
                natural = theta * sigma
        call_closing(addresses[mode, 1], theta, c, change)
        early = False
        for g in range(guards):
            low = c[n + g, multiplicity[g]] <= 0.0 and layout[1 + g, 2] == 0
            if low and multiplicity[g] == 0 and layout[1 + g, 0] == SURFACE:
                multiplicity[g] = _zeros_when_leaving(c[n + g], order)
                low = multiplicity[g] == 0
            hits[g] = 1 if low and not _silent(c[n + g], order) else 0
            early = early or hits[g] == 1
        if early:  # on a surface and not leaving it: Python looks closer
            integers[I_GUARD] = NOWHERE
            return RESOLVE
        best, hit, doubtful, used = _first_event(
            integers, c, n, order, layout, multiplicity, change[n:], theta, method, table, work, bounds
        )
        if final and hit < 0:  # the horizon belongs to the run: an event at it counts
            for g in range(guards):
                if _ends_at_zero(c[n + g], multiplicity[g], order, theta):
                    best, hit, doubtful = 1.0, g, True
        part = theta if hit < 0 else best * theta
        if doubtful:
            integers[I_GUARD], integers[I_LANDING] = hit, BRACKET
            floats[F_NEAR], floats[F_REACH] = part * sigma, theta * sigma
            return DOUBTFUL
        if integers[I_SAMPLE] < sample_times.size:
            _sample(floats, integers, c, order, part, sigma, mode, sample_times, samples, sample_modes)
        together = False
        if hit >= 0:
            for g in range(guards):
                hits[g] = 1 if g == hit or _at_zero(c[n + g], multiplicity[g], order, part, layout[1 + g, 2]) else 0
                together = together or (hits[g] == 1 and g != hit)
            call_closing(addresses[mode, 1], part, c, change)
        bounded = _move(x, x_low, change)
        _add_time(floats, part * sigma)
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
            _polish(
                floats, integers, x, x_low, addresses[mode, 0], addresses[mode, 1], constants[mode], ahead, change,
                n + hit, sigma, theta, until,
            )  # fmt: skip
        which, zeros, what = 0, 1, CROSS
        if kind == SURFACE:
            if together or layout[1 + hit, 4] == 1:
                if settling is None:
                    return RESOLVE
                target = decided(floats[F_TIME], floats[F_LOW], x, mode, layout, hits, settling)
                if target < 0 or not _settle(
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
            zeros = _zeros_at_release(layouts[target], index, speeds[n:, 0])
            if zeros == 0:
                return RESOLVE
        _record(floats, integers, x, times, marks, states, what, index, mode, target, used)
        integers[I_MODE] = target
        _start(multiplicity, layouts[target], index, zeros)
        if crowded(floats, integers):
            return ACCUMULATED


@inner()
def _polish(  # type: ignore[no-untyped-def]
    floats, integers, x, x_low, expansion, closing, constants, ahead, change, row, sigma, theta, until,
):  # fmt: skip
    """Put the end of a slide on its guard to the last digit, whatever the tolerance of the step that led there.

    A tangent point is where the field's normal velocity vanishes: left a little beside it, the field would
    point back at the surface, and the slide would begin anew. Newton's steps on the expansion at the landing.
    """
    for _ in range(3):
        call_expand(expansion, floats[F_TIME], floats[F_LOW], sigma, x, constants, ahead)
        integers[I_RHS] += 1
        off, slope = ahead[row, 0], ahead[row, 1]
        size = abs(off) + abs(slope) * theta
        if abs(off) <= 2.0 * _EPS * size or not slope < 0.0:
            return
        shift = -off / slope
        if abs(shift) > 0.1 * theta or floats[F_TIME] + shift * sigma > until:
            return
        call_closing(closing, shift, ahead, change)
        _move(x, x_low, change)
        _add_time(floats, shift * sigma)


@inner()
def _settle(  # type: ignore[no-untyped-def]
    floats, integers, x, times, marks, states, multiplicity, mode, target, layout, after, hits, signs, landing,
):  # fmt: skip
    """Go over to a mode in which several surfaces may have changed; False where Python has to tell of it."""
    changes = 0
    for i in range(signs.shape[1]):
        changes += 1 if signs[mode, i] != signs[target, i] else 0
    if changes == 0 or integers[I_COUNT] + changes > times.shape[0]:
        return False
    for i in range(signs.shape[1]):
        before, now = signs[mode, i], signs[target, i]
        if before != now:
            kind = STICK if now == 0 else FREE if before == 0 else CROSS
            _record(floats, integers, x, times, marks, states, kind, i, mode, target, landing)
    for g in range(after[0, 0]):
        multiplicity[g] = 0
        if after[1 + g, 0] == SURFACE:  # left with a speed: the decision was a clear one
            surface = after[1 + g, 1]
            multiplicity[g] = 1 if signs[mode, surface] == 0 else 0
            for k in range(layout[0, 0]):
                if hits[k] == 1 and layout[1 + k, 1] == surface:
                    multiplicity[g] = 1
    integers[I_MODE] = target
    return True


@inner()
def _start(multiplicity, layout, surface, zeros):  # type: ignore[no-untyped-def]
    """Known zeros of the guards at the start of a mode: those of the surface just left."""
    for g in range(layout[0, 0]):
        same = layout[1 + g, 0] == SURFACE and layout[1 + g, 1] == surface
        multiplicity[g] = zeros if same else 0


@inner()
def _zeros_at_release(layout, surface, speeds):  # type: ignore[no-untyped-def]
    """1 if the surface is left with a speed, 2 if tangentially, 0 if the new mode's field points back at it."""
    for g in range(layout[0, 0]):
        if layout[1 + g, 0] == SURFACE and layout[1 + g, 1] == surface:
            towards, beyond = speeds[2 * g], speeds[2 * g + 1]
            if abs(towards) <= TANGENT * (abs(towards) + abs(beyond)):
                return 2
            return 1 if towards < 0.0 else 0
    return 0


@inner()
def _zeros_when_leaving(row, order):  # type: ignore[no-untyped-def]
    """1 or 2 for a surface on the wrong side that is being left with a speed or tangentially, 0 for any other.

    A mode's side of a surface was decided when it was left, and no root came since: a value below zero is
    rounding's (another event followed at once), and if it rises there is nothing to decide.
    """
    size = 0.0
    for k in range(1, order + 1):
        size += abs(row[k])
    if row[1] > TANGENT * size:
        return 1
    return 2 if abs(row[1]) <= TANGENT * size and row[2] > 0.5 * size else 0


@inner()
def _ends_at_zero(row, zeros, order, theta):  # type: ignore[no-untyped-def]
    """True if a guard falls to zero at the end of a step, as far as rounding can tell."""
    if row[zeros] <= 0.0 or not _at_zero(row, zeros, order, theta, 0):
        return False
    slope, power = 0.0, 1.0
    for k in range(1, order + 1):
        slope += k * row[k] * power
        power *= theta
    return slope < 0.0


@inner()
def _silent(row, order):  # type: ignore[no-untyped-def]
    """True for a guard that is zero and stays so: nothing falls through zero there."""
    size = 0.0
    for k in range(order + 1):
        size += abs(row[k])
    return size == 0.0


@inner()
def _at_zero(row, zeros, order, tau, rising_only):  # type: ignore[no-untyped-def]
    """True if a guard is at zero at the event of another one, as far as rounding can tell."""
    q = row[zeros:]
    degree = order - zeros
    if rising_only and q[0] < 0.0:
        return False
    size, power = 0.0, 1.0
    for k in range(degree + 1):
        size += abs(q[k]) * power
        power *= tau
    return size > 0.0 and value(q, degree, tau) <= 32.0 * _EPS * size
