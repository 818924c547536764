"""The Taylor tape: a smooth field as a list of elementary operations with known coefficient recurrences.

Every node is a function of time along the solution. Its Taylor coefficients follow from those of its arguments by the
classical recurrences (Jorba and Zou, *Experimental Mathematics* 14, 2005, Sec. 2), with the equations in
:mod:`henon_ref.taylor.rules`. The same tape is compiled to machine code (:mod:`henon_ref.taylor.llvm.expansion`) and
run over any ring (:mod:`henon_ref.taylor.series`): doubles, balls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.traversal import fraction, is_longer, product
from henon_ref.taylor.rules import RULES, Linear, Product, Quotient

TIME = sp.Symbol("t", real=True)
"""Symbol of time in every expression of a system [s]."""

INFINITE = 1 << 30
"""Degree in time of a node that is not known to be a polynomial in time."""


@dataclass(frozen=True, slots=True)
class Node:
    """One elementary operation.

    ``op`` is one of: constant (c), clock (c0 + c1 t), state (i), add, sub, mul, div (two nodes), square,
    scale (c a), shift (a + c), rsub (c - a), recip (c / a), power (a**c), sqrt, exp, log, and the operations
    with a partner series as second argument: sin (its cos), cos (its sin), sinh, cosh, tan (1 + tan^2),
    tanh (1 - tanh^2), atan (1 + a^2), asin and acos (sqrt(1 - a^2)).
    """

    op: str
    args: tuple[int, ...] = ()
    """Nodes read by the operation; for ``state`` the index of the state."""
    constants: tuple[int, ...] = ()
    """Indices into :attr:`Tape.constants`."""
    degree: int = INFINITE
    """Bound of the degree in time along every solution, from the form alone; coefficients above it are zero."""


@dataclass(frozen=True)
class Tape:
    """A field and some functions of time and state (guards) as one list of elementary operations."""

    nodes: tuple[Node, ...]
    constants: tuple[sp.Expr, ...]
    """Exact expressions in parameters and slip signs; each user of the tape rounds them once."""
    field: tuple[int, ...]
    """Node of each x_i'."""
    outputs: tuple[int, ...]

    @property
    def counts(self) -> dict[str, int]:
        """Number of nodes of each operation, a measure of a model's cost."""
        return dict(sorted(Counter(node.op for node in self.nodes).items()))

    @property
    def degree(self) -> int:
        """Bound of the degree in time of all states and outputs along every solution."""
        nodes = self.nodes
        return max([nodes[row].degree + 1 for row in self.field] + [nodes[row].degree for row in self.outputs])

    def part(self, outputs: Sequence[int]) -> Tape:
        """Return the tape of some outputs without the field; the constants keep their indices."""
        needed = self.needed(self.outputs[at] for at in outputs)
        new = {at: place for place, at in enumerate(sorted(needed))}
        nodes = [self.nodes[at] for at in sorted(needed)]
        moved = (n if n.op == "state" else replace(n, args=tuple(new[a] for a in n.args)) for n in nodes)
        return Tape(tuple(moved), self.constants, (), tuple(new[self.outputs[at]] for at in outputs))

    def needed(self, rows: Iterable[int]) -> set[int]:
        """Indices of the given nodes and of all nodes that they depend on."""
        found: set[int] = set()
        wanted = list(rows)
        while wanted:
            at = wanted.pop()
            if at not in found:
                found.add(at)
                wanted += () if self.nodes[at].op == "state" else self.nodes[at].args
        return found


def build_tape(
    states: Sequence[sp.Symbol],
    field: Iterable[sp.Expr],
    outputs: Iterable[sp.Expr] = (),
    definitions: Sequence[tuple[sp.Symbol, sp.Expr]] = (),
) -> Tape:
    """Write a smooth field and further functions of time and state as a tape.

    ``field``: x_i' in time, states and constants (parameters, slip signs: every other symbol); ``outputs``: further
    functions whose series along the solution are computed; ``definitions``: names used in these expressions, with their
    values, each in terms of earlier names. A name is a node of its own, even if its value is constant: it is not merged
    with other constants. ModelError if a function has no coefficient recurrence here (sign, Abs, Piecewise ...).
    """
    field, outputs = list(field), list(outputs)
    named = [expression for _, expression in definitions]
    builder = _Builder(tuple(states), _repeated([*named, *field, *outputs]), {name for name, _ in definitions})
    for name, expression in definitions:
        builder.define(name, expression)
    field_nodes = tuple(builder.node(expression) for expression in field)
    output_nodes = tuple(builder.node(expression) for expression in outputs)
    degrees = _degrees(builder.nodes, field_nodes)
    nodes = tuple(replace(node, degree=degree) for node, degree in zip(builder.nodes, degrees, strict=True))
    return Tape(nodes, tuple(builder.constants), field_nodes, output_nodes)


