"""The paper's program with each of its mistakes as a switch, for the audit of :mod:`henon_ref.studies.paper.audit`.

All switches off it is the method of Sec. 3 done right on Eq. (18): order 4, Filippov's sliding. All on it
is the appendix as printed, number for number (:mod:`henon_ref.henon.listing_program`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.listing_program import EDGES, acceleration, base_position, effective_changes, zone
from henon_ref.jit.njit import njit

Floats = NDArray[np.float64]
_compile = njit(allocates=True)

DEFECTS: dict[str, str] = {
    "aliased_steps": "`xn = x` names one list twice: every Runge-Kutta stage moves the state itself",
    "one_sided_release": "a stick is tested against the upper tangent point only",
    "exit_side": "the stick is left to the wrong side (`k <> 2`)",
    "frozen_forcing": "the forcing of the start of a step stands at all its stages",
    "frozen_tangent": "the way back to the tangent point takes it where it is at the end of the step",
    "quantised_release": "aliased, that way back is zero: a release keeps the time of the end of the step",
    "landing_sign": "above the belt's speed the landing step has the wrong sign",
    "rounded_sixth": "`h*0.166666` stands for h/6 in the landing step",
}
"""Each mistake that changes what the program computes: its name and what it is."""
_ALIASED, _ONE_SIDED, _EXIT, _FORCING, _TANGENT, _QUANTISED, _SIGN, _SIXTH = range(len(DEFECTS))

MAX_CHANGES = 20_000
"""Changes of mode after which a run counts as chattering."""


@dataclass(frozen=True)
class VariantRun:
    """What one variant did."""

    times: Floats
    """Times of the changes of mode [s]."""
    states: Floats
    """(k, 2) positions and velocities there."""
    modes: NDArray[np.int64]
    """Mode after each change: -1 below the belt's speed, 0 in stick, +1 above."""
    status: str
    """``ok``, ``chatters`` (the changes of mode never end) or ``diverged``."""
    path: Floats
    """(steps, 3) time, position and velocity after each step, as far as it was asked for."""


@_compile
def _slip_step(x, t, h, side_constant, p, aliased, frozen):  # type: ignore[no-untyped-def]
    """Runge-Kutta in time; ``x`` is (position, velocity). With aliasing ``old`` moves with every stage."""
    m1, k1, k2, mu0, A, w = p
    old = x if aliased else x.copy()
    start = base_position(A, w, t)
    middle = start if frozen else base_position(A, w, t + h / 2)
    end = start if frozen else base_position(A, w, t + h)
    v1, a1 = x[1], acceleration(x[0], x[1], start, side_constant, m1, k1, k2, mu0)
    x[0], x[1] = old[0] + h / 2 * v1, old[1] + h / 2 * a1
    v2, a2 = x[1], acceleration(x[0], x[1], middle, side_constant, m1, k1, k2, mu0)
    x[0], x[1] = old[0] + h / 2 * v2, old[1] + h / 2 * a2
    v3, a3 = x[1], acceleration(x[0], x[1], middle, side_constant, m1, k1, k2, mu0)
    x[0], x[1] = old[0] + h * v3, old[1] + h * a3
    v4, a4 = x[1], acceleration(x[0], x[1], end, side_constant, m1, k1, k2, mu0)
    x[0] = old[0] + h / 6 * (v1 + 2 * (v2 + v3) + v4)
    x[1] = old[1] + h / 6 * (a1 + 2 * (a2 + a3) + a4)


@_compile
def _landing_step(x, t, length, side_constant, p, aliased, frozen, sixth):  # type: ignore[no-untyped-def]
    """Eq. (14): Runge-Kutta with the velocity as independent variable. Returns the time of the landing."""
    m1, k1, k2, mu0, A, w = p
    old = x if aliased else x.copy()
    half = length * 0.5
    start = base_position(A, w, t)
    t1 = 1 / acceleration(x[0], x[1], start, side_constant, m1, k1, k2, mu0)
    p1 = x[1] * t1
    x[0], x[1] = old[0] + half * p1, old[1] + half
    base = start if frozen else base_position(A, w, t + half * t1)
    t2 = 1 / acceleration(x[0], x[1], base, side_constant, m1, k1, k2, mu0)
    p2 = x[1] * t2
    x[0] = old[0] + half * p2
    base = start if frozen else base_position(A, w, t + half * t2)
    t3 = 1 / acceleration(x[0], x[1], base, side_constant, m1, k1, k2, mu0)
    p3 = x[1] * t3
    x[0], x[1] = old[0] + length * p3, old[1] + length
    base = start if frozen else base_position(A, w, t + length * t3)
    t4 = 1 / acceleration(x[0], x[1], base, side_constant, m1, k1, k2, mu0)
    p4 = x[1] * t4
    x[0] = old[0] + sixth * length * (p1 + 2 * (p2 + p3) + p4)
    return t + sixth * length * (t1 + 2 * (t2 + t3) + t4)


