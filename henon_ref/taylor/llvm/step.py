"""Machine code of a step: bounds of its size, the series at its end, the number of roots of a guard on it.

By Descartes' rule of signs the number of roots on a step is the number of sign changes of the Bernstein coefficients,
or less by an even number (Mourrain and Pavone, *J. Symbolic Comput.* 44, 2009): no or one sign change is decisive.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

from henon_ref.jit.ir_writer import LANES, ONE, VECTOR, ZERO, IRWriter, Value, literal, loop_function, row_length
from henon_ref.kernel.library import kernel

ARGUMENT_CHANGE = 8.0
"""Largest change of the argument of an exponential on one step."""
FALLING_PART = 0.7
"""Longest step, as a part of the time in which a denominator may fall to zero."""
FLATTEST = 0.45
"""Largest d_0 d_2/d_1^2 of a denominator that may fall to zero as a power m: (m - 1)/(2 m); 1/2 for an exponential."""
STEP_LIMIT = 2.0
"""Longest step in units if an argument has terms of order 3 or higher."""
GROWING = ("exp", "sinh", "tanh")
"""Functions whose argument bounds the step."""
SATURATED = {"exp": 750.0, "tanh": 20.0}
"""Argument (exp: minus the argument) beyond which the value is 0 (tanh: 1 or -1) to the last digit."""


def last_terms(w: IRWriter, rows: Sequence[Sequence[Value]], sizes: Sequence[str], order: int) -> list[str]:
    """(largest last, largest last but one, sum of all) relative coefficients; ``sizes``: inverse size of each row."""
    ratios: tuple[list[str], list[str]] = ([], [])
    for row, inverse in zip(rows, sizes, strict=True):
        for found, value in zip(ratios, (row[order], row[order - 1]), strict=True):
            if value is not None:
                found.append(w.binary("fmul", w.call("fabs", value), inverse))
    last, before = ratios
    return [w.paired(w.larger, last), w.paired(w.larger, before), w.paired(w.plus, [*before, *last])]


def inverse_size(w: IRWriter, row: Sequence[Value]) -> str:
    """1 / (size of a row's first three terms on a step of one unit)."""
    size = literal(1e-300)
    for value in row[:3]:
        if value is not None:
            size = w.binary("fadd", size, w.call("fabs", value))
    return w.binary("fdiv", ONE, size)


def fall(w: IRWriter, first: Value, second: Value, quotient: Sequence[Value] | None = None) -> Value:
    """Inverse of half the time, in units, in which a denominator may fall to zero; zero or less if it does not fall.

    The denominator is a multiple of d = 1 - ``first`` t - ``second`` t^2 up to order 2. The time is that of the smaller
    root of this quadratic; if there is none, of the double root of one with the same slope. It does not count if d
    falls as an exponential, which has no root (FLATTEST), nor if the ``quotient`` with this denominator rises by less
    than before a root of d: then its numerator falls, too (sin(x)/x near x = 0).
    """
    if first is None and second is None:
        return None
    four = w.scaled(4.0, second)
    inside, bend = (w.fused(w.scaled(factor, first), first, four) or ZERO for factor in (1.0, 4.0 * FLATTEST))
    found = w.add(first, w.call("sqrt", w.larger(inside, ZERO)))
    counts = [w.emit(f"fcmp oge double {bend}, {ZERO}")]
    if quotient is not None and first is not None:
        before, rise = quotient[0], w.mul(quotient[0], quotient[1]) or ZERO
        root = w.mul(w.scaled(0.5, first), w.mul(before, before)) or ZERO
        counts.append(w.emit(f"fcmp oge double {rise}, {root}"))
    for each in counts:
        found = w.emit(f"select i1 {each}, double {found}, double {ZERO}")
    return found


def before_falls(w: IRWriter, falls: str) -> str:
    """Longest step, in units, on which no denominator falls to zero, or nearly; ``falls``: the largest :func:`fall`.

    A feature that is much narrower than a step, such as 1/(1 + (u/w)^2) before u = 0, may be below rounding in all
    Taylor coefficients: only the denominator shows it. Steps then approach the feature by a constant part of their
    distance to it, until the coefficients contain it.
    """
    return w.binary("fdiv", literal(2.0 * FALLING_PART), w.larger(falls, literal(1e-30)))


def longest_step(w: IRWriter, exponentials: Sequence[tuple[str, Sequence[Value]]]) -> str:
    """Longest step, in units, on which no exponential's argument changes by more than ARGUMENT_CHANGE.

    An exponential that underflows to zero (a pulse long before its beginning) has Taylor coefficients that are zero
    too, so that no error estimate detects its growth; only its argument shows it. While the exponential is zero, its
    argument may move half the way to the end of the underflow.

    On a step theta <= STEP_LIMIT the argument a changes by at most abs(a_1) theta + bend theta^2, where bend is the sum
    of abs(a_j) STEP_LIMIT^(j - 2). If a is quadratic, this holds for any theta, and STEP_LIMIT is not applied.

    ``exponentials``: name and argument's coefficients of each function in :data:`GROWING`.
    """
    result = literal(1e30)
    for name, argument in exponentials:
        moving = [(j, value) for j, value in enumerate(argument) if j > 0 and value is not None]
        if not moving:
            continue
        slope = next((w.call("fabs", value) for j, value in moving if j == 1), ZERO)
        bend, quadratic = ZERO, ZERO
        for j, value in moving:
            if j > 1:
                bend = w.plus(bend, w.binary("fmul", w.call("fabs", value), literal(STEP_LIMIT ** (j - 2))))
            if j == 2:
                quadratic = bend
        change = literal(ARGUMENT_CHANGE)
        if name in SATURATED:
            start = argument[0] or ZERO
            depth = w.neg(start) if name == "exp" else w.call("fabs", start)
            half_way = w.binary("fmul", literal(0.5), w.binary("fsub", depth or ZERO, literal(SATURATED[name])))
            change = w.larger(half_way, change)
        inside = w.binary(
            "fadd", w.binary("fmul", slope, slope), w.binary("fmul", literal(4.0), w.binary("fmul", bend, change))
        )
        below = w.binary("fadd", w.binary("fadd", slope, w.call("sqrt", inside)), literal(1e-300))
        root = w.binary("fdiv", w.binary("fmul", literal(2.0), change), below)
        result = w.smaller(root, result)
        if bend != quadratic:  # terms of order 3 and higher exist; the limit applies only if they change the bend
            free = w.emit(f"fcmp oeq double {bend}, {quadratic}")
            limit = w.emit(f"select i1 {free}, double {literal(1e30)}, double {literal(STEP_LIMIT)}")
            result = w.smaller(limit, result)
    return result


def step_end_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double theta, double* C, double* out)``: evaluation of the series at the end of a step.

    For each state, ``out`` receives its change over the step (all terms but the first, so that adding it rounds once);
    then for each output a lower bound on (0, theta]: its first coefficient plus its negative terms.
    """
    w = IRWriter()
    powers, strides = _powers(w)
    for r in range(states + outputs):
        _row(w, ("%C", r * row_length(order)), ("%out", r), order, r >= states, powers, strides)
    return _function(name, w.lines)


def looped_step_end_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR as :func:`step_end_ir`, with loops over the rows."""
    text, lines = "", []
    for which, first, count in (("states", 0, states), ("outputs", states, outputs)):
        w = IRWriter()
        w.lines += [
            f"  %row = mul i64 %at, {row_length(order)}",
            "  %C = getelementptr double, ptr %first, i64 %row",
            "  %out = getelementptr double, ptr %results, i64 %at",
        ]
        powers, strides = _powers(w)
        _row(w, ("%C", 0), ("%out", 0), order, which == "outputs", powers, strides)
        text += loop_function(
            f"{name}.{which}", "double %theta, ptr noalias %first, ptr noalias %results, i64 %count", w.lines
        )
        lines += [
            f"  %first{first} = getelementptr double, ptr %C, i64 {first * row_length(order)}",
            f"  %results{first} = getelementptr double, ptr %out, i64 {first}",
            f"  call void @{name}.{which}(double %theta, ptr %first{first}, ptr %results{first}, i64 {count})",
        ]
    return text + _function(name, lines)


