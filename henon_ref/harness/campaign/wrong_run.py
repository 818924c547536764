"""A wrong run and its transitions, as the patterns of causes see them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import groupby, takewhile

from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow, TransitionRow, number

Rows = Sequence[TransitionRow]


class WrongRun:
    """One wrong run and its transitions in order, without touches."""

    def __init__(self, run: RunRow, transitions: Rows) -> None:
        self.run = run
        self.rows = [row for row in transitions if row.outcome != "touch"]
        self.right = list(takewhile(lambda row: row.outcome == "matched", self.rows))
        """Transitions before the first wrong one."""
        self.matched, self.missed, self.spurious = (
            [row for row in self.rows if row.outcome == what] for what in ("matched", "missed", "spurious")
        )
        self.end, self.step, self.steps = number(run.end_time_s), number(run.step_s), number(run.steps)
        self.solver = registry.base_name(run.solver).partition("+")[0]
        """Name without restart and variant."""

    def found(self, pattern: str) -> re.Match[str] | None:
        """Search the reason of the run for a regular expression."""
        return re.search(pattern, self.run.status_reason or "")

    def misses_at(self, time: float) -> bool:
        """Check whether the first missed transition is at a time [s], within the error of an unlocated end.

        The error of an end that is not located as an event is below 1000 rtol; BDF reaches 200 at rtol 1e-12.
        """
        within = 1000.0 * number(self.run.rtol)
        return any(abs(exact_time(row) - time) <= within for row in self.missed[:1])

    @property
    def missed_pairs(self) -> list[Rows]:
        """Groups of consecutive missed transitions after which the mode is the same as before the group.

        Each surface is crossed an even number of times within a group. Empty if the run is wrong in another way, too,
        because its path between the transitions is then unknown.
        """
        groups = [list(own) for what, own in groupby(self.rows, lambda row: row.outcome) if what == "missed"]
        whole = all(
            group[0].from_mode == group[-1].to_mode
            and all(count % 2 == 0 for count in Counter(row.surface for row in group).values())
            for group in groups
        )
        return [*groups] if whole and self.run.status == "wrong" and self.run.spurious == 0 else []

    @property
    def first_missed(self) -> Rows:
        """First missed transitions, up to the return to the mode before them; later errors follow from these.

        Empty if the mode does not return before the next transition of the run. Also empty if the group begins within
        a mean step after a transition of the same surface, because the restart there may have lost it.
        """
        group = list(takewhile(lambda row: row.outcome == "missed", self.rows[len(self.right) :]))
        until = next((k for k, row in enumerate(group, 1) if row.to_mode == group[0].from_mode), 0)
        if not until or self.run.status != "wrong" or not self.found(" missed, "):
            return []
        left = [exact_time(row) for row in self.right if row.surface == group[0].surface]
        return group[:until] if not left or exact_time(group[0]) - left[-1] > self.end / self.steps else []

    @property
    def stopped_between(self) -> Rows:
        """First two missed transitions of a surface, if the run failed between them and they lie within a mean step.

        An event of another surface then stopped the library between the two roots, where the guard is negative.
        """
        own = [row for row in self.missed if row.surface == self.missed[0].surface][:2]
        if self.run.status != "failed" or not self.found("was stepped over") or self.run.spurious or len(own) < 2:
            return []
        first, last = map(exact_time, own)
        return own if first <= self.end <= last and last - first < self.end / max(self.steps, 1.0) else []


def exact_time(row: TransitionRow) -> float:
    """Time of a transition of the exact run [s]."""
    return number(row.reference_time_s)
