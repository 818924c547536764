"""How long a step may be: what the step size is chosen by, as machine code."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.henon.emitter import ONE, Value, Writer, literal

SWING = 8.0
"""How far the argument of an exponential may move on one step."""


def norms(w: Writer, rows: Sequence[Sequence[Value]], sizes: Sequence[str], order: int) -> list[str]:
    """(largest last, largest last but one, sum of all), relative; ``sizes``: inverse size of each row."""
    ratios: tuple[list[str], list[str]] = ([], [])
    for row, inverse in zip(rows, sizes, strict=True):
        for found, value in zip(ratios, (row[order], row[order - 1]), strict=True):
            if value is not None:
                found.append(w.binary("fmul", w.call("fabs", value), inverse))
    last, before = ratios
    return [w.paired(w.larger, last), w.paired(w.larger, before), w.paired(w.plus, [*before, *last])]


def inverse_size(w: Writer, row: Sequence[Value]) -> str:
    """1 / (size of a row's first three terms on a step of sigma)."""
    size = literal(1e-300)
    for value in row[:3]:
        if value is not None:
            size = w.binary("fadd", size, w.call("fabs", value))
    return w.exact("fdiv", ONE, size)


def longest(w: Writer, arguments: Sequence[Sequence[Value]]) -> str:
    """Longest step, in units of sigma, on which no exponential's argument moves by more than SWING.

    An exponential that is zero in double precision (a drive that sleeps) has no Taylor coefficient that could
    tell of its waking: its argument does.
    """
    result = literal(1e30)
    for argument in arguments:
        terms = [w.call("fabs", a) for a in argument[1:3] if a is not None]
        if terms:
            total = terms[0] if len(terms) == 1 else w.binary("fadd", terms[0], terms[1])
            ratio = w.exact("fdiv", literal(SWING), w.binary("fadd", total, literal(1e-300)))
            result = w.emit(
                f"select i1 {w.emit(f'fcmp olt double {ratio}, {result}')}, double {ratio}, double {result}"
            )
    return result
