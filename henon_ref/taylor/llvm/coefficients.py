"""Inputs of recurrences: coefficients of nodes, constants of the tape, convolutions of coefficients."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from henon_ref.jit.ir_writer import LANES, MINUS, ONE, ZERO, IRWriter, Value
from henon_ref.taylor.llvm.linear_forms import Factor, Pair


class Coefficients(list[Value]):
    """Taylor coefficients of one node as far as they are written; a structural zero is None."""

    def __init__(self, w: IRWriter, values: Sequence[Value] = ()) -> None:
        super().__init__(values)
        self._w = w

    def doubled(self, j: int) -> Value:
        return self._w.once.add(self[j], self[j])

    def weighted(self, j: int) -> Value:
        """j a_j: coefficient j - 1 of the derivative."""
        return self._w.once.scaled(float(j), self[j])

    def inner_square(self, k: int) -> Value:
        """Sum of a_j a_(k-j) over 1 <= j <= k - 1, without repeating equal products."""
        old: list[tuple[Value, Value]] = [(self[k // 2], self[k // 2])] if k % 2 == 0 else []
        old += [(self.doubled(j), self[k - j]) for j in range((k - 1) // 2, 0, -1)]
        return self._w.total(old[:-3], old[-3:])


class Constants:
    """The constants of a tape, or of one node; ``place``: where the number with an index is in memory."""

    def __init__(self, w: IRWriter, count: int, place: Callable[[int], tuple[str, int]]) -> None:
        self._w, self._count, self._place = w, count, place
        self._products: dict[Factor, Value] = {}
        self._sums: dict[tuple[Factor, ...], Value] = {}

    def value(self, index: int) -> str:
        """A constant, rounded to double."""
        return self._w.once.load(*self._place(index))

    def lost(self, index: int) -> str:
        """Rounding error of a constant."""
        return self.value(index + self._count)

    def total(self, factors: Sequence[Factor]) -> Value:
        """Sum of products of constants (an empty product is 1), computed once."""
        key = tuple(factors)
        if key not in self._sums:
            total: Value = None
            for factor in factors:
                total = self._w.add(total, self._product(factor))
            self._sums[key] = total
        return self._sums[key]

    def _product(self, factor: Factor) -> Value:
        if factor not in self._products:
            product: Value = ONE
            for index in factor.constants:
                product = self._w.mul(product, self.value(index))
            if factor.sign < 0:
                product = MINUS if product == ONE else self._w.neg(product)
            self._products[factor] = product
        return self._products[factor]


class Convolutions:
    """Sums of the older products of all convolutions of an order, several at once in the lanes of vectors.

    u * v at order k is the sum of u_j v_(k-j). For 2 <= j < k/2 the products u_j v_(k-j) and v_j u_(k-j) are lanes of
    the product of two packed vectors, one with its neighbours swapped. The products with j = 0 and 1, and the middle
    one, are left to the recurrence.
    """

    def __init__(self, w: IRWriter, series: Mapping[int, Sequence[Value]], pairs: Sequence[Pair], order: int) -> None:
        self.w, self.series, self.order = w, series, order
        half = LANES // 2
        wanted = list(pairs) if order >= 8 else []  # at lower orders a lane would have only one or two products
        self.groups = [wanted[i : i + half] for i in range(0, len(wanted), half)]
        self.operands: list[dict[int, tuple[str, str]]] = [{} for _ in self.groups]
        self.sums: dict[tuple[Pair, int], str] = {}
        self.grouped = frozenset(wanted)
        self.scales: dict[Pair, Value] = {}
        """Factors by which u of a pair is multiplied."""
        self._scaled: dict[tuple[Pair, int], Value] = {}

    def left(self, pair: Pair, k: int) -> Value:
        """u_k of a pair, times its factor."""
        if pair not in self.scales:
            return self.series[pair[0]][k]
        if (pair, k) not in self._scaled:
            self._scaled[pair, k] = self.w.mul(self.scales[pair], self.series[pair[0]][k])
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
