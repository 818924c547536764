"""What a comparison comes to, over all its cases: a line a solver at its tightest settings, and what is not right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from henon_ref.report.text.formats import setting
from henon_ref.rows import RunRow
from henon_ref.score.gate import demand
from henon_ref.score.standing import SolverLine, standings, tightest

NOT_JUDGED = ("not run", "not judged")
"""Verdicts on what is no solver's fault, and yet no answer."""


@dataclass(frozen=True)
class Failing:
    """What keeps a solver from being right, and where."""

    solver: str
    status: str
    reason: str
    where: tuple[str, ...]
    """``case reading at setting``."""


@dataclass
class EndTable:
    """Collects the rows of finished cases; of each reading and solver the one at the tightest setting."""

    rows: list[RunRow] = field(default_factory=list)

    def add(self, rows: Sequence[RunRow]) -> None:
        """Take the rows of a finished case."""
        self.rows += tightest(rows)

    def solvers(self) -> list[SolverLine]:
        """A line a solver, the best first."""
        return standings(self.rows)

    def failing(self) -> list[Failing]:
        """What is wrong by a solver's own fault, and what has no answer, the same ones of a solver together."""
        found: dict[tuple[str, str, str], list[str]] = {}
        for row in self.rows:
            solver, status, reason = row.solver, row.status, row.status_reason or ""
            if demand(solver, [row]).failures or row.verdict in NOT_JUDGED:
                where = f"{row.case} {row.reading} at {setting(row.rtol, row.step_s)}"
                found.setdefault((solver, status, reason), []).append(where)
        return [Failing(*key, tuple(where)) for key, where in found.items()]

    def document(self) -> dict[str, Any]:
        """Both as they stand in a JSON document; a missing value is null."""
        return {
            "solvers": [asdict(line) for line in self.solvers()],
            "failing": [asdict(failing) for failing in self.failing()],
        }
