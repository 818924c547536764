"""An expression as operations: the one form that text and SymPy are read into before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import sympy as sp

from henon_ref.casefile.grammar import MAX_NESTING
from henon_ref.errors import ExpressionError

LONGEST_NUMBER = 24
"""Characters that a number counts for at most."""
_BINDING = {"+": 1, "-": 2, "*": 2, "/": 3, "^": 4}
"""How closely an operation binds: what binds less than it stands in parentheses."""


class Operation:
    """A number, a name, or an operation with its arguments; equal to one that says the same, wherever it stands.

    Attributes
    ----------
    kind : str
        ``number``, ``name``, ``+`` and ``*`` (of two or more), ``-`` and ``/`` (of one: its opposite, one over it),
        ``^``, ``call``, and ``<``, ``<=``, ``>``, ``>=`` in a condition.
    value : Rational or str
        Of a number; the name; the function's.
    arguments : tuple of Operation
    offset : int
        Where it begins in its text, or of ``/`` and ``^`` where the operator stands; 0 where there is no text.
    names : tuple of str
        Those in it, in order of appearance.
    length : int
        Characters that it counts for.
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
        """Where it begins in its text."""
        return self.arguments[0].begin if self.kind == "^" else self.offset

    def parts(self, inside: Callable[[Operation], bool] = lambda _: True) -> Iterator[Operation]:
        """It and all that stands in it, each before its arguments; not what is in a part that is not ``inside``."""
        waiting = [self]
        while waiting:
            part = waiting.pop()
            yield part
            if inside(part):
                waiting += reversed(part.arguments)

    def renamed(self, names: Mapping[str, str]) -> Operation:
        """The same with other names."""
        if self.kind == "name":
            return Operation("name", (), names.get(str(self.value), self.value))
        return Operation(self.kind, tuple(part.renamed(names) for part in self.arguments), self.value)

    def text(self, binding: int = 0) -> str:
        """It in the words of a case file, in parentheses where it binds less closely than it has to."""
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
    """An operation in which functions and powers nest no deeper than ``MAX_NESTING``."""
    waiting = [(operation, 0)]
    while waiting:
        part, level = waiting.pop()
        level += part.kind in ("call", "^")
        if level > MAX_NESTING:
            raise ExpressionError(f"functions and powers nest deeper than {MAX_NESTING}", part.begin)
        waiting += [(inner, level) for inner in part.arguments]
    return operation
