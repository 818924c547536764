"""A figure as SVG, no longer than it need be."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COORDINATES = re.compile(rb' (?:d|points|x|y)="[^"]*"')
_INDENT = re.compile(rb"(?<=\n) +(?=<)")
_GROUP = re.compile(rb'<g id="\w+_\d+"')
_LONG = re.compile(rb"-?\d+\.\d{4,}(?![\d.e])")


def svg(figure: Figure) -> bytes:
    """A figure as SVG: the same bytes for the same data."""
    from henon_ref.figures.style import save

    buffer = io.BytesIO()
    save(figure, buffer)
    return shortened(buffer.getvalue())


def shortened(content: bytes) -> bytes:
    """An SVG with coordinates to a thousandth of a point, which no eye can tell, and what no program needs left out.

    Examples
    --------
    >>> shortened(b'<g id="axes_1">\\n <path d="M 49.621534 -33.20000 \\nL 1e-05 7.5"/>')
    b'<g>\\n<path d="M 49.622 -33.2L 1e-05 7.5"/>'
    """
    content = _GROUP.sub(b"<g", _INDENT.sub(b"", content))
    return _COORDINATES.sub(lambda found: _LONG.sub(_rounded, found[0].replace(b" \n", b"")), content)


def _rounded(found: re.Match[bytes]) -> bytes:
    text = f"{float(found[0]):.3f}".rstrip("0").rstrip(".")
    return (text if text != "-0" else "0").encode()
