"""What a scene wants of its parameters: bounds on expressions in them, each checked at the values of the file."""

from __future__ import annotations

from dataclasses import dataclass, field

import sympy as sp

from henon_ref.casefile.source import Path, Source
from henon_ref.modes.exact_numbers import exact_sign


@dataclass
class Requirements:
    """Collects the expressions that must be larger than 0, or not smaller, and checks their values."""

    source: Source
    expressions: list[sp.Expr] = field(default_factory=list)
    """Checked; where new values of the parameters make all of these larger than 0, the scene allows them."""

    def positive(self, expression: sp.Expr, value: sp.Expr, path: Path, what: str) -> None:
        """Want an expression to be larger than 0.

        Raises
        ------
        CaseError
            At ``path``, where its value is not.
        """
        self._want(expression, path, f"{what} must be larger than 0", exact_sign(value) > 0)

    def nonnegative(self, expression: sp.Expr, value: sp.Expr, path: Path, message: str) -> None:
        """Want an expression to be 0 or larger.

        Raises
        ------
        CaseError
            At ``path``, with the message, where its value is not.
        """
        self._want(expression, path, message, exact_sign(value) >= 0)

    def _want(self, expression: sp.Expr, path: Path, message: str, met: bool) -> None:
        if not met:
            raise self.source.error(path, message)
        self.expressions.append(expression)