class _Builder:
    """Builder of nodes from expressions; equal expressions become one node."""

    def __init__(self, states: tuple[sp.Symbol, ...], repeated: frozenset[sp.Expr], names: set[sp.Symbol]) -> None:
        self.repeated = repeated
        self.nodes: list[Node] = []
        self.constants: list[sp.Expr] = []
        self._constant_index: dict[sp.Expr, int] = {}
        self._memo: dict[sp.Expr, int] = {x: self._add("state", (i,)) for i, x in enumerate(states)}
        self._interned: dict[tuple[object, ...], int] = {}
        self._of_states: dict[sp.Basic, bool] = dict.fromkeys((*states, *names), True)
        self._moves: dict[sp.Basic, bool] = {TIME: True, **self._of_states}

    def node(self, expression: sp.Expr) -> int:
        """Return the node of an expression, adding it if it is new."""
        expression = sp.sympify(expression)
        if expression not in self._memo:
            self._memo[expression] = self._make(expression)
        return self._memo[expression]

    def define(self, name: sp.Symbol, expression: sp.Expr) -> None:
        """Make a name an alias of a node."""
        self._memo[name] = self.node(expression)

    def _is_constant(self, expression: sp.Expr) -> bool:
        """Whether the expression contains neither time nor states."""
        return not _holds(expression, self._moves)

    def _constant(self, value: sp.Expr) -> int:
        if value not in self._constant_index:
            self._constant_index[value] = len(self.constants)
            self.constants.append(value)
        return self._constant_index[value]

    def _add(self, op: str, args: tuple[int, ...] = (), constants: tuple[int, ...] = ()) -> int:
        self.nodes.append(Node(op, args, constants))
        return len(self.nodes) - 1

    def _op(self, op: str, *args: int, constants: tuple[sp.Expr, ...] = ()) -> int:
        indices = tuple(self._constant(c) for c in constants)
        key = (op, args, indices)
        if key not in self._interned:
            self._interned[key] = self._add(op, args, indices)
        return self._interned[key]

    def _make(self, e: sp.Expr) -> int:
        if self._is_constant(e):
            return self._op("constant", constants=(e,))
        of_time = not _holds(e, self._of_states) and not is_longer(e, 100)  # a longer one takes long to differentiate
        if of_time and sp.diff(e, TIME, 2) == 0:
            slope = sp.cancel(sp.diff(e, TIME))  # e may be a quotient that is linear only after cancellation
            start = sp.expand(sp.cancel(e - slope * TIME) if e.is_rational_function(TIME) else e - slope * TIME)
            if not slope.has(TIME) and not start.has(TIME):
                return self._op("clock", constants=(start, slope))
        if e.is_Add:
            return self._sum(e.args, sp.Integer(1))
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        return self._function(e)

    def _split(self, e: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        """(constant factor, remaining factors)."""
        if e.is_Mul:
            constant = [f for f in e.args if self._is_constant(f)]
            rest = [f for f in e.args if not self._is_constant(f)]
            return (product(constant), sp.Mul._from_args(rest)) if constant else (sp.S.One, e)  # args are sorted
        return (e, sp.S.One) if self._is_constant(e) else (sp.S.One, e)

    def _terms(self, terms: Iterable[sp.Expr], factor: sp.Expr) -> tuple[sp.Expr, list[tuple[sp.Expr, sp.Expr]]]:
        """(constant part, [(factor, moving part)]), with the constant factors of nested sums multiplied in.

        A sum that occurs elsewhere too is not expanded but kept as one node.
        """
        constant: sp.Expr = sp.S.Zero
        moving: list[tuple[sp.Expr, sp.Expr]] = []
        for term in terms:
            own, rest = self._split(term)
            c = product([part for part in (factor, own) if part is not sp.S.One])
            if rest is sp.S.One:
                constant = c if constant is sp.S.Zero else constant + c
            elif rest.is_Add and rest not in self.repeated:
                inner_constant, inner = self._terms(rest.args, c)
                constant = constant if inner_constant is sp.S.Zero else constant + inner_constant
                moving += inner
            else:
                moving.append((c, rest))
        return constant, moving

    def _sum(self, terms: Iterable[sp.Expr], factor: sp.Expr) -> int:
        constant, moving = self._terms(terms, factor)
        moving.sort(key=lambda item: item[0].could_extract_minus_sign())
        first, *others = moving
        total = self._scaled(*first)
        for c, e in others:
            negative = c.could_extract_minus_sign()
            total = self._op("sub" if negative else "add", total, self._scaled(-c if negative else c, e))
        if constant is not sp.S.Zero:
            total = self._op("shift", total, constants=(constant,))
        return total

    def _scaled(self, factor: sp.Expr, e: sp.Expr) -> int:
        if factor is sp.S.One:
            return self.node(e)
        numerator, denominator = _quotient(e)
        if denominator is not sp.S.One and self._is_constant(numerator):
            return self._op("recip", self.node(denominator), constants=(factor * numerator,))
        return self._op("scale", self.node(e), constants=(factor,))

    def _product(self, e: sp.Expr) -> int:
        factor, rest = self._split(e)
        if rest.is_Add and rest not in self.repeated:
            return self._sum(rest.args, factor)
        if factor is not sp.S.One:
            return self._scaled(factor, rest)
        numerator, denominator = _quotient(rest)
        if denominator is not sp.S.One:
            below = self.node(denominator)
            if self._is_constant(numerator):
                return self._op("recip", below, constants=(numerator,))
            return self._op("div", self.node(numerator), below)
        factors = sorted(rest.args, key=lambda p: (not p.is_Pow, sp.default_sort_key(p)))
        return reduce(self._multiplied, map(self.node, factors))

    def _multiplied(self, a: int, b: int) -> int:
        return self._op("square", a) if a == b else self._op("mul", min(a, b), max(a, b))

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> int:
        if base == sp.E:
            return self._op("exp", self.node(exponent))
        if not self._is_constant(exponent):
            return self.node(sp.exp(exponent * sp.log(base), evaluate=False))
        if exponent == -sp.S.Half or (exponent.is_Integer and exponent.is_negative):
            return self._op("recip", self.node(base**-exponent), constants=(sp.Integer(1),))
        if exponent == sp.S.Half:
            return self._op("sqrt", self.node(base))
        if not exponent.is_Integer:
            return self._op("power", self.node(base), constants=(exponent,))
        n = int(exponent)
        if n % 2:
            return self._multiplied(self.node(base ** (n - 1)), self.node(base))
        half = self.node(base ** (n // 2))
        return self._multiplied(half, half)

    def _function(self, e: sp.Expr) -> int:
        if not e.args:
            raise ModelError(f"{e} is no state, time or number")
        inner = self.node(e.args[0])
        name = e.func.__name__
        pairs = {"sin": ("sin", "cos"), "cos": ("sin", "cos"), "sinh": ("sinh", "cosh"), "cosh": ("sinh", "cosh")}
        if name in pairs:
            first, second = pairs[name]
            key = (first, inner)
            if key not in self._interned:
                at = len(self.nodes)
                self._add(first, (inner, at + 1))
                self._add(second, (inner, at))
                self._interned[key] = at
            return self._interned[key] + (name == second)
        if name in ("tan", "tanh"):
            key = (name, inner)
            if key not in self._interned:
                at = len(self.nodes)
                one = self._constant(sp.Integer(1))
                self._add(name, (inner, at + 2))
                self._add("square", (at,))
                self._add("shift" if name == "tan" else "rsub", (at + 1,), (one,))
                self._interned[key] = at
            return self._interned[key]
        if name in ("exp", "log"):
            return self._op(name, inner)
        if name in ("asin", "acos", "atan"):
            square = self._multiplied(inner, inner)
            if name == "atan":
                return self._op("atan", inner, self._op("shift", square, constants=(sp.Integer(1),)))
            return self._op(name, inner, self._op("sqrt", self._op("rsub", square, constants=(sp.Integer(1),))))
        raise ModelError(f"no Taylor recurrence for {name}: a field is smooth in t and x; write signs as sign symbols")


def _degrees(nodes: Sequence[Node], field: Sequence[int]) -> list[int]:
    """Degree in time of each node along every solution; the degree of a state is one more than its derivative's."""
    states, before = [INFINITE] * len(nodes), [0]
    while states != before:  # states that depend on each other keep INFINITE; each round may settle another state
        before = states
        degrees: list[int] = []
        for node in nodes:
            degrees.append(states[node.args[0]] if node.op == "state" else _degree(node, degrees))
        states = [min(degrees[source] + 1, INFINITE) for source in field] + states[len(field) :]
    return degrees


def _degree(node: Node, known: Sequence[int]) -> int:
    """Degree of a node from those of earlier nodes."""
    if not node.args:
        return 1 if node.op == "clock" else 0
    first, second = known[node.args[0]], known[node.args[-1]] if node.args[-1] < len(known) else INFINITE
    match RULES[node.op]:
        case Linear():
            return max(first, second)
        case Product():
            return min(first + second, INFINITE)
        case Quotient("a", "b"):
            return first if second == 0 else INFINITE
    return 0 if first == 0 else INFINITE


def _repeated(expressions: Iterable[sp.Expr]) -> frozenset[sp.Expr]:
    """Sums that occur more than once."""
    seen: set[sp.Expr] = set()
    twice: set[sp.Expr] = set()
    for expression in expressions:
        for part in sp.preorder_traversal(sp.sympify(expression)):
            if part.is_Add:
                (twice if part in seen else seen).add(part)
    return frozenset(twice)


def _quotient(e: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Numerator and denominator as written."""
    above, below = fraction(e)
    return (product(above), product(below)) if below else (e, sp.S.One)


def _holds(expression: sp.Basic, known: dict[sp.Basic, bool]) -> bool:
    """Whether an expression contains a symbol that is True in ``known``, memoised (unlike ``Expr.has``)."""
    if expression not in known:
        known[expression] = any(_holds(part, known) for part in expression.args)
    return known[expression]