def _function(name: str, lines: Sequence[str]) -> str:
    body = "\n".join(lines)
    return f"define void @{name}(double %theta, ptr noalias %C, ptr noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


def _powers(w: IRWriter) -> tuple[str, list[str]]:
    """Powers of theta from 0 to 3, and theta^4, each as a vector."""
    square = w.binary("fmul", "%theta", "%theta")
    strides = [w.vector([w.binary("fmul", square, square)] * LANES)]
    return w.vector([ONE, "%theta", square, w.binary("fmul", square, "%theta")]), strides


def _row(
    w: IRWriter, row: tuple[str, int], out: tuple[str, int], order: int, bound: bool, powers: str, strides: list[str]
) -> None:
    """Store the result of one row: a state's change, or an output's lower ``bound``."""
    zero, terms = w.vector([ZERO] * LANES), []
    for v in range(row_length(order) // LANES):
        term = w.load(row[0], row[1] + v * LANES, VECTOR)
        if v == 0:
            term = w.emit(f"insertelement {VECTOR} {term}, double {ZERO}, i64 0")
        if (v + 1) * LANES > order + 1:  # behind the row's end memory may hold anything
            own = ", ".join(f"i1 {int(k <= order)}" for k in range(v * LANES, (v + 1) * LANES))
            term = w.emit(f"select <{LANES} x i1> <{own}>, {VECTOR} {term}, {VECTOR} {zero}")
        if bound:
            below = w.emit(f"fcmp olt {VECTOR} {term}, {zero}")
            term = w.emit(f"select <{LANES} x i1> {below}, {VECTOR} {term}, {VECTOR} {zero}")
        terms.append(term)
    total = _estrin(w, terms, strides)
    total = w.across(LANES, w.lanewise("fmul", LANES, total, powers))
    w.store(w.plus(w.load(*row), total) if bound else total, *out)


def _estrin(w: IRWriter, terms: list[str], strides: list[str]) -> str:
    """sum of terms_v stride^v by Estrin's scheme; ``strides``: the powers 1, 2, 4 ... computed so far."""
    level = 0
    while len(terms) > 1:
        if level == len(strides):
            strides.append(w.lanewise("fmul", LANES, strides[-1], strides[-1]))
        paired = [w.lanewise_fused(LANES, terms[i + 1], strides[level], terms[i]) for i in range(0, len(terms) - 1, 2)]
        terms = paired + terms[2 * len(paired) :]
        level += 1
    return terms[0]


def bernstein_ir(order: int, name: str) -> str:
    """LLVM IR of ``i64 name(double* q, double* powers, i64 degree, double* a, double* b)``.

    ``a`` receives q_k powers_k up to ``degree``, then zeros; ``b`` the Bernstein coefficients of degree ``order`` of
    this polynomial on [0, 1]; both arrays hold whole vectors. The value (``enum roots_outcome`` of ``kernel.h``) is
    ROOT if the polynomial falls through exactly one root there, NO_ROOT if through none, and SUBDIVIDE if undecided.
    """
    w = IRWriter()
    blocks = row_length(order) // LANES
    every = (1 << (order + 1)) - 1
    degree = w.emit(f"insertelement <{LANES} x i64> poison, i64 %degree, i64 0")
    degree = w.emit(f"shufflevector <{LANES} x i64> {degree}, <{LANES} x i64> poison, <{LANES} x i32> zeroinitializer")
    zero = w.vector([ZERO] * LANES)
    terms = []
    for v in range(blocks):
        places = ", ".join(f"i64 {v * LANES + i}" for i in range(LANES))
        counts = w.emit(f"icmp sle <{LANES} x i64> <{places}>, {degree}")
        product = w.lanewise("fmul", LANES, w.load("%q", v * LANES, VECTOR), w.load("%powers", v * LANES, VECTOR))
        terms.append(w.emit(f"select <{LANES} x i1> {counts}, {VECTOR} {product}, {VECTOR} {zero}"))
        w.store(terms[v], "%a", v * LANES, VECTOR)
    splats = [w.shuffled(LANES, terms[k // LANES], [k % LANES] * LANES) for k in range(order + 1)]
    positive, certain = "0", "0"
    for v in range(blocks):
        chains = [splats[0], zero]
        for k in range(1, min(order, LANES * v + LANES - 1) + 1):
            weights = w.vector([literal(_weight(order, k, i)) for i in range(LANES * v, LANES * v + LANES)])
            chains[k % 2] = w.lanewise_fused(LANES, splats[k], weights, chains[k % 2])
        b = w.lanewise("fadd", LANES, *chains)
        w.store(b, "%b", v * LANES, VECTOR)
        positive = _with_signs(w, positive, f"fcmp ogt {VECTOR} {b}, {zero}", v)
        certain = _with_signs(w, certain, f"fcmp one {VECTOR} {b}, {zero}", v)
    positive = w.emit(f"and i64 {positive}, {every}")
    certain = w.emit(f"icmp eq i64 {w.emit(f'and i64 {certain}, {every}')}, {every}")
    turned = w.emit(f"xor i64 {positive}, {w.emit(f'lshr i64 {positive}, 1')}")
    changes = w.emit(f"call i64 @llvm.ctpop.i64(i64 {w.emit(f'and i64 {turned}, {every >> 1}')})")
    falling = w.emit(f"select i1 {w.emit(f'trunc i64 {positive} to i1')}, i64 {kernel.ROOT}, i64 {kernel.NO_ROOT}")
    outcome = w.emit(f"select i1 {w.emit(f'icmp eq i64 {changes}, 1')}, i64 {falling}, i64 {kernel.SUBDIVIDE}")
    outcome = w.emit(f"select i1 {w.emit(f'icmp eq i64 {changes}, 0')}, i64 {kernel.NO_ROOT}, i64 {outcome}")
    outcome = w.emit(f"select i1 {certain}, i64 {outcome}, i64 {kernel.SUBDIVIDE}")
    body = "\n".join(w.lines)
    return (
        f"define i64 @{name}(ptr noalias %q, ptr noalias %powers, i64 %degree, ptr noalias %a, ptr noalias %b) {{\n"
        f"entry:\n{body}\n  ret i64 {outcome}\n}}\n"
    )


def _weight(order: int, k: int, i: int) -> float:
    """Weight of power coefficient k in Bernstein coefficient i."""
    return comb(i, k) / comb(order, k) if i <= order else 0.0


def _with_signs(w: IRWriter, mask: str, comparison: str, block: int) -> str:
    bits = w.emit(f"bitcast <{LANES} x i1> {w.emit(comparison)} to i{LANES}")
    wide = w.emit(f"shl i64 {w.emit(f'zext i{LANES} {bits} to i64')}, {block * LANES}")
    return w.emit(f"or i64 {mask}, {wide}")
