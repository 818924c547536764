"""What the expressions of one case file cost to read, and what has been read of them."""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

import sympy as sp

from henon_ref.errors import ExpressionError

MAX_WORK = 300_000
"""Characters of operations that are worked out for one file; a text that stands in it again costs nothing."""
IRRATIONAL = 4
"""A number that is not rational costs so many times as much: its digits are computed."""

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


@dataclass
class Work:
    """The work done for one file; every reading of an expression is counted here and looked up here first."""

    done: int = 0
    values: dict[Hashable, sp.Expr] = field(default_factory=dict)
    """What a text stands for, by the text and what its names stand for."""

    def charge(self, characters: int, offset: int) -> None:
        """Count work before it is done.

        Raises
        ------
        ExpressionError
            Where it is more than a file may cost.
        """
        self.done += characters
        if self.done > MAX_WORK:
            raise ExpressionError(
                f"with this the file's expressions are more work than {MAX_WORK} characters of operations, the most that "
                "is allowed (each with the values of parameters and signs; a text that stands in the file again does not "
                "count again); make them shorter or fewer",
                offset,
            )


def key_of(kind: str, text: str, names: Mapping[str, sp.Expr]) -> Hashable:
    """What decides the value of a text: itself, and what the names in it stand for."""
    return kind, text, tuple((name, names.get(name)) for name in dict.fromkeys(_NAME.findall(text)))
