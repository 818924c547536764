"""What a guard's polynomial in double-double does next to a doubtful point, decided on proof or not at all.

It is recentred at its minimum there, or at its root where it has none, and a short window that ends there is split
off. Up to the window the guard stays clear of zero beyond the noise of double precision; on the window the signs of
its Bernstein coefficients tell whether it has one root or none (Descartes' rule).
"""

from __future__ import annotations

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.polynomial import value
from henon_ref.henon.registers import EPS
from henon_ref.jit import inner

UNSURE, OPEN, ROOT, STEEP, MISS, PASSED = range(6)
"""Outcomes: not decided; nothing but the sign of a minimum undecided; a root, and one steep enough for signs in double
precision; a minimum above zero; none of them up to the step's end."""
LOCAL = 16
"""Degree of the polynomial on a window."""
FINE = 4
"""Coefficients of it in double-double; the others are small on a window."""
NOISE = 1e-27
"""Values below this of the polynomial's size cannot be told from zero."""
CLEAR = 1e-11
"""A window begins where the guard is this much of its size."""
COARSE = 1e-13
"""What the rest of the step has to stay above."""
WIDEST = 0.1
"""Fraction of the step that a window may have."""
SLOPE = 1e-11
"""Relative slope at a root from which on double precision has its sign right."""
HALVINGS = 60
"""Pieces of the step that are kept at once."""
PARABOLIC = 1e-6
"""Relative curvature of a minimum that is one of second order."""
BEYOND = 2.0**-46
"""How far behind the step's end a root is looked for: rounding may have put it there."""


@inner()
def decide(q, q_low, size, start, work):  # type: ignore[no-untyped-def]
    """What a polynomial does on (0, 1] up to a doubtful point: the outcome, and where."""
    g, b, stack = work[0], work[1], work[2:]
    s, s_low = start, 0.0
    minimum = False
    for _ in range(3):  # the second time from next to it; the third to see that it stays there
        _recentred(q, q_low, s, s_low, g)
        minimum, shift = _stationary(g)
        if not minimum:
            shift = _newton(g, -WIDEST, WIDEST)
        if not abs(shift) <= WIDEST:
            return UNSURE, 0.0, 0.0
        s, s_low = dd.add(s, s_low, shift, 0.0)
        if abs(shift) <= 1e-18:
            break
    if not s > 0.0 or (minimum and s >= 1.0 - 2.0 * BEYOND):  # at the very end another step may see more
        return UNSURE, 0.0, 0.0
    _recentred(q, q_low, s, s_low, g)
    if minimum and g[0] >= -NOISE * size and not _double_zero(g, size):
        return UNSURE, 0.0, 0.0
    touching = minimum and abs(g[0]) <= NOISE * size
    if touching:
        g[0] = g[1] = 0.0
    if not minimum:
        if not (abs(g[0]) <= NOISE * size and -g[1] > SLOPE * size):
            return UNSURE, 0.0, 0.0
        g[0] = 0.0
    width = 1e-9
    while width < WIDEST and width < s and not value(g, LOCAL, -width) > CLEAR * size:
        width *= 4.0
    width = min(width, s)
    changes = _sign_changes(g, width, _rest(q, s, width), b)
    if width >= WIDEST or changes < 0 or changes != (1 if g[0] < 0.0 else 0):
        return UNSURE, 0.0, 0.0
    if width < s and not _stays_clear(q, s - width, size, stack):
        return UNSURE, 0.0, 0.0
    if touching:
        return OPEN, s, s_low
    if not minimum:
        return (STEEP, s, s_low) if s <= 1.0 else (PASSED, start, 0.0)
    if g[0] > 0.0:
        return MISS, s, s_low
    v = _newton(g, -width, 0.0)
    slope = -_slope(g, v)
    s, s_low = dd.add(s, s_low, v, 0.0)
    return (STEEP if slope > SLOPE * size else ROOT), s, s_low


@inner()
def _double_zero(g, size):  # type: ignore[no-untyped-def]
    """True for a minimum that the next step may take for a zero of order two."""
    return g[0] <= CLEAR * size and g[2] > PARABOLIC * size


@inner()
def _recentred(q, q_low, s, s_low, g):  # type: ignore[no-untyped-def]
    """Coefficients g of q about s up to degree LOCAL; the first FINE are rounded at their end only."""
    a0, a1, a2, a3 = 0.0, 0.0, 0.0, 0.0
    e0, e1, e2, e3 = 0.0, 0.0, 0.0, 0.0
    g[:] = 0.0
    for k in range(q.size - 1, -1, -1):
        for i in range(LOCAL, FINE, -1):
            g[i] = g[i] * s + g[i - 1]
        g[FINE] = g[FINE] * s + a3
        a3, e3 = dd.multiply(a3, e3, s, s_low)
        a3, e3 = dd.add(a3, e3, a2, e2)
        a2, e2 = dd.multiply(a2, e2, s, s_low)
        a2, e2 = dd.add(a2, e2, a1, e1)
        a1, e1 = dd.multiply(a1, e1, s, s_low)
        a1, e1 = dd.add(a1, e1, a0, e0)
        a0, e0 = dd.multiply(a0, e0, s, s_low)
        a0, e0 = dd.add(a0, e0, q[k], q_low[k])
    g[0], g[1], g[2], g[3] = a0, a1, a2, a3


