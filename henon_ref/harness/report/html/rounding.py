"""Numbers of a page's data, no longer than what is shown of them."""

from __future__ import annotations


def rounded(value: object, places: int) -> float | int | None:
    """A number to so many significant places, a whole one without a point; None where it is missing."""
    if not isinstance(value, float | int):
        return None
    short = float(f"{value:.{places}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short
