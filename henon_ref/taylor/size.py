"""Size of expressions as written, counted up to a limit, because the text of a case file may be huge."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp


def size(expression: sp.Expr, limit: int) -> int:
    """Number of operations, symbols and numbers of an expression, each occurrence counted; at most limit + 1."""
    waiting: list[sp.Basic] = [expression]
    count = 0
    while waiting and count <= limit:
        part = waiting.pop()
        count += 1
        waiting += part.args
    return count


def total_size(expressions: Iterable[sp.Expr], limit: int) -> int:
    """Total size of several expressions; at most limit + 1."""
    count = 0
    for expression in expressions:
        count += size(expression, limit - count)
        if count > limit:
            break
    return count
