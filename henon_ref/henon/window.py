"""What a guard's polynomial does next to a doubtful point, decided on proof or not at all.

The polynomial is one in double-double, or, where that has left it open, in quad-double.

It is recentred at its minimum there, or at its root where it has none, and a short window that ends there is split
off. Up to the window the guard stays clear of zero beyond the noise of double precision; on the window the signs of
its Bernstein coefficients tell whether it has one root or none (Descartes' rule). Behind a minimum above zero there is
another window, up to where the guard is clear of zero again: the next step begins there and knows nothing of it.
"""

from __future__ import annotations

from numba import boolean, float64, int64, types

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.about import LOST, about
from henon_ref.henon.apart import ROW, ROWS, apart
from henon_ref.henon.isolation import NOTHING
from henon_ref.henon.polynomial import value
from henon_ref.henon.quadseries import PARTS
from henon_ref.henon.registers import A_ABOUT, A_CLEAR, A_DECIDE, EPS
from henon_ref.henon.views import INTEGERS
from henon_ref.jit import inner

UNSURE, OPEN, ROOT, STEEP, PASSED, ACROSS, MISS, TOUCH = range(8)
"""Outcomes: not decided; nothing undecided but a window that ends at a minimum, or the minimum's sign alone; a root,
and one steep enough for signs in double precision; no root, and the guard is clear of zero again (or the root lies
behind the step's end). And, of a closer look as a whole: a root, and the field beyond its surface is known; the guard's
minimum above zero, which it goes on from as from a double zero; its minimum at zero."""
LOCAL = 16
"""Degree of the polynomial on a window."""
FINE = 4
"""Coefficients of it in double-double; the others are small on a window."""
NOISE = 1e-27
"""Values below this of the polynomial's size cannot be told from zero in double-double."""
CLEAR = 1e-11
"""Windows begin and end where the guard is this much of its size."""
SETTLED = 1e-3
"""A place is exact where another step of Newton's would change the polynomial by less than this of its noise."""
SETTLED_CLOSE = 0.1 * NOTHING / EPS
"""Or, in quad-double, by less than this of its size where that step is below EPS, and taken to a double's digits."""
BENT = 1e-13
"""Relative second derivative above which a touch or a miss is told by quad-double: the next step relies on it."""
COARSE = 1e-13
"""What the rest of the step has to stay above."""
WIDEST = 0.1
"""Fraction of the step that a window may have."""
SLOPE = 1e-11
"""Relative slope at a root from which on double precision has its sign right."""
POLISHED = 4
"""Steps towards a minimum in double precision, at most."""
HALVINGS = 60
"""Pieces of the step that are kept at once."""
BEYOND = 2.0**-46
"""How far behind the step's end a root is looked for: rounding may have put it there."""


@inner()
def stays_clear(q, end, size, stack):  # type: ignore[no-untyped-def]
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


call_clear = apart(A_CLEAR, stays_clear, boolean, ROW, float64, float64, ROWS)
call_about = apart(A_ABOUT, about, types.UniTuple(float64, 2), ROW, int64, int64, float64, float64, float64)


