"""A comparison in some lines: a row a solver, at its tightest setting, over the readings of the case."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.rows import RunRow
from henon_ref.score.standing import RIGHT, standings, tightest
from henon_ref.text import html, one_line

COLUMNS = ("solver", "right of judged", "digits", "time [ms]", "times as long", "note")
LONGEST_NOTE = 60
"""Characters of a note in the table of a terminal."""


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


def text_table(rows: Sequence[RunRow]) -> str:
    """The table as lines of text, safe for a terminal."""
    lines = [COLUMNS, *(tuple(map(one_line, line)) for line in summary_rows(rows))]
    widths = [max(len(line[k]) for line in lines) for k in range(len(COLUMNS) - 1)]
    return "\n".join(_padded(line, widths) for line in lines)


def _padded(line: Sequence[str], widths: Sequence[int]) -> str:
    """One line of the table: names to the left, numbers to the right, what is long in a note cut off."""
    *cells, note = line
    numbers = [cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True)]
    short = note if len(note) <= LONGEST_NOTE else f"{note[: LONGEST_NOTE - 3]}..."
    return "  ".join([cells[0].ljust(widths[0]), *numbers, short]).rstrip()


def html_table(rows: Sequence[RunRow]) -> str:
    """The table as HTML; nothing in it, whoever named a solver, is a tag or a formula."""
    head = "".join(f"<th>{name}</th>" for name in COLUMNS)
    body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in line)}</tr>" for line in summary_rows(rows))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
