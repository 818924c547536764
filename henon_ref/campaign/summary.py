"""A comparison in some lines: a row a solver, at its tightest setting, over the readings of the case."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import geometric_mean, median

from henon_ref.columns import Row
from henon_ref.score.gate import demand
from henon_ref.text import html, one_line

COLUMNS = ("solver", "right of judged", "digits", "time [ms]", "times as long", "note")
LONGEST_NOTE = 60
"""Characters of a note in the table of a terminal."""


def summary_rows(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """A row a solver (:data:`COLUMNS`), the one that is right most often first, among equals the fastest.

    ``digits`` are the fewest of any reading in which it is right, ``time`` is the median of its right runs, ``times as
    long`` the geometric mean over readings of its time over the fastest right solver's. All of them are of each
    reading's tightest setting.
    """
    last = _tightest(rows)
    fastest: dict[object, float] = {}
    for row in last:
        fastest[row["reading"]] = min(_time(row), fastest.get(row["reading"], math.inf))
    solvers: dict[str, list[Row]] = {}
    for row in last:
        solvers.setdefault(str(row["solver"]), []).append(row)
    lines = [_line(solver, own, fastest) for solver, own in solvers.items()]
    return [line for _, line in sorted(lines, key=lambda found: found[0])]


def _tightest(rows: Sequence[Row]) -> list[Row]:
    """Of each reading and solver the row with the smallest tolerance or step."""
    found: dict[tuple[object, object], Row] = {}
    for row in rows:
        key = row["reading"], row["solver"]
        if key not in found or _size(row) < _size(found[key]):
            found[key] = row
    return list(found.values())


def _line(
    solver: str, rows: Sequence[Row], fastest: Mapping[object, float]
) -> tuple[tuple[int, float], tuple[str, ...]]:
    """What a solver is sorted by, and its row."""
    good = [row for row in rows if row["verdict"] == "right"]
    counted = demand(solver, rows)
    digits = [_number(row["digits"]) for row in good if row["digits"] is not None]
    timed = [row for row in good if _time(row) < math.inf]
    ratio = geometric_mean(_time(row) / fastest[row["reading"]] for row in timed) if timed else math.inf
    cells = (
        solver,
        f"{counted.right} of {counted.judged}",
        f"{min(digits):.1f}" if digits else "",
        _three(1e3 * median(map(_time, timed))) if timed else "",
        _three(ratio) if timed else "",
        _note([row for row in rows if row["verdict"] != "right"]),
    )
    return (-counted.right, ratio), cells


def _three(value: float) -> str:
    """A number to three places, without an exponent up to a million."""
    return f"{float(f'{value:.3g}'):g}"


def _note(rows: Sequence[Row]) -> str:
    """What became of the first run that is not right, and how many others there are."""
    if not rows:
        return ""
    reason = str(rows[0]["status_reason"] or "")
    more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
    return f"{rows[0]['status']}{': ' if reason else ''}{reason}{more}"


def text_table(rows: Sequence[Row]) -> str:
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


def html_table(rows: Sequence[Row]) -> str:
    """The table as HTML; nothing in it, whoever named a solver, is a tag or a formula."""
    head = "".join(f"<th>{name}</th>" for name in COLUMNS)
    body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in line)}</tr>" for line in summary_rows(rows))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _size(row: Row) -> float:
    return _number(row["step_s"] if row["rtol"] is None else row["rtol"])


def _time(row: Row) -> float:
    """Wall time of a right run [s]; infinite for any other."""
    wall = _number(row["wall_s"])
    return wall if row["verdict"] == "right" and wall > 0 else math.inf


def _number(value: object) -> float:
    return float(value) if isinstance(value, float | int) else math.nan
