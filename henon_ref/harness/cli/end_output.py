"""What the comparison says on standard output: a line a finished case, the table at the end, the report's path."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import demand
from henon_ref.harness.score.standing import SolverLine, standings, tightest
from henon_ref.harness.table import Table, count, digits, duration, significant
from henon_ref.text import listed, message

HEADINGS = ("solver", "right of judged", "digits", "time", "times as long")
MOST_FAILING = 24
"""Lines on what is not right; the JSON document and the reports have all."""
MOST_PLACES = 3
"""Readings that one such line names."""
NOTE = (
    "At the tightest setting. Over the readings in which a solver is right: of its digits the fewest, of its time the "
    "median, of its times as long as the fastest the geometric mean."
)


def case_line(name: str, rows: Sequence[RunRow], report: Path) -> str:
    """What is said of a finished case."""
    right = sum(row.verdict == "right" for row in rows)
    return message(f"{name}: {count(len(rows), 'row')}, {right} right: {report}")


def print_end(table: EndTable, *, readings: int) -> None:
    """Print the table, and below it what is not right and why."""
    print(Table(HEADINGS, "lrrrr", _cells(table)).text)
    if readings > 1:
        print(NOTE)
    failing = table.failing()
    for found in failing[:MOST_FAILING]:
        print(failing_line(found))
    if len(failing) > MOST_FAILING:
        print(f"and {len(failing) - MOST_FAILING} more, see the reports")
    absent = {row.solver for row in table.rows if row.status == "unavailable"}
    if missing := sorted(set(map(registry.missing_package, absent)) - {""}):
        print(f"to install what is missing: {shlex.join(['pip', 'install', *missing])}")


def failing_line(found: Failing) -> str:
    """What keeps a solver from being right, and where, in one line."""
    reason = f" ({found.reason.rstrip('.')})" if found.reason else ""
    return message(f"{found.solver}: {found.status}{reason}: {listed(found.where, MOST_PLACES)}")


def document(table: EndTable, report: Path, **more: Any) -> str:
    """The JSON document: the table, the report's path, and what else the caller knows."""
    return json.dumps({**table.document(), "report": str(report), **more}, indent=1)


def _cells(table: EndTable) -> list[tuple[str, ...]]:
    return [
        (
            line.solver,
            f"{line.right} of {line.judged}" if line.judged else "not judged",
            "" if line.digits is None else digits(line.digits),
            duration(line.time_s),
            "" if line.times_as_long is None else significant(line.times_as_long),
        )
        for line in table.solvers()
    ]


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
                where = f"{row.case} {row.reading} at {row.setting}"
                found.setdefault((solver, status, reason), []).append(where)
        return [Failing(*key, tuple(where)) for key, where in found.items()]

    def document(self) -> dict[str, Any]:
        """Both as they stand in a JSON document; a missing value is null."""
        return {
            "solvers": [asdict(line) for line in self.solvers()],
            "failing": [asdict(failing) for failing in self.failing()],
        }
