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
_GROUP_OF_ONE = re.compile(rb"<g>\n(<(?:path|use) [^>]*/>)\n</g>")
_GLYPH = b"DejaVuSans-"
_MOVED = re.compile(rb'(<use [^>]*)transform="translate\((\S+) (\S+)\)"')
_MARKER = re.compile(rb'<path id="(\w+)" [^>]*? style="([^"]*)"/>')
_MARKED = re.compile(rb'(<use xlink:href="#(\w+)"[^>]*?) style="([^"]*)"/>')
_LONG = re.compile(rb"-?\d+\.\d{4,}(?![\d.e])")


def svg(figure: Figure) -> bytes:
    """A figure as SVG: the same bytes for the same data."""
    from henon_ref.figures.style import save

    buffer = io.BytesIO()
    save(figure, buffer)
    return shortened(buffer.getvalue())


def shortened(content: bytes) -> bytes:
    """An SVG that looks the same: coordinates to a thousandth of a point, and nothing said twice.

    Examples
    --------
    >>> shortened(b'<g id="axes_1">\\n <path d="M 49.621534 -33.20000 \\nL 1e-05 7.5"/>\\n</g>')
    b'<path d="M 49.622 -33.2L 1e-05 7.5"/>'
    >>> shortened(b'<use xlink:href="#DejaVuSans-14" transform="translate(63.625 0)"/>')
    b'<use xlink:href="#d14" x="63.625"/>'
    """
    content = _GROUP.sub(b"<g", _INDENT.sub(b"", content)).replace(b"<g/>\n", b"")
    content = _MOVED.sub(rb'\1x="\2" y="\3"', content.replace(_GLYPH, b"d")).replace(b' y="0"/>', b"/>")
    content = _without_repeated_styles(content)
    while (fewer := _GROUP_OF_ONE.sub(rb"\1", content)) != content:
        content = fewer
    return _COORDINATES.sub(lambda found: _LONG.sub(_rounded, found[0].replace(b" \n", b"")), content)


def _without_repeated_styles(content: bytes) -> bytes:
    """Uses of a marker without what the marker's own style says, too."""
    styles = {name: style.split(b"; ") for name, style in _MARKER.findall(content)}

    def fewer(found: re.Match[bytes]) -> bytes:
        own = [part for part in found[3].split(b"; ") if part not in styles.get(found[2], ())]
        return found[1] + (b' style="' + b"; ".join(own) + b'"/>' if own else b"/>")

    return _MARKED.sub(fewer, content)


def _rounded(found: re.Match[bytes]) -> bytes:
    text = f"{float(found[0]):.3f}".rstrip("0").rstrip(".")
    return (text if text != "-0" else "0").encode()
