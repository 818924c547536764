"""A Taylor tape as a program over balls: the coefficient recurrences, in operations with known tail bounds.

The nodes are those of :class:`henon_ref.taylor.tape.Tape`, and so are their recurrences
(:mod:`henon_ref.taylor.series`), but the nodes that a tail bound needs are made explicit (:mod:`.tail_bounds`): a
quotient is a product with a reciprocal, and log, atan, asin and acos are integrals ``y' = a' v`` with a known factor v.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.method_cache import cached_method
from henon_ref.taylor.rules import ARGUMENT, RULES, SELF, IntegralOfProduct, IntegralOfQuotient, Power, Quotient, Root
from henon_ref.taylor.series import BALL, expand
from henon_ref.taylor.tape import INFINITE, Node, Tape

Series = list[arb]


class Program:
    """The operations of a tape, to be run over balls of any precision.

    Operations are nodes, but an operation may read one that is added after it. The first node that it reads is the
    argument, the last one that of its recurrence; tail bounds read those between them too.

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
        self._tape = Tape(tuple(self.operations), self.expressions, self.field, tuple(range(len(self.operations))))

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
            below = rule.place(index, args)
            place[index] = self._add(node.op, args[0], self._reciprocal(below), below)
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
        return expand(self._tape, self.numbers(bits), time, state, order, BALL, unit)[1]
