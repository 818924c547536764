"""Proven bounds of Taylor remainders ("tails"), in the Banach algebra of power series: ``|a| = sum |a_k| R^k``.

Write the solution as its polynomial of order N plus a tail e of orders above N. Integration divides the coefficient
of order k by k + 1, so on tails the Picard map contracts by about ``R L / (N + 2)``: for N of some tens it maps the
set ``{|e_i| <= eps_i}`` into itself for R close to the radius of convergence. The set is convex and closed and the
map is compact (integration is), so by Schauder it has a fixed point in the set. That fixed point is the solution,
because the formal power series solution is unique. One self-map checked in upper bounds therefore proves that the
solution exists and is analytic on the complex disc of radius R, with ``|e_i| <= eps_i``; at radius r < R the tail is
at most ``eps_i (r/R)^(N+1)``. Every operation has a bound in the same algebra (:func:`_static`,
:meth:`Tails.propagate`). Validation of a Taylor step by its tail in a weighted l1 space is the radii-polynomial
approach: Hungria, Lessard and Mireles James, *Math. Comp.* 85, 2016.

All numbers here are upper bounds in double precision: sums and products of non-negative doubles. Each result is
multiplied by a factor that exceeds all its rounding errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, isfinite

import numpy as np
import sympy as sp
from flint import arb
from numpy.typing import NDArray

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
from henon_ref.taylor.series import BALL, expand
from henon_ref.taylor.tape import INFINITE, Node, Tape

Series = list[arb]
RAISE = 1 + 2.0**-36
"""Factor above the relative rounding error of a few thousand operations on non-negative doubles."""
TINY = 1e-290
"""Term above the underflow error of a sum of a few thousand terms."""
ROUNDS = 12
"""Tries to find tails that the Picard map sends into themselves, counted from the last try in which another state got
a nonzero tail: in a chain of states, a tail advances one state per try."""


class Program:
    """The operations of a tape without parameters, to be run over balls of any precision.

    Operations are nodes, and their recurrences those of :mod:`henon_ref.taylor.series`, but the nodes that a tail bound
    needs are made explicit: a quotient is a product with a reciprocal, and log, atan, asin and acos are integrals
    ``y' = a' v`` with a known factor v. An operation may read one that is added after it. The first node that it reads
    is its argument, and the last one that of its recurrence; only tail bounds read those between them.
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


def magnitudes(series: Sequence[Series]) -> NDArray[np.float64]:
    """Return upper bounds of ``|a_k|``, shape (operations, order + 1)."""
    return np.array([[float(c.abs_upper()) for c in row] for row in series]) * RAISE + TINY


