"""A Taylor tape as a program over balls: the coefficient recurrences, and what the tail bounds need of them.

The nodes are those of :class:`henon_ref.taylor.tape.Tape` with a few made explicit, so that every operation
is one of a handful with a known bound on its tail (:mod:`.tails`): a quotient is a product with a
reciprocal, and log, atan, asin and acos are primitives ``y' = a' v`` of a known factor v.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import mul

import sympy as sp
from flint import arb

from henon_ref.taylor.tape import INFINITE, Tape
from henon_ref.truth.balls import enclose

Step = Callable[[int], None]
Series = list[arb]
ZERO = arb(0)


@dataclass(frozen=True, slots=True)
class Operation:
    """One node: what it is, the nodes it reads, its constants, its degree in time where the form bounds it."""

    op: str
    args: tuple[int, ...] = ()
    constants: tuple[int, ...] = ()
    degree: int = INFINITE


class Program:
    """The operations of a tape, ready to be run over balls of any precision.

    Parameters
    ----------
    tape : Tape
        Its constants hold exact numbers only (no parameters left).
    """

    def __init__(self, tape: Tape) -> None:
        self.operations: list[Operation] = []
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
        self._numbers: dict[int, list[arb]] = {}

    def numbers(self, bits: int) -> list[arb]:
        """The constants at a precision (call it with that precision in force)."""
        if bits not in self._numbers:
            self._numbers[bits] = [enclose(e) for e in self.expressions]
        return self._numbers[bits]

    # -- translation ------------------------------------------------------------------------------------

    def _add(self, op: str, *args: int, constants: tuple[int, ...] = (), degree: int = INFINITE) -> int:
        self.operations.append(Operation(op, args, constants, degree))
        return len(self.operations) - 1

    def _reciprocal(self, node: int) -> int:
        if node not in self._reciprocals:
            self._reciprocals[node] = self._add("recip", node, constants=(self._one,))
        return self._reciprocals[node]

    def _translate(self, tape: Tape, index: int) -> None:
        node = tape.nodes[index]
        place = self._place
        if node.op in ("sin", "cos", "sinh", "cosh", "tan", "tanh"):
            self._with_partner(tape, index)
            return
        args = tuple(place[a] for a in node.args)
        if node.op == "state":
            self._place[index] = self._add("state", node.args[0])
        elif node.op == "div":
            place[index] = self._add("mul", args[0], self._reciprocal(args[1]))
        elif node.op == "log":
            place[index] = self._add("log", args[0], self._reciprocal(args[0]))
        elif node.op in ("atan", "asin", "acos"):
            place[index] = self._add(node.op, args[0], self._reciprocal(args[1]))
        elif node.op == "sqrt":
            at = len(self.operations)
            place[index] = self._add("sqrt", args[0], at + 1)
            self._reciprocals[at] = self._add("recip", at, constants=(self._one,))
        elif node.op == "power":
            # y' = c a' w with w = y / a.
            inverse = self._reciprocal(args[0])
            at = len(self.operations)
            place[index] = self._add("power", args[0], at + 1, inverse, constants=node.constants)
            self._add("mul", at, inverse)
        else:
            place[index] = self._add(node.op, *args, constants=node.constants, degree=node.degree)

    def _with_partner(self, tape: Tape, index: int) -> None:
        """Operations that read a node made after them: sin with its cos, tan with 1 + tan^2."""
        node = tape.nodes[index]
        inner = self._place[node.args[0]]
        if node.args[1] > index:
            # All nodes up to the partner follow one another on the tape, and so they do here.
            self._place[index] = self._add(node.op, inner, len(self.operations) + node.args[1] - index)
        else:
            self._place[index] = self._add(node.op, inner, self._place[node.args[1]])

    # -- running ----------------------------------------------------------------------------------------

    def run(self, bits: int, time: arb, state: Sequence[arb], order: int, unit: arb) -> list[Series]:
        """Coefficients 0..order, in powers of s = (t - time) / unit, of every operation along the solution.

        Balls in, balls out: each coefficient holds that of every solution through the balls of time and state.
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
                # All at once: a state may be the derivative of another.
                for target, value in [(target, source[k] * weight) for target, source in links]:
                    target.append(value)
        return series

    def _step(self, index: int, series: list[Series], numbers: list[arb], time: arb, unit: arb) -> Step:
        """What appends coefficient k of one operation to its series."""
        operation = self.operations[index]
        op, y = operation.op, series[index]
        operands = [series[i] for i in operation.args]
        degrees = [self.operations[i].degree for i in operation.args]
        constant = [numbers[i] for i in operation.constants]
        if op == "clock":
            return _listed(y, [constant[0] + constant[1] * time, constant[1] * unit])
        if op == "constant":
            return _listed(y, constant)
        if op in ("mul", "square"):
            return _product(y, operands[0], operands[-1], degrees[0], degrees[-1])
        if op in _VALUES or op == "power":
            return _primitive(op, y, operands[0], degrees[0], y if op == "exp" else operands[1], constant)
        return _SIMPLE[op](y, operands[0], operands[-1], constant)


