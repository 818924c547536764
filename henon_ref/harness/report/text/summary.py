"""The table that a reading's report begins with: a row a solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.report.text.formats import digits, setting, significant
from henon_ref.harness.report.text.ranking import by_solver, most_accurate
from henon_ref.harness.report.text.tables import samples_of, timed
from henon_ref.harness.rows import NOT_RUN, RunRow
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown

HEADINGS = ("solver", "digits", "time", "times as long", "setting", "right", "note")
EXPLAINED = (
    "Shown is the most accurate right run of each solver, its time set against the shortest one in the table. Right: "
    "at how many of its settings a solver is."
)
"""Below a table in which times are compared."""


def solver_table(comparison: Comparison, result: ReadingResult) -> Table:
    """A row a solver: its most accurate right run, at how many settings it is right, and what else became of it.

    Times are set against the shortest one in the table, where several solvers have one. Solvers that are right come
    first, the fastest of them at the top; then those that are not, and those that did not run.
    """
    records = comparison.of_reading(result.reading.name)
    samples, solvers = samples_of(records), by_solver([record.run for record in records])
    best = {solver: _best(own) for solver, own in solvers.items()}
    walls = {solver: row.wall_s for solver, row in best.items() if row is not None and row.wall_s}
    lines = []
    for solver in sorted(solvers, key=lambda solver: (_rank(best[solver], solvers[solver]), walls.get(solver, 0.0))):
        row = best[solver]
        cells = ("", "", "", "")
        if row is not None:
            cells = (
                "" if row.digits is None else digits(row.digits),
                timed(row, samples) if solver in walls else "",
                times_as_long(walls, solver),
                setting(row.rtol, row.step_s),
            )
        lines.append((code(solver), *cells, _right_at(solvers[solver]), _note(solvers[solver], row)))
    return Table(HEADINGS, "lrrrrrl", lines)


def times_as_long(walls: Mapping[str, float], solver: str) -> str:
    """A solver's time over the shortest of all; nothing where there is no other time, or none of its own."""
    return significant(walls[solver] / min(walls.values())) if solver in walls and len(walls) > 1 else ""


def _best(rows: Sequence[RunRow]) -> RunRow | None:
    """The most accurate right row of one solver; without transitions, where no row has digits, the last right one."""
    right = [row for row in rows if row.verdict == "right"]
    return most_accurate(right) or (right[-1] if right else None)


def _rank(best: RunRow | None, rows: Sequence[RunRow]) -> int:
    if rows[-1].status in NOT_RUN:
        return 3
    if best is None:
        return 2
    return 0 if best.wall_s is not None else 1


def _right_at(rows: Sequence[RunRow]) -> str:
    """At how many of its settings a solver is right, or why none was run or judged."""
    if rows[-1].status in NOT_RUN:
        return rows[-1].status
    if all(row.verdict == "not judged" or row.verdict is None for row in rows):
        return "not judged"
    return f"{sum(row.verdict == 'right' for row in rows)} of {len(rows)}"


def _note(rows: Sequence[RunRow], best: RunRow | None) -> str:
    """What became of the runs that are not right, and what the best one lacks."""
    if rows[-1].status in NOT_RUN:
        return markdown(rows[-1].status_reason or "").rstrip(".")
    notes: dict[str, list[str]] = {}
    for row in rows:
        if row.verdict not in ("right", None):
            notes.setdefault(_ending(row), []).append(setting(row.rtol, row.step_s))
    phrases = [f"{ending} at {', '.join(at)}" for ending, at in notes.items()]
    if best is not None and best.missed_touches:
        phrases.append(f"touches missed: {best.missed_touches}")
    if best is not None and best.undecided_after_s is not None:
        phrases.append(f"decided until t = {best.undecided_after_s:.9g} s")
    if best is not None and best.wall_s is None:
        phrases.append(f"no time: {markdown(str(best.status_reason)).rstrip('.')}")
    return "; ".join(phrases)


def _ending(row: RunRow) -> str:
    """What is not right in a row: the transitions missed and spurious, else the status."""
    if row.status == "wrong" and (row.missed or row.spurious):
        return f"{row.missed} missed, {row.spurious} spurious"
    fault = row.verdict if row.verdict in ("ill-conditioned", "not unique") else ""
    return ", ".join(part for part in (row.status, fault) if part)
