"""Bounds that the step size is chosen by, as machine code: last terms of the series, change of exponents."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import ONE, ZERO, IRWriter, Value, literal

ARGUMENT_CHANGE = 8.0
"""How far the argument of an exponential may move on one step."""
STEP_LIMIT = 2.0
"""How many units a step may be where an argument has terms of order 3 and higher."""
GROWING = ("exp", "sinh", "tanh")
"""Functions whose argument bounds the step."""
SATURATED = {"exp": 750.0, "tanh": 20.0}
"""Argument (of exp: minus the argument) from which on the value is 0 (of tanh: 1 or -1) to the last digit."""


def last_terms(w: IRWriter, rows: Sequence[Sequence[Value]], sizes: Sequence[str], order: int) -> list[str]:
    """(largest last, largest last but one, sum of all), relative; ``sizes``: inverse size of each row."""
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
    """Longest step, in units of time, on which no exponential's argument moves by more than ARGUMENT_CHANGE.

    An exponential that is zero in double precision (a pulse long before it begins) has Taylor coefficients that are
    zero, too, and so no error estimate sees it grow: its argument does. As long as it is zero the argument may move
    half the way to where it is not.

    On a step theta <= STEP_LIMIT the argument a moves by no more than abs(a_1) theta + bend theta^2, where bend is
    the sum of abs(a_j) STEP_LIMIT^(j - 2): exact where a is quadratic, and then without that limit.

    Parameters
    ----------
    exponentials : sequence
        Of each of the functions that are :data:`GROWING` the name, and the coefficients of the argument.
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
        if bend != quadratic:  # there are terms of order 3 and higher; none of them counts where they add nothing
            free = w.emit(f"fcmp oeq double {bend}, {quadratic}")
            limit = w.emit(f"select i1 {free}, double {literal(1e30)}, double {literal(STEP_LIMIT)}")
            result = w.smaller(limit, result)
    return result
