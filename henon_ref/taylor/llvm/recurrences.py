"""Recurrences of all operations, as writers of code; the rules are those of :mod:`henon_ref.taylor.rules`.

The recurrences are those of Jorba and Zou, *Experimental Mathematics* 14 (2005), Sec. 2. In every sum of products the
newest coefficients come last, so that only they delay the next order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from henon_ref.jit.ir_writer import LANES, ONE, ZERO, IRWriter, Value, literal
from henon_ref.taylor import rules
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Convolutions
from henon_ref.taylor.llvm.linear_forms import Form
from henon_ref.taylor.llvm.sin_cos import sin_cos
from henon_ref.taylor.llvm.step import fall
from henon_ref.taylor.tape import Node

Recurrence = Callable[[int], Value]
"""Writer of coefficient k of one node, called in turn from k = 0, from those of lower order and from coefficients k of
the nodes that it reads."""


@dataclass(frozen=True, eq=False)
class Recurrences:
    """Writers of the coefficients of a tape's nodes."""

    w: IRWriter
    constants: Constants
    series: Mapping[int, Coefficients]
    """Coefficients of each node."""
    convolutions: Convolutions
    integrals: Mapping[int, tuple[Coefficients, Value]]
    """States that are integrals of other states: the other state's coefficients, and the factor."""
    order: int
    phases: dict[int, tuple[str, str]] = field(default_factory=dict)
    """Value of each clock in double-double."""
    inverses: dict[int, str] = field(default_factory=dict)
    """1 / denominator of each reciprocal."""
    falls: list[str] = field(default_factory=list)
    """:func:`.step.fall` of each denominator, written with coefficients 2."""
    _sines: dict[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    _powers: dict[int, list[str]] = field(default_factory=dict)

    def of(self, at: int, node: Node, clock: Node | None, below: Form | None) -> Recurrence:
        """Recurrence of a node that is not a sum.

        ``clock``: the argument of a sine or cosine, if it is a clock; ``below``: the denominator of a reciprocal.
        """
        numbers = [self.constants.value(index) for index in node.constants]
        if node.op == "constant":
            return lambda k: numbers[0] if k == 0 else None
        if node.op == "clock":
            return self.clock(at, node)
        if clock is not None:
            return self.sine_of_time(node.op, node.args[0], clock)
        if below is not None:
            return self._reciprocal(at, numbers[0], below)
        a, b = self.series[node.args[0]], self.series[node.args[-1]]
        match rules.RULES[node.op]:
            case rules.Product():
                return self._square(a) if a is b else self._product(at, node)
            case rules.Quotient():
                return self._quotient(at, node)
            case rules.Root():
                return self._root(a, self.series[at])
            case rules.Power():
                return self._power(numbers[0], a, self.series[at])
            case rules.IntegralOfProduct(sign) as rule:
                return self._integral_of_product(node.op, sign, a, self.series[rule.place(at, node.args)])
            case rules.IntegralOfQuotient(sign) as rule:
                factor = self.series[rule.place(at, node.args)]
                return self._integral_of_quotient(node.op, sign, a, factor, self.series[at])
        raise NotImplementedError(node.op)

    def linear(self, form: Form, k: int) -> Value:
        """Coefficient k of a sum of nodes times factors, plus a constant.

        The newest coefficient of a state that is an integral of another one is computed from the other state's, so that
        the sum does not wait for it.
        """
        w, total = self.w, self.constants.total
        found = total(form.constant) if k == 0 else None
        newest: list[tuple[Value, Value]] = []
        for leaf in form.leaves():
            factor = total(form.terms[leaf])
            if k > 0 and leaf in self.integrals:
                source, rate = self.integrals[leaf]
                newest.append((w.scaled(1.0 / k, w.once.mul(rate, factor)), source[k - 1]))
            else:
                found = w.fused(factor, self.series[leaf][k], found)
        for weight, value in newest:
            found = w.fused(weight, value, found)
        return found

    def rate_factors(self, form: Form) -> dict[int, Value]:
        """Factors of the nodes in a state's rate, times the time unit."""
        return {leaf: self.w.mul(self.constants.total(factors), "%unit") for leaf, factors in form.terms.items()}

    def state(self, form: Form, factors: Mapping[int, Value], k: int) -> Value:
        """Coefficient k > 0 of a state whose rate is a form; ``factors``: see :meth:`rate_factors`."""
        w, leaves = self.w, form.leaves()
        total = w.mul(self.constants.total(form.constant), "%unit") if k == 1 else None
        for leaf in leaves[:-1]:
            total = w.fused(factors[leaf], self.series[leaf][k - 1], total)
        total = w.scaled(1.0 / k, total)
        if not leaves:
            return total
        last = leaves[-1]  # added last, because its coefficient is computed last
        return w.fused(w.scaled(1.0 / k, factors[last]), self.series[last][k - 1], total)

    def clock(self, at: int, node: Node) -> Recurrence:
        """y = c0 + c1 t in double-double, so that a phase is accurate at large times."""
        start, slope = node.constants

        def coefficient(k: int) -> Value:
            if k == 0:
                self.phases[at] = self._phase(start, slope)
                return self.w.binary("fadd", *self.phases[at])
            return self.w.mul(self.constants.value(slope), "%unit") if k == 1 else None

        return coefficient

    def _phase(self, start: int, slope: int) -> tuple[str, str]:
        w, c0, c1 = self.w, self.constants.value(start), self.constants.value(slope)
        product = w.binary("fmul", c1, "%t_hi")
        error = w.call("fma", c1, "%t_hi", w.emit(f"fneg double {product}"))
        error = w.binary("fadd", error, w.binary("fmul", self.constants.lost(slope), "%t_hi"))
        error = w.binary("fadd", error, w.binary("fmul", c1, "%t_lo"))
        total = w.binary("fadd", product, c0)  # two-sum
        part = w.binary("fsub", total, product)
        lost = w.binary("fsub", product, w.binary("fsub", total, part))
        lost = w.binary("fadd", lost, w.binary("fsub", c0, part))
        return total, w.binary("fadd", w.binary("fadd", error, lost), self.constants.lost(start))

    def sine_of_time(self, op: str, at: int, clock: Node) -> Recurrence:
        """y = sin or cos of c0 + c1 t: coefficient k is (c1 unit)^k / k! times one of +-sin, +-cos."""
        row: list[Value] = []

        def coefficient(k: int) -> Value:
            if k == 0:
                w, powers = self.w, self._powers_of_clock(at, clock)
                s, c = self._sin_cos(*self.phases[at])
                row.append(s if op == "sin" else c)
                pattern = [s, c, w.neg(s), w.neg(c)] if op == "sin" else [c, w.neg(s), w.neg(c), s]
                cycle = w.vector([value or ZERO for value in pattern])
                for v, power in enumerate(powers):
                    inverse = [literal(1.0 / math.factorial(v * LANES + i)) for i in range(LANES)]
                    vector = w.lanewise("fmul", LANES, power, w.lanewise("fmul", LANES, cycle, w.vector(inverse)))
                    row.extend(w.lane(LANES, vector, i) for i in range(LANES) if v + i > 0)
            return row[k]

        return coefficient

    def _powers_of_clock(self, at: int, clock: Node) -> list[str]:
        """Powers of c1 unit up to the order, as vectors; none for order 0."""
        if at not in self._powers:
            self._powers[at] = []
            if self.order:
                rate = self.w.mul(self.constants.value(clock.constants[1]), "%unit")
                self._powers[at] = _powers(self.w, rate or ZERO, -(-(self.order + 1) // LANES))
        return self._powers[at]

    def _sin_cos(self, high: str, low: str) -> tuple[str, str]:
        """Sine and cosine, written together and once."""
        if (high, low) not in self._sines:
            self._sines[high, low] = sin_cos(self.w, high, low)
        return self._sines[high, low]

    def _value(self, op: str, argument: Value) -> str:
        """Value of a function of the C library, or of sine and cosine."""
        if op in ("sin", "cos"):
            return self._sin_cos(argument or ZERO, ZERO)[op == "cos"]
        return self.w.once.call(op, argument or ZERO)

    def inverse(self, value: Value) -> str:
        return self.w.once.binary("fdiv", ONE, value or ZERO)

    def _falls(self, below: Coefficients, scale: Value, quotient: Coefficients | None = None) -> None:
        """Write the fall of a denominator; ``scale``: minus the inverse of its first coefficient."""
        found = fall(self.w, self.w.mul(scale, below[1]), self.w.mul(scale, below[2]), quotient)
        if found is not None:
            self.falls.append(found)

    def _product(self, at: int, node: Node) -> Recurrence:
        """y = a b."""
        w, (u, v) = self.w, node.args
        a, b = self.series[u], self.series[v]

        def coefficient(k: int) -> Value:
            if k == 0:
                return w.mul(a[0], b[0])
            older = self.convolutions.inner((u, v, at), k)
            return w.fused(a[0], b[k], w.fused(a[k], b[0], older))

        return coefficient

    def _square(self, a: Coefficients) -> Recurrence:
        """y = a a, with half the products."""
        w = self.w
        return lambda k: w.fused(a.doubled(0), a[k], a.inner_square(k)) if k else w.mul(a[0], a[0])

    def _quotient(self, at: int, node: Node) -> Recurrence:
        """y = a / b."""
        a, b = (self.series[i] for i in node.args)

        def coefficient(k: int) -> Value:
            inverse = self.inverse(b[0])
            if k == 0:
                return self.w.mul(a[0], inverse)
            if k == 1:
                self.convolutions.scales[node.args[1], at, at] = self.w.neg(inverse)
            if k == 2:
                self._falls(b, self.w.neg(inverse), self.series[at])
            return self.w.fused(a[k], inverse, self._quotient_tail(node.args[1], at, k))

        return coefficient

    def _reciprocal(self, at: int, c: Value, below: Form) -> Recurrence:
        """y = c / (slope x + rest); the coefficients of the denominator, a linear form of one node, are not written."""
        (x,) = below.terms

        def coefficient(k: int) -> Value:
            w = self.w
            if k == 0:
                self.inverses[at] = self.inverse(self.linear(below, 0))
                return w.mul(c, self.inverses[at])
            if k == 1:
                slope = self.constants.total(below.terms[x])
                self.convolutions.scales[x, at, at] = w.neg(w.mul(slope, self.inverses[at]))
            if k == 2:
                self._falls(self.series[x], self.convolutions.scales[x, at, at])
            return self._quotient_tail(x, at, k)

        return coefficient

    def _quotient_tail(self, x: int, y: int, k: int) -> Value:
        """Sum of (factor x_j) y_(k-j) over 1 <= j <= k: the part of a quotient's coefficient from its older ones."""
        w, own, pair, (a, b) = self.w, self.convolutions, (x, y, y), (self.series[x], self.series[y])
        factor = own.scales[pair]
        by_first = w.once.mul(factor, b[0])
        rest: Value = None
        if k > 1:
            late, rest = own.parts(pair, k)
            if k > 2:
                rest = w.fused(w.once.mul(factor, b[1]), a[k - 1], rest)
            rest = w.add(w.fused(own.left(pair, 1), b[k - 1], rest), late)
        return w.fused(by_first, a[k], rest)

    def _root(self, a: Coefficients, y: Coefficients) -> Recurrence:
        """y y = a."""

        def coefficient(k: int) -> Value:
            if k == 0:
                return self._value("sqrt", a[0])
            half = self.w.scaled(0.5, self.w.sub(a[k], y.inner_square(k)))
            return self.w.mul(half, self.inverse(y[0]))

        return coefficient

    def _power(self, c: str, a: Coefficients, y: Coefficients) -> Recurrence:
        """y' a = c a' y, from y_0 = a_0^c."""

        def coefficient(k: int) -> Value:
            w = self.w
            if k == 0:
                return w.call("pow", a[0] or ZERO, c)
            terms = []
            for j in range(1, k + 1):
                if a[j] is not None and y[k - j] is not None:
                    weight = w.sub(w.scaled(float(j), c), literal(float(k - j)))
                    terms.append((w.mul(weight, a[j]), y[k - j]))
            inverse = self.inverse(a[0])
            if k == 2:
                self._falls(a, w.neg(inverse), y)
            return w.scaled(1.0 / k, w.mul(w.total(terms[:-1], terms[-1:]), inverse))

        return coefficient

    def _integral_of_product(self, op: str, sign: int, a: Coefficients, factor: Coefficients) -> Recurrence:
        """y' = sign a' factor, from y_0 = op(a_0)."""

        def coefficient(k: int) -> Value:
            w = self.w
            if k == 0:
                return self._value(op, a[0])
            terms = [(a.weighted(j), factor[k - j]) for j in range(1, k + 1)]
            value = w.scaled(1.0 / k, w.total(terms[1:-1], terms[:1] + terms[1:][-1:]))
            return w.neg(value) if sign < 0 else value

        return coefficient

    def _integral_of_quotient(
        self, op: str, sign: int, a: Coefficients, factor: Coefficients, y: Coefficients
    ) -> Recurrence:
        """y' factor = sign a', from y_0 = op(a_0)."""

        def coefficient(k: int) -> Value:
            w = self.w
            if k == 0:
                return self._value(op, a[0])
            terms = [(y.weighted(j), factor[k - j]) for j in range(1, k)]
            rest = w.neg(a[k]) if sign < 0 else a[k]
            older = w.scaled(1.0 / k, w.total(terms[:-1], terms[-1:]))
            if k == 2 and op == "atan":
                self._falls(factor, w.neg(self.inverse(factor[0])))
            return w.mul(w.sub(rest, older), self.inverse(factor[0]))

        return coefficient


def _powers(w: IRWriter, x: str, vectors: int) -> list[str]:
    """x^0, x^1, ... as vectors."""
    square = w.binary("fmul", x, x)
    powers = [w.vector([ONE, x, square, w.binary("fmul", square, x)])]
    if vectors > 1:
        jump = w.binary("fmul", square, square)
        stride = w.vector([jump] * LANES)
        powers.append(w.lanewise("fmul", LANES, powers[0], stride))
    if vectors > 2:
        stride = w.lanewise("fmul", LANES, stride, stride)
        for v in range(2, vectors):
            powers.append(w.lanewise("fmul", LANES, powers[v - 2], stride))
    return powers
