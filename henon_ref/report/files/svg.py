"""A figure as SVG, no longer than it need be."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COORDINATES = re.compile(rb' (?:d|points|x|y)="[^"]*"')
_INDENT = re.compile(rb"(?<=\n) +(?=<)")
_LONG = re.compile(rb"-?\d+\.\d{4,}(?![\d.e])")


def svg(figure: Figure) -> bytes:
    """A figure as SVG: the same bytes for the same data."""
    from henon_ref.figures.style import save

    buffer = io.BytesIO()
    save(figure, buffer)
    return _INDENT.sub(b"", short_coordinates(buffer.getvalue()))


def short_coordinates(content: bytes) -> bytes:
    """An SVG with its coordinates to a thousandth of a point, which no eye can tell: less to keep.

    Examples
    --------
    >>> short_coordinates(b'<path d="M 49.621534 -33.20000 L 1e-05 7.5"/>')
    b'<path d="M 49.622 -33.2 L 1e-05 7.5"/>'
    """
    return _COORDINATES.sub(lambda found: _LONG.sub(_rounded, found[0]), content)


def _rounded(found: re.Match[bytes]) -> bytes:
    text = f"{float(found[0]):.3f}".rstrip("0").rstrip(".")
    return (text if text != "-0" else "0").encode()
