"""The recurrences of every operation that is no sum, writing code instead of computing.

Jorba and Zou, *Experimental Mathematics* 14 (2005), Sec. 2. In every sum of products the newest coefficients
come last, so that from order to order only they are waited for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from henon_ref.henon.emitter import ONE, ZERO, Value, Writer, literal
from henon_ref.henon.phase import sin_cos
from henon_ref.taylor.tape import INFINITE, Node, Tape

LANES = 4
"""Doubles in a vector."""
SHORTEST = 8
"""Order from which convolutions go in vectors."""

Pair = tuple[int, int]


class Convolutions:
    """The older parts of all convolutions of an order, several at a time in the lanes of vectors.

    u * v at order k is the sum of u_j v_(k-j): the lanes u_j v_(k-j) and v_j u_(k-j), for j from 2 to below
    k/2, take two vectors of the same shape, one the other with neighbours swapped. What is left (j = 0 and 1
    and the middle) is for whoever asks.
    """

    def __init__(self, w: Writer, series: Callable[[int], Sequence[Value]], pairs: Sequence[Pair], order: int) -> None:
        self.w, self.series, self.order = w, series, order
        half = LANES // 2
        wanted = list(pairs) if order >= SHORTEST else []
        self.groups = [wanted[i : i + half] for i in range(0, len(wanted), half)]
        self.operands: list[dict[int, tuple[str, str]]] = [{} for _ in self.groups]
        self.sums: dict[tuple[Pair, int], str] = {}
        self.grouped = frozenset(wanted)

    def pack(self, k: int) -> None:
        """Take in the coefficients of order k, once they are all known."""
        if k < 2 or k > self.order - 2:
            return
        for group, operands in zip(self.groups, self.operands, strict=True):
            values = [self.series(node)[k] or ZERO for pair in group for node in pair]
            packed = self.w.vector(values)
            swapped = self.w.shuffled(len(values), packed, [i ^ 1 for i in range(len(values))])
            operands[k] = packed, swapped

    def add_up(self, k: int) -> None:
        """Sums for order k, of coefficients up to k - 2."""
        if k < 5:
            return
        w = self.w
        for group, operands in zip(self.groups, self.operands, strict=True):
            lanes = 2 * len(group)
            chains = ["", ""]
            for at, j in enumerate(range((k - 1) // 2, 1, -1)):
                a, b = operands[j][0], operands[k - j][1]
                which = at % 2 if k > 10 else 0
                chain = chains[which]
                chains[which] = w.lanewise_fused(lanes, a, b, chain) if chain else w.lanewise("fmul", lanes, a, b)
            total = w.lanewise("fadd", lanes, chains[1], chains[0]) if chains[1] else chains[0]
            swapped = w.shuffled(lanes, total, [i ^ 1 for i in range(lanes)])
            total = w.lanewise("fadd", lanes, total, swapped)
            for at, pair in enumerate(group):
                self.sums[pair, k] = w.lane(lanes, total, 2 * at)

    def older(self, pair: Pair, k: int) -> Value:
        """Sum of u_j v_(k-j) over 2 <= j <= k - 2."""
        w, (u, v) = self.w, (self.series(pair[0]), self.series(pair[1]))
        if pair not in self.grouped:
            return w.total([(u[j], v[k - j]) for j in range(2, k - 1)])
        total: Value = self.sums.get((pair, k))
        if k % 2 == 0 and k >= 4:
            total = w.fused(u[k // 2], v[k // 2], total)
        return total

    def inner(self, pair: Pair, k: int) -> Value:
        """Sum of u_j v_(k-j) over 1 <= j <= k - 1, the newest v last."""
        w, (u, v) = self.w, (self.series(pair[0]), self.series(pair[1]))
        total = self.older(pair, k)
        if k == 2:
            return w.mul(u[1], v[1])
        if k > 2:
            total = w.fused(u[k - 1], v[1], total)
            total = w.fused(u[1], v[k - 1], total)
        return total


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
        self._turns: dict[int, tuple[list[Value], list[Value]]] = {}

    def value(self, at: int, node: Node, k: int) -> Value:
        """Coefficient k of node ``at``."""
        op = node.op
        if op == "constant":
            return self.constant(node.constants[0], False) if k == 0 else None
        if op == "clock":
            return self._clock(at, node, k)
        if op == "mul":
            return self._product(node.args, k)
        if op == "square":
            return self._square(node.args[0], k)
        if op == "div":
            return self._quotient(at, node, k)
        if op in ("sin", "cos") and self.tape.nodes[node.args[0]].op == "clock":
            return self._turning(node)[op == "cos"][k]
        return self._start(at, node) if k == 0 else self._transcendental(at, node, k)

    def made(self, *key: object, make: Callable[[], Value]) -> Value:
        """A value made once and used at all later orders."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def reciprocal(self, at: int, k: int, numerator: str, below: tuple[int, str, str]) -> Value:
        """Coefficient k of ``numerator / (a x + b)``; ``below``: the node x, the value of a x + b, and a."""
        w, (base, start, slope) = self.w, below
        y, x = self.series(at), self.series(base)
        inverse = self.made("inverse of", start, make=lambda: w.exact("fdiv", ONE, start))
        if k == 0:
            return w.mul(numerator, inverse)
        # -(sum over j < k of y_j a_(k-j)) / a_0, the newest coefficient of x apart
        minus = self.made(at, "minus", make=lambda: w.neg(w.mul(slope, inverse)))
        newest = self.made(at, "newest", make=lambda: w.mul(minus, y[0]))
        if k == 1:
            return w.mul(newest, x[1])
        before = self.made(at, "before", make=lambda: w.mul(minus, x[1]))
        old = self.convolutions.older((base, at), k)
        if k > 2:
            old = w.fused(x[k - 1], y[1], old)
        return w.fused(newest, x[k], w.fused(before, y[k - 1], w.mul(old, minus)))

    def _product(self, args: tuple[int, ...], k: int) -> Value:
        w, (a, b) = self.w, (self.series(args[0]), self.series(args[1]))
        if k == 0:
            return w.mul(a[0], b[0])
        old = self.convolutions.inner((args[0], args[1]), k)
        return w.fused(a[0], b[k], w.fused(a[k], b[0], old))

    def _twice(self, node: int, j: int) -> Value:
        value = self.series(node)[j]
        return self.made(node, "twice", j, make=lambda: self.w.add(value, value))

    def _halved(self, node: int, k: int) -> Value:
        """Sum of a_j a_(k-j) over 1 <= j <= k - 1, each product formed once."""
        a = self.series(node)
        old: list[tuple[Value, Value]] = [(a[k // 2], a[k // 2])] if k % 2 == 0 else []
        old += [(self._twice(node, j), a[k - j]) for j in range((k - 1) // 2, 0, -1)]
        return self.w.total([], old)  # one chain: all but its last links are ready early

    def _square(self, node: int, k: int) -> Value:
        w, a = self.w, self.series(node)
        if k == 0:
            return w.mul(a[0], a[0])
        return w.fused(self._twice(node, 0), a[k], self._halved(node, k))

    def _quotient(self, at: int, node: Node, k: int) -> Value:
        w, y = self.w, self.series(at)
        a, b = self.series(node.args[0]), self.series(node.args[1])
        start = b[0] or ZERO
        inverse = self.made("inverse of", start, make=lambda: w.exact("fdiv", ONE, start))
        if k == 0:
            return w.mul(a[0], inverse)
        rest = w.fused(y[0], b[k], self.convolutions.inner((node.args[1], at), k))
        return w.mul(w.sub(a[k], rest), inverse)

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
        product = w.exact("fmul", slope, "%t_hi")
        error = w.call("fma", slope, "%t_hi", w.emit(f"fneg double {product}"))
        error = w.exact("fadd", error, w.exact("fmul", self.constant(c1, True), "%t_hi"))
        error = w.exact("fadd", error, w.exact("fmul", slope, "%t_lo"))
        shift = self.constant(c0, False)
        total = w.exact("fadd", product, shift)  # two-sum
        part = w.exact("fsub", total, product)
        lost = w.exact(
            "fadd",
            w.exact("fsub", product, w.exact("fsub", total, part)),
            w.exact("fsub", shift, part),
        )
        low = w.exact("fadd", w.exact("fadd", error, lost), self.constant(c0, True))
        self._phase[at] = total, low
        return w.exact("fadd", total, low)

    def _turning(self, node: Node) -> tuple[list[Value], list[Value]]:
        """All coefficients of the sine and the cosine of c0 + c1 t: (c1 sigma)^k / k! times a value that turns."""
        clock = node.args[0]
        if clock not in self._turns:
            w = self.w
            s, c = sin_cos(w, *self._phase[clock])
            rate = w.mul(self.constant(self.tape.nodes[clock].constants[1], False), "%sigma") if self.order else None
            sines: list[Value] = [s]
            cosines: list[Value] = [c]
            if rate is not None:
                minus_s, minus_c = w.emit(f"fneg double {s}"), w.emit(f"fneg double {c}")
                powers = powers_of(w, rate, -(-(self.order + 1) // LANES))
                for values, pattern in ((sines, [s, c, minus_s, minus_c]), (cosines, [c, minus_s, minus_c, s])):
                    turn = w.vector(pattern)
                    for v, power in enumerate(powers):
                        inverse = [literal(_inverse_factorial(v * LANES + i)) for i in range(LANES)]
                        row = w.lanewise("fmul", LANES, power, w.lanewise("fmul", LANES, turn, w.vector(inverse)))
                        values += [w.lane(LANES, row, i) for i in range(LANES) if v + i > 0]
            else:
                sines += [None] * self.order
                cosines += [None] * self.order
            self._turns[clock] = sines, cosines
        return self._turns[clock]

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
        w, op, y, a = self.w, node.op, self.series(at), self.series(node.args[0])
        if op == "sqrt":
            start = y[0] or ZERO
            inverse = self.made("inverse of", start, make=lambda: w.exact("fdiv", ONE, start))
            return w.mul(w.scaled(0.5, w.sub(a[k], self._halved(at, k))), inverse)
        if op == "power":
            return self._power(at, node, k)
        if op in ("exp", "sin", "cos", "sinh", "cosh", "tan", "tanh"):
            q = y if op == "exp" else self.series(node.args[1])
            terms = [(self._weighted(node.args[0], j), q[k - j]) for j in range(1, k + 1)]
            value = w.scaled(1.0 / k, w.total(terms[1:-1], terms[:1] + terms[1:][-1:]))
            return w.neg(value) if op == "cos" else value
        # log, atan, asin, acos: y' q = a'
        below = node.args[0] if op == "log" else node.args[1]
        q = self.series(below)
        terms = [(self._weighted(at, j), q[k - j]) for j in range(1, k)]
        rest = w.neg(a[k]) if op == "acos" else a[k]
        start = q[0] or ZERO
        inverse = self.made("inverse of", start, make=lambda: w.exact("fdiv", ONE, start))
        return w.mul(w.sub(rest, w.scaled(1.0 / k, w.total(terms[:-1], terms[-1:]))), inverse)

    def _power(self, at: int, node: Node, k: int) -> Value:
        w, y, a = self.w, self.series(at), self.series(node.args[0])
        exponent = self.constant(node.constants[0], False)
        terms = []
        for j in range(1, k + 1):
            if a[j] is not None and y[k - j] is not None:
                weight = w.sub(w.scaled(float(j), exponent), literal(float(k - j)))
                terms.append((w.mul(weight, a[j]), y[k - j]))
        start = a[0] or ZERO
        inverse = self.made("inverse of", start, make=lambda: w.exact("fdiv", ONE, start))
        return w.scaled(1.0 / k, w.mul(w.total(terms[:-1], terms[-1:]), inverse))

    def _weighted(self, node: int, j: int) -> Value:
        value = self.series(node)[j]
        return self.made(node, "weighted", j, make=lambda: self.w.scaled(float(j), value))


def convolved(tape: Tape, bases: Callable[[int], int]) -> list[Pair]:
    """The products worth a lane: pairs of nodes that are no polynomials in time; ``bases``: what a node is read as."""
    pairs: list[Pair] = []
    for at, node in enumerate(tape.nodes):
        if node.op == "mul":
            pair = node.args[0], node.args[1]
        elif node.op in ("recip", "div"):
            pair = bases(node.args[-1]), at
        else:
            continue
        if all(tape.nodes[i].degree == INFINITE for i in pair):
            pairs.append(pair)
    return list(dict.fromkeys(pairs))


def powers_of(w: Writer, x: str, vectors: int) -> list[str]:
    """x^0, x^1, ... in vectors."""
    square = w.exact("fmul", x, x)
    powers = [w.vector([ONE, x, square, w.exact("fmul", square, x)])]
    if vectors > 1:
        jump = w.exact("fmul", square, square)
        stride = w.vector([jump] * LANES)
        powers.append(w.lanewise("fmul", LANES, powers[0], stride))
    if vectors > 2:
        stride = w.lanewise("fmul", LANES, stride, stride)
        for v in range(2, vectors):
            powers.append(w.lanewise("fmul", LANES, powers[v - 2], stride))
    return powers


def _inverse_factorial(k: int) -> float:
    return 1.0 / math.factorial(k)
