"""The runs that a study is made of, by the campaign that makes those of the reports; two runs compared."""

from __future__ import annotations

import math
from collections.abc import Sequence

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.campaign import compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import Observer
from henon_ref.harness.rows import RunRow
from henon_ref.trajectory import Trajectory


def rows_of(cases: Sequence[Case], options: Options, observer: Observer) -> dict[str, list[RunRow]]:
    """Run the cases; the rows of each one's runs (columns of ``runs.csv``) by its name, in the order of the cases."""
    found: dict[str, list[RunRow]] = {case.name: [] for case in cases}

    def deliver(comparison: Comparison) -> None:
        found[comparison.case.name] = comparison.run_rows

    compare_all(cases, options, deliver, observer=observer)
    return found


def largest_time_difference(one: Trajectory, other: Trajectory) -> float:
    """Greatest difference of a transition's time in two runs [s]; infinite where their sequences differ."""
    if [t.to_mode for t in one.transitions] != [t.to_mode for t in other.transitions]:
        return math.inf
    return max((abs(a.time - b.time) for a, b in zip(one.transitions, other.transitions, strict=True)), default=0.0)
