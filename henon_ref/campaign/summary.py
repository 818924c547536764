"""A comparison in some lines: a row a solver, at its tightest setting, over the readings of the case."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.rows import RunRow
from henon_ref.score.standing import RIGHT, standings, tightest
from henon_ref.table import Table

COLUMNS = ("solver", "right of judged", "digits", "time [ms]", "times as long", "note")
LONGEST_NOTE = 60
"""Characters of a note where the table is printed."""


def summary_rows(rows: Sequence[RunRow]) -> list[tuple[str, ...]]:
    """A row a solver (:data:`COLUMNS`), the one that is right most often first, among equals the fastest.

    ``digits`` are the fewest of any reading in which it is right, ``time`` is the median of its right runs, ``times as
    long`` the geometric mean over readings of its time over the fastest right solver's. All of them are of each
    reading's tightest setting.
    """
    last = tightest(rows)
    return [
        (
            line.solver,
            f"{line.right} of {line.judged}",
            "" if line.digits is None else f"{line.digits:.1f}",
            "" if line.time_s is None else _three(1e3 * line.time_s),
            "" if line.times_as_long is None else _three(line.times_as_long),
            _note([row for row in last if row.solver == line.solver and row.verdict != RIGHT]),
        )
        for line in standings(last)
    ]


def _three(value: float) -> str:
    """A number to three places, without an exponent up to a million."""
    return f"{float(f'{value:.3g}'):g}"


def _note(rows: Sequence[RunRow]) -> str:
    """What became of the first run that is not right, and how many others there are."""
    if not rows:
        return ""
    reason = rows[0].status_reason or ""
    more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
    return f"{rows[0].status}{': ' if reason else ''}{reason}{more}"


def summary(rows: Sequence[RunRow], *, longest: int | None = None) -> Table:
    """The same as a table; ``longest``: characters of a note."""
    lines = summary_rows(rows)
    if longest is not None:
        short = [note if len(note) <= longest else f"{note[: longest - 3]}..." for *_, note in lines]
        lines = [(*line[:-1], note) for line, note in zip(lines, short, strict=True)]
    return Table(COLUMNS, "lrrrrl", lines)