def _spill(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Norm of the orders above N of the product of two polynomials, given by their terms ``|a_k| R^k``."""
    beyond = np.cumsum(b[::-1])
    return float(np.dot(a[1:], beyond[:-1]))


def _static(operation: Node, own: NDArray[np.float64], terms: NDArray[np.float64]) -> tuple[float, float, float]:
    """The part of an operation's tail bound that does not depend on the tails of the states: norm, spill, slope.

    The norm of the operation's polynomial; the norm of the orders above N of the products of polynomials in the
    operation; and a bound q with ``|int a' u| <= q |u|`` for u of orders above N (the tail of a is excluded).
    """
    order = len(own) - 1
    norm = float(np.sum(own))
    args = operation.args
    match RULES.get(operation.op):
        case Product():
            return norm, _spill(terms[args[0]], terms[args[-1]]), 0.0
        case Quotient():
            return norm, _spill(own, terms[args[0]]), 0.0
        case Root():
            return norm, _spill(own, own), _spill(own, terms[args[1]])
        case Power() | IntegralOfProduct() | IntegralOfQuotient():
            # (int a' q)_n = sum (i/n) a_i q_{n-i}: i/n <= i/(N+1) above N, and i/(i+N+1) where q is a tail.
            index = np.arange(order + 1)
            a = terms[args[0]]
            factor = terms[args[1]] if args[1:] else own
            return norm, _spill(a * index / (order + 1), factor), float(np.dot(a, index / (index + order + 1)))
    return norm, 0.0, 0.0


class Tails:
    """Tail bounds of every operation of a program on the disc of radius ``radius``."""

    def __init__(
        self, program: Program, numbers: Sequence[arb], sizes: NDArray[np.float64], radius: float, unit: float
    ) -> None:
        self.program = program
        self.order = sizes.shape[1] - 1
        self.gain = unit * radius * RAISE
        with np.errstate(over="ignore", invalid="ignore"):
            # Overflow gives infinite bounds, which validate() refuses.
            terms = sizes * (radius ** np.arange(self.order + 1) * RAISE) + TINY
        self.terms = terms
        self.constants = [
            [(float(numbers[i].abs_lower()) / RAISE, float(numbers[i].abs_upper()) * RAISE) for i in o.constants]
            if o.op in ("scale", "recip", "power")
            else []
            for o in program.operations
        ]
        static = zip(*(_static(o, terms[i], terms) for i, o in enumerate(program.operations)), strict=True)
        self.norm, self.spill, self.slope = ([value * RAISE + TINY for value in own] for own in static)
        self.last = [float(terms[i][-1]) for i in program.field]

    def inner_norm(self, index: int) -> float:
        """Norm of an operation's polynomial on the disc of an eighth of the radius."""
        return float(np.dot(self.terms[index], 0.125 ** np.arange(self.order + 1)))

    def validate(self) -> tuple[list[float], list[float]] | None:
        """Proven tails (of the states, of the outputs), or None if no self-map was found.

        The Picard map sends a state's tail to at most ``unit R (|f_N| R^N / (N + 1) + eps_f / (N + 2))``.
        """
        program = self.program
        states = [0.0] * len(program.field)
        patience, reached = ROUNDS, 0
        while patience > 0:
            tails = self.propagate(states)
            mapped = [
                (last / (self.order + 1) + tails[i] / (self.order + 2)) * self.gain * RAISE + TINY
                for last, i in zip(self.last, program.field, strict=True)
            ]
            if not all(map(isfinite, mapped)):
                return None
            if all(new <= old for new, old in zip(mapped, states, strict=True)):
                return states, [tails[i] for i in program.outputs]
            before, reached = reached, sum(tail > 1e-250 for tail in mapped)  # not just TINY, grown by the tries
            patience = ROUNDS if reached > before else patience - 1
            # The factor leaves room for growth of the image, even if the tails of other states dominate it.
            states = [1.5 * new for new in mapped]
        return None

    def propagate(self, states: Sequence[float]) -> list[float]:
        """Tails of all operations, from the tails of the states."""
        tails: list[float] = []
        for index, operation in enumerate(self.program.operations):
            value = states[operation.args[0]] if operation.op == "state" else self._tail(index, operation, tails)
            tails.append(value if value >= 0 else inf)
            if not isfinite(tails[-1]):
                return [inf] * len(self.program.operations)
        return tails

    def _tail(self, index: int, operation: Node, tails: list[float]) -> float:
        args, norm, spill = operation.args, self.norm, self.spill[index]
        if not args:  # a constant, or the clock
            return 0.0
        a = tails[args[0]]
        match RULES[operation.op]:
            case Linear(second=0, constant="term"):
                return a
            case Linear(second=0):
                return self.constants[index][0][1] * a * RAISE
            case Linear():
                return (a + tails[args[1]]) * RAISE
            case Product():
                b = tails[args[-1]]
                return (spill + norm[args[0]] * b + norm[args[-1]] * a + a * b) * RAISE
            case Quotient():
                # v = y/c: 1 - v b has orders above N only; Neumann's series gives the rest of 1/b.
                defect = (spill + norm[index] * a) / self.constants[index][0][0] * RAISE
                return norm[index] * defect / (1 - defect) * RAISE if defect < 0.5 else inf
            case Root():
                # u = v (t - u^2)/2 + (1 - v y) u with v the polynomial of 1/y and t = a - y^2, both above N.
                inverse, defect = norm[args[1]], self.slope[index]
                rest = inverse * (a + spill) / 2
                return _fixed(lambda u: rest + inverse * u * u / 2 + defect * u, lambda u: inverse * u + defect)
            case Power() | IntegralOfProduct() | IntegralOfQuotient():
                return self._integral(index, operation, tails)

    def _integral(self, index: int, operation: Node, tails: list[float]) -> float:
        """Tail of ``int a' factor``."""
        rule, args, norm = RULES[operation.op], operation.args, self.norm
        a, own = tails[args[0]], norm[index]
        q = self.slope[index] + a
        rest = self.spill[index] + a * (norm[args[1]] if args[1:] else own)
        match rule:
            case IntegralOfQuotient():
                return (rest + q * tails[args[1]]) * RAISE
            case IntegralOfProduct(factor="1 + y**2" | "1 - y**2"):
                # The tail of the factor is 2 y u + u^2 plus the orders above N of y_N^2.
                square = _spill(self.terms[index], self.terms[index]) * RAISE
                return _fixed(lambda u: rest + q * (square + 2 * own * u + u * u), lambda u: q * (2 * own + 2 * u))
            case Power():
                # y' = c a' (y v), v = 1/a.
                c = self.constants[index][0][1]
                v, tail = norm[args[2]], tails[args[2]]
                mixed = _spill(self.terms[index], self.terms[args[2]]) * RAISE
                return _fixed(
                    lambda u: c * (rest + q * (mixed + v * u + own * tail + tail * u)), lambda u: c * q * (v + tail)
                )
            case IntegralOfProduct(paired=True):
                # Both tails of the pair at once: u_s = int a' u_c + d_s and vice versa.
                rest = max(rest, self.spill[args[1]] + a * own)
        return rest / (1 - q * RAISE) * RAISE if q < 0.9 else inf


def _fixed(picard: Callable[[float], float], slope: Callable[[float], float]) -> float:
    """Radius of a ball that a map sends into itself as a contraction; infinite if none is found."""
    u = picard(0.0) * RAISE
    for _ in range(ROUNDS):
        image = picard(u) * RAISE
        if not isfinite(image):
            return inf
        if image <= u and slope(u) < 0.9:
            return float(u)
        u = 1.5 * image
    return inf