@_compile
def _release_time(position, t, h, edge, vp, A, w):  # type: ignore[no-untyped-def]
    """Time in (t, t + h] at which the stick's z reaches ``edge``, by bisection: what Eq. (15) is after."""
    low, high = 0.0, h
    falls = position + vp * h - base_position(A, w, t + h) < edge
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = position + vp * middle - base_position(A, w, t + middle)
        if (inside > edge) if falls else (inside < edge):
            low = middle
        else:
            high = middle
    return t + high


@_compile
def _spring_force(z, k1, k2):  # type: ignore[no-untyped-def]
    return -k1 * z + k2 * z**3


@_compile
def _run(x, t, until, h, edges, numbers, d, changes, sticking, path, path_from):  # type: ignore[no-untyped-def]
    """The main loop. ``changes`` takes a row (step, time, position, velocity, mode) a change of mode.

    Returns the number of changes, of rows of the path, and how it ended: 0 done, 1 chatters, 2 not finite.
    """
    m, k1, k2, mu0, vp, A, w = numbers
    p = (1 / m, k1, k2, mu0, A, w)
    sixth = 0.166666 if d[_SIXTH] else 1 / 6
    side = -1 if x[1] < vp else 1
    base = base_position(A, w, t)
    upper = zone(x[0], edges, base)
    before = x.copy()
    count = step = filled = 0
    while t < until and count < changes.shape[0]:
        mode = 0 if sticking else side
        before[:] = x
        if sticking:
            after = x[0] + h * vp
            base = base_position(A, w, t + h)
            edge = edges[upper]
            out = after >= edge + base
            if not out and not d[_ONE_SIDED] and after <= edges[upper + 1] + base:
                out, edge = True, edges[upper + 1]
            if not out:
                x[0], t = after, t + h
            else:
                sticking = False
                if d[_QUANTISED]:
                    x[0], t = edge + base, t + h
                elif d[_TANGENT]:
                    x[0], t = edge + base, t + (edge + base - x[0]) / vp
                else:
                    at = _release_time(x[0], t, h, edge, vp, A, w)
                    x[0], t = x[0] + vp * (at - t), at
                right = 1 if _spring_force(edge, k1, k2) > 0 else -1
                side = -right if d[_EXIT] else right
        else:
            side_constant = vp + 1 if side == -1 else vp - 1
            _slip_step(x, t, h, side_constant, p, d[_ALIASED], d[_FORCING])
            if (x[1] >= vp) if side == -1 else (x[1] <= vp):
                if not d[_ALIASED]:
                    x[:] = before
                length = vp - x[1]
                if d[_SIGN] and side == 1:
                    length = -length
                if length != 0:
                    t = _landing_step(x, t, length, side_constant, p, d[_ALIASED], d[_FORCING], sixth)
                x[1] = vp
                base = base_position(A, w, t)
                force = _spring_force(x[0] - base, k1, k2)
                if force**2 - mu0**2 <= 0:
                    upper = zone(x[0], edges, base)
                    sticking = True
                else:
                    side = -side
            else:
                t = t + h
        if not np.isfinite(x[0]):
            return count, filled, 2
        now = 0 if sticking else side
        if now != mode:
            changes[count, 0], changes[count, 1], changes[count, 4] = step, t, now
            changes[count, 2], changes[count, 3] = x[0], x[1]
            count += 1
        if t >= path_from and filled < path.shape[0]:
            path[filled, 0], path[filled, 1], path[filled, 2] = t, x[0], x[1]
            filled += 1
        step += 1
    return count, filled, 1 if count == changes.shape[0] else 0


def run_variant(
    defects: Collection[str],
    *,
    step: float,
    numbers: tuple[float, ...],
    start: tuple[float, float] | None = None,
    until: float = 70.0,
    path_from: float | None = None,
) -> VariantRun:
    """Run the paper's program on Fig. 8 with some of its mistakes.

    Parameters
    ----------
    defects : collection of str
        Names out of :data:`DEFECTS`.
    step : float
        Step h [s].
    numbers : tuple of float
        m, k1, k2, mu0, vp, A, w.
    start : tuple of float, optional
        Position and velocity at t = 0, in slip; the paper's start in stick, [z(4), vp], without it.
    until : float
        Horizon [s].
    path_from : float, optional
        Time from which the path is kept [s]; without it no path is.

    Raises
    ------
    KeyError
        For an unknown defect.
    """
    switched = np.zeros(len(DEFECTS), dtype=np.bool_)
    index = {name: i for i, name in enumerate(DEFECTS)}
    for name in defects:
        switched[index[name]] = True
    changes = np.empty((MAX_CHANGES, 5))
    path = np.empty((0 if path_from is None else int((until - path_from) / step) + 2 * MAX_CHANGES, 3))
    x = np.array([EDGES[3], numbers[4]] if start is None else start)
    first = 0 if start is None else -1 if start[1] < numbers[4] else 1
    count, filled, how = _run(
        x, 0.0, until, step, EDGES, numbers, switched, changes, first == 0, path, path_from or 0.0
    )
    rows = effective_changes(changes[:count], first)
    rows = rows[rows[:, 1] <= until]
    return VariantRun(
        rows[:, 1], rows[:, 2:4], rows[:, 4].astype(np.int64), ("ok", "chatters", "diverged")[how], path[:filled]
    )
