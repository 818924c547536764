"""Figures of a report as short SVG, and the job of a worker that draws the figures of a reading."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from henon_ref.casefile.case import Reading
from henon_ref.figures.motion import Motion, draw_portrait, motion_of
from henon_ref.figures.plots import draw_modes
from henon_ref.figures.scene import draw_scene
from henon_ref.figures.style import image
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.figures import draw_cost, draw_errors
from henon_ref.harness.score.reference import Expected
from henon_ref.trajectory import Samples
from henon_ref.workers.worker import Job, WorkerState

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("scene", "portrait", "modes", "errors", "cost")
"""Kinds of figures of a reading, which are part of their file names."""


def figure_job(result: ReadingResult, records: list[Record]) -> Job:
    """Return the job that draws the figures of one reading."""
    return Job(draw_figures, (result.reading, result.expected, result.samples, records), 120.0)


def draw_figures(
    state: WorkerState, reading: Reading, expected: Expected | None, samples: Samples | None, records: list[Record]
) -> dict[str, bytes]:
    """Job: draw the figures of one reading; return contents by file name."""
    motion = motion_in(samples, expected)
    drawn: dict[str, Figure | None] = {}
    if reading.scene is not None:
        drawn["scene"] = draw_scene(reading.scene)
    if motion is not None:
        system = reading.problem.system
        drawn |= {"portrait": draw_portrait(system, motion), "modes": draw_modes(system, motion)}
    if expected is not None:
        drawn["errors"] = draw_errors([(record.run, record.transitions) for record in records], expected)
        drawn["cost"] = draw_cost([record.run for record in records], expected)
    return {file_name(reading.name, kind): svg(figure) for kind, figure in drawn.items() if figure is not None}


def motion_in(samples: Samples | None, expected: Expected | None) -> Motion | None:
    """Return the sampled motion of a reading between its exact transitions; None if it is not known."""
    return None if samples is None or expected is None else motion_of(samples, expected.transitions)


def file_name(reading: str, kind: str) -> str:
    return f"{reading}_{kind}.svg"


def svg(figure: Figure) -> bytes:
    """Format a figure as SVG; equal data give equal bytes."""
    return shortened(image(figure))


UNIT = 0.01
"""Resolution of coordinates [pt], about a hundredth of a pixel."""
BEND = 0.03
"""Largest distance of a simplified curve from the original [pt], a twentieth of the width of a thin line."""


def shortened(content: bytes) -> bytes:
    """Shorten an SVG without visible change: round coordinates, simplify curves, and remove what is written twice.

    A shortened SVG is returned unchanged.

    >>> shortened(b'<g id="axes_1">\\n <path d="M 49.621534 -33.20000 \\nL 1e-05 7.5"/>\\n</g>')
    b'<path d="M49.62-33.2l-49.62 40.7"/>'
    >>> shortened(b'<text style="fill: none" x="8.2513" y="7" transform="rotate(-0 8.2513 7)">7 s</text>')
    b'<text style="fill: none" x="8.25" y="7">7 s</text>'
    """
    content = re.sub(rb"(?<=\n) +(?=<)|<!--.*?-->\n|<metadata>.*?</metadata>\n", b"", content, flags=re.DOTALL)
    content = re.sub(rb'<g id="[\w.]+_\d+"', b"<g", content).replace(b" xlink:href=", b" href=")
    content = _without_plain_groups(re.sub(rb' transform="rotate\(-0 [^"]*"', b"", content))
    content = re.sub(rb' (clip-path)="(url\(#\w+\))" style="([^"]*)"', rb' style="\3; \1: \2"', content)
    content = _without_repeated_styles(content)
    for k, name in enumerate(dict.fromkeys(re.findall(rb' id="([mp][0-9a-f]{10})"', content))):
        content = content.replace(name, b"n%d" % k)
    return re.sub(rb"<\w[^>]*>", _with_short_numbers, content)


def _with_short_numbers(tag: re.Match[bytes]) -> bytes:
    text = re.sub(rb' (?:x|y)="[^"]*"|(?:translate|rotate)\([^)]*', _rounded, tag[0])
    return re.sub(rb' d="([MLQCz\d\s.e-]*)"', lambda found: b' d="' + _relative(found[1]) + b'"', text)


def _rounded(coordinates: re.Match[bytes]) -> bytes:
    """Round the numbers with three decimals or more."""
    return re.sub(rb"-?\d+\.\d{3,}(?![\d.e])", lambda own: _number(_units(own[0])), coordinates[0])


def _without_plain_groups(content: bytes) -> bytes:
    """Remove the groups without attributes; every tag is a line."""
    kept: list[bytes] = []
    groups: list[bool] = []
    for line in content.split(b"\n"):
        if line.startswith(b"<g") and not line.endswith(b"/>"):
            groups.append(line == b"<g>")
        plain = line in (b"<g>", b"<g/>") or (line == b"</g>" and groups.pop())
        kept += [] if plain else [line]
    return b"\n".join(kept)


def _without_repeated_styles(content: bytes) -> bytes:
    """Write the style of a marker once, with its path, and replace styles that occur several times by classes."""
    use = re.compile(rb'(<use href="#(\w+)"[^>]*?) style="([^"]*)"/>')
    definition = re.compile(rb'(<path id="(\w+)" [^>]*? style=")([^"]*)(?="/>)')
    uses = {found[2]: found[3] for found in use.finditer(content)}  # all uses of a marker have one style
    markers = {found[2] for found in definition.finditer(content)}

    def complete(found: re.Match[bytes]) -> bytes:
        parts = found[3].split(b"; ") + (uses[found[2]].split(b"; ") if found[2] in uses else [])
        return found[1] + b"; ".join(dict.fromkeys(parts))

    content = definition.sub(complete, content)
    content = use.sub(lambda found: found[1] + b"/>" if found[2] in markers else found[0], content)
    attribute = re.compile(rb' style="([^"]*)"')
    styles = attribute.findall(content)
    names = {style: b"c%d" % k for k, style in enumerate(dict.fromkeys(s for s in styles if styles.count(s) > 1))}
    rules = b"".join(b".%s{%s}" % (name, style) for style, name in names.items())
    if b"</style>" not in content:
        return content
    content = content.replace(b"</style>", rules + b"</style>", 1)
    return attribute.sub(lambda own: b' class="%s"' % names[own[1]] if own[1] in names else own[0], content)


def _units(text: bytes) -> int:
    return round(float(text) / UNIT)


def _number(units: int) -> bytes:
    """Format a number of units as points without leading and trailing zeros."""
    text = f"{units * UNIT:.2f}".rstrip("0").rstrip(".")
    return text.replace("0.", ".", 1).encode() if text.startswith(("0.", "-0.")) else text.encode()


def _relative(path: bytes) -> bytes:
    """Convert a path to relative coordinates, and omit points that make no visible difference.

    A line with nearly the direction of the previous line extends that line; ``bend`` bounds the distance of the points
    that have been omitted from it [UNIT].
    """
    pieces: list[tuple[bytes, list[int]]] = []
    here = begin = (0, 0)
    bend = 0.0
    for command, text in re.findall(rb"([MLQCz])([-\d\s.e]*)", path):
        values = list(map(_units, text.split()))
        if command in b"Mz":
            pieces.append((command, values))
            here = begin = (values[0], values[1]) if values else begin
            continue
        steps = [value - here[k % 2] for k, value in enumerate(values)]
        here = values[-2], values[-1]
        if command == b"L" and pieces[-1][0] == b"l":
            (a, b), (c, d) = pieces[-1][1], steps
            bent = bend + abs(a * d - b * c) / (math.hypot(a + c, b + d) or math.inf)
            if bent <= BEND / UNIT and a * c + b * d > 0:
                pieces[-1], bend = (b"l", [a + c, b + d]), bent
                continue
        if any(steps):
            pieces.append((command.lower(), steps))
            bend = 0.0
    return _written(pieces)


def _written(pieces: Sequence[tuple[bytes, list[int]]]) -> bytes:
    made, before = bytearray(), b""
    for command, values in pieces:
        if command == b"l" and 0 in values:
            command, values = (b"h", values[:1]) if values[1] == 0 else (b"v", values[1:])
        made += command if command != before or command in b"Mz" else b""
        for k, text in enumerate(map(_number, values)):
            first = k == 0 and made.endswith(command)
            made += text if first or text.startswith(b"-") else b" " + text
        before = command
    return bytes(made)
