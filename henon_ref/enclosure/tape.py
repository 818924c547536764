"""A Taylor tape as a program over balls: the coefficient recurrences, in operations with known tail bounds.

The nodes are those of :class:`henon_ref.taylor.tape.Tape`, but with helper nodes made explicit, so that each operation
is of one of few kinds whose tail has a known bound (:mod:`.tail_bounds`): a quotient is a product with a reciprocal,
and log, atan, asin and acos are integrals ``y' = a' v`` with a known factor v. The equation of each operation is in
:mod:`henon_ref.taylor.rules`; this file has the recurrences in balls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add, mul, sub

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.method_cache import cached_method
from henon_ref.taylor.rules import (
    ARGUMENT,
    RULES,
    SELF,
    IntegralOfProduct,
    IntegralOfQuotient,
    Linear,
    Power,
    Product,
    Quotient,
    Root,
)
from henon_ref.taylor.tape import INFINITE, Node, Tape

Step = Callable[[int], None]
Series = list[arb]
ZERO = arb(0)


class Program:
    """The operations of a tape, to be run over balls of any precision.

    Operations are nodes, but an operation may read one that is added after it.

    Parameters
    ----------
    tape : Tape
        Without parameters: its constants are exact numbers.
    """

    def __init__(self, tape: Tape) -> None:
        self.operations: list[Node] = []
        self._place: list[int] = [-1] * len(tape.nodes)
        self._reciprocals: dict[int, int] = {}
        self._one = len(tape.constants)
        self.expressions: tuple[sp.Expr, ...] = (*tape.constants, sp.Integer(1))
        for index in range(len(tape.nodes)):
            self._translate(tape, index)
        self.field = tuple(self._place[i] for i in tape.field)
        self.outputs = tuple(self._place[i] for i in tape.outputs)
        places = {o.args[0]: i for i, o in enumerate(self.operations) if o.op == "state"}
        self.states = tuple(places[i] for i in range(len(self.field)))

    @cached_method
    def numbers(self, bits: int) -> list[arb]:
        """Constants at a precision, which must be the working precision."""
        return [enclose(e) for e in self.expressions]

    def _add(self, op: str, *args: int, constants: tuple[int, ...] = (), degree: int = INFINITE) -> int:
        self.operations.append(Node(op, args, constants, degree))
        return len(self.operations) - 1

    def _reciprocal(self, node: int) -> int:
        if node not in self._reciprocals:
            self._reciprocals[node] = self._add("recip", node, constants=(self._one,))
        return self._reciprocals[node]

    def _translate(self, tape: Tape, index: int) -> None:
        node = tape.nodes[index]
        place, rule = self._place, RULES.get(node.op)
        if isinstance(rule, IntegralOfProduct) and rule.factor != SELF:
            self._with_partner(tape, index)
            return
        args = tuple(place[a] for a in node.args)
        at = len(self.operations)
        if node.op == "state":
            place[index] = self._add("state", node.args[0])
        elif isinstance(rule, Quotient) and rule.above == ARGUMENT:
            place[index] = self._add("mul", args[0], self._reciprocal(args[1]))
        elif isinstance(rule, IntegralOfQuotient):
            below = self._reciprocal(rule.place(index, args))
            place[index] = self._add(node.op, args[0], below)
        elif isinstance(rule, Root):
            place[index] = self._add(node.op, args[0], at + 1)
            self._reciprocals[at] = self._add("recip", at, constants=(self._one,))
        elif isinstance(rule, Power):
            # y' = c a' w with w = y / a.
            inverse = self._reciprocal(args[0])
            at = len(self.operations)
            place[index] = self._add(node.op, args[0], at + 1, inverse, constants=node.constants)
            self._add("mul", at, inverse)
        else:
            place[index] = self._add(node.op, *args, constants=node.constants, degree=node.degree)

    def _with_partner(self, tape: Tape, index: int) -> None:
        """Add an operation that reads a node added after it: sin with its cos, tan with 1 + tan^2."""
        node = tape.nodes[index]
        inner = self._place[node.args[0]]
        if node.args[1] > index:
            # The nodes up to the partner are consecutive on the tape, and so are their operations.
            self._place[index] = self._add(node.op, inner, len(self.operations) + node.args[1] - index)
        else:
            self._place[index] = self._add(node.op, inner, self._place[node.args[1]])

    def run(self, bits: int, time: arb, state: Sequence[arb], order: int, unit: arb) -> list[Series]:
        """Coefficients 0..order, in powers of s = (t - time) / unit, of every operation along the solution.

        Each coefficient encloses the coefficients of all solutions through the balls of time and state.
        """
        numbers = self.numbers(bits)
        solution = [[value] for value in state]
        series = [solution[o.args[0]] if o.op == "state" else [] for o in self.operations]
        steps = [self._step(i, series, numbers, time, unit) for i, o in enumerate(self.operations) if o.op != "state"]
        links = [(target, series[source]) for target, source in zip(solution, self.field, strict=True)]
        for k in range(order + 1):
            for step in steps:
                step(k)
            if k < order:
                weight = unit / (k + 1)
                # Compute all before appending: a state may be the derivative of another state.
                for target, value in [(target, source[k] * weight) for target, source in links]:
                    target.append(value)
        return series

    def _step(self, index: int, series: list[Series], numbers: list[arb], time: arb, unit: arb) -> Step:
        """Return the function that appends coefficient k of one operation to its series."""
        operation = self.operations[index]
        op, y = operation.op, series[index]
        operands = [series[i] for i in operation.args]
        degrees = [self.operations[i].degree for i in operation.args]
        constant = [numbers[i] for i in operation.constants]
        if op in ("constant", "clock"):
            values = constant if op == "constant" else [constant[0] + constant[1] * time, constant[1] * unit]
            return lambda k: y.append(values[k] if k < len(values) else ZERO)
        a, b = operands[0], operands[-1]
        match RULES[op]:
            case Linear() as rule:
                return _linear(rule, y, a, b, constant)
            case Product():
                return _product(y, a, b, degrees[0], degrees[-1])
            case Quotient():
                return _reciprocal(y, a, constant[0])
            case Root():
                return _root(y, a)
            case Power():
                return _power(y, a, degrees[0], operands[1], constant[0])
            case IntegralOfProduct(sign, factor):
                return _integral(y, a, degrees[0], y if factor == SELF else b, sign, getattr(arb, op))
            case IntegralOfQuotient(sign):
                return _integral(y, a, degrees[0], b, sign, getattr(arb, op))


def _convolution(a: Series, b: Series, first: int, last: int, total: int) -> arb:
    """Sum of a[j] b[total - j] over first <= j <= last."""
    if last < first:
        return ZERO
    return sum(map(mul, a[first : last + 1], b[total - last : total - first + 1][::-1]), ZERO)


def _product(y: Series, a: Series, b: Series, degree_a: int, degree_b: int) -> Step:
    if a is b:

        def square(k: int) -> None:
            half = 2 * _convolution(a, a, max(0, k - degree_a), (k - 1) // 2, k)
            y.append(half if k % 2 or k // 2 > degree_a else half + a[k // 2] * a[k // 2])

        return square

    return lambda k: y.append(_convolution(a, b, max(0, k - degree_b), min(k, degree_a), k))


def _integral(y: Series, a: Series, degree: int, factor: Series, sign: int, start: Callable[[arb], arb]) -> Step:
    """y with y' = sign a' factor; ``start`` maps a[0] to y[0]."""
    slopes: Series = [ZERO]

    def step(k: int) -> None:
        if k == 0:
            y.append(start(a[0]))
            return
        slopes.append(a[k] * (sign * k) if k <= degree else ZERO)
        y.append(_convolution(slopes, factor, 1, min(k, degree), k) / k)

    return step


def _power(y: Series, a: Series, degree: int, factor: Series, c: arb) -> Step:
    """y = a^c, by y' = c a' factor."""
    total: Series = []
    add_to_total = _integral(total, a, degree, factor, 1, lambda start: start**c)

    def step(k: int) -> None:
        add_to_total(k)
        y.append(c * total[k] if k else total[0])

    return step


def _linear(rule: Linear, y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    if rule.second:
        combined = add if rule.second > 0 else sub
        return lambda k: y.append(combined(a[k], b[k]))
    (c,) = constant
    if rule.constant == "factor":
        return lambda k: y.append(c * a[k])
    if rule.first < 0:
        return lambda k: y.append(-a[k] if k else c - a[0])
    return lambda k: y.append(a[k] if k else a[0] + c)


def _reciprocal(y: Series, a: Series, c: arb) -> Step:
    return lambda k: y.append(-_convolution(y, a, 0, k - 1, k) / a[0] if k else c / a[0])


def _root(y: Series, a: Series) -> Step:
    return lambda k: y.append((a[k] - _convolution(y, y, 1, k - 1, k)) / (2 * y[0]) if k else a[0].sqrt())
