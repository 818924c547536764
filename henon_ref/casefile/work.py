"""What the expressions of one case file cost to read, and what has been read of them."""

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
"""Characters that the expressions of one file may count; SymPy takes two microseconds or three for each."""
OPERATION, READ, CACHED = 20, 2, 3
"""An operation counts as so many characters besides its own, taking a text apart as so many for each of it, and a text
that is known already as so many."""

_NAME = re.compile(r"[^\W\d]\w*")


@dataclass
class Work:
    """The work done for one file; every reading of an expression is counted here and looked up here first."""

    done: int = 0
    files: int = 1
    """As many files' work is allowed: a system from Python may be larger than one of a file."""
    values: dict[Hashable, sp.Expr] = field(default_factory=dict)
    """What an expression stands for, or a part of it, by its operations and what its names stand for."""
    known: dict[Hashable, Any] = field(default_factory=dict)
    """What else is known: operations of texts and of SymPy, kinks of operations, and what has been checked."""
    built: dict[Hashable, tuple[object, Any]] = field(default_factory=dict)
    """What is built of parts of the file, by these parts, which are kept beside it."""

    def charge(self, characters: int, offset: int) -> None:
        """Count work before it is done."""
        self.done += characters
        most = self.files * MAX_WORK
        if self.done > most:
            raise ExpressionError(
                "with this the expressions of the file are too much work: each text, worked out with the values of the "
                f"parameters and both sides of the signs, counts by its length, and {most} characters are "
                "allowed; make the expressions, or the readings, shorter or fewer",
                offset,
            )


def key_of(kind: str, part: Operation, names: Mapping[str, sp.Expr]) -> Hashable:
    """What decides the value of a part of an expression: itself, and what the names in it stand for."""
    return kind, part, tuple(names.get(name) for name in part.names)


def overlaid(over: Mapping[str, sp.Expr], names: Mapping[str, sp.Expr]) -> Mapping[str, sp.Expr]:
    """Names, some of them with another meaning; nothing is copied, as there may be thousands."""
    return ChainMap(over, names)  # type: ignore[arg-type]  # only read


def names_in(written: str | sp.Expr) -> list[str]:
    """Names that may stand in a text, or in an expression of SymPy, each once."""
    if isinstance(written, str):
        return list(dict.fromkeys(_NAME.findall(written)))
    return sorted({symbol.name for symbol in written.free_symbols})
