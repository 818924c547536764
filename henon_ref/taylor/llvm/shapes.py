"""Shapes of the nodes of a long tape: nodes of one shape differ only in the places that they read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from henon_ref.taylor.llvm.linear_forms import Factor, Form, Forms
from henon_ref.taylor.rules import LINEAR, RULES, Linear, Product, Quotient
from henon_ref.taylor.tape import INFINITE, Tape

Factors = tuple[Factor, ...]
"""A sum of products of constants; an empty sum is 0."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Everything that the code of one node, rate or output depends on, with operands as indices into `Operands`."""

    op: str
    """Operation of the tape; ``sum``, ``rate`` and ``output`` for linear forms; ``sin of time``, ``cos of time``."""
    series: tuple[tuple[bool, int], ...]
    """For each series: whether it is a state that an output reads, and its degree, at most the order."""
    constants: int
    """Number of constants that are read."""
    args: tuple[int, ...] = ()
    terms: tuple[tuple[int, Factors], ...] = ()
    """Leaves of the form with their factors."""
    constant: Factors = ()
    integrals: tuple[tuple[int, int, Factors], ...] = ()
    """Leaves that are integrals of other states: (leaf, other state, rate)."""
    in_vectors: bool = False
    """Whether straight-line code computes the convolution in the lanes of vectors, that is in another order."""

    @property
    def degree(self) -> int:
        """Degree of the form in time."""
        return max([self.series[label][1] for label, _ in self.terms], default=0)


class Operands(NamedTuple):
    """Operands of one node: series (state i as -1 - i, else the node's index) and constants as sums of products."""

    series: tuple[int, ...]
    constants: tuple[Factors, ...]


@dataclass
class _Reading:
    """Indices of the operands of a node."""

    degrees: Mapping[int, int]
    order: int
    series: list[int] = field(default_factory=list)
    constants: list[Factors] = field(default_factory=list)

    def place(self, at: int) -> int:
        if at not in self.series:
            self.series.append(at)
        return self.series.index(at)

    def factors(self, found: Sequence[Factor]) -> Factors:
        """Register a sum of products as one constant; 0, 1 and -1 are kept as they are."""
        if not found or (len(found) == 1 and not found[0].constants):
            return tuple(found)
        self.constants.append(tuple(found))
        return (Factor(1, (len(self.constants) - 1,)),)

    def made(self, op: str, **rest: object) -> tuple[Shape, Operands]:
        series = tuple((at < 0 and op == "output", min(self.degrees[at], self.order)) for at in self.series)
        shape = Shape(op, series, len(self.constants), **rest)  # type: ignore[arg-type]
        return shape, Operands(tuple(self.series), tuple(self.constants))


class Shapes:
    """Shapes of all computed nodes of a tape at an order, and the order of their computation.

    Attributes
    ----------
    nodes : dict
        Node -> its shape and operands, for nodes with a series of their own.
    rates, outputs : list
        Shape and operands of each state's rate and of each output.
    levels : dict
        Node -> length of the longest chain of nodes that must be computed before it at the same order.
    last : set of int
        Nodes whose coefficient of the highest order is required.
    """

    def __init__(self, tape: Tape, order: int) -> None:
        self.tape, self.order = tape, order
        self._forms = forms = Forms(tape)
        self.last = forms.last
        self._degrees = {self._name(at): node.degree for at, node in enumerate(tape.nodes)}
        self._integrals = {
            -1 - i: (leaf, forms.field[i].terms[leaf]) for i, leaf in forms.integral_states(order).items()
        }
        self._in_vectors = set(forms.convolved())
        self.nodes = {
            at: self._sum("sum", forms.kept[at]) if at in forms.kept else self._node(at)
            for at, node in enumerate(tape.nodes)
            if at in forms.kept or node.op not in (*LINEAR, "state")
        }
        self.rates = [self._sum("rate", form) for form in forms.field]
        self.outputs = [self._sum("output", form) for form in forms.outputs]
        self.levels: dict[int, int] = {}
        for at, (shape, operands) in self.nodes.items():
            now = operands.series if shape.terms or self._reads_now(shape.op) else operands.series[:1]
            self.levels[at] = 1 + max([self.levels[a] for a in now if a >= 0 and a != at], default=-1)

    def degree(self, name: int) -> int:
        """Degree of a series in time, at most the order."""
        return min(self._degrees.get(name, INFINITE), self.order)

    def argument(self, at: int) -> tuple[int, bool]:
        """The series that a function reads, and whether its coefficient of the highest order is computed."""
        name = self._name(self.tape.nodes[at].args[0])
        return name, name < 0 or name in self.last

    def _name(self, at: int) -> int:
        node = self.tape.nodes[at]
        return -1 - node.args[0] if node.op == "state" else at

    @staticmethod
    def _reads_now(op: str) -> bool:
        """Whether coefficient k requires coefficient k of all arguments, not only of the first."""
        return isinstance(RULES.get(op), Linear | Product | Quotient)

    def _node(self, at: int) -> tuple[Shape, Operands]:
        node, reading = self.tape.nodes[at], _Reading(self._degrees, self.order)
        timed = node.op in ("sin", "cos") and self.tape.nodes[node.args[0]].op == "clock"
        if node.op == "clock" or timed:
            clock, lost = self.tape.nodes[node.args[0]] if timed else node, len(self.tape.constants)
            for index in (*clock.constants, *(index + lost for index in clock.constants)):
                reading.factors([Factor(1, (index,))])
            return reading.made(f"{node.op} of time" if timed else node.op)
        for index in node.constants:
            reading.factors([Factor(1, (index,))])
        if node.op == "recip":
            below = self._forms.below(node.args[0])
            (x,) = below.terms
            reading.place(self._name(x))
            terms = ((0, reading.factors(below.terms[x])),)
            constant = reading.factors(below.constant)
            in_vectors = (x, at, at) in self._in_vectors
            return reading.made("recip", terms=terms, constant=constant, in_vectors=in_vectors)
        args = tuple(reading.place(self._name(a)) for a in node.args)
        pair = (node.args[1], at, at) if node.op == "div" else (*node.args, at)
        return reading.made(node.op, args=args, in_vectors=pair in self._in_vectors)

    def _sum(self, op: str, form: Form) -> tuple[Shape, Operands]:
        reading = _Reading(self._degrees, self.order)
        for leaf in form.leaves():
            reading.place(self._name(leaf))
        terms = tuple((reading.place(self._name(leaf)), reading.factors(f)) for leaf, f in form.terms.items())
        constant, integrals = reading.factors(form.constant), []
        for leaf in form.leaves() if op != "rate" else ():
            if self._name(leaf) in self._integrals:
                source, rate = self._integrals[self._name(leaf)]
                label, of = reading.place(self._name(leaf)), reading.place(self._name(source))
                integrals.append((label, of, reading.factors(rate)))
        return reading.made(op, terms=terms, constant=constant, integrals=tuple(integrals))
