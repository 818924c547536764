"""One wrong run, as the rules on causes want it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from henon_ref import registry
from henon_ref.rows import RunRow, TransitionRow, number

IN_FRONT = 1000.0
"""Tolerances that a run's error stays below where nothing locates its end: BDF's is 200 of them at 1e-12."""


@dataclass(frozen=True)
class Seen:
    """One wrong run, as the rules want it."""

    run: RunRow
    transitions: Sequence[TransitionRow]

    @property
    def solver(self) -> str:
        """The solver's name without its restart and variant."""
        return registry.base_name(self.run.solver).partition("+")[0]

    @property
    def restart(self) -> str:
        """How the library was restarted."""
        return registry.restart_of(self.run.solver)

    @property
    def reason(self) -> str:
        """The solver's own words."""
        return self.run.status_reason or ""

    @property
    def missed_pairs(self) -> list[list[TransitionRow]]:
        """Groups of transitions that are missed in a row, where each group leads back to where it began.

        Each surface is crossed an even number of times in it, and there and back again. Empty where something else went
        wrong, too: then it is not known what the run did in between.
        """
        if self.run.status != "wrong" or number(self.run.spurious) != 0:
            return []
        groups: list[list[TransitionRow]] = [[]]
        for row in self.transitions:
            if row.outcome == "missed":
                groups[-1].append(row)
            elif groups[-1] and row.outcome != "touch":
                groups.append([])
        groups = [group for group in groups if group]
        whole = all(
            group[0].from_mode == group[-1].to_mode
            and all(count % 2 == 0 for count in Counter(row.surface for row in group).values())
            for group in groups
        )
        return groups if whole else []

    @property
    def first_missed(self) -> list[TransitionRow]:
        """Transitions missed first, up to where the mode is again as before them: what comes behind follows from them.

        Empty where what comes before them is not right, where the mode does not become so before the next transition
        of the run, and where they begin within a mean step of a transition of the same surface, whose restart may have
        lost them.
        """
        if self.run.status != "wrong" or " missed, " not in self.reason:
            return []
        rows = [row for row in self.transitions if row.outcome != "touch"]
        first = next((k for k, row in enumerate(rows) if row.outcome != "matched"), len(rows))
        group = list(takewhile(lambda row: row.outcome == "missed", rows[first:]))
        until = next((k for k, row in enumerate(group, 1) if row.to_mode == group[0].from_mode), 0)
        step = number(self.run.end_time_s) / number(self.run.steps)
        left = [number(row.reference_time_s) for row in rows[:first] if group and row.surface == group[0].surface]
        if not until or (left and not number(group[0].reference_time_s) - left[-1] > step):
            return []
        return group[:until]

    @property
    def stopped_between(self) -> list[TransitionRow]:
        """Two transitions of a surface that are missed first, where the run was ended between them.

        Within a mean step of each other: an event of another surface stopped the library, and the guard was negative.
        """
        if self.run.status != "failed" or "was stepped over" not in self.reason or not self.right_so_far:
            return []
        missed = [row for row in self.transitions if row.outcome == "missed"]
        own = [row for row in missed if row.surface == missed[0].surface][:2]
        times = [number(row.reference_time_s) for row in own]
        end, step = number(self.run.end_time_s), number(self.run.end_time_s) / max(number(self.run.steps), 1.0)
        return own if len(own) == 2 and times[0] <= end <= times[1] and times[1] - times[0] < step else []

    @property
    def depth(self) -> float:
        """Greatest depth of the surface function within the pairs that are missed [unit of the surface]."""
        depths = [row.graze_distance for group in self.missed_pairs for row in group]
        return max((depth for depth in depths if depth is not None), default=float("nan"))

    @property
    def right_so_far(self) -> bool:
        """What was found before the run ended is right."""
        return number(self.run.spurious) == 0

    def misses_at(self, time: float) -> bool:
        """Whether the first transition that is missed is where the run ended [s]: a pole behind its surface."""
        roots = [row.reference_time_s for row in self.transitions if row.outcome == "missed"][:1]
        return any(root is not None and abs(root - time) <= IN_FRONT * number(self.run.rtol) for root in roots)
