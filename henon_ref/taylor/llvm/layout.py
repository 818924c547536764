"""Rows of coefficients as they lie in memory: how long they are, and code that stores them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, Value, literal, row_length

_VECTOR = f"<{LANES} x double>"


def store_values(w: IRWriter, values: Sequence[Value], row: int, width: int) -> None:
    """Store coefficients one by one; ``width``: doubles from one row to the next."""
    for k, value in enumerate(values):
        w.store(value or ZERO, "%C", row * width + k)


def store_integral(w: IRWriter, values: Sequence[Value], row: int, rate: tuple[int, Value], order: int) -> None:
    """Store the row of a state whose rate is a multiple of another one: from that one's row, which is there.

    Coefficient k is factor / k times the other's coefficient k - 1; ``rate``: the other's row and the factor.
    """
    width, (source, factor) = row_length(order), rate
    store_values(w, values[:LANES], row, width)
    scale = w.vector([factor or ZERO] * LANES)
    for k in range(LANES, width, LANES):
        parts = w.vector([literal(1.0 / j if j <= order else 0.0) for j in range(k, k + LANES)])
        before = w.load("%C", source * width + k - 1, _VECTOR)
        after = w.lanewise("fmul", LANES, before, w.lanewise("fmul", LANES, scale, parts))
        w.store(after, "%C", row * width + k, _VECTOR)


def store_combination(w: IRWriter, first: Value, row: int, parts: Mapping[int, Value], order: int) -> None:
    """Store a sum of rows times factors; its first coefficient, where a constant may come in, is given."""
    width = row_length(order)
    factors = {source: w.vector([factor or ZERO] * LANES) for source, factor in parts.items()}
    for k in range(0, width, LANES):
        total = ""
        for source, factor in factors.items():
            values = w.load("%C", source * width + k, _VECTOR)
            if total:
                total = w.lanewise_fused(LANES, factor, values, total)
            else:
                total = w.lanewise("fmul", LANES, factor, values)
        w.store(total or w.vector([ZERO] * LANES), "%C", row * width + k, _VECTOR)
    w.store(first or ZERO, "%C", row * width)
