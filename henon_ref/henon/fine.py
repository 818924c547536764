"""Taylor coefficients of a solution in double-double, about 31 digits: one interpreter, compiled once for all models.

What it interprets is a tape that was lowered to a few operations (:mod:`henon_ref.henon.program`).
"""

from __future__ import annotations

import math

from llvmlite import ir
from numba import float64, int64, types
from numba.core import cgutils
from numba.extending import intrinsic

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.apart import apart, missing
from henon_ref.henon.program import (
    ACOS,
    ADD,
    ASIN,
    ATAN,
    CLOCK,
    CONSTANT,
    COS,
    COSH,
    DEGREE,
    DEGREE_A,
    DEGREE_B,
    DIV,
    EXP,
    FIRST,
    LOG,
    MUL,
    OP,
    OWN,
    RECIP,
    RSUB,
    SCALE,
    SIN,
    SINH,
    SLOPE,
    SQRT,
    SQUARE,
    STATE,
    SUB,
    TAN,
    TANH,
    A,
    B,
    C,
)
from henon_ref.henon.registers import A_START
from henon_ref.jit import inner

NEGLIGIBLE = 1e-31
"""Size of a coefficient, relative to its series, that no longer counts."""
QUIET = 4
"""So many orders in a row without one that counts end the expansion."""
LANES = 4
"""Doubles in a register."""


@intrinsic
def _lanes(typing, high, low, up, down, blocks):  # type: ignore[no-untyped-def]
    """Four sums of products at once, as s of each and then e of each, s + e the sum.

    Of the arrays' elements up, up + 1, ... and down, down - 1, ..., as many as blocks of four. The compiler may
    not do this by itself: it would change the order of the sum.
    """
    signature = types.UniTuple(types.float64, 2 * LANES)(high, low, types.int64, types.int64, types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        lanes = ir.VectorType(ir.DoubleType(), LANES)
        fma = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(lanes, [lanes] * 3), f"llvm.fma.v{LANES}f64"
        )
        parts = [context.make_array(sig.args[i])(context, builder, value=args[i]).data for i in (0, 1)]
        backwards = ir.Constant(ir.VectorType(ir.IntType(32), LANES), list(range(LANES - 1, -1, -1)))
        up, down, blocks = args[2:]
        s, e = (cgutils.alloca_once_value(builder, ir.Constant(lanes, [0.0] * LANES)) for _ in range(2))
        with cgutils.for_range(builder, blocks) as loop:
            done = builder.mul(loop.index, loop.index.type(LANES))
            forth, back = builder.add(up, done), builder.sub(builder.sub(down, done), down.type(LANES - 1))
            x, x_low, y, y_low = (
                builder.load(builder.bitcast(builder.gep(part, [place]), lanes.as_pointer()), align=8)
                for place in (forth, back)
                for part in parts
            )
            y, y_low = (builder.shuffle_vector(v, v, backwards) for v in (y, y_low))
            p = builder.fmul(x, y)
            rest = builder.call(fma, [x, y, builder.fneg(p)])
            rest = builder.call(fma, [x, y_low, builder.call(fma, [x_low, y, rest])])
            before = builder.load(s)
            total = builder.fadd(before, p)
            part = builder.fsub(total, before)
            lost = builder.fadd(builder.fsub(before, builder.fsub(total, part)), builder.fsub(p, part))
            builder.store(total, s)
            builder.store(builder.fadd(builder.load(e), builder.fadd(lost, rest)), e)
        sums = [builder.extract_element(builder.load(v), ir.IntType(32)(i)) for v in (s, e) for i in range(LANES)]
        return context.make_tuple(builder, sig.return_type, sums)

    return signature, codegen


@inner(forceinline=True)
def _dot(high, low, a, b, first, last, k):  # type: ignore[no-untyped-def]
    """Sum of a[j] b[k - j] over first <= j <= last, rounded at its end only."""
    s, e = 0.0, 0.0
    blocks = (last + 1 - first) // LANES
    if blocks > 0:
        width = high.shape[1]
        sums = _lanes(high, low, a * width + first, b * width + k - first, blocks)
        for i in range(LANES):
            s, lost = dd.two_sum(s, sums[i])
            e += lost + sums[LANES + i]
        first += LANES * blocks
    for j in range(first, last + 1):
        x, y = high[a, j], high[b, k - j]
        p, rest = dd.two_product(x, y)
        s, lost = dd.two_sum(s, p)
        e += lost + (rest + (x * low[b, k - j] + low[a, j] * y))
    return dd.quick_two_sum(s, e)


@inner()
def start(op, a, a_low, c, c_low):  # type: ignore[no-untyped-def]
    """The function behind an integral, of one number (and of power's exponent)."""
    if op == SIN:
        return dd.sine(a, a_low)
    if op == COS:
        return dd.cosine(a, a_low)
    if op == TAN:
        return dd.tangent(a, a_low)
    if op == SINH:
        return dd.hyperbolic_sine(a, a_low)
    if op == COSH:
        return dd.hyperbolic_cosine(a, a_low)
    if op == TANH:
        return dd.hyperbolic_tangent(a, a_low)
    if op == EXP:
        return dd.exponential(a, a_low)
    if op == LOG:
        return dd.logarithm(a, a_low)
    if op == ASIN:
        return dd.arc_sine(a, a_low)
    if op == ACOS:
        return dd.arc_cosine(a, a_low)
    if op == ATAN:
        return dd.arc_tangent(a, a_low)
    return dd.power(a, a_low, c, c_low)


_start = apart(A_START, start, types.UniTuple(float64, 2), int64, float64, float64, float64, float64)


@inner(forceinline=True)
def _linear(code, k, high, low, constants):  # type: ignore[no-untyped-def]
    """Coefficient k of what needs coefficient k of its arguments only."""
    op, a, c = code[OP], code[A], code[C]
    x, x_low = high[a, k], low[a, k]
    if op == STATE:
        return high[code[OWN], k], low[code[OWN], k]
    if op == ADD:
        return dd.add(x, x_low, high[code[B], k], low[code[B], k])
    if op == SUB:
        return dd.add(x, x_low, -high[code[B], k], -low[code[B], k])
    if op == SCALE:
        return dd.multiply(x, x_low, constants[c, 0], constants[c, 1])
    if op == SLOPE:
        return dd.multiply(x, x_low, float(k), 0.0)
    if op == RSUB:
        x, x_low = -x, -x_low
    return dd.add(x, x_low, constants[c, 0], constants[c, 1]) if k == 0 else (x, x_low)


@inner(forceinline=True)
def _convolved(code, k, high, low, constants):  # type: ignore[no-untyped-def]
    """Coefficient k of a product, a quotient or a square root: one sum, of which squares need half only."""
    op, own, a, below = code[OP], code[OWN], code[A], code[B]
    if op == SQRT and k == 0:
        return dd.square_root(high[a, 0], low[a, 0])
    first, last = max(code[FIRST], k - code[DEGREE_B]), min(k, code[DEGREE_A])
    left, right = (own, below) if op >= SQRT else (a, below)
    if op >= DIV:
        last = k - 1
    elif op != MUL:
        last = (k - 1) // 2
    s, s_low = _dot(high, low, left, right, first, last, k)
    if SQUARE <= op <= SQRT:
        s, s_low = 2.0 * s, 2.0 * s_low
        if k % 2 == 0 and k // 2 >= first:
            p, p_low = high[left, k // 2], low[left, k // 2]
            p, p_low = dd.multiply(p, p_low, p, p_low)
            s, s_low = dd.add(s, s_low, p, p_low)
    if op < SQRT:
        return s, s_low
    p, p_low = high[a, k], low[a, k]
    if op == RECIP:
        p, p_low = (constants[code[C], 0], constants[code[C], 1]) if k == 0 else (0.0, 0.0)
    s, s_low = dd.add(p, p_low, -s, -s_low)
    twice = 2.0 if op == SQRT else 1.0
    return dd.divide(s, s_low, twice * high[below, 0], twice * low[below, 0])


@inner(forceinline=True)
def _integral(integers, code, k, high, low, inverse, inverse_low, constants):  # type: ignore[no-untyped-def]
    """Coefficient k of an integral; inverse is 1 / k."""
    op, a, b, c = code[OP], code[A], code[B], code[C]
    if k == 0:
        return _start(integers, op, high[a, 0], low[a, 0], constants[c, 0], constants[c, 1])
    y, y_low = dd.multiply(high[b, k], low[b, k], inverse, inverse_low)
    return (-y, -y_low) if op >= COS else (y, y_low)


@inner()
def expand_fine(  # type: ignore[no-untyped-def]
    integers, codes, constants, field, outputs, t, t_low, x, x_low, unit, unit_low, order, least, high, low, sizes
):
    """Taylor coefficients of the solution through (t, x) and of the outputs along it, in units of ``unit``.

    Coefficient k is c_k unit^k. The expansion ends when all states and outputs have been quiet for QUIET orders.

    Parameters
    ----------
    integers : row of int
        Of the run: where functions that stand apart are.
    codes, constants, field, outputs : ndarray
        Of a :class:`henon_ref.henon.program.Program`.
    t, t_low, unit, unit_low : float
    x, x_low : ndarray, shape (n,)
    order, least : int
        Highest order, and the order before which the expansion does not end but where it is a polynomial's.
    high, low : ndarray, shape (rows, order + 1)
        Gets the coefficients: row i < n state i, ``outputs[i]`` output i.
    sizes : ndarray, shape (rows,)
        Gets the sum of the sizes of each row's coefficients.

    Returns
    -------
    int
        The last order computed, -1 where something is not finite, or a function is missing.
    """
    n, quiet, highest = len(x), 0, 0
    for i in range(len(codes)):
        highest = max(highest, codes[i, DEGREE])
        if codes[i, OP] >= SIN and missing(integers, A_START):
            return -1
    least = min(least, highest)
    sizes[:] = 0.0
    for i in range(n):
        high[i, 0], low[i, 0] = x[i], x_low[i]
    inverse, inverse_low = 1.0, 0.0
    for k in range(order + 1):
        for i in range(len(codes)):
            code = codes[i]
            op, own, b, c = code[OP], code[OWN], code[B], code[C]
            if k > code[DEGREE]:
                high[own, k], low[own, k] = 0.0, 0.0
                continue
            if op == CONSTANT:
                y, y_low = constants[c, 0], constants[c, 1]
            elif op == CLOCK:
                other, other_low = (t, t_low) if k == 0 else (unit, unit_low)
                y, y_low = dd.multiply(constants[b, 0], constants[b, 1], other, other_low)
                if k == 0:
                    y, y_low = dd.add(y, y_low, constants[c, 0], constants[c, 1])
            elif op <= SLOPE:
                y, y_low = _linear(code, k, high, low, constants)
            elif op < SIN:
                y, y_low = _convolved(code, k, high, low, constants)
            else:
                y, y_low = _integral(integers, code, k, high, low, inverse, inverse_low, constants)
            high[own, k], low[own, k] = y, y_low
            sizes[own] += abs(y)
            if not sizes[own] < math.inf:
                return -1
        quiet += 1
        for i in range(n + len(outputs)):
            row = i if i < n else outputs[i - n]
            if abs(high[row, k]) > NEGLIGIBLE * sizes[row]:
                quiet = 0
                break
        if quiet >= QUIET and k >= least:
            return k
        if k < order:
            inverse = 1.0 / (k + 1.0)
            inverse_low = dd.fma(-inverse, k + 1.0, 1.0) * inverse
            factor, factor_low = dd.multiply(unit, unit_low, inverse, inverse_low)
            for i in range(n):
                y, y_low = dd.multiply(high[field[i], k], low[field[i], k], factor, factor_low)
                high[i, k + 1], low[i, k + 1] = y, y_low
    return order
