"""Memory layout of rows of coefficients, and code that stores them."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, Value, literal, row_length

_VECTOR = f"<{LANES} x double>"


Row = tuple[str, int]
"""An array, and the offset of a row in it."""


def store_values(w: IRWriter, values: Sequence[Value], row: Row) -> None:
    array, first = row
    for k, value in enumerate(values):
        w.store(value or ZERO, array, first + k)


def store_integral(w: IRWriter, values: Sequence[Value], row: Row, source: Row, factor: Value, order: int) -> None:
    """Store the row of a state whose rate is a multiple of another state, from the stored row of the other state.

    Coefficient k is factor / k times coefficient k - 1 of the other state.
    """
    store_values(w, values[:LANES], row)
    scale = w.vector([factor or ZERO] * LANES)
    for k in range(LANES, row_length(order), LANES):
        parts = w.vector([literal(1.0 / j if j <= order else 0.0) for j in range(k, k + LANES)])
        before = w.load(source[0], source[1] + k - 1, _VECTOR)
        after = w.lanewise("fmul", LANES, before, w.lanewise("fmul", LANES, scale, parts))
        w.store(after, row[0], row[1] + k, _VECTOR)


def store_combination(w: IRWriter, first: Value, row: Row, parts: Sequence[tuple[Row, Value]], order: int) -> None:
    """Store a sum of rows times factors; its first coefficient is passed, since it may contain a constant."""
    factors = [(source, w.vector([factor or ZERO] * LANES)) for source, factor in parts]
    for k in range(0, row_length(order), LANES):
        total = ""
        for (array, begin), factor in factors:
            values = w.load(array, begin + k, _VECTOR)
            if total:
                total = w.lanewise_fused(LANES, factor, values, total)
            else:
                total = w.lanewise("fmul", LANES, factor, values)
        w.store(total or w.vector([ZERO] * LANES), row[0], row[1] + k, _VECTOR)
    w.store(first or ZERO, *row)
