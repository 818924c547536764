"""Bounds for the choice of the step size, as machine code: last terms of the series, change of exponents."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import ONE, ZERO, IRWriter, Value, literal

ARGUMENT_CHANGE = 8.0
"""Largest change of the argument of an exponential on one step."""
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
