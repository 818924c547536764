"""Initial-value problems of a Filippov system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy as sp

from henon_ref.filippov.system import FilippovSystem


@dataclass(frozen=True)
class Problem:
    """One initial-value problem of a Filippov system, in exact numbers.

    Every number is an exact SymPy number (``Rational(1, 10)``, ``sqrt(3)/9``); a solver rounds it once.
    """

    system: FilippovSystem
    """The system; its ``parameters`` hold the exact values."""
    start: sp.Expr
    """Initial time [s]."""
    initial: tuple[sp.Expr, ...]
    """Initial state, in the order of ``system.states``."""
    until: sp.Expr
    """Horizon: the run ends here [s]."""
    initial_mode: Mapping[int, int] = field(default_factory=dict)
    """Surface index -> -1, 0 or +1, for a start on a surface that the fields leave open."""
