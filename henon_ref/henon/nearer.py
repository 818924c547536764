"""A doubtful event in quad-double: what the closer look in double-double (:mod:`henon_ref.henon.near`) leaves open.

First the sign of a minimum (:mod:`henon_ref.henon.touch`); then, where the motion is of low degree, a flat root
(:mod:`henon_ref.henon.flat`); then whatever roots stand close together, by the same proof as in double-double
(:mod:`henon_ref.henon.window`). What is not clear then is left to :mod:`henon_ref.henon.closer`.
"""

from __future__ import annotations

from numba import float64, int64, types

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.apart import COUNTS, LAYOUT, ROW, ROWS, apart, missing
from henon_ref.henon.flat import HIGHEST, at_flat_root
from henon_ref.henon.primitives import array_of, doubles_at, integers_at
from henon_ref.henon.program import COLUMNS
from henon_ref.henon.quadseries import PARTS, WIDTH, expand
from henon_ref.henon.registers import (
    A_ABOUT,
    A_FLAT_ROOT,
    A_MINIMUM,
    A_QUAD,
    F_LOW,
    F_STATE,
    F_TIME,
    I_ORDER,
    L_CODES,
    L_CONSTANTS,
    L_NUMBERS,
    L_OPERATIONS,
    L_QUADS,
    L_ROWS,
    L_SIZES,
)
from henon_ref.henon.touch import at_minimum
from henon_ref.henon.views import INTEGERS, rest_of
from henon_ref.henon.window import OPEN, UNSURE, call_decide
from henon_ref.jit import inner

_QUAD = types.UniTuple(float64, 4)
_expand = apart(
    A_QUAD, expand, int64,
    LAYOUT, ROWS, COUNTS, int64, int64, float64, float64, ROW, ROW, float64, float64, int64, ROWS, ROW,
)  # fmt: skip
_at_minimum = apart(A_MINIMUM, at_minimum, types.Tuple((int64, float64)), ROW, int64, float64, float64)
_at_flat_root = apart(
    A_FLAT_ROOT, at_flat_root, types.Tuple((int64, _QUAD, int64)), INTEGERS, ROW, int64, float64, ROW, ROWS
)


@inner()
def look_nearer(floats, integers, look, field, output, row, unit, part, guard, s, s_low, sure, work):  # type: ignore[no-untyped-def]
    """What a guard does next to a place on the step, before which it has no root: the outcome, where, and its order.

    Parameters
    ----------
    floats, integers : row
        The run.
    look, field : ndarray of int
        What the closer look works with (L_...), and rows of the field.
    output, row : int
        The guard's place among the outputs, and its row.
    unit, part : float
        What the guard is expanded in, and which part of the step that is.
    guard : tuple
        In double-double, without its known zeros: coefficients, what rounding them lost, zeros, size on the step.
    s, s_low : float
        The place, in that unit.
    sure : bool
        It is a minimum, and nothing is open but the sign there.
    work : ndarray
        Work space of :func:`henon_ref.henon.window.decide`.

    Returns
    -------
    outcome : int
        As of that function, but never OPEN.
    place, low : float
    order : int
        Above 2 at a flat root.
    """
    if missing(integers, A_QUAD) or missing(integers, A_MINIMUM) or missing(integers, A_FLAT_ROOT):
        return UNSURE, s, s_low, 2
    if missing(integers, A_ABOUT):
        return UNSURE, s, s_low, 2
    q, q_low, zeros, size = guard
    codes = integers_at(look[L_CODES], look[L_OPERATIONS], COLUMNS)
    constants = doubles_at(look[L_CONSTANTS], look[L_NUMBERS], PARTS)
    quads = doubles_at(look[L_QUADS], look[L_ROWS], WIDTH)
    sizes = doubles_at(look[L_SIZES], 2, look[L_ROWS])[1]
    n, least = field.size, integers[I_ORDER]
    t, t_low = floats[F_TIME], floats[F_LOW]
    x, x_low = array_of(rest_of(floats, F_STATE), n), array_of(rest_of(floats, F_STATE + n), n)
    own = quads[row]
    if sure and zeros == 0:
        u, u_low = dd.multiply(s, s_low, unit, 0.0)
        degree = _expand(
            integers, codes, constants, field, output, row, t, t_low, x, x_low, u, u_low, least, quads, sizes
        )
        if degree >= 0:
            outcome, shift = _at_minimum(integers, own, degree, size, s * part)
            if outcome != UNSURE:
                s, s_low = dd.add(s, s_low, s * shift, 0.0)
                return outcome, s, s_low, 2
    degree = _expand(integers, codes, constants, field, output, row, t, t_low, x, x_low, unit, 0.0, least, quads, sizes)
    if degree < 0:
        return UNSURE, s, s_low, 2
    own = own[: PARTS * (degree + 1)]
    if degree <= HIGHEST:
        outcome, place, order = _at_flat_root(integers, integers, own, degree, s, q, work)
        if outcome != UNSURE:
            return outcome, place[0], place[1], order
    outcome, place, low, _ = call_decide(integers, integers, q, q_low, own, zeros, size, s, s_low, work)
    if outcome == UNSURE and place > 0.0:
        outcome, place, low, _ = call_decide(integers, integers, q, q_low, own, zeros, size, place, low, work)
    return (UNSURE if outcome in (UNSURE, OPEN) else outcome), place, low, 2
