"""Expression as operations: the common form of text and SymPy before anything is computed.

:class:`Work` is the cost of the expressions of a file, and the cache of their operations and values.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.expressions.grammar import CONSTANTS, EULER, MAX_DEPTH, MAX_NESTING, NAME, check_name
from henon_ref.text import shortened

MAX_WORK = 1_000_000
"""Largest number of characters that the expressions of a file may cost; SymPy needs 2 to 3 microseconds for each."""
OPERATION, READ, CACHED = 20, 2, 3
"""Characters that an operation costs in addition to its own, that parsing costs for each character of a text, and
that a cached text costs."""
_BINDING = {"+": 1, "-": 2, "*": 2, "/": 3, "^": 4}
"""Binding strength of an operation; an operand that binds less closely is put in parentheses."""


class Operation:
    """Number, name, or operation with arguments; two are equal if they have the same content, at any offset.

    Attributes
    ----------
    kind : str
        ``number``, ``name``, ``+`` and ``*`` (of two or more), ``-`` and ``/`` (of one: its opposite, one over it),
        ``^``, ``call``, and ``<``, ``<=``, ``>``, ``>=`` in a condition.
    value : Rational or str
        Value of a number; name; name of a function.
    arguments : tuple of Operation
    offset : int
        Offset in the text: of the beginning, or for ``/`` and ``^`` of the operator; 0 if there is no text.
    names : tuple of str
        Names in the operation, in order of appearance.
    length : int
        Characters that the operation counts for (see :class:`Work`).
    """

    __slots__ = ("_hash", "arguments", "kind", "length", "names", "offset", "value")

    def __init__(
        self,
        kind: str,
        arguments: tuple[Operation, ...] = (),
        value: sp.Rational | str = "",
        offset: int = 0,
    ) -> None:
        self.kind, self.arguments, self.value, self.offset = kind, arguments, value, offset
        own = (str(value),) if kind == "name" else ()
        self.names: tuple[str, ...] = own or tuple(dict.fromkeys(name for part in arguments for name in part.names))
        length = min(len(str(value)), 24) if kind == "number" else len(str(value))
        self.length: int = length + 1 + sum(part.length + 2 for part in arguments)
        self._hash = hash((kind, value, arguments))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Operation):
            return NotImplemented
        same = self is other or (self._hash, self.kind, self.value) == (other._hash, other.kind, other.value)
        return same and self.arguments == other.arguments

    @property
    def begin(self) -> int:
        """Offset of the first character in the text."""
        return self.arguments[0].begin if self.kind == "^" else self.offset

    def parts(self, inside: Callable[[Operation], bool] = lambda _: True) -> Iterator[Operation]:
        """Yield the operation and its parts, each before its arguments; parts that are not ``inside`` are opaque."""
        waiting = [self]
        while waiting:
            part = waiting.pop()
            yield part
            if inside(part):
                waiting += reversed(part.arguments)

    def renamed(self, names: Mapping[str, str]) -> Operation:
        """Return the operation with some names replaced."""
        if self.kind == "name":
            return Operation("name", (), names.get(str(self.value), self.value))
        return Operation(self.kind, tuple(part.renamed(names) for part in self.arguments), self.value)

    def text(self, binding: int = 0) -> str:
        """Return the operation as in a case file, in parentheses if it binds less closely than ``binding``."""
        own = _BINDING.get(self.kind, 9)
        first = self.arguments[0] if self.arguments else self
        match self.kind:
            case "number":
                found = str(self.value)
                own = 9 if found.isdigit() else 1
            case "name":
                found = str(self.value)
            case "call":
                found = f"{self.value}({', '.join(part.text() for part in self.arguments)})"
            case "-":
                found = f"-{first.text(2)}"
            case "/":
                found, own = f"1/{first.text(4)}", 2
            case "^":
                found = f"{first.text(5)}^{self.arguments[1].text(5)}"
            case "*":
                others = (
                    f"/{p.arguments[0].text(4)}" if p.kind == "/" else f"*{p.text(3)}" for p in self.arguments[1:]
                )
                found = first.text(2) + "".join(others)
            case "+":
                others = (
                    f" - {p.arguments[0].text(2)}" if p.kind == "-" else f" + {p.text(2)}" for p in self.arguments[1:]
                )
                found = first.text(1) + "".join(others)
            case _:
                found = f"{first.text()} {self.kind} {self.arguments[1].text()}"
        return f"({found})" if own < binding else found


def operation_of(expression: sp.Expr, names: Collection[str], functions: Mapping[str, int]) -> Operation:
    """Return the operations of a SymPy expression; ``names``, ``functions`` as in :func:`expressions.parser.parsed`.

    Symbols are identified by name, whatever their assumptions; a float is converted to the decimal number that it
    prints as. Sums and products keep the order in which SymPy prints them; kinks are numbered in this order.
    """
    found = _converted(expression, 0)
    for part in found.parts():
        if part.kind == "name":
            check_name(str(part.value), names, functions, 0)
        elif part.kind == "call" and part.value not in functions:
            check_name(str(part.value), (), functions, 0)
    return found


def spelled_out(expression: sp.Expr) -> str:
    """Return a SymPy expression as text of a case file."""
    return _converted(expression, 0).text()


def _converted(e: sp.Basic, depth: int) -> Operation:
    if depth > MAX_DEPTH:
        raise ExpressionError(f"nested deeper than {MAX_DEPTH}")
    if isinstance(e, sp.Symbol):
        if not NAME.fullmatch(e.name):
            raise ExpressionError(
                f"the symbol {shortened(e.name)} is not a name: a letter, then letters, digits and underscores"
            )
        return Operation("name", (), e.name)
    if e.is_Rational:
        return Operation("number", (), sp.Rational(e))
    if e.is_Float and e.is_finite:
        return Operation("number", (), sp.Rational(repr(float(e)) if e._prec == 53 else str(e)))
    if e.is_Add:
        return Operation("+", tuple(_converted(term, depth + 1) for term in e.as_ordered_terms()))
    if e.is_Mul:
        factors = [_converted(factor, depth + 1) for factor in e.as_ordered_factors()]
        return Operation("*", tuple(sorted(factors, key=lambda factor: factor.kind == "/")))
    if e.is_Pow:
        return _power(e, depth)
    if isinstance(e, sp.Heaviside):
        above = Operation(">", (_converted(e.args[0], depth + 1), Operation("number", (), sp.S.Zero)))
        one, none = (Operation("number", (), number) for number in (sp.S.One, sp.S.Zero))
        return Operation("call", (one, above, none), "piecewise")
    if isinstance(e, sp.Piecewise):
        return _chosen(list(e.args), depth)
    return _other(e, depth)


def _other(e: sp.Basic, depth: int) -> Operation:
    """Convert a function; other objects are refused by their name."""
    if e is sp.E or e is sp.pi:
        return Operation("name", (), EULER if e is sp.E else CONSTANTS[0])
    if not e.args:
        check_name(str(e), (), {}, 0)
    if isinstance(e, sp.cot):  # SymPy writes tan(x + pi/2) as -cot(x)
        return _converted(sp.cos(e.args[0]) / sp.sin(e.args[0]), depth)
    name = {sp.Abs: "abs", sp.Max: "max", sp.Min: "min"}.get(e.func, e.func.__name__)
    ordered = sorted(e.args, key=sp.default_sort_key) if isinstance(e, sp.Max | sp.Min) else e.args
    if not ordered or not all(isinstance(a, sp.Expr) for a in ordered):
        raise ExpressionError(f"{shortened(str(e))} is not an expression")
    return Operation("call", tuple(_converted(a, depth + 1) for a in ordered), name)


def _power(e: sp.Pow, depth: int) -> Operation:
    base, exponent = e.args
    below = exponent.is_Rational and exponent.is_negative
    exponent = -exponent if below else exponent
    found = _converted(base, depth + 1)
    if exponent != 1:
        found = Operation("^", (found, _converted(exponent, depth + 1)))
    return Operation("/", (found,)) if below else found


def _chosen(pairs: list[tuple[sp.Expr, sp.Basic]], depth: int) -> Operation:
    """Convert a Piecewise; a condition with And or Or becomes a choice within a choice."""
    if not pairs:
        raise ExpressionError("a Piecewise has no value if none of its conditions holds; end it with (value, True)")
    if depth > MAX_DEPTH:
        raise ExpressionError(f"nested deeper than {MAX_DEPTH}")
    (value, condition), *others = pairs
    if condition == sp.true:
        return _converted(value, depth + 1)
    if isinstance(condition, sp.And | sp.Or):
        first, *rest = sorted(condition.args, key=sp.default_sort_key)
        within = _chosen([(value, condition.func(*rest)), *others], depth + 1)
        if isinstance(condition, sp.Or):
            return _choice(_converted(value, depth + 1), first, within, depth)
        return _choice(within, first, _chosen(others, depth + 1), depth)
    return _choice(_converted(value, depth + 1), condition, _chosen(others, depth + 1), depth)


def _choice(value: Operation, condition: sp.Basic, otherwise: Operation, depth: int) -> Operation:
    if not isinstance(condition, sp.StrictLessThan | sp.LessThan | sp.StrictGreaterThan | sp.GreaterThan):
        raise ExpressionError(f"a condition must compare with <, <=, > or >=, not {shortened(str(condition))}")
    sides = tuple(_converted(side, depth + 1) for side in (condition.lhs, condition.rhs))
    return Operation("call", (value, Operation(condition.rel_op, sides), otherwise), "piecewise")


def checked_nesting(operation: Operation) -> Operation:
    """Return an operation after checking that functions and powers nest no deeper than ``MAX_NESTING``."""
    waiting = [(operation, 0)]
    while waiting:
        part, level = waiting.pop()
        level += part.kind in ("call", "^")
        if level > MAX_NESTING:
            raise ExpressionError(f"functions and powers nest deeper than {MAX_NESTING}", part.begin)
        waiting += [(inner, level) for inner in part.arguments]
    return operation


@dataclass
class Work:
    """Work done for one file; every expression is charged to it, and looked up in it first."""

    done: int = 0
    files: int = 1
    """Number of files whose work is allowed: a system from Python may be larger than one of a file."""
    known: dict[Hashable, Any] = field(default_factory=dict)
    """Cache of operations, of the values of expressions and their parts, of checks made, and of what is built."""

    def charge(self, characters: int, offset: int) -> None:
        """Charge work before it is done; raises ExpressionError if it exceeds the limit."""
        self.done += characters
        most = self.files * MAX_WORK
        if self.done > most:
            raise ExpressionError(
                "up to here the expressions of the file are too much work: each text, evaluated with the values of the "
                f"parameters and on both sides of the signs, costs its length, and {most} characters are allowed; make "
                "the expressions, or the readings, shorter or fewer",
                offset,
            )


def key_of(kind: str, part: Operation, names: Mapping[str, sp.Expr]) -> Hashable:
    """Return the key of the value of a part of an expression: the part, and the meanings of its names."""
    return kind, part, tuple(names.get(name) for name in part.names)


def overlaid(over: Mapping[str, sp.Expr], names: Mapping[str, sp.Expr]) -> Mapping[str, sp.Expr]:
    """Return names of which ``over`` replaces some; nothing is copied, as there may be thousands."""
    return ChainMap(over, names)  # type: ignore[arg-type]  # only read


def names_in(written: str | sp.Expr) -> list[str]:
    """Return the names that occur in a text or in a SymPy expression, each once."""
    if isinstance(written, str):
        return list(dict.fromkeys(re.findall(r"[^\W\d]\w*", written)))
    return sorted({symbol.name for symbol in written.free_symbols})
