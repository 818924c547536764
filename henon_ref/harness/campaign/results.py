"""What a campaign knows of a case: truths, rows, samples, and what is still to come."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from henon_ref.casefile.case import Case, Reading
from henon_ref.harness import registry
from henon_ref.harness.campaign.journal import Journal
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.campaign.settings import Setting
from henon_ref.harness.campaign.truth_job import Statement
from henon_ref.harness.score.reference import Expected
from henon_ref.trajectory import Samples

Slot = tuple[str, str, Setting]
"""Reading, solver, setting: a row's place."""


@dataclass(eq=False)
class ReadingResult:
    """What is known of one reading besides the runs' rows."""

    reading: Reading
    statement: Statement
    samples: Samples | None = None
    """The motion on a grid of times, where figures are asked for and a solver could sample."""
    sampled_by: str = ""
    drawn: bool = False
    """Whether its figures have been asked for."""
    figures: dict[str, bytes] = field(default_factory=dict)
    """File name -> SVG."""
    figures_reason: str = ""
    """Why figures are missing."""

    @property
    def expected(self) -> Expected | None:
        """What its runs are scored against; None where no truth could be had."""
        return self.statement.expected


@dataclass
class CaseState:
    """A case at work."""

    case: Case
    results: dict[str, ReadingResult]
    journal: Journal | None
    rows: dict[Slot, Record] = field(default_factory=dict)
    keys: dict[Slot, str] = field(default_factory=dict)
    """Journal key of every row that is to be made."""
    pending: Counter[str] = field(default_factory=Counter)
    """Reading -> sequences of jobs that are not over."""
    delivered: bool = False

    def keep(self, slot: Slot, record: Record) -> None:
        """A row is finished: on the disk first, if there is a journal."""
        if self.journal is not None:
            self.journal.add(self.keys[slot], record)
        self.rows[slot] = record

    def records(self, reading: str | None = None) -> list[Record]:
        """Rows so far, of one reading or all, by reading, solver and setting."""
        order = [r.name for r in self.case.readings]
        names = list(registry.names())

        def place(slot: Slot) -> tuple[int, int, str, float]:
            name, solver, setting = slot
            base = registry.base_name(solver)
            rank = names.index(base) if base in names else len(names)
            return order.index(name), rank, solver, -(setting.rtol or setting.step or 0.0)

        return [self.rows[slot] for slot in sorted(self.rows, key=place) if reading in (None, slot[0])]
