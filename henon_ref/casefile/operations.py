"""Expression as operations: the common form of text and SymPy before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import sympy as sp

from henon_ref.casefile.grammar import MAX_NESTING
from henon_ref.errors import ExpressionError

LONGEST_NUMBER = 24
"""Largest number of characters that a number counts for."""
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
        Characters that the operation counts for (see :mod:`henon_ref.casefile.work`).
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
        length = min(len(str(value)), LONGEST_NUMBER) if kind == "number" else len(str(value))
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
