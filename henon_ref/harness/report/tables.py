"""Tables of a case's report that are made from its rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from henon_ref.baselines.causes import CAUSES
from henon_ref.grouping import grouped
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.campaign.timing import UNSTABLE
from henon_ref.harness.report.matrix import MatrixRow, solvers_of, summary
from henon_ref.harness.rows import NOT_RUN, UNDECIDED, UNJUDGED, Key, RunRow, StickRow, number
from henon_ref.harness.score.ranking import (
    LEVELS,
    WholeRow,
    best_setting,
    by_solver,
    cheapest,
    floor,
    most_accurate,
    right,
)
from henon_ref.harness.table import Table, count, digits, duration, error, significant
from henon_ref.text import code, markdown
from henon_ref.trajectory import sticks

MARK = "†"
"""Mark after a time whose samples scatter too much."""
SOLVERS = ("solver", "digits", "time", "times as long", "setting", "right", "note")
"""Headings of the first table of a report or a reading."""
Samples = Mapping[Key, Sequence[float]]
"""Key of a run -> timing samples [s]."""


def samples_of(records: Sequence[Record]) -> Samples:
    return {record.run.key: record.samples for record in records}


def solver_table(records: Sequence[Record]) -> Table:
    """Make the table with one row per solver of a reading: most accurate right run, number of right settings, notes.

    Times are also given relative to the shortest one in the table if several solvers have a time. The right solvers
    come first, sorted by time, followed by the solvers that are not right and those that did not run.
    """
    samples, solvers = samples_of(records), by_solver(record.run for record in records)
    # If no right row has digits (no transitions), the last right row.
    best = {
        solver: most_accurate(right(own)) or next((row for row in reversed(own) if row.verdict == "right"), None)
        for solver, own in solvers.items()
    }
    walls = {solver: row.wall_s for solver, row in best.items() if row is not None and row.wall_s}
    ranked = sorted(solvers, key=lambda solver: (_rank(best[solver], solvers[solver]), walls.get(solver, 0.0)))
    lines = [
        _solver_line(
            solver, best[solver], walls, samples, _right_at(solvers[solver]), _note(solvers[solver], best[solver])
        )
        for solver in ranked
    ]
    return Table(SOLVERS, "lrrrrrl", lines)


def whole_table(whole: Sequence[WholeRow], judged: int) -> Table:
    """Make the table of solvers over all readings of a case with a truth; ``whole`` is from :func:`over_all`.

    A row shows the setting at which a solver is right in the most readings, and its total time if it is right in all.
    Other settings that are right in equally many readings are listed in the note.
    """
    solvers = by_solver(whole)
    best = {solver: best_setting(rows) for solver, rows in solvers.items()}
    walls = {solver: number(row.wall_s) for solver, row in best.items() if row.verdict == "right"}
    lines = []
    for solver in sorted(solvers, key=lambda solver: (-best[solver].right_in, walls.get(solver, 0.0))):
        row, most = best[solver], best[solver].right_in
        others = [own.setting for own in solvers[solver] if own.right_in == most and own.key != row.key]
        note = f"in as many at {', '.join(others)}" if most and others else ""
        lines.append(_solver_line(solver, row if most else None, walls, {}, f"{most} of {judged}", note))
    return Table(SOLVERS, "lrrrrrl", lines)


def _solver_line(
    solver: str, row: RunRow | None, walls: Mapping[str, float], samples: Samples, at: str, note: str
) -> tuple[str, ...]:
    if row is None:
        return code(solver), "", "", "", "", at, note
    time = timed(row, samples) if solver in walls else ""
    longer = significant(walls[solver] / min(walls.values())) if solver in walls and len(walls) > 1 else ""
    return code(solver), digits(row.digits), time, longer, row.setting, at, note


def _rank(best: RunRow | None, rows: Sequence[RunRow]) -> int:
    if rows[-1].status in NOT_RUN:
        return 3
    if best is None:
        return 2
    return 0 if best.wall_s is not None else 1


def _right_at(rows: Sequence[RunRow]) -> str:
    if rows[-1].status in NOT_RUN:
        return rows[-1].status
    if not any(row.judged for row in rows):
        return "not judged"
    return f"{sum(row.verdict == 'right' for row in rows)} of {len(rows)}"


def _note(rows: Sequence[RunRow], best: RunRow | None) -> str:
    """Describe the runs that are not right, and the deficiencies of the best run."""
    if rows[-1].status in NOT_RUN:
        return markdown(rows[-1].status_reason or "").rstrip(".")
    notes = grouped((row for row in rows if row.verdict not in ("right", None)), _ending)
    phrases = [f"{ending} at {', '.join(row.setting for row in own)}" for ending, own in notes.items()]
    if best is not None and best.missed_touches:
        phrases.append(f"touches missed: {best.missed_touches}")
    if best is not None and best.undecided_after_s is not None:
        phrases.append(f"decided until t = {best.undecided_after_s:.9g} s")
    if best is not None and best.wall_s is None:
        phrases.append(f"no time: {markdown(str(best.status_reason)).rstrip('.')}")
    return "; ".join(phrases)


def _ending(row: RunRow) -> str:
    """Return the numbers of missed and spurious transitions of a wrong row, else its status."""
    if row.status == "wrong" and (row.missed or row.spurious):
        return f"{row.missed} missed, {row.spurious} spurious"
    return f"{row.status}, {row.verdict}" if row.verdict in UNDECIDED else row.status


def price_table(rows: Sequence[RunRow], samples: Samples) -> Table | None:
    """Make the table of the two cheapest solvers for each number of digits; None if fewer than two solvers ran."""
    found, ran = {level: cheapest(rows, level) for level in LEVELS}, {r.solver for r in rows if r.status not in NOT_RUN}
    if len(ran) < 2 or not any(first for first, _ in found.values()):
        return None
    lines = []
    for level, (first, other) in found.items():
        cells, ratio = [*_priced(first, samples), *(_priced(other, samples) if first else ("", "", ""))], ""
        if first is not None and other is not None:
            ratio = significant(number(other.wall_s) / number(first.wall_s), 3)
        lines.append((f"{level}", *cells, ratio))
    headings = ("digits", "cheapest", "setting", "time", "next", "setting", "time", "times as long")
    return Table(headings, "rlrrlrrr", lines)


def _priced(row: RunRow | None, samples: Samples) -> tuple[str, str, str]:
    return ("none", "", "") if row is None else (code(row.solver), row.setting, timed(row, samples))


def digits_table(readings: Mapping[str, Sequence[RunRow]]) -> Table:
    """Make the table of the digits that each solver reaches on each reading, or of its status."""
    solvers = solvers_of(row for rows in readings.values() for row in rows)
    lines = []
    for reading, rows in readings.items():
        own = {solver: _digits(summary(runs)) for solver, runs in by_solver(rows).items()}
        transitions = next((row.reference_transitions for row in rows if row.reference_transitions is not None), None)
        lines.append((f"[{reading}](#{reading})", _count(transitions), *(own.get(solver, "") for solver in solvers)))
    return Table(("reading", "transitions", *map(code, solvers)), "lr", lines)


def _digits(row: MatrixRow) -> str:
    if row.right:
        reached = digits(row.digits) or "ok"
        return reached if row.right == row.settings else f"{reached} *"
    if row.verdict in UNDECIDED:
        return str(row.verdict)
    if row.status in NOT_RUN or row.status == "timeout":
        return {"unsupported": "–", "unavailable": "·"}.get(row.status, row.status)
    return "not judged" if row.verdict in (None, *UNJUDGED) else row.status  # "ok" does not mean right here


def run_table(records: Sequence[Record]) -> Table:
    """Make the table of all runs: numbers of transitions, errors, times and work."""
    lines = []
    for row, samples in ((record.run, record.samples) for record in records if record.run.status not in NOT_RUN):
        lines.append(
            (
                code(row.solver),
                row.setting,
                f"{row.status} ({row.verdict})" if row.verdict in UNDECIDED else row.status,
                _count(row.matched),
                "" if row.missed is None else f"{row.missed} / {row.spurious}",
                error(row.max_time_error_s, floor(row)),
                digits(row.digits),
                error(row.max_stick_error_s, floor(row)),
                _wall(row, samples),
                duration(row.compile_s),
                *map(_count, (row.steps, row.rhs_evaluations, row.event_evaluations)),
            )
        )
    headings = (
        "solver", "setting", "status", "matched", "missed / spurious", "worst error [s]", "digits",
        "stick error [s]", "time (IQR)", "compile", "steps", "right-hand sides", "event functions",
    )  # fmt: skip
    return Table(headings, "lrlr", lines)


def _count(value: int | None) -> str:
    return "" if value is None else f"{value}"


def _wall(row: RunRow, samples: Sequence[float]) -> str:
    """Format the median wall time, its interquartile range or else the number of samples, and the mark."""
    if row.wall_s is None:
        return ""
    few = "" if row.timed_runs is None else count(row.timed_runs, "run")
    note = few if row.wall_s_iqr is None else duration(row.wall_s_iqr)
    return duration(row.wall_s) + (f" ({note})" if note else "") + _mark(row, samples)


def timed(row: RunRow, samples: Samples) -> str:
    """Format the median wall time of a row, with a mark if its samples scatter too much."""
    return duration(row.wall_s) + _mark(row, samples.get(row.key, ()))


def _mark(row: RunRow, samples: Sequence[float]) -> str:
    """Return the mark if the interquartile range (of two samples, half their distance) is large against the median."""
    scatter = row.wall_s_iqr
    if scatter is None:
        scatter = (max(samples) - min(samples)) / 2 if samples else 0.0
    return f" {MARK}" if scatter > UNSTABLE * number(row.wall_s) else ""


def reason_table(rows: Sequence[RunRow]) -> Table | None:
    """Make the table of runs that are not right: the solver's reason, the verdict with its basis, and the known cause.

    Settings of a solver with equal entries share a line.
    """

    def cells(row: RunRow) -> tuple[str, ...]:
        verdict = ": ".join(markdown(part) for part in (row.verdict, row.verdict_basis) if part)
        cause = f"[{CAUSES[row.cause].title}](../causes/README.md#{row.cause})" if row.cause else ""
        return code(row.solver), row.status, markdown(row.status_reason or ""), verdict, cause

    alike = grouped((row for row in rows if row.verdict != "right" and row.status not in NOT_RUN), cells)
    headings = ("solver", "setting", "status", "reason", "verdict", "cause")
    lines = [(solver, ", ".join(row.setting for row in own), *rest) for (solver, *rest), own in alike.items()]
    return Table(headings, "lrllll", lines) if lines else None


def stick_table(records: Sequence[Record], result: ReadingResult) -> Table | None:
    """Make the table of the exact sticks in the measured window, with the errors of the most accurate right run."""
    expected, reading, system = result.expected, result.reading, result.reading.problem.system
    exact = sticks(expected.transitions, start=expected.start, after=reading.measure_after) if expected else []
    if not exact:
        return None
    able = [record for record in records if record.sticks and right([record.run])]
    best = max(able, key=lambda record: number(record.run.digits), default=None)
    own: dict[int, StickRow] = {row.index: row for row in best.sticks} if best else {}
    headings = ["stick", "surface", "begins at [s]", "exact duration [s]"]
    if best is not None:
        length = f"length in {code(system.state_names[0])}{_unit(result)}"
        headings += [f"error of {code(best.run.solver)} [s]", length]
    rows = []
    for index, stick in enumerate(exact[:12]):  # sticks.csv has all
        cells = [f"{index}", system.sign_names[stick.surface], f"{stick.start:.9f}", f"{stick.duration:.13f}"]
        if best is not None:
            row = own.get(index)
            cells.append("" if row is None else error(row.error_s))
            cells.append("" if row is None or row.length is None else f"{row.length:.9f}")
        rows.append(tuple(cells))
    return Table(tuple(headings), "rlr", rows)


def _unit(result: ReadingResult) -> str:
    """Return the unit of the first state if it is the position of a body in a scene."""
    bodies = result.reading.scene.bodies.values() if result.reading.scene else ()
    first = result.reading.problem.system.states[0]
    kind = next((body.kind for body in bodies if body.states and body.states[0] == first), "")
    return {"mass": " [m]", "rotor": " [rad]"}.get(kind, "")
