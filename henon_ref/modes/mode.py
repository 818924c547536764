"""Modes: for each surface, the side on which the state is, or sliding on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

Mode = tuple[int, ...]
"""One entry per surface: -1 or +1 in slip (the sign of h), 0 in sliding (stick)."""
CLEAR = 1e-9
"""Part of the size of its terms above which a value is clearly not zero."""


def mode_text(mode: Sequence[int], signs: Sequence[str]) -> str:
    """Write a mode as the reports do.

    >>> mode_text((1, 0), ["s", "u"])
    's=+1 u=0'
    """
    return " ".join(f"{name}={value:+d}" if value else f"{name}=0" for name, value in zip(signs, mode, strict=True))


def replaced(mode: Mode, index: int, value: int) -> Mode:
    """Return the mode with one entry replaced."""
    return (*mode[:index], value, *mode[index + 1 :])


def mode_number(mode: Mode) -> int:
    """Return the mode as a number in base 3, with the first surface as the last digit."""
    number = 0
    for entry in reversed(mode):
        number = 3 * number + entry + 1
    return number


def numbered_mode(number: int, surfaces: int) -> Mode:
    """Return the mode with this number.

    >>> numbered_mode(mode_number((1, 0, -1)), 3)
    (1, 0, -1)
    """
    return tuple(number // 3**i % 3 - 1 for i in range(surfaces))


def transition_kind(before: int, after: int) -> Literal["stick", "release", "crossing", "graze"]:
    """Name the change of one surface's entry: stick, release, crossing or graze (touch without crossing)."""
    if before == after:
        return "graze"
    if after == 0:
        return "stick"
    if before == 0:
        return "release"
    return "crossing"


def sign_after(below: float, above: float) -> int | None:
    """Return the side on which a trajectory leaves a surface (-1, +1), 0 for sliding, None if two signs do not decide.

    ``below``, ``above``: dh/dt of the fields on the negative and on the positive side, at a point of the surface h = 0.
    A trajectory that reaches the surface from one side crosses it if both fields point to the other side, and slides if
    both fields point at the surface (Filippov 1988, Sec. 4).

    >>> sign_after(1.0, 2.0), sign_after(-1.0, -2.0), sign_after(1.0, -2.0)
    (1, -1, 0)
    >>> sign_after(-1.0, 2.0), sign_after(1.0, 1e-12)
    (None, None)
    """
    clear = CLEAR * (abs(below) + abs(above))
    if below > clear:
        return 1 if above > clear else 0 if above < -clear else None
    return -1 if below < -clear and above < -clear else None
