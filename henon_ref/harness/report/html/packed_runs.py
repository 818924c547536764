"""Rows of runs as short lists: text by its number in a list of words, numbers to so many places as are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from henon_ref.harness.report.html.rendering import rounded
from henon_ref.harness.report.text.formats import setting
from henon_ref.harness.rows import RunRow
from henon_ref.text import one_line

TEXT = 0
"""In place of a number's places: the field is text."""
FIELDS: Mapping[str, int] = {
    "setting": TEXT, "status": TEXT, "verdict": TEXT, "digits": 5, "max_time_error_s": 2, "wall_s": 4,
    "max_stick_error_s": 2, "max_state_error": 2, "steps": 12, "rhs_evaluations": 12, "wall_s_iqr": 2, "missed": 12,
    "spurious": 12, "missed_touches": 12, "status_reason": TEXT, "cause": TEXT, "verdict_basis": TEXT,
}  # fmt: skip
"""Fields of a run on the page, in their order, and the significant places of each number."""
Shown = dict[str, object]
"""The fields of a run by name."""
NONE_OF = ("missed", "spurious", "missed_touches")
"""Numbers that are left out where they are 0."""
USUAL = ("ok", "right", "wrong", "solver defect", "1e-6", "1e-9", "1e-12", "failed", "timeout")
"""Words that most runs have: theirs are the shortest numbers."""


class Words:
    """Texts, each once."""

    def __init__(self, words: Sequence[str] = USUAL) -> None:
        self.listed = list(words)
        self._places = {word: place for place, word in enumerate(words)}

    def number(self, word: object) -> int | None:
        """A text's number; None for None."""
        if word is None:
            return None
        text = one_line(str(word))
        if text not in self._places:
            self._places[text] = len(self.listed)
            self.listed.append(text)
        return self._places[text]


def field_values(row: RunRow) -> Shown:
    """The fields that the page shows of a row of runs."""
    shown = dict(zip(FIELDS, row.values(FIELDS), strict=True))
    shown |= {"setting": setting(row.rtol, row.step_s), "digits": _floored(row.digits)}
    return shown | {name: shown[name] or None for name in NONE_OF}


def packed(run: Shown, words: Words) -> list[Any]:
    """A run's fields as a list, without what is missing at its end."""
    return trimmed([words.number(run[name]) if not places else rounded(run[name], places)
                    for name, places in FIELDS.items()])  # fmt: skip


def unpacked(values: Sequence[Any], words: Sequence[str]) -> Shown:
    """The fields that a list of :func:`packed` holds."""
    padded = [*values, *[None] * (len(FIELDS) - len(values))]
    return {
        name: words[value] if not places and value is not None else value
        for (name, places), value in zip(FIELDS.items(), padded, strict=True)
    }


def trimmed(values: list[Any]) -> list[Any]:
    """A list without the missing values at its end."""
    while values and values[-1] is None:
        values.pop()
    return values


def _floored(digits: float | None) -> float | None:
    """Digits to a thousandth, never more than there are."""
    return int(digits * 1000) / 1000 if digits and digits > 0 else digits