@inner()
def decide(integers, q, q_low, quads, zeros, size, start, start_low, work):  # type: ignore[no-untyped-def]
    """What a guard, q s^zeros, does on (0, 1] up to a doubtful point: the outcome, where, where its window begins.

    ``quads`` are the guard's own coefficients in quad-double, four doubles each, where double-double has left it open
    and come to the place; else there are none. UNSURE comes with another place to look from, where there is one.
    """
    g, b, stack = work[0], work[1], work[2:]
    nearer = quads.size > 0
    noise, nothing = (LOST, NOTHING) if nearer else (NOISE, NOISE)
    s, s_low = (start if nearer else _lowest(q, start)), 0.0
    minimum, settled, close = False, False, False
    for looked in range(4):  # again from next to it; the last time to see that it stays there
        _recentred(integers, q, q_low, quads, zeros, size, s, s_low, g)
        minimum, shift = _stationary(g, noise * size, 0.0)
        if not minimum:
            shift = _newton(g, -WIDEST, WIDEST)
        if not abs(shift) <= WIDEST:
            return UNSURE, 0.0, 0.0, 0.0
        close = abs(shift) <= EPS
        settled = abs(g[1] * shift) <= (SETTLED_CLOSE if nearer and close else SETTLED * noise) * size
        if settled and (looked > 0 or close):
            break
        s, s_low = dd.add(s, s_low, shift, 0.0)
    if (minimum or nearer) and close:  # the coefficients of higher order are the same there
        s, s_low = dd.add(s, s_low, shift, 0.0)
        g[0], g[1], shift = (value(g, LOCAL, shift), 0.0, 0.0) if minimum else (0.0, _slope(g, shift), 0.0)
    if not settled or not s > 0.0 or (minimum and s >= 1.0 - 2.0 * BEYOND):  # at the very end another step may see more
        return UNSURE, 0.0, 0.0, 0.0
    if not minimum:
        steep = -g[1] > SLOPE * size
        if not (abs(g[0]) <= noise * size and (steep or (nearer and -g[1] > nothing * size))):
            return UNSURE, 0.0, 0.0, 0.0
        g[0] = 0.0
    width = 1e-9
    while width < WIDEST and width < s and not value(g, LOCAL, -width) > CLEAR * size:
        width *= 2.0
    width = min(width, s)
    if width >= WIDEST or (width < s and not call_clear(integers, q, s - width, size, stack)):
        return UNSURE, 0.0, 0.0, 0.0
    bound = _bound(q, s)
    touching = minimum and abs(g[0]) <= nothing * size
    if touching:  # what the window tells then, it tells of the guard less its value at the minimum
        g[0] = g[1] = 0.0
    changes = _sign_changes(g, -width, size, noise, bound, b, stack[0])
    if not minimum:
        if changes != 0:
            before, shift = _stationary(g, noise * size, -width)
            return UNSURE, (s + shift if before and shift < 0.0 else 0.0), 0.0, 0.0
        return (STEEP if steep else ROOT, s, s_low, 0.0) if s <= 1.0 else (PASSED, start, start_low, 0.0)
    if g[0] > 0.0 and changes == 0:
        behind = 1e-9
        while behind < WIDEST and not value(g, LOCAL, behind) * (s + behind) ** zeros > CLEAR * size:
            behind *= 2.0
        if behind < WIDEST and s + behind <= 1.0 and _sign_changes(g, behind, size, noise, bound, b, stack[0]) == 0:
            s, s_low = dd.add(s, s_low, behind, 0.0)
            return PASSED, s, s_low, 0.0
    if g[0] < 0.0 and changes == 1:
        away = _newton(g, -width, 0.0)
        s, s_low = dd.add(s, s_low, away, 0.0)
        # Far from the minimum it is known there to a double's digits only, and next to it so is the minimum's depth.
        _recentred(integers, q, q_low, quads, zeros, size, s, s_low, g)
        s, s_low = dd.add(s, s_low, _newton(g, 0.5 * away, -0.5 * away) if nearer else -g[0] / g[1], 0.0)
        return (STEEP if -g[1] > SLOPE * size else ROOT), s, s_low, 0.0
    clear = s - width
    s, s_low = dd.add(s, s_low, shift, 0.0)
    if nearer and changes == 0 and g[2] > BENT * size:
        return (TOUCH if touching else MISS), s, s_low, 0.0
    return OPEN, s, s_low, (s if touching and changes == 0 else clear)


call_decide = apart(
    A_DECIDE, decide, types.Tuple((int64, float64, float64, float64)),
    INTEGERS, ROW, ROW, ROW, int64, float64, float64, float64, ROWS,
)  # fmt: skip


@inner()
def _lowest(q, start):  # type: ignore[no-untyped-def]
    """The minimum next to a place by double precision; that place where none is found."""
    s = start
    for _ in range(POLISHED):
        slope, bend, twist = 0.0, 0.0, 0.0
        for k in range(q.size - 1, 0, -1):
            twist = twist * s + bend
            bend = bend * s + slope
            slope = slope * s + k * q[k]
        shift = _towards(slope, bend, twist)
        s -= shift
        if not (bend > 0.0 and abs(s - start) <= WIDEST):
            return start
        if abs(shift) <= 4.0 * EPS * s:
            break
    return s


@inner(forceinline=True)
def _towards(slope, bend, twist):  # type: ignore[no-untyped-def]
    """How far behind a stationary point a place is: Newton's method on the slope over its derivative.

    A flat minimum, too, is a simple root of that (Schroeder 1870). ``twist`` is half the third derivative.
    """
    below = bend * bend - 2.0 * slope * twist
    return slope * bend / below if below > 0.0 else slope / bend


@inner()
def _recentred(integers, q, q_low, quads, zeros, size, s, s_low, g):  # type: ignore[no-untyped-def]
    """Coefficients g of q about s up to degree LOCAL; the first FINE are rounded at their end only.

    The first two are made of ``quads`` where there are any.
    """
    g[:] = 0.0
    top = q.size - 1
    while top >= 0 and abs(q[top]) <= EPS * size:  # of these a double's digits do
        for i in range(LOCAL, 0, -1):
            g[i] = g[i] * s + g[i - 1]
        g[0] = g[0] * s + q[top]
        top -= 1
    a0, a1, a2, a3 = g[0], g[1], g[2], g[3]
    e0, e1, e2, e3 = 0.0, 0.0, 0.0, 0.0
    for k in range(top, -1, -1):
        for i in range(LOCAL, FINE, -1):
            g[i] = g[i] * s + g[i - 1]
        g[FINE] = g[FINE] * s + a3
        a3, e3 = dd.compensated(a3, e3, s, s_low, a2, e2)
        a2, e2 = dd.compensated(a2, e2, s, s_low, a1, e1)
        a1, e1 = dd.compensated(a1, e1, s, s_low, a0, e0)
        a0, e0 = dd.compensated(a0, e0, s, s_low, q[k], q_low[k])
    g[0], g[1], g[2], g[3] = a0 + e0, a1 + e1, a2 + e2, a3 + e3
    if quads.size > 0:
        g[0], g[1] = call_about(integers, quads, quads.size // PARTS - 1, zeros, size, s, s_low)


@inner()
def _slope(g, v):  # type: ignore[no-untyped-def]
    total = LOCAL * g[LOCAL]
    for i in range(LOCAL - 1, 0, -1):
        total = total * v + i * g[i]
    return total


@inner()
def _stationary(g, level, v):  # type: ignore[no-untyped-def]
    """Whether there is a minimum close to a place, and where: :func:`_towards` in a bracket, halved if that fails."""
    left, right = -WIDEST, WIDEST
    for _ in range(60):
        slope, bend, twist = LOCAL * g[LOCAL], 0.0, 0.0
        for i in range(LOCAL - 1, 0, -1):
            twist = twist * v + bend
            bend = bend * v + slope
            slope = slope * v + i * g[i]
        if abs(slope) <= level:
            break
        if not bend > 0.0:
            return False, 0.0
        if slope < 0.0:
            left = v
        else:
            right = v
        new = v - _towards(slope, bend, twist)
        if not left < new < right:
            new = 0.5 * (left + right)
        step = new - v
        v = new
        if abs(step) <= 4.0 * EPS * abs(v):
            break
    return True, v


@inner()
def _newton(g, left, right):  # type: ignore[no-untyped-def]
    """The root between two places, g falling through it: Newton's method in a bracket, halved where that fails."""
    v = 0.0 if left < 0.0 < right else 0.5 * (left + right)
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
def _bound(q, s):  # type: ignore[no-untyped-def]
    """Bound of q on the disc of radius 1/2 about s: of coefficient k there it is 2^k times as much (Cauchy)."""
    total = 0.0
    for k in range(q.size - 1, -1, -1):
        total = total * (s + 0.5) + abs(q[k])
    return total


@inner()
def _sign_changes(g, width, size, lost, bound, b, doubt):  # type: ignore[no-untyped-def]
    """Sign changes of the Bernstein coefficients between 0 and a place next to it; -1 where one may be zero.

    What may make it zero is what is lost of g (of the first two that much of their size, of the first FINE NOISE), of
    the sums, and what the local polynomial leaves out.
    """
    ratio = 2.0 * abs(width)
    if ratio > 0.5:
        return -1
    power, choose, term = 1.0, 1.0, bound
    for i in range(LOCAL + 1):
        b[i] = g[i] * power
        noise = lost * size if i == 0 else (lost if i < 2 else NOISE if i < FINE else LOCAL * EPS) * term
        doubt[i] = (noise + LOCAL * EPS * abs(b[i])) / choose
        b[i] /= choose
        power *= width
        term *= ratio
        choose = choose * (LOCAL - i) / (i + 1.0)
    rest = term / (1.0 - ratio)
    for j in range(1, LOCAL + 1):
        for i in range(LOCAL, j - 1, -1):
            b[i] += b[i - 1]
            doubt[i] += doubt[i - 1]
    changes, before = 0, 0.0
    for i in range(LOCAL + 1):
        if before == 0.0 and b[i] == 0.0:  # the window ends at a root
            continue
        if not abs(b[i]) > doubt[i] + rest:
            return -1
        changes += 1 if before * b[i] < 0.0 else 0
        before = b[i]
    return changes
