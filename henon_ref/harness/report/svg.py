"""Write a figure as a short SVG."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNIT = 0.01
"""Resolution of coordinates [pt], about a hundredth of a pixel."""
BEND = 0.03
"""Largest distance of a simplified curve from the original [pt], a twentieth of the width of a thin line."""
_NOTES = re.compile(rb"(?<=\n) +(?=<)|<!--.*?-->\n|<metadata>.*?</metadata>\n", re.DOTALL)
_GROUP = re.compile(rb'<g id="\w+_\d+"')
_GROUP_OF_ONE = re.compile(rb"<g>\n(<(?:path|use) [^>]*/>)\n</g>")
_GLYPH = re.compile(rb'(<path id=")(?:DejaVuSans-|d)([\w-]+" d=")([^"]*)(" transform="scale\()0.015625(?=\))')
_BLANK = re.compile(rb'<path id="(d[\w-]+)" transform="scale\(\S+\)"/>')
_LETTER = re.compile(rb'(<use href="#d[\w-]+" x=")([^"]+)')
_MOVED = re.compile(rb'(<use [^>]*)transform="translate\((\S+) (\S+)\)"')
_MARKER = re.compile(rb'<path id="(\w+)" [^>]*? style="([^"]*)"/>')
_MARKED = re.compile(rb'(<use href="#(\w+)"[^>]*?) style="([^"]*)"/>')
_STYLE = re.compile(rb' style="([^"]*)"')
_NAME = re.compile(rb' id="([mp][0-9a-f]{10})"')
_PLACE = re.compile(rb' (?:x|y)="[^"]*"')
_LONG = re.compile(rb"-?\d+\.\d{3,}(?![\d.e])")
_PATH = re.compile(rb' d="([MLQCz\d\s.e-]*)"')
_COMMAND = re.compile(rb"([MLQCz])([-\d\s.e]*)")


def svg(figure: Figure) -> bytes:
    """Format a figure as SVG; equal data give equal bytes."""
    from henon_ref.figures.style import image

    return shortened(image(figure))


def shortened(content: bytes) -> bytes:
    """Shorten an SVG without visible change: round coordinates, simplify curves, and remove repeated styles.

    A shortened SVG is returned unchanged.

    Examples
    --------
    >>> shortened(b'<g id="axes_1">\\n <path d="M 49.621534 -33.20000 \\nL 1e-05 7.5"/>\\n</g>')
    b'<path d="M49.62-33.2l-49.62 40.7"/>'
    >>> shortened(b'<use xlink:href="#DejaVuSans-14" transform="translate(63.625 0)"/>')
    b'<use href="#d14" x="64"/>'
    """
    content = _GROUP.sub(b"<g", _NOTES.sub(b"", content)).replace(b"<g/>\n", b"").replace(b" xlink:href=", b" href=")
    content = _GLYPH.sub(_coarse, content).replace(b"DejaVuSans-", b"d")
    content = _MOVED.sub(rb'\1x="\2" y="\3"', content).replace(b' y="0"/>', b"/>")
    content = _without_repeated_styles(content)
    while (fewer := _GROUP_OF_ONE.sub(rb"\1", content)) != content:
        content = fewer
    for k, name in enumerate(dict.fromkeys(_NAME.findall(content))):
        content = content.replace(name, b"n%d" % k)
    for blank in _BLANK.findall(content):
        content = re.sub(rb'<use href="#%s"[^>]*>\n' % blank, b"", content)
    content = _LETTER.sub(lambda own: b"%s%d" % (own[1], round(float(own[2]))), content)
    content = _PLACE.sub(lambda found: _LONG.sub(lambda own: _number(_units(own[0])), found[0]), content)
    return _PATH.sub(lambda found: b' d="' + _relative(found[1]) + b'"', content)


def _coarse(glyph: re.Match[bytes]) -> bytes:
    """Write the outline of a glyph in units 16 times as large."""
    outline = re.sub(rb"-?[\d.]+", lambda own: b"%d" % round(float(own[0]) / 16), glyph[3])
    return glyph[1] + b"d" + glyph[2] + outline + glyph[4] + b"0.25"


def _without_repeated_styles(content: bytes) -> bytes:
    """Remove style parts that a marker already defines, and replace styles that occur several times by classes."""
    markers = {name: style.split(b"; ") for name, style in _MARKER.findall(content)}

    def fewer(found: re.Match[bytes]) -> bytes:
        own = [part for part in found[3].split(b"; ") if part not in markers.get(found[2], ())]
        return found[1] + (b' style="' + b"; ".join(own) + b'"/>' if own else b"/>")

    content = _MARKED.sub(fewer, content)
    styles = _STYLE.findall(content)
    names = {style: b"c%d" % k for k, style in enumerate(dict.fromkeys(s for s in styles if styles.count(s) > 1))}
    rules = b"".join(b".%s{%s}" % (name, style) for style, name in names.items())
    if b"</style>" not in content:
        return content
    content = content.replace(b"</style>", rules + b"</style>", 1)
    return _STYLE.sub(lambda own: b' class="%s"' % names[own[1]] if own[1] in names else own[0], content)


def _units(text: bytes) -> int:
    return round(float(text) / UNIT)


def _number(units: int) -> bytes:
    """Format a number of units as points without leading and trailing zeros."""
    text = f"{units * UNIT:.2f}".rstrip("0").rstrip(".")
    return text.replace("0.", ".", 1).encode() if text.startswith(("0.", "-0.")) else text.encode()


@dataclass
class _Piece:
    """Command of a path, its numbers [UNIT], and a bound on the distance of omitted points from it [UNIT]."""

    command: bytes
    values: list[int]
    bend: float = 0.0


def _relative(path: bytes) -> bytes:
    """Convert a path to relative coordinates, and omit points that make no visible difference."""
    pieces: list[_Piece] = []
    here = begin = (0, 0)
    for command, text in _COMMAND.findall(path):
        values = list(map(_units, text.split()))
        if command in b"Mz":
            pieces.append(_Piece(command, values))
            begin = (values[0], values[1]) if values else begin
            here = begin
        else:
            _add(pieces, command.lower(), [value - here[k % 2] for k, value in enumerate(values)])
            here = values[-2], values[-1]
    return _written(pieces)


def _add(pieces: list[_Piece], command: bytes, steps: list[int]) -> None:
    """Add a piece; a line with nearly the direction of the previous line extends that line."""
    last = pieces[-1]
    if command == last.command == b"l":
        (a, b), (c, d) = last.values, steps
        bend = last.bend + abs(a * d - b * c) / (math.hypot(a + c, b + d) or math.inf)
        if bend <= BEND / UNIT and a * c + b * d > 0:
            last.values, last.bend = [a + c, b + d], bend
            return
    if any(steps):
        pieces.append(_Piece(command, steps))


def _written(pieces: list[_Piece]) -> bytes:
    made, before = bytearray(), b""
    for piece in pieces:
        command, values = piece.command, piece.values
        if command == b"l" and 0 in values:
            command, values = (b"h", values[:1]) if values[1] == 0 else (b"v", values[1:])
        made += command if command != before or command in b"Mz" else b""
        for k, text in enumerate(map(_number, values)):
            first = k == 0 and made.endswith(command)
            made += text if first or text.startswith(b"-") else b" " + text
        before = command
    return bytes(made)
