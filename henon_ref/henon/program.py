"""A Taylor tape as arrays of numbers, for the interpreter in double-double (:mod:`henon_ref.henon.fine`).

It is lowered to a few operations: every function f with f' = a' q or f' = a' / q becomes the series of a' (in slopes
k a_k), a product or a quotient, and an integral that starts with f(a_0).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.taylor.tape import INFINITE, Node, Tape

# Operations. From SIN on they are integrals, falling ones from COS on.
CONSTANT, CLOCK, STATE, ADD, SUB, SCALE, SHIFT, RSUB, SLOPE, MUL, SQUARE, SQRT, DIV, RECIP = range(14)
SIN, TAN, SINH, COSH, TANH, EXP, LOG, ASIN, ATAN, POWER, COS, ACOS = range(14, 26)
# Columns of a program's codes: operation; row it writes, rows it reads; its constant (a clock's slope is in B);
# first index of a sum; degrees in time of its own series and of those it reads; bits of the outputs that need it (the
# last bit stands for all from the 62nd on).
OP, OWN, A, B, C, FIRST, DEGREE, DEGREE_A, DEGREE_B, NEEDED = range(10)
COLUMNS = 10

_PLAIN = {
    "constant": CONSTANT,
    "clock": CLOCK,
    "state": STATE,
    "add": ADD,
    "sub": SUB,
    "scale": SCALE,
    "shift": SHIFT,
    "rsub": RSUB,
    "mul": MUL,
    "square": SQUARE,
    "div": DIV,
    "recip": RECIP,
    "sqrt": SQRT,
}
_PRODUCT = {"sin": SIN, "cos": COS, "tan": TAN, "sinh": SINH, "cosh": COSH, "tanh": TANH, "exp": EXP}
"""Functions f of a with f' = a' q, where q is f itself or the node's second argument."""
_QUOTIENT = {"log": LOG, "asin": ASIN, "acos": ACOS, "atan": ATAN}
"""Functions f of a with f' = a' / q, where q is a itself or the node's second argument."""


class Program(NamedTuple):
    """A tape as arrays."""

    codes: NDArray[np.int64]
    """(operations, COLUMNS): one operation a row, in the order of their evaluation."""
    constants: NDArray[np.float64]
    """(C + 1, 4): each in four doubles, largest first, and a zero for operations without one."""
    field: NDArray[np.int64]
    """(n,): row of x_i'."""
    outputs: NDArray[np.int64]
    """(outputs,): row of each further function."""
    rows: int
    """Series it works on: row i < N is node i of the tape, its first n the states; helpers follow."""


def program(tape: Tape, numbers: Sequence[Sequence[float]]) -> Program:
    """Lower a tape; ``numbers`` are its constants as four doubles each, largest first."""
    lowered = _Lowered(tape)
    for i, row in enumerate(tape.outputs):
        lowered.mark([row], tape.field, 1 << min(i, 62))
    return Program(
        np.array(lowered.codes, dtype=np.int64).reshape(-1, COLUMNS),
        np.array([*numbers, (0.0,) * 4], dtype=np.float64),
        np.array(tape.field, dtype=np.int64),
        np.array(tape.outputs, dtype=np.int64),
        len(lowered.degrees),
    )


class _Lowered:
    """Codes of a tape's nodes and of the helpers between them."""

    def __init__(self, tape: Tape) -> None:
        self.codes: list[list[int]] = []
        self.degrees = [node.degree for node in tape.nodes]
        """Of every row."""
        self._slopes: dict[int, int] = {}
        for own, node in enumerate(tape.nodes):
            self._lower(own, node)

    def _emit(self, op: int, a: int = 0, b: int = 0, c: int = 0, *, own: int = -1, first: int = 0) -> int:
        if own < 0:
            own = len(self.degrees)
            self.degrees.append(self.degrees[a] if op == SLOPE else INFINITE)
        degrees = [self.degrees[row] for row in (own, a, b)] if op not in (CONSTANT, CLOCK) else [self.degrees[own]] * 3
        self.codes.append([op, own, a, b, c, first, *degrees, 0])
        return own

    def mark(self, rows: Iterable[int], field: Sequence[int], bits: int) -> None:
        """Note in all codes that some rows come from who needs them."""
        codes = {code[OWN]: code for code in self.codes}
        waiting, seen = [*rows], set[int]()
        while waiting:
            row = waiting.pop()
            if row in seen:
                continue
            seen.add(row)
            code = codes[row]
            code[NEEDED] |= bits
            op = code[OP]
            if op == STATE:
                waiting.append(field[row])
            elif op not in (CONSTANT, CLOCK):
                waiting.append(code[A])
                if op in (ADD, SUB) or op >= MUL:
                    waiting.append(code[B])

    def _slope(self, a: int) -> int:
        if a not in self._slopes:
            self._slopes[a] = self._emit(SLOPE, a)
        return self._slopes[a]

    def _lower(self, own: int, node: Node) -> None:
        a, b = (*node.args, 0, 0)[:2]
        c = node.constants[0] if node.constants else 0
        if node.op in _PLAIN:
            if node.op in ("square", "recip"):
                b = a
            elif node.op == "sqrt":
                b = own
            elif node.op == "clock":
                b = node.constants[1]
            self._emit(_PLAIN[node.op], a, b, c, own=own, first=int(node.op == "sqrt"))
        elif node.op in _PRODUCT:
            q = b if len(node.args) > 1 else own
            self._emit(_PRODUCT[node.op], a, self._emit(MUL, self._slope(a), q, first=1), own=own)
        elif node.op in _QUOTIENT:
            q = b if len(node.args) > 1 else a
            self._emit(_QUOTIENT[node.op], a, self._emit(DIV, self._slope(a), q), own=own)
        else:  # power: f' = c a' f / a
            product = self._emit(SCALE, self._emit(MUL, self._slope(a), own, first=1), c=c)
            self._emit(POWER, a, self._emit(DIV, product, a), c, own=own)