@inner()
def _slope(g, v):  # type: ignore[no-untyped-def]
    total = LOCAL * g[LOCAL]
    for i in range(LOCAL - 1, 0, -1):
        total = total * v + i * g[i]
    return total


@inner()
def _stationary(g):  # type: ignore[no-untyped-def]
    """Whether there is a minimum close by, and its distance: Newton's method on the slope."""
    v = 0.0
    for _ in range(60):
        slope, bend = LOCAL * g[LOCAL], 0.0
        for i in range(LOCAL - 1, 0, -1):
            bend = bend * v + slope
            slope = slope * v + i * g[i]
        if not bend > 0.0:
            return False, 0.0
        step = -slope / bend
        v += step
        if not abs(v) <= WIDEST:
            return False, 0.0
        if abs(step) <= 4.0 * EPS * abs(v) or abs(step) < 1e-30:
            break
    return True, v


@inner()
def _newton(g, left, right):  # type: ignore[no-untyped-def]
    """The root between two places, g falling through it: Newton's method in a bracket, halved where that fails."""
    v = 0.0 if right > 0.0 else 0.5 * (left + right)
    for _ in range(200):
        height, slope = value(g, LOCAL, v), _slope(g, v)
        if height > 0.0:
            left = v
        else:
            right = v
        new = v - height / slope if slope < 0.0 else left - 1.0
        if not left <= new <= right:
            new = 0.5 * (left + right)
        step = abs(new - v)
        v = new
        if step <= 4.0 * EPS * abs(v) or step < 1e-30:
            break
    return v


@inner()
def _rest(q, s, width):  # type: ignore[no-untyped-def]
    """Bound of what the local polynomial leaves out on a window (Cauchy's estimate on a disc of radius 1/2)."""
    if width > 0.25:
        return 1e300
    total = 0.0
    for k in range(q.size - 1, -1, -1):
        total = total * (s + 0.5) + abs(q[k])
    ratio = 2.0 * width
    return total * ratio ** (LOCAL + 1) / (1.0 - ratio)


@inner()
def _sign_changes(g, width, rest, b):  # type: ignore[no-untyped-def]
    """Sign changes of the Bernstein coefficients on [-width, 0]; -1 where one cannot be told from zero."""
    power, choose = 1.0, 1.0
    for i in range(LOCAL + 1):
        b[i] = g[i] * power / choose
        power *= -width
        choose = choose * (LOCAL - i) / (i + 1.0)
    for j in range(1, LOCAL + 1):
        for i in range(LOCAL, j - 1, -1):
            b[i] += b[i - 1]
    changes, before = 0, 0.0
    for i in range(LOCAL + 1):
        if before == 0.0 and b[i] == 0.0:  # the window ends at a root
            continue
        if not abs(b[i]) > rest:
            return -1
        changes += 1 if before * b[i] < 0.0 else 0
        before = b[i]
    return changes


@inner()
def _stays_clear(q, end, size, stack):  # type: ignore[no-untyped-def]
    """True if a polynomial is larger than COARSE of its size all over [0, end], by double precision."""
    least = COARSE * size
    degree, power, tail = 0, 1.0, 0.0
    for k in range(q.size):
        if abs(q[k]) * power > EPS * size:
            degree = k
        power *= end
    power, choose = 1.0, 1.0
    for k in range(q.size):
        if k > degree:
            tail += abs(q[k]) * power
        else:
            stack[0, k] = q[k] * power / choose
            choose = choose * (degree - k) / (k + 1.0)
        power *= end
    for j in range(1, degree + 1):
        for i in range(degree, j - 1, -1):
            stack[0, i] += stack[0, i - 1]
    top, looked = 1, 0
    while top > 0:
        top -= 1
        looked += 1
        right = stack[top]
        lowest = right[0]
        for i in range(1, degree + 1):
            lowest = min(lowest, right[i])
        if lowest > least + tail:
            continue
        if not min(right[0], right[degree]) > least + tail or top + 2 >= stack.shape[0] or looked > 4 * HALVINGS:
            return False
        left = stack[top + 1]
        for i in range(degree + 1):  # de Casteljau in place
            left[i] = right[0]
            for j in range(degree - i):
                right[j] = 0.5 * (right[j] + right[j + 1])
        top += 2
    return True
