"""Recurrences of all operations but sums, as writers of code: one class per kind of rule.

The rules are those of :mod:`henon_ref.taylor.rules`; the recurrences are those of Jorba and Zou, *Experimental
Mathematics* 14 (2005), Sec. 2. In every sum of products the newest coefficients come last, so that only they delay the
next order.
"""

from __future__ import annotations

from typing import Protocol

from henon_ref.jit.ir_writer import ZERO, IRWriter, Value, literal
from henon_ref.taylor.llvm.coefficients import Coefficients, Functions
from henon_ref.taylor.llvm.convolutions import Convolutions, Pair
from henon_ref.taylor.llvm.sums import LinearForm


class Recurrence(Protocol):
    """Writer of the coefficients of one node in turn from k = 0; it keeps the values that later orders use."""

    def coefficient(self, k: int) -> Value:
        """Coefficient k, from those of lower order and from coefficients k of the nodes that it reads."""


class Constant:
    """y = c."""

    def __init__(self, value: Value) -> None:
        self.value = value

    def coefficient(self, k: int) -> Value:
        return self.value if k == 0 else None


class Product:
    """y = a b."""

    def __init__(self, w: IRWriter, a: Coefficients, b: Coefficients, convolutions: Convolutions, pair: Pair) -> None:
        self.w, self.a, self.b = w, a, b
        self.convolutions, self.pair = convolutions, pair

    def coefficient(self, k: int) -> Value:
        w, a, b = self.w, self.a, self.b
        if k == 0:
            return w.mul(a[0], b[0])
        older = self.convolutions.inner(self.pair, k)
        return w.fused(a[0], b[k], w.fused(a[k], b[0], older))


class Square:
    """y = a a, with half the products."""

    def __init__(self, w: IRWriter, a: Coefficients) -> None:
        self.w, self.a = w, a

    def coefficient(self, k: int) -> Value:
        w, a = self.w, self.a
        if k == 0:
            return w.mul(a[0], a[0])
        return w.fused(a.doubled(0), a[k], a.inner_square(k))


class QuotientTail:
    """Sum of (factor x_j) y_(k-j) over 1 <= j <= k: the part of a quotient's coefficient from its older ones."""

    def __init__(self, w: IRWriter, x: Coefficients, y: Coefficients, convolutions: Convolutions, pair: Pair) -> None:
        self.w, self.x, self.y = w, x, y
        self.convolutions, self.pair = convolutions, pair
        self.factor: Value = None
        self.by_first: Value = None
        """factor y_0"""
        self.by_second: Value = None
        """factor y_1"""

    def begin(self, factor: Value) -> None:
        """Set the factor, at k = 1."""
        self.convolutions.scale(self.pair, factor)
        self.factor, self.by_first = factor, self.w.mul(factor, self.y[0])

    def total(self, k: int) -> Value:
        w, x, y, c = self.w, self.x, self.y, self.convolutions
        rest: Value = None
        if k > 1:
            late, rest = c.parts(self.pair, k)
            if k == 3:
                self.by_second = w.mul(self.factor, y[1])
            if k > 2:
                rest = w.fused(self.by_second, x[k - 1], rest)
            rest = w.add(w.fused(c.left(self.pair, 1), y[k - 1], rest), late)
        return w.fused(self.by_first, x[k], rest)


class Quotient:
    """y = a / b."""

    def __init__(self, w: IRWriter, functions: Functions, a: Coefficients, b: Coefficients, tail: QuotientTail) -> None:
        self.w, self.functions, self.a, self.b, self.tail = w, functions, a, b, tail

    def coefficient(self, k: int) -> Value:
        inverse = self.functions.inverse(self.b[0])
        if k == 0:
            return self.w.mul(self.a[0], inverse)
        if k == 1:
            self.tail.begin(self.w.neg(inverse))
        return self.w.fused(self.a[k], inverse, self.tail.total(k))


class Reciprocal:
    """y = c / (slope x + rest): if the denominator is a linear form of one node, its coefficients are not computed."""

    def __init__(self, w: IRWriter, functions: Functions, c: Value, below: LinearForm, tail: QuotientTail) -> None:
        self.w, self.functions, self.c, self.below, self.tail = w, functions, c, below, tail
        self.inverse: Value = None

    def coefficient(self, k: int) -> Value:
        w = self.w
        if k == 0:
            self.inverse = self.functions.inverse(self.below.coefficient(0))
            return w.mul(self.c, self.inverse)
        if k == 1:
            (node,) = self.below.leaves
            self.tail.begin(w.neg(w.mul(self.below.factor(node), self.inverse)))
        return self.tail.total(k)


class Root:
    """y y = a."""

    def __init__(self, w: IRWriter, functions: Functions, a: Coefficients, y: Coefficients) -> None:
        self.w, self.functions, self.a, self.y = w, functions, a, y

    def coefficient(self, k: int) -> Value:
        w, a, y = self.w, self.a, self.y
        if k == 0:
            return self.functions.call("sqrt", a[0])
        return w.mul(w.scaled(0.5, w.sub(a[k], y.inner_square(k))), self.functions.inverse(y[0]))


class Power:
    """y' a = c a' y, from y_0 = a_0^c."""

    def __init__(self, w: IRWriter, functions: Functions, c: str, a: Coefficients, y: Coefficients) -> None:
        self.w, self.functions, self.c, self.a, self.y = w, functions, c, a, y

    def coefficient(self, k: int) -> Value:
        w, a, y = self.w, self.a, self.y
        if k == 0:
            return w.call("pow", a[0] or ZERO, self.c)
        terms = []
        for j in range(1, k + 1):
            if a[j] is not None and y[k - j] is not None:
                weight = w.sub(w.scaled(float(j), self.c), literal(float(k - j)))
                terms.append((w.mul(weight, a[j]), y[k - j]))
        inverse = self.functions.inverse(a[0])
        return w.scaled(1.0 / k, w.mul(w.total(terms[:-1], terms[-1:]), inverse))


class IntegralOfProduct:
    """y' = sign a' factor, from y_0 = op(a_0)."""

    def __init__(
        self, w: IRWriter, functions: Functions, op: str, sign: int, a: Coefficients, factor: Coefficients
    ) -> None:
        self.w, self.functions, self.op, self.sign, self.a, self.factor = w, functions, op, sign, a, factor

    def coefficient(self, k: int) -> Value:
        w = self.w
        if k == 0:
            return self.functions.call(self.op, self.a[0])
        terms = [(self.a.weighted(j), self.factor[k - j]) for j in range(1, k + 1)]
        value = w.scaled(1.0 / k, w.total(terms[1:-1], terms[:1] + terms[1:][-1:]))
        return w.neg(value) if self.sign < 0 else value


class IntegralOfQuotient:
    """y' factor = sign a', from y_0 = op(a_0)."""

    def __init__(
        self,
        w: IRWriter,
        functions: Functions,
        op: str,
        sign: int,
        a: Coefficients,
        factor: Coefficients,
        y: Coefficients,
    ) -> None:
        self.w, self.functions, self.op, self.sign = w, functions, op, sign
        self.a, self.factor, self.y = a, factor, y

    def coefficient(self, k: int) -> Value:
        w = self.w
        if k == 0:
            return self.functions.call(self.op, self.a[0])
        terms = [(self.y.weighted(j), self.factor[k - j]) for j in range(1, k)]
        rest = w.neg(self.a[k]) if self.sign < 0 else self.a[k]
        older = w.scaled(1.0 / k, w.total(terms[:-1], terms[-1:]))
        return w.mul(w.sub(rest, older), self.functions.inverse(self.factor[0]))
