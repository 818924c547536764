"""Rows held against earlier ones: whether a run's status, or the digits of its times, got worse."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from henon_ref.harness.rows import Key, RunRow
from henon_ref.harness.score.reference import HALF_ULP

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
    missing: tuple[RunRow, ...]
    """Earlier rows that are not among those of now."""


def held_against(rows: Iterable[RunRow], earlier: Iterable[RunRow]) -> Regression:
    """Hold rows against earlier ones of the same case, reading, solver, tolerance and step.

    Parameters
    ----------
    rows, earlier : iterable of RunRow
        Of earlier ones only the key, ``status`` and ``max_time_error_s`` are needed.
    """
    before = {row.key: row for row in earlier}
    now = {row.key: row for row in rows}
    both = [key for key in now if key in before]
    changes = {key: _change(before[key], now[key]) for key in both}
    return Regression(
        compared=len(both),
        worse={key: words for key, words in changes.items() if words},
        missing=tuple(row for key, row in before.items() if key not in now),
    )


def _change(before: RunRow, now: RunRow) -> str:
    """In what a row got worse; empty where it did not."""
    ranks = _rank(before), _rank(now)
    if ranks[1] > ranks[0]:
        return f"was {_state(before, ranks[0])}, is {_state(now, ranks[1])}"
    if ranks != (0, 0):  # once a run has gone wrong, the last bit decides where it goes
        return ""
    was, now_is = before.max_time_error_s, now.max_time_error_s
    if was is None or now_is is None:
        return ""
    least = max(_floor(before), _floor(now))
    fewer = math.log10(max(now_is, least) / max(was, least))
    if fewer <= LOST:
        return ""
    return f"worst time error was {was:.2g} s, is {now_is:.2g} s: {fewer:.2f} digits fewer, {LOST:g} are allowed"


def _rank(row: RunRow) -> int:
    if row.verdict == "right" or (row.verdict is None and row.status == "ok"):
        return 0
    return _RANKS[row.status]


def _state(row: RunRow, rank: int) -> str:
    return row.status_text if rank or row.status == "ok" else f"{row.status_text} and {_RANK_NAMES[0]}"


def _floor(row: RunRow) -> float:
    """The least error that is told apart from none [s]: the truth's radius, or half a unit in a time's last place."""
    latest = max(abs(row.end_time_s or 0.0), row.time_unit_s or 1.0)
    return max(row.reference_radius_s or 0.0, HALF_ULP * latest)
