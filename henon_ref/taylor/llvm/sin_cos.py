"""Sine and cosine of a double-double phase, as straight-line code.

One argument reduction serves both functions; a call of the C library for each costs a third of an expansion. The
polynomials are Taylor's (order 17 has an error below half a unit in the last place on a quarter turn around zero), in
the arrangement of Sun's fdlibm (``k_sin.c``, ``k_cos.c``), which includes the tail of the reduced phase.
"""

from __future__ import annotations

import math
from fractions import Fraction

from henon_ref.jit.ir_writer import ONE, PAIR, IRWriter, literal

_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
"""pi/2 as an unevaluated sum of three doubles."""


def sin_cos(w: IRWriter, high: str, low: str) -> tuple[str, str]:
    """Sine and cosine of ``high + low`` (|low| at most a few ulps of high).

    Phases above 1e15 are passed to the C library: doubles of this size are an eighth apart. Code that may not branch
    calls the function :func:`sin_cos_ir`.
    """
    if not w.branches:
        both = w.emit(f"call {PAIR} @sin_cos(double {high}, double {low})")
        return w.emit(f"extractvalue {PAIR} {both}, 0"), w.emit(f"extractvalue {PAIR} {both}, 1")
    near, far, done = w.name(), w.name(), w.name()
    within = w.emit(f"fcmp olt double {w.call('fabs', high)}, {literal(1e15)}")
    w.lines += [f"  br i1 {within}, label %{near}, label %{far}", f"{near}:"]
    s, c = _reduced(w, high, low)
    w.lines += [f"  br label %{done}", f"{far}:"]
    sin, cos = w.call("sin", high), w.call("cos", high)
    s_far = w.binary("fadd", sin, w.binary("fmul", low, cos))
    c_far = w.binary("fsub", cos, w.binary("fmul", low, sin))
    w.lines += [f"  br label %{done}", f"{done}:"]
    return (
        w.emit(f"phi double [ {s}, %{near} ], [ {s_far}, %{far} ]"),
        w.emit(f"phi double [ {c}, %{near} ], [ {c_far}, %{far} ]"),
    )


def sin_cos_ir() -> str:
    """LLVM IR of a function ``sin_cos`` that returns :func:`sin_cos` as two numbers."""
    w = IRWriter()
    s, c = sin_cos(w, "%high", "%low")
    first = w.emit(f"insertvalue {PAIR} poison, double {s}, 0")
    both = w.emit(f"insertvalue {PAIR} {first}, double {c}, 1")
    body = "\n".join(w.lines)
    return f"define internal {PAIR} @sin_cos(double %high, double %low) {{\nentry:\n{body}\n  ret {PAIR} {both}\n}}\n"


def _reduced(w: IRWriter, high: str, low: str) -> tuple[str, str]:
    """Cody-Waite reduction by multiples of pi/2, given as three doubles; then the polynomials and the quadrant."""
    n = w.call("rint", w.binary("fmul", high, literal(1.0 / _HALF_PI[0])))
    minus = w.emit(f"fneg double {n}")
    first = w.call("fma", minus, literal(_HALF_PI[0]), high)  # exact: a multiple of 2^-52 (or of high's last place)
    product = w.binary("fmul", n, literal(_HALF_PI[1]))
    lost = w.call("fma", n, literal(_HALF_PI[1]), w.emit(f"fneg double {product}"))
    # two-sum of first - product
    total = w.binary("fsub", first, product)
    part = w.binary("fsub", total, first)
    error = w.binary("fsub", w.binary("fsub", first, w.binary("fsub", total, part)), w.binary("fadd", product, part))
    tail = w.binary("fsub", w.binary("fadd", error, low), lost)
    tail = w.call("fma", minus, literal(_HALF_PI[2]), tail)
    r = w.binary("fadd", total, tail)
    rest = w.binary("fadd", w.binary("fsub", total, r), tail)
    early = w.binary("fadd", w.call("fma", minus, literal(_HALF_PI[1]), first), low)  # r except for its last bits
    z = w.binary("fmul", early, early)
    square = w.binary("fmul", z, z)
    powers = z, square, w.binary("fmul", square, square)
    s = _sine(w, r, rest, powers)
    c = _cosine(w, early, w.binary("fadd", w.binary("fsub", r, early), rest), powers)
    quadrant = w.emit(f"fptosi double {n} to i64")
    odd = w.emit(f"trunc i64 {quadrant} to i1")
    sine = w.emit(f"select i1 {odd}, double {c}, double {s}")
    cosine = w.emit(f"select i1 {odd}, double {s}, double {c}")
    return _signed(w, sine, quadrant), _signed(w, cosine, w.emit(f"add i64 {quadrant}, 1"))


def _signed(w: IRWriter, value: str, quadrant: str) -> str:
    """Negate the value in the quadrants 2 and 3."""
    sign = w.emit(f"shl i64 {w.emit(f'and i64 {quadrant}, 2')}, 62")
    bits = w.emit(f"bitcast double {value} to i64")
    return w.emit(f"bitcast i64 {w.emit(f'xor i64 {bits}, {sign}')} to double")


def _polynomial(w: IRWriter, powers: tuple[str, str, str], coefficients: list[float]) -> str:
    """Polynomial of seven terms by Estrin's scheme; ``powers``: z, z^2 and z^4."""
    z, square, fourth = powers
    c = [literal(value) for value in coefficients]
    pairs = [w.call("fma", c[i + 1], z, c[i]) for i in (0, 2, 4)]
    low = w.call("fma", pairs[1], square, pairs[0])
    high = w.call("fma", c[6], square, pairs[2])
    return w.call("fma", high, fourth, low)


def _sine(w: IRWriter, r: str, rest: str, powers: tuple[str, str, str]) -> str:
    z = powers[0]
    series = [float(Fraction((-1) ** k, math.factorial(2 * k + 1))) for k in range(2, 9)]
    tail = w.call("fma", _polynomial(w, powers, series), z, literal(-1.0 / 6.0))
    cube = w.binary("fmul", z, r)
    slope = w.call("fma", literal(-0.5), z, ONE)
    return w.binary("fadd", r, w.call("fma", cube, tail, w.binary("fmul", rest, slope)))


def _cosine(w: IRWriter, r: str, rest: str, powers: tuple[str, str, str]) -> str:
    z, square, _ = powers
    series = [float(Fraction((-1) ** k, math.factorial(2 * k))) for k in range(2, 9)]
    half = w.binary("fmul", z, literal(0.5))
    head = w.binary("fsub", ONE, half)
    lost = w.binary("fsub", w.binary("fsub", ONE, head), half)
    correction = w.call("fma", w.emit(f"fneg double {r}"), rest, lost)
    return w.binary("fadd", head, w.call("fma", square, _polynomial(w, powers, series), correction))
