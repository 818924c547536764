"""What the expressions of one case file cost to read, and what has been read of them."""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from henon_ref.errors import ExpressionError

MAX_WORK = 1_000_000
"""Characters that the expressions of one file may count; SymPy takes two microseconds or three for each."""
OPERATION, SCAN, CACHED = 20, 2, 3
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
    """What a text stands for, by the text and what its names stand for."""

    texts: dict[Hashable, Any] = field(default_factory=dict)
    """What is known of a text whatever its names stand for."""
    built: dict[Hashable, tuple[object, Any]] = field(default_factory=dict)
    """What is built of parts of the file, by these parts, which are kept beside it."""

    def charge(self, characters: int, offset: int) -> None:
        """Count work before it is done.

        Raises
        ------
        ExpressionError
            Where it is more than a file may cost.
        """
        self.done += characters
        most = self.files * MAX_WORK
        if self.done > most:
            raise ExpressionError(
                "with this the expressions of the file are too much work: each text, worked out with the values of the "
                f"parameters and both sides of the signs, counts by its length, and {most} characters are "
                "allowed; make the expressions, or the readings, shorter or fewer",
                offset,
            )


def key_of(kind: str, text: str, names: Mapping[str, sp.Expr]) -> Hashable:
    """What decides the value of a text: itself, and what the names in it stand for."""
    return kind, text, tuple((name, names.get(name)) for name in names_in(text))


def overlaid(over: Mapping[str, sp.Expr], names: Mapping[str, sp.Expr]) -> Mapping[str, sp.Expr]:
    """Names, some of them with another meaning; nothing is copied, as there may be thousands."""
    return ChainMap(over, names)  # type: ignore[arg-type]  # only read


def names_in(text: str) -> list[str]:
    """Names that may stand in a text, each once."""
    return list(dict.fromkeys(_NAME.findall(text)))
