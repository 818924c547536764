"""The recurrences of every operation that is no sum, writing code instead of computing.

Jorba and Zou, *Experimental Mathematics* 14 (2005), Sec. 2. In every sum of products the newest coefficients
come last, so that from order to order only they are waited for.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from henon_ref.jit.ir_writer import LANES, ONE, ZERO, Value, Writer, literal
from henon_ref.taylor.llvm.convolutions import Convolutions
from henon_ref.taylor.llvm.sin_cos import sin_cos
from henon_ref.taylor.rules import RULES, IntegralOfProduct, IntegralOfQuotient, Power, Root
from henon_ref.taylor.tape import Node, Tape


class Recurrences:
    """Coefficient k of a node from those of its arguments.

    Parameters
    ----------
    constant : callable
        Value of a constant of the tape (index, its low part or not).
    convolutions : Convolutions
    series : callable
        Coefficients known so far of a node.
    """

    def __init__(
        self,
        w: Writer,
        tape: Tape,
        constant: Callable[[int, bool], str],
        convolutions: Convolutions,
        series: Callable[[int], list[Value]],
        order: int,
    ) -> None:
        self.w, self.tape, self.constant, self.convolutions = w, tape, constant, convolutions
        self.series, self.order = series, order
        self._phase: dict[int, tuple[str, str]] = {}
        self._made: dict[tuple[object, ...], Value] = {}
        self._turns: dict[int, list[Value]] = {}
        self._turned: dict[int, tuple[list[str], tuple[str, str]]] = {}

    def value(self, at: int, node: Node, k: int) -> Value:
        """Coefficient k of node ``at``."""
        op = node.op
        if op == "constant":
            return self.constant(node.constants[0], False) if k == 0 else None
        if op == "clock":
            return self._clock(at, node, k)
        if op == "mul":
            return self._product(at, node, k)
        if op == "square":
            return self._square(node.args[0], k)
        if op == "div":
            return self._quotient(at, node, k)
        if op in ("sin", "cos") and self.tape.nodes[node.args[0]].op == "clock":
            return self._turning(at, node)[k]
        return self._start(at, node) if k == 0 else self._transcendental(at, node, k)

    def made(self, *key: object, make: Callable[[], Value]) -> Value:
        """A value made once and used at all later orders."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def reciprocal(self, at: int, k: int, below: tuple[int, Value, Value]) -> Value:
        """Coefficient k of ``c / (a x + b)``; ``below``: the node x, the value of a x + b, and a."""
        w, (base, start, slope) = self.w, below
        inverse = self._inverse(start)
        if k == 0:
            numerator = self.constant(self.tape.nodes[at].constants[0], False)
            return w.mul(numerator, inverse)
        return self._divided(base, at, k, self.made(at, "minus", make=lambda: w.neg(w.mul(slope, inverse))))

    def _inverse(self, value: Value) -> str:
        start = value or ZERO
        made = self.made("inverse of", start, make=lambda: self.w.binary("fdiv", ONE, start))
        return made or ZERO

    def _divided(self, base: int, at: int, k: int, minus: Value) -> Value:
        """Sum of (minus x_j) y_(k-j) over 1 <= j <= k: what quotient y's coefficient owes to its older ones."""
        w, c = self.w, self.convolutions
        x, y, pair = self.series(base), self.series(at), (base, at, at)
        c.scale(pair, minus)
        newest = self.made(at, "newest", make=lambda: w.mul(minus, y[0]))
        rest = None
        if k > 1:
            total, rest = c.parts(pair, k)
            if k > 2:
                rest = w.fused(self.made(at, "after", make=lambda: w.mul(minus, y[1])), x[k - 1], rest)
            rest = w.add(w.fused(c.left(pair, 1), y[k - 1], rest), total)
        return w.fused(newest, x[k], rest)

    def _product(self, at: int, node: Node, k: int) -> Value:
        w, (a, b) = self.w, (self.series(node.args[0]), self.series(node.args[1]))
        if k == 0:
            return w.mul(a[0], b[0])
        old = self.convolutions.inner((node.args[0], node.args[1], at), k)
        return w.fused(a[0], b[k], w.fused(a[k], b[0], old))

    def _twice(self, node: int, j: int) -> Value:
        value = self.series(node)[j]
        return self.made(node, "twice", j, make=lambda: self.w.add(value, value))

    def _halved(self, node: int, k: int) -> Value:
        """Sum of a_j a_(k-j) over 1 <= j <= k - 1, each product formed once."""
        a = self.series(node)
        old: list[tuple[Value, Value]] = [(a[k // 2], a[k // 2])] if k % 2 == 0 else []
        old += [(self._twice(node, j), a[k - j]) for j in range((k - 1) // 2, 0, -1)]
        return self.w.total(old[:-3], old[-3:])

    def _square(self, node: int, k: int) -> Value:
        w, a = self.w, self.series(node)
        if k == 0:
            return w.mul(a[0], a[0])
        return w.fused(self._twice(node, 0), a[k], self._halved(node, k))

    def _quotient(self, at: int, node: Node, k: int) -> Value:
        w, (a, b) = self.w, (self.series(node.args[0]), self.series(node.args[1]))
        inverse = self._inverse(b[0])
        if k == 0:
            return w.mul(a[0], inverse)
        minus = self.made(at, "minus", make=lambda: w.neg(inverse))
        return w.fused(a[k], inverse, self._divided(node.args[1], at, k, minus))

    # -- functions of time ------------------------------------------------------------------------------

    def _clock(self, at: int, node: Node, k: int) -> Value:
        """c0 + c1 t in double-double, so that a phase loses nothing at large times."""
        w = self.w
        c0, c1 = node.constants
        slope = self.constant(c1, False)
        if k == 1:
            return w.mul(slope, "%sigma")
        if k > 1:
            return None
        product = w.binary("fmul", slope, "%t_hi")
        error = w.call("fma", slope, "%t_hi", w.emit(f"fneg double {product}"))
        error = w.binary("fadd", error, w.binary("fmul", self.constant(c1, True), "%t_hi"))
        error = w.binary("fadd", error, w.binary("fmul", slope, "%t_lo"))
        shift = self.constant(c0, False)
        total = w.binary("fadd", product, shift)  # two-sum
        part = w.binary("fsub", total, product)
        lost = w.binary(
            "fadd",
            w.binary("fsub", product, w.binary("fsub", total, part)),
            w.binary("fsub", shift, part),
        )
        low = w.binary("fadd", w.binary("fadd", error, lost), self.constant(c0, True))
        self._phase[at] = total, low
        return w.binary("fadd", total, low)

    def _turning(self, at: int, node: Node) -> list[Value]:
        """All coefficients of the sine or cosine of c0 + c1 t: (c1 sigma)^k / k! times a value that turns."""
        if at not in self._turns:
            w = self.w
            powers, (s, c) = self._phases(node.args[0])
            row: list[Value] = [s if node.op == "sin" else c]
            pattern = [s, c, w.neg(s), w.neg(c)] if node.op == "sin" else [c, w.neg(s), w.neg(c), s]
            turn = w.vector([value or ZERO for value in pattern])
            for v, power in enumerate(powers):
                inverse = [literal(_inverse_factorial(v * LANES + i)) for i in range(LANES)]
                vector = w.lanewise("fmul", LANES, power, w.lanewise("fmul", LANES, turn, w.vector(inverse)))
                row += [w.lane(LANES, vector, i) for i in range(LANES) if v + i > 0]
            self._turns[at] = row
        return self._turns[at]

    def _phases(self, clock: int) -> tuple[list[str], tuple[str, str]]:
        """Powers of c1 sigma up to the order, in vectors (none for order 0); sine and cosine of c0 + c1 t."""
        if clock not in self._turned:
            w = self.w
            powers: list[str] = []
            if self.order:
                rate = w.mul(self.constant(self.tape.nodes[clock].constants[1], False), "%sigma")
                powers = powers_of(w, rate or ZERO, -(-(self.order + 1) // LANES))
            self._turned[clock] = powers, sin_cos(w, *self._phase[clock])
        return self._turned[clock]

    # -- functions of the state -------------------------------------------------------------------------

    def _start(self, at: int, node: Node) -> Value:
        w, op = self.w, node.op
        argument = self.series(node.args[0])[0] or ZERO
        if op == "power":
            return w.call("pow", argument, self.constant(node.constants[0], False))
        if op in ("sin", "cos"):
            key = ("turn", argument)
            if key not in self._made:
                self._made[key], self._made["cosine", argument] = sin_cos(w, argument, ZERO)
            return self._made[key if op == "sin" else ("cosine", argument)]
        return self.made(op, argument, make=lambda: w.call(op, argument))

    def _transcendental(self, at: int, node: Node, k: int) -> Value:
        w, y, a = self.w, self.series(at), self.series(node.args[0])
        match RULES[node.op]:
            case Root():
                return w.mul(w.scaled(0.5, w.sub(a[k], self._halved(at, k))), self._inverse(y[0]))
            case Power():
                return self._power(at, node, k)
            case IntegralOfProduct(sign) as rule:
                q = self.series(rule.place(at, node.args))
                terms = [(self._weighted(node.args[0], j), q[k - j]) for j in range(1, k + 1)]
                value = w.scaled(1.0 / k, w.total(terms[1:-1], terms[:1] + terms[1:][-1:]))
                return w.neg(value) if sign < 0 else value
            case IntegralOfQuotient(sign) as rule:
                q = self.series(rule.place(at, node.args))
                terms = [(self._weighted(at, j), q[k - j]) for j in range(1, k)]
                rest = w.neg(a[k]) if sign < 0 else a[k]
                return w.mul(w.sub(rest, w.scaled(1.0 / k, w.total(terms[:-1], terms[-1:]))), self._inverse(q[0]))
        raise NotImplementedError(node.op)

    def _power(self, at: int, node: Node, k: int) -> Value:
        w, y, a = self.w, self.series(at), self.series(node.args[0])
        exponent = self.constant(node.constants[0], False)
        terms = []
        for j in range(1, k + 1):
            if a[j] is not None and y[k - j] is not None:
                weight = w.sub(w.scaled(float(j), exponent), literal(float(k - j)))
                terms.append((w.mul(weight, a[j]), y[k - j]))
        start = a[0] or ZERO
        inverse = self.made("inverse of", start, make=lambda: w.binary("fdiv", ONE, start))
        return w.scaled(1.0 / k, w.mul(w.total(terms[:-1], terms[-1:]), inverse))

    def _weighted(self, node: int, j: int) -> Value:
        value = self.series(node)[j]
        return self.made(node, "weighted", j, make=lambda: self.w.scaled(float(j), value))


def powers_of(w: Writer, x: str, vectors: int) -> list[str]:
    """x^0, x^1, ... in vectors."""
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


def _inverse_factorial(k: int) -> float:
    return 1.0 / math.factorial(k)
