"""The least and the largest value of an expression along a run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
import sympy as sp

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.system import System
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.runs import Columns, Runs
from henon_ref.sweeps.step_extremes import Pieces, along_steps, joined_pieces, pieces_of
from henon_ref.taylor.tape import TIME

KEPT = 16
"""Expressions that are kept once they are read: checked, and needed again for each chunk."""
MOST_NUMBERS = 1 << 22
"""Coefficients of steps that are in memory at one time, but for those of one run."""


@lru_cache(maxsize=KEPT)
def _read(system: System, text: str) -> sp.Expr:
    return system.expression(text, f"the expression {text[:60]!r}")


@dataclass(frozen=True)
class Extremes(Observation):
    """See :func:`henon_ref.sweeps.observe.extremes`.

    Each run is done once more by itself, with its steps (:mod:`henon_ref.sweeps.step_extremes`).
    """

    of: str
    after: float | None = None
    name: str | None = None
    kind: ClassVar[str] = "extremes"

    def names(self, system: System) -> tuple[list[str], dict[str, list[str]]]:
        return [f"min_{self.name or self.of}", f"max_{self.name or self.of}"], {}

    def check(self, system: System) -> None:
        if not self._expression(system).free_symbols & {TIME, *system.model.states}:
            raise ArgumentError(f"the extremes of {self.of[:60]!r}: it never changes, it holds no state and no t")

    def _expression(self, system: System) -> sp.Expr:
        return _read(system, self.of)

    def columns(self, runs: Runs) -> Columns:
        steps = along_steps(runs.system.model.states, self._expression(runs.system))
        after = -np.inf if self.after is None else self.after
        least, largest = np.full(len(runs), np.nan), np.full(len(runs), np.nan)
        parts: list[Pieces] = []

        def search() -> None:
            if parts:
                pieces = joined_pieces(parts, after)
                own = np.unique(pieces.run)
                found = steps.extremes(pieces, runs.parameters, len(runs))
                least[own], largest[own] = found[0][own], found[1][own]
                parts.clear()

        kept = 0
        for k, point in enumerate(runs.arguments()):
            try:
                solution = simulate(runs.system, **point).sol
            except HenonRefError:  # the point's row says why
                continue
            assert solution is not None
            parts.append(pieces_of(k, solution, after))
            kept += parts[-1].states.size
            if kept > MOST_NUMBERS:
                search()
                kept = 0
        search()
        name = self.name or self.of
        return {f"min_{name}": least, f"max_{name}": largest}