def _listed(y: Series, values: Sequence[arb]) -> Step:
    def step(k: int) -> None:
        y.append(values[k] if k < len(values) else ZERO)

    return step


def convolution(a: Series, b: Series, first: int, last: int, total: int) -> arb:
    """Sum of a[j] b[total - j] over first <= j <= last."""
    if last < first:
        return ZERO
    return sum(map(mul, a[first : last + 1], b[total - last : total - first + 1][::-1]), ZERO)


def _product(y: Series, a: Series, b: Series, degree_a: int, degree_b: int) -> Step:
    if a is b:

        def square(k: int) -> None:
            half = 2 * convolution(a, a, max(0, k - degree_a), (k - 1) // 2, k)
            y.append(half if k % 2 or k // 2 > degree_a else half + a[k // 2] * a[k // 2])

        return square

    def step(k: int) -> None:
        y.append(convolution(a, b, max(0, k - degree_b), min(k, degree_a), k))

    return step


_VALUES: dict[str, Callable[[arb], arb]] = {
    name: getattr(arb, name)
    for name in ("exp", "sin", "cos", "sinh", "cosh", "tan", "tanh", "log", "atan", "asin", "acos")
}


def _primitive(op: str, y: Series, a: Series, degree: int, factor: Series, constant: list[arb]) -> Step:
    """y with y' = sign a' factor."""
    sign = -1 if op in ("cos", "acos") else 1
    slopes: Series = [ZERO]

    def step(k: int) -> None:
        if k == 0:
            y.append(a[0] ** constant[0] if op == "power" else _VALUES[op](a[0]))
            return
        slopes.append(a[k] * (sign * k) if k <= degree else ZERO)
        total = convolution(slopes, factor, 1, min(k, degree), k) / k
        y.append(constant[0] * total if op == "power" else total)

    return step


def _add(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    return lambda k: y.append(a[k] + b[k])


def _sub(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    return lambda k: y.append(a[k] - b[k])


def _scale(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    factor = constant[0]
    return lambda k: y.append(factor * a[k])


def _shift(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    offset = constant[0]
    return lambda k: y.append(a[k] if k else a[0] + offset)


def _rsub(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    offset = constant[0]
    return lambda k: y.append(-a[k] if k else offset - a[0])


def _recip(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    def step(k: int) -> None:
        if k == 0:
            y.append(constant[0] / a[0])
        else:
            y.append(-convolution(y, a, 0, k - 1, k) / a[0])

    return step


def _sqrt(y: Series, a: Series, b: Series, constant: list[arb]) -> Step:
    def step(k: int) -> None:
        if k == 0:
            y.append(a[0].sqrt())
        else:
            y.append((a[k] - convolution(y, y, 1, k - 1, k)) / (2 * y[0]))

    return step


_SIMPLE: dict[str, Callable[[Series, Series, Series, list[arb]], Step]] = {
    "add": _add,
    "sub": _sub,
    "scale": _scale,
    "shift": _shift,
    "rsub": _rsub,
    "recip": _recip,
    "sqrt": _sqrt,
}
