"""How solvers are drawn on a page: as in every figure, and lighter where the page is dark."""

from __future__ import annotations

from collections.abc import Iterable

from henon_ref.figures.style import Line, lines_of

PAPER, NIGHT = "#ffffff", "#15181c"
"""Backgrounds of a light and of a dark page."""
SEEN = 3.0
"""Contrast with the background that a line has at least (WCAG 2.2, 1.4.11)."""
_DASHES = {"-": (), "--": (5, 3), ":": (1.5, 2.5), "-.": (5, 2, 1.5, 2)}


def solver_lines(solvers: Iterable[str]) -> dict[str, dict[str, object]]:
    """Colours (light, dark), dashes [line widths], marker and width of each solver's line."""
    return {name: _drawn(line) for name, line in lines_of(solvers).items()}


def _drawn(line: Line) -> dict[str, object]:
    dashes = _DASHES[line.dashes] if isinstance(line.dashes, str) else line.dashes[1]
    return {
        "light": towards(line.colour, "#000000", PAPER),
        "dark": towards(line.colour, "#ffffff", NIGHT),
        "dashes": " ".join(f"{length:g}" for length in dashes),
        "marker": line.marker,
        "width": line.width,
    }


def towards(colour: str, end: str, background: str) -> str:
    """A colour, mixed with black or white until it is seen on a background.

    Examples
    --------
    >>> towards("#000000", "#ffffff", "#15181c"), towards("#0072b2", "#000000", "#ffffff")
    ('#6b6b6b', '#0072b2')
    """
    for share in range(0, 101, 2):
        mixed = _mixed(colour, end, share / 100)
        if contrast(mixed, background) >= SEEN:
            return mixed
    return end


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours (WCAG 2.2).

    Examples
    --------
    >>> round(contrast("#000000", "#ffffff"), 6)
    21.0
    """
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in _channels(colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _mixed(colour: str, end: str, share: float) -> str:
    parts = zip(_channels(colour), _channels(end), strict=True)
    return "#" + "".join(f"{round(255 * ((1 - share) * a + share * b)):02x}" for a, b in parts)


def _channels(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue
