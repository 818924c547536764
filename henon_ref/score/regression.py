"""Rows held against earlier ones: whether a run's status, or the digits of its times, got worse."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from henon_ref.columns import Row
from henon_ref.score.gate import setting_text, status_text
from henon_ref.score.reference import HALF_ULP

Key = tuple[object, ...]
"""Case, reading, solver, tolerance and step: what tells a row apart from all others."""
KEY = ("case", "reading", "solver", "rtol", "step_s")
LOST = 0.5
"""Digits that a row may lose."""
_RANKS = {
    **dict.fromkeys(("ok", "wrong", "diverged", "nonunique", "invalid"), 1),
    **dict.fromkeys(("timeout", "failed"), 2),
    **dict.fromkeys(("unsupported", "unavailable"), 3),
}
"""Statuses of rows that are not right, by how little is left: another result, none, no run. A right row has rank 0."""
_RANK_NAMES = ("right", "not right", "without a result", "not run")


@dataclass(frozen=True)
class Regression:
    """What became of earlier rows."""

    compared: int
    """Rows that there are now and were there earlier."""
    worse: dict[Key, str]
    """Rows that got worse, and in what."""
    missing: tuple[Key, ...]
    """Earlier rows that are not among those of now."""


def key_of(row: Row) -> Key:
    """What tells a row apart from all others."""
    return tuple(row[column] for column in KEY)


def run_name(row: Row) -> str:
    """A row in a message.

    Examples
    --------
    >>> run_name({"case": "fig8", "reading": "default", "solver": "henon", "rtol": 1e-9, "step_s": None})
    'fig8: default: henon (rtol 1e-09)'
    """
    return f"{row['case']}: {row['reading']}: {row['solver']}{setting_text(row)}"


def held_against(rows: Iterable[Row], earlier: Iterable[Row]) -> Regression:
    """Hold rows against earlier ones of the same case, reading, solver, tolerance and step.

    Parameters
    ----------
    rows, earlier : iterable of Row
        Of earlier ones only the columns of the key, ``status`` and ``max_time_error_s`` are needed.
    """
    before = {key_of(row): row for row in earlier}
    now = {key_of(row): row for row in rows}
    both = [key for key in now if key in before]
    changes = {key: _change(before[key], now[key]) for key in both}
    return Regression(
        compared=len(both),
        worse={key: words for key, words in changes.items() if words},
        missing=tuple(key for key in before if key not in now),
    )


def _change(before: Row, now: Row) -> str:
    """In what a row got worse; empty where it did not."""
    ranks = _rank(before), _rank(now)
    if ranks[1] > ranks[0]:
        return f"was {_state(before, ranks[0])}, is {_state(now, ranks[1])}"
    if ranks != (0, 0):  # once a run has gone wrong, the last bit decides where it goes
        return ""
    errors = _error(before), _error(now)
    if None in errors:
        return ""
    least = max(_floor(before), _floor(now))
    digits = [-math.log10(max(error, least)) for error in errors if error is not None]
    if digits[0] - digits[1] <= LOST:
        return ""
    return (
        f"worst time error was {errors[0]:.2g} s, is {errors[1]:.2g} s: {digits[0] - digits[1]:.2f} digits fewer, "
        f"{LOST:g} are allowed"
    )


def _rank(row: Row) -> int:
    verdict = row.get("verdict")
    if verdict == "right" or (verdict is None and row["status"] == "ok"):
        return 0
    return _RANKS[str(row["status"])]


def _state(row: Row, rank: int) -> str:
    words = status_text({"status_reason": None, **row})
    return words if rank or row["status"] == "ok" else f"{words} and {_RANK_NAMES[0]}"


def _number(row: Row, column: str) -> float | None:
    value = row.get(column)
    return float(value) if isinstance(value, float | int) and math.isfinite(value) else None


def _error(row: Row) -> float | None:
    return _number(row, "max_time_error_s")


def _floor(row: Row) -> float:
    """The least error that is told apart from none [s]: the truth's radius, or half a unit in a time's last place."""
    latest = max(abs(_number(row, "end_time_s") or 0.0), _number(row, "time_unit_s") or 1.0)
    return max(_number(row, "reference_radius_s") or 0.0, HALF_ULP * latest)


def names(keys: Sequence[Key]) -> list[str]:
    """Rows in a message, by their keys."""
    return [run_name(dict(zip(KEY, key, strict=True))) for key in keys]
