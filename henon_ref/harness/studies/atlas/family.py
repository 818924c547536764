"""Families of readings that differ in one distance, and the outcome of a run of one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import sympy as sp

from henon_ref.casefile.case import Case
from henon_ref.harness.rows import NOT_RUN, RunRow
from henon_ref.harness.studies.restart_tables import ending
from henon_ref.modes.system import FilippovSystem

TOLERANCES = tuple(10.0**-k for k in range(3, 14))
"""Relative tolerances of the atlas."""
FAMILY = "family"
"""Tag of a case whose readings differ in one parameter."""
KINDS = {
    "two-roots": "distance of the two roots [s]",
    "grazing": "distance from the graze, in units of the surface",
}
"""Tags of the families that the atlas shows, and what their parameter is; the first that fits counts."""

Outcome = Literal["right", "missed", "spurious", "both", "status", "failed"]
OUTCOMES: dict[Outcome, str] = {
    "right": "found right",
    "missed": "missed",
    "spurious": "spurious",
    "both": "missed and spurious",
    "status": "ended otherwise than the exact run",
    "failed": "failed or out of time",
}
"""What may come of a run, in words."""


@dataclass(frozen=True)
class Family:
    """A case whose readings differ in one parameter, the distance."""

    case: Case
    """With the family's readings alone."""
    meaning: str
    """What the distance is, with its unit."""
    distances: dict[str, float]
    """Reading -> distance; negative on the side where the surface is not reached."""

    @property
    def order(self) -> list[str]:
        """Readings by distance, from far outside to far inside."""
        return sorted(self.distances, key=self.distances.__getitem__)


def family_of(case: Case) -> Family | None:
    """The family that a case is; None where it is none, or its readings differ in more than one parameter.

    Readings with other equations than the first one's are not of the family.
    """
    first = case.readings[0]
    tags = set(first.tags)
    meaning = next((words for tag, words in KINDS.items() if tag in tags), None)
    if FAMILY not in tags or meaning is None:
        return None
    alike = [r for r in case.readings if _equations(r.problem.system) == _equations(first.problem.system)]
    values = [reading.problem.system.parameters for reading in alike]
    differing = [symbol for symbol in values[0] if len({own.get(symbol) for own in values}) > 1]
    if len(differing) != 1:
        return None
    own = replace(case, readings=tuple(alike))
    distances = {r.name: float(values[differing[0]]) for r, values in zip(alike, values, strict=True)}
    return Family(own, meaning, distances)


def _equations(system: FilippovSystem) -> tuple[tuple[sp.Expr, ...], ...]:
    return system.surfaces, system.field


def outcome_of(row: RunRow) -> Outcome | None:
    """What came of a run; None for one that was not made."""
    if row.status in NOT_RUN:
        return None
    end = ending(row)
    if end == "right" or end == "failed":
        return end
    if row.missed and row.spurious:
        return "both"
    return "missed" if row.missed else "spurious" if row.spurious else "status"
