"""Inputs of recurrences: coefficients of nodes, constants of the tape, and values used by several recurrences."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import MINUS, ONE, ZERO, IRWriter, Value
from henon_ref.taylor.llvm.linear_forms import Factor
from henon_ref.taylor.llvm.sin_cos import sin_cos
from henon_ref.taylor.tape import Tape


class Coefficients(list[Value]):
    """Taylor coefficients of one node as far as they are written; a structural zero is None."""

    def __init__(self, w: IRWriter, values: Sequence[Value] = ()) -> None:
        super().__init__(values)
        self._w = w
        self._doubled: dict[int, Value] = {}
        self._weighted: dict[int, Value] = {}

    def doubled(self, j: int) -> Value:
        """2 a_j, computed once."""
        if j not in self._doubled:
            self._doubled[j] = self._w.add(self[j], self[j])
        return self._doubled[j]

    def weighted(self, j: int) -> Value:
        """j a_j, computed once: coefficient j - 1 of the derivative."""
        if j not in self._weighted:
            self._weighted[j] = self._w.scaled(float(j), self[j])
        return self._weighted[j]

    def inner_square(self, k: int) -> Value:
        """Sum of a_j a_(k-j) over 1 <= j <= k - 1, without repeating equal products."""
        old: list[tuple[Value, Value]] = [(self[k // 2], self[k // 2])] if k % 2 == 0 else []
        old += [(self.doubled(j), self[k - j]) for j in range((k - 1) // 2, 0, -1)]
        return self._w.total(old[:-3], old[-3:])


class Constants:
    """The constants of a tape, loaded first."""

    def __init__(self, w: IRWriter, tape: Tape) -> None:
        self._w, self._count = w, len(tape.constants)
        self._loaded: dict[int, str] = {}
        self._products: dict[Factor, Value] = {}
        self._sums: dict[tuple[Factor, ...], Value] = {}
        for node in tape.nodes:
            for index in node.constants:
                self.value(index)
                if node.op == "clock":
                    self.lost(index)

    def value(self, index: int) -> str:
        """A constant, rounded to double."""
        if index not in self._loaded:
            self._loaded[index] = self._w.load("%K", index)
        return self._loaded[index]

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


class Functions:
    """Functions of values, each computed once for all nodes that use it."""

    def __init__(self, w: IRWriter) -> None:
        self._w = w
        self._inverses: dict[str, str] = {}
        self._calls: dict[tuple[str, str], str] = {}
        self._sines: dict[str, tuple[str, str]] = {}
        self._products: dict[tuple[Value, Value], Value] = {}

    def inverse(self, value: Value) -> str:
        below = value or ZERO
        if below not in self._inverses:
            self._inverses[below] = self._w.binary("fdiv", ONE, below)
        return self._inverses[below]

    def call(self, op: str, value: Value) -> str:
        """Call a function of the C library; sine and cosine are computed together by :func:`sin_cos`."""
        argument = value or ZERO
        if op in ("sin", "cos"):
            if argument not in self._sines:
                self._sines[argument] = sin_cos(self._w, argument, ZERO)
            return self._sines[argument][op == "cos"]
        if (op, argument) not in self._calls:
            self._calls[op, argument] = self._w.call(op, argument)
        return self._calls[op, argument]

    def product(self, a: Value, b: Value) -> Value:
        """Product that is used at every order, computed once."""
        if (a, b) not in self._products:
            self._products[a, b] = self._w.mul(a, b)
        return self._products[a, b]
