"""Quad-double arithmetic: a number as the unevaluated sum of four doubles, about 63 digits, in compiled code.

The operations are the QD library's quicker ones (Hida, Li and Bailey, *Proc. 15th IEEE Symp. on Computer Arithmetic*,
2001): accurate relative to the size of what goes into a sum, not relative to the sum. A number is a tuple of
four floats, largest part first. None of this may be compiled with fastmath.
"""

from __future__ import annotations

import math

from henon_ref.henon.doubledouble import quick_two_sum, two_product, two_sum
from henon_ref.jit import inner


@inner()
def add(a, b):  # type: ignore[no-untyped-def]
    """a + b."""
    s0, t0 = two_sum(a[0], b[0])
    s1, t1 = two_sum(a[1], b[1])
    s2, t2 = two_sum(a[2], b[2])
    s3, t3 = two_sum(a[3], b[3])
    s1, t0 = two_sum(s1, t0)
    s2, t0, t1 = _three_sum(s2, t0, t1)
    s3, t0, t2 = _three_sum(s3, t0, t2)
    return _renormalized(s0, s1, s2, s3, t0 + (t1 + t2 + t3))


@inner(forceinline=True)
def accumulated(s, a):  # type: ignore[no-untyped-def]
    """s + a, for a sum of many: its parts overlap (see :func:`rounded`), and take a third of :func:`add`'s time."""
    s0, t0 = two_sum(s[0], a[0])
    s1, t1 = two_sum(s[1], a[1])
    s2, t2 = two_sum(s[2], a[2])
    s1, t0 = two_sum(s1, t0)
    s2, t1 = two_sum(s2, t1)
    s2, t0 = two_sum(s2, t0)
    return s0, s1, s2, s[3] + (a[3] + (t0 + t1 + t2))


@inner()
def rounded(s):  # type: ignore[no-untyped-def]
    """An accumulated sum as a double."""
    high, low = two_sum(s[0], s[1])
    high, rest = two_sum(high, s[2])
    return high + (low + rest + s[3])


@inner()
def multiply(a, b):  # type: ignore[no-untyped-def]
    """a b."""
    return _renormalized(*_product(a, b))


@inner(forceinline=True)
def accumulated_product(s, a, b):  # type: ignore[no-untyped-def]
    """s + a b, for a sum of many (see :func:`accumulated`): the product need not be put in order."""
    p0, p1, p2, p3, p4 = _product(a, b)
    return accumulated(s, (p0, p1, p2, p3 + p4))


@inner(forceinline=True)
def _product(a, b):  # type: ignore[no-untyped-def]
    """a b as five parts that may overlap."""
    a0, a1, a2, a3 = a
    b0, b1, b2, b3 = b
    p0, q0 = two_product(a0, b0)
    p1, q1 = two_product(a0, b1)
    p2, q2 = two_product(a1, b0)
    p3, q3 = two_product(a0, b2)
    p4, q4 = two_product(a1, b1)
    p5, q5 = two_product(a2, b0)
    p1, p2, q0 = _three_sum(p1, p2, q0)
    p2, q1, q2 = _three_sum(p2, q1, q2)
    p3, p4, p5 = _three_sum(p3, p4, p5)
    s0, t0 = two_sum(p2, p3)
    s1, t1 = two_sum(q1, p4)
    s1, t0 = two_sum(s1, t0)
    s2 = q2 + p5 + (t0 + t1)
    s1, t0 = two_sum(s1, a0 * b3 + a1 * b2 + a2 * b1 + a3 * b0 + (q0 + q3 + q4 + q5))
    return p0, p1, s0, s1, s2 + t0


@inner()
def scale(a, factor):  # type: ignore[no-untyped-def]
    """a times a double."""
    p0, q0 = two_product(a[0], factor)
    p1, q1 = two_product(a[1], factor)
    p2, q2 = two_product(a[2], factor)
    p1, t0 = two_sum(q0, p1)
    p2, t0, t1 = _three_sum(t0, q1, p2)
    s3, t0, _ = _three_sum(t0, q2, a[3] * factor)
    return _renormalized(p0, p1, p2, s3, t0 + t1)


@inner()
def negative(a):  # type: ignore[no-untyped-def]
    """-a."""
    return -a[0], -a[1], -a[2], -a[3]


@inner()
def divide(a, b):  # type: ignore[no-untyped-def]
    """a / b, by long division."""
    q0 = a[0] / b[0]
    r = add(a, negative(scale(b, q0)))
    q1 = r[0] / b[0]
    r = add(r, negative(scale(b, q1)))
    q2 = r[0] / b[0]
    r = add(r, negative(scale(b, q2)))
    q3 = r[0] / b[0]
    r = add(r, negative(scale(b, q3)))
    return _renormalized(q0, q1, q2, q3, r[0] / b[0])


@inner()
def square_root(a):  # type: ignore[no-untyped-def]
    """Square root of a: Newton's method on its inverse, twice the digits at each step. Not a number below zero."""
    if a[0] == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    y = 1.0 / math.sqrt(a[0]), 0.0, 0.0, 0.0
    half = 0.5 * a[0], 0.5 * a[1], 0.5 * a[2], 0.5 * a[3]
    for _ in range(3):
        rest = add((0.5, 0.0, 0.0, 0.0), negative(multiply(half, multiply(y, y))))
        y = add(y, multiply(y, rest))
    return multiply(a, y)


@inner()
def _three_sum(a, b, c):  # type: ignore[no-untyped-def]
    """a + b + c as three parts, largest first."""
    s, t = two_sum(a, b)
    s, u = two_sum(c, s)
    t, u = two_sum(t, u)
    return s, t, u


@inner()
def _renormalized(c0, c1, c2, c3, c4):  # type: ignore[no-untyped-def]
    """Five parts that may overlap as four that do not."""
    s, c4 = quick_two_sum(c3, c4)
    s, c3 = quick_two_sum(c2, s)
    s, c2 = quick_two_sum(c1, s)
    c0, c1 = quick_two_sum(c0, s)
    c1, c2 = quick_two_sum(c1, c2)
    c2, c3 = quick_two_sum(c2, c3)
    c3, c4 = quick_two_sum(c3, c4)
    return c0, c1, c2, c3 + c4
