"""Convolutions of coefficients, several at once in the lanes of vectors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, Value
from henon_ref.taylor.tape import INFINITE, Tape

VECTOR_ORDER = 8
"""Order from which convolutions use vectors; at lower orders a lane would have only one or two products."""

Pair = tuple[int, int, int]
"""Nodes u and v, and the node whose recurrence uses the sum of u_j v_(k-j)."""


class Convolutions:
    """Sums of the older products of all convolutions of an order, several at once in the lanes of vectors.

    u * v at order k is the sum of u_j v_(k-j). For 2 <= j < k/2 the products u_j v_(k-j) and v_j u_(k-j) are lanes of
    the product of two packed vectors, one with its neighbours swapped. The products with j = 0 and 1, and the middle
    one, are left to the recurrence.
    """

    def __init__(self, w: IRWriter, series: Mapping[int, Sequence[Value]], pairs: Sequence[Pair], order: int) -> None:
        self.w, self.series, self.order = w, series, order
        half = LANES // 2
        wanted = list(pairs) if order >= VECTOR_ORDER else []
        self.groups = [wanted[i : i + half] for i in range(0, len(wanted), half)]
        self.operands: list[dict[int, tuple[str, str]]] = [{} for _ in self.groups]
        self.sums: dict[tuple[Pair, int], str] = {}
        self.grouped = frozenset(wanted)
        self._scales: dict[Pair, Value] = {}
        self._scaled: dict[tuple[Pair, int], Value] = {}

    def scale(self, pair: Pair, factor: Value) -> None:
        """Multiply u of a pair by a factor from now on."""
        self._scales[pair] = factor

    def left(self, pair: Pair, k: int) -> Value:
        """u_k of a pair, times the factor if one is set."""
        if pair not in self._scales:
            return self.series[pair[0]][k]
        if (pair, k) not in self._scaled:
            self._scaled[pair, k] = self.w.mul(self._scales[pair], self.series[pair[0]][k])
        return self._scaled[pair, k]

    def pack(self, k: int) -> None:
        """Pack the coefficients of order k, once all of them are known."""
        if k < 2 or k > self.order - 2:
            return
        for group, operands in zip(self.groups, self.operands, strict=True):
            values = [v or ZERO for pair in group for v in (self.left(pair, k), self.series[pair[1]][k])]
            packed = self.w.vector(values)
            swapped = self.w.shuffled(len(values), packed, [i ^ 1 for i in range(len(values))])
            operands[k] = packed, swapped

    def add_up(self, k: int) -> None:
        """Add the sums for order k, from coefficients up to k - 2."""
        if k < 5:
            return
        w = self.w
        for group, operands in zip(self.groups, self.operands, strict=True):
            lanes = 2 * len(group)
            total = w.total_lanewise(lanes, [(operands[j][0], operands[k - j][1]) for j in range((k - 1) // 2, 1, -1)])
            swapped = w.shuffled(lanes, total, [i ^ 1 for i in range(lanes)])
            total = w.lanewise("fadd", lanes, total, swapped)
            for at, pair in enumerate(group):
                self.sums[pair, k] = w.lane(lanes, total, 2 * at)

    def parts(self, pair: Pair, k: int) -> tuple[Value, Value]:
        """Sum of u_j v_(k-j) over 2 <= j <= k - 2 in two parts, which are available late and early."""
        w, v = self.w, self.series[pair[1]]
        if pair not in self.grouped:
            return None, w.total([(self.left(pair, j), v[k - j]) for j in range(2, k - 1)])
        middle = w.mul(self.left(pair, k // 2), v[k // 2]) if k % 2 == 0 and k >= 4 else None
        return self.sums.get((pair, k)), middle

    def inner(self, pair: Pair, k: int) -> Value:
        """Sum of u_j v_(k-j) over 1 <= j <= k - 1."""
        w, (u, v) = self.w, (self.series[pair[0]], self.series[pair[1]])
        if k == 2:
            return w.mul(u[1], v[1])
        total, rest = self.parts(pair, k)
        if k > 2:
            rest = w.fused(u[k - 1], v[1], rest)
            rest = w.fused(u[1], v[k - 1], rest)
        return w.add(rest, total)


def convolved(tape: Tape, denominator: Callable[[int], int]) -> list[Pair]:
    """Products that use lanes: of nodes that are not polynomials in time; ``denominator``: see :class:`Forms`."""
    pairs: list[Pair] = []
    for at, node in enumerate(tape.nodes):
        if node.op == "mul":
            pair = node.args[0], node.args[1], at
        elif node.op in ("recip", "div"):
            pair = denominator(node.args[-1]), at, at
        else:
            continue
        if all(tape.nodes[i].degree == INFINITE for i in pair):
            pairs.append(pair)
    return pairs
