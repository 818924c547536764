"""The tables of a report, as rows of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from henon_ref.baselines.causes import CAUSES
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.campaign.timing import UNSTABLE
from henon_ref.harness.report.text.formats import count, digits, duration, error, setting, significant
from henon_ref.harness.report.text.ranking import floor, prices, right
from henon_ref.harness.rows import NOT_RUN, Key, RunRow, StickRow, number
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown
from henon_ref.trajectory import sticks

MOST_STICKS = 12
"""Sticks shown for a reading; all are in sticks.csv."""
MARK = "†"
"""Behind a time whose samples scatter too much."""


Samples = Mapping[Key, Sequence[float]]
"""Timing samples by the run's key."""


def samples_of(records: Sequence[Record]) -> Samples:
    """The timing samples of a reading's records."""
    return {record.run.key: record.samples for record in records}


def price_table(rows: Sequence[RunRow], samples: Samples | None = None) -> Table | None:
    """The cheapest solver for so many digits, and what the next one costs; None where fewer than two solvers ran."""
    ran = {row.solver for row in rows if row.status not in NOT_RUN}
    if len(ran) < 2 or all(price.row is None for price in prices(rows)):
        return None
    lines = []
    for price in prices(rows):
        cells = [f"{price.digits}"]
        for row, missing in ((price.row, "none"), (price.next_row, "none" if price.row is not None else "")):
            cells += [missing, "", ""] if row is None else [
                code(row.solver), setting(row.rtol, row.step_s), timed(row, samples)
            ]  # fmt: skip
        ratio = ""
        if price.row is not None and price.next_row is not None:
            ratio = significant(number(price.next_row.wall_s) / number(price.row.wall_s), 3)
        lines.append((*cells, ratio))
    headings = ("digits", "cheapest", "setting", "time", "next", "setting", "time", "times as long")
    return Table(headings, "rlrrlrrr", lines)


def run_table(records: Sequence[Record]) -> Table:
    """Every run that could be made: what was found, how well, at what cost."""
    lines = []
    for record in records:
        row = record.run
        if row.status in NOT_RUN:
            continue
        edits = "" if row.missed is None else f"{row.missed} / {row.spurious}"
        lines.append(
            (
                code(row.solver),
                setting(row.rtol, row.step_s),
                status(row),
                _count(row.matched),
                edits,
                error(row.max_time_error_s, floor(row)),
                "" if row.digits is None else digits(row.digits),
                error(row.max_stick_error_s, floor(row)),
                wall(row, record.samples),
                duration(row.compile_s),
                *map(_count, (row.steps, row.rhs_evaluations, row.event_evaluations)),
            )
        )
    headings = (
        "solver", "setting", "status", "matched", "missed / spurious", "worst error [s]", "digits",
        "stick error [s]", "time (IQR)", "compile", "steps", "right-hand sides", "event functions",
    )  # fmt: skip
    return Table(headings, "lrlrrrrrrrrrr", lines)


def _count(value: int | None) -> str:
    return "" if value is None else f"{value}"


def status(row: RunRow) -> str:
    """Status, with the verdict where the solver is not to blame."""
    return f"{row.status} ({row.verdict})" if row.verdict in ("ill-conditioned", "not unique") else row.status


def wall(row: RunRow, samples: Sequence[float] = ()) -> str:
    """Median wall time, its interquartile range, and a mark where the samples scatter too much.

    Where the samples are too few for a range, their number stands in its place; two of them are marked where their
    half distance is as large as a range that would be.
    """
    if row.wall_s is None:
        return ""
    if row.wall_s_iqr is not None:
        note = duration(row.wall_s_iqr)
    else:
        note = "" if row.timed_runs is None else count(row.timed_runs, "run")
    return duration(row.wall_s) + (f" ({note})" if note else "") + _mark(row, samples)


def timed(row: RunRow, samples: Samples | None = None) -> str:
    """Median wall time of a row that has one, marked where its samples scatter too much."""
    return duration(row.wall_s) + _mark(row, (samples or {}).get(row.key, ()))


def _mark(row: RunRow, samples: Sequence[float] = ()) -> str:
    if row.wall_s_iqr is not None:
        scatter = row.wall_s_iqr
    else:
        scatter = (max(samples) - min(samples)) / 2 if samples else 0.0
    return f" {MARK}" if scatter > UNSTABLE * number(row.wall_s) else ""


def reason_table(rows: Sequence[RunRow]) -> Table | None:
    """Why a run is not right: the solver's reason, the verdict and what it rests on, the cause where it is known."""
    # One line for a solver that says the same at every setting.
    merged: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        if row.verdict == "right" or row.status in NOT_RUN:
            continue
        verdict = ": ".join(markdown(part) for part in (row.verdict, row.verdict_basis) if part)
        cause = _cause(row.cause) if row.cause else ""
        cells = (code(row.solver), row.status, markdown(row.status_reason or ""), verdict, cause)
        merged.setdefault(cells, []).append(setting(row.rtol, row.step_s))
    if not merged:
        return None
    return Table(
        ("solver", "setting", "status", "reason", "verdict", "cause"),
        "lrllll",
        [(cells[0], ", ".join(at), *cells[1:]) for cells, at in merged.items()],
    )


def _cause(name: str) -> str:
    """A link to a cause on the page of causes, which lies in a folder beside the report's."""
    return f"[{CAUSES[name].title}](../causes/README.md#{name})"


def stick_table(comparison: Comparison, result: ReadingResult) -> Table | None:
    """The sticks of the measured window: the truth's, and how near the most accurate right run comes to them."""
    expected, reading = result.expected, result.reading
    if expected is None:
        return None
    exact = sticks(expected.transitions, start=expected.start, after=reading.measure_after)
    if not exact:
        return None
    rows = []
    best = _best_stick_run(comparison, reading.name)
    for index, stick in enumerate(exact[:MOST_STICKS]):
        cells = [f"{index}", reading.problem.system.sign_names[stick.surface], f"{stick.start:.9f}"]
        cells.append(f"{stick.duration:.13f}")
        if best is not None:
            own = next((row for row in best[1] if row.index == index), None)
            cells.append("" if own is None else error(own.error_s))
            cells.append("" if own is None or own.length is None else f"{own.length:.9f}")
        rows.append(tuple(cells))
    headings = ["stick", "surface", "begins at [s]", "exact duration [s]"]
    if best is not None:
        headings += [f"error of {code(best[0])} [s]", f"length [unit of {code(reading.problem.system.state_names[0])}]"]
    return Table(tuple(headings), "rl" + "r" * (len(headings) - 2), rows)


def _best_stick_run(comparison: Comparison, reading: str) -> tuple[str, list[StickRow]] | None:
    """Solver and stick rows of the most accurate right run of a reading."""
    records = [record for record in comparison.of_reading(reading) if record.sticks and right([record.run])]
    if not records:
        return None
    best = max(records, key=lambda record: number(record.run.digits))
    return best.run.solver, best.sticks
