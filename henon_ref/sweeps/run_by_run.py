"""Observations of a run by itself: Lyapunov exponents, and functions of one's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from henon_ref.analysis.lyapunov import lyapunov_exponents
from henon_ref.errors import HenonRefError
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.simulation.system import System
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.runs import Columns, Runs


@dataclass(frozen=True)
class Lyapunov(Observation):
    """See :func:`henon_ref.sweeps.observe.lyapunov`."""

    span: float
    discard: float = 0.0
    kind: ClassVar[str] = "lyapunov"

    def names(self, system: System) -> tuple[list[str], list[str]]:
        return ["lyapunov"], []

    def columns(self, runs: Runs) -> Columns:
        found = np.full(len(runs), np.nan)
        for k, point in enumerate(runs.arguments()):
            del point["until"]
            try:
                spectrum = lyapunov_exponents(runs.system, span=self.span, discard=self.discard, **point)
            except HenonRefError:  # such as two surfaces that change at one instant: there is nothing to tell
                continue
            if spectrum.status == "ok":
                found[k] = spectrum.exponents[0]
        return {"lyapunov": found}


@dataclass(frozen=True)
class Function(Observation):
    """See :func:`henon_ref.sweeps.observe.function`."""

    of: Callable[[Solution], Any]
    name: str
    dense_output: bool = False
    kind: ClassVar[str] = "function"

    def columns(self, runs: Runs) -> Columns:
        rows = []
        for point in runs.arguments():
            value = self.of(simulate(runs.system, dense_output=self.dense_output, **point))
            rows.append({str(k): v for k, v in value.items()} if isinstance(value, Mapping) else {self.name: value})
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> Any:
    """Numbers as doubles, with NaN for None; anything else as text."""
    if all(v is None or isinstance(v, Real | np.generic) for v in values):
        return np.array([np.nan if v is None else float(v) for v in values])
    return np.array([None if v is None else str(v) for v in values], dtype=object)
