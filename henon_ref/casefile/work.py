"""Cost of reading the expressions of a case file, and cache of their values."""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from henon_ref.casefile.operations import Operation
from henon_ref.errors import ExpressionError

MAX_WORK = 1_000_000
"""Largest number of characters that the expressions of a file may cost; SymPy needs 2 to 3 microseconds for each."""
OPERATION, READ, CACHED = 20, 2, 3
"""Characters that an operation costs in addition to its own, that parsing costs for each character of a text, and
that a cached text costs."""

_NAME = re.compile(r"[^\W\d]\w*")


@dataclass
class Work:
    """Work done for one file; every expression is charged to it, and looked up in it first."""

    done: int = 0
    files: int = 1
    """Number of files whose work is allowed: a system from Python may be larger than one of a file."""
    values: dict[Hashable, sp.Expr] = field(default_factory=dict)
    """Cache of the values of expressions and their parts, by their operations and the meanings of their names."""
    known: dict[Hashable, Any] = field(default_factory=dict)
    """Cache of operations of texts and of SymPy, of kinks, and of checks made."""
    built: dict[Hashable, tuple[object, Any]] = field(default_factory=dict)
    """Cache of what is built from parts of the file, by these parts; they are kept alive with it."""

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
        return list(dict.fromkeys(_NAME.findall(written)))
    return sorted({symbol.name for symbol in written.free_symbols})
