"""Templates of reports, and HTML pages: a single file with its style, scripts and data.

The data of a page is compressed JSON, as base64 text in a script element that the browser does not run. It can be read
back. Arrays of numbers within it are base64 text, too.
"""

from __future__ import annotations

import json
import re
import zlib
from base64 import b64decode, b64encode
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures.motion import Motion, axes_of_portrait, limits_around, plane_of, surface_curves
from henon_ref.figures.style import lines_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import one_line

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def environment() -> Environment:
    """Make the environment of all templates; values are escaped in HTML, and inserted as they are in markdown."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("henon_ref.harness.report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=lambda name: str(name).endswith(".html"),
    )


def rendered(template: str, scripts: Sequence[str], data: Any, **context: Any) -> str:
    """Render a page from the file names of its template and of the scripts that draw the data.

    ``context`` holds the other variables of the template. They are escaped; style, scripts and data are not.
    """
    folder = files("henon_ref.harness.report") / "templates"
    style, *code = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", *scripts))
    made = environment().get_template(template)
    return made.render(style=style, script="\n".join(code), data=embedded(data), **context).strip() + "\n"


def embedded(data: Any) -> str:
    """Encode data as text that contains no HTML markup.

    >>> unpacked(embedded({"name": "</script><b>"}))
    {'name': '</script><b>'}
    """
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def unpacked(text: str) -> Any:
    """Decode the text of :func:`embedded`."""
    return json.loads(zlib.decompress(b64decode(text)))


def read_embedded(page: str) -> Any:
    """Read the data of a page; None if it has none."""
    block = re.search(r'<script type="application/zlib" id="data">(.*?)</script>', page, re.DOTALL)
    try:
        return None if block is None else unpacked(block[1])
    except (RecursionError, ValueError, zlib.error):
        return None


def rounded(value: object, places: int) -> object:
    """Round a number to significant digits, as an integer if possible; make text printable."""
    if isinstance(value, str):
        return one_line(value)
    if not isinstance(value, float | int):
        return value
    short = float(f"{value:.{places}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def packed_numbers(values: Any, kind: str) -> str:
    """Encode numbers of a NumPy type (little-endian) as base64 text."""
    with np.errstate(over="ignore"):  # values beyond single precision become infinite
        return b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")


CELLS = 2048
"""Grid steps between the limits of a portrait, four to six a pixel; points may lie up to seven times this distance
outside."""
MOST_POINTS = 1500
"""Number of points above which a portrait is thinned further."""


def packed(system: FilippovSystem, motion: Motion) -> dict[str, Any]:
    """Return the portrait of a motion as JSON; for a system with one state, the state over time.

    ``pieces`` are pairs (label, points) in order of time, ``surfaces`` are points. Points are text: integers x y of the
    first point, where 0 and ``CELLS`` are the limits, and of the steps from each point to the next.
    """
    pair = axes_of_portrait(system)
    x, y = pair or (0, 0)
    points = np.column_stack([motion.states[:, x] if pair else motion.times, motion.states[:, y]])
    limits = limits_around(points[:, 0]), limits_around(points[:, 1])
    curves = [(label, points[piece]) for label, piece in plane_of(system, x, y).pieces(motion.modes)]
    for threshold in (2.0**k for k in range(1, 13)):  # allowed distance of a thinned curve from its points [grid steps]
        pieces = [(label, _on_grid(own, limits, threshold)) for label, own in curves]
        if sum(len(own) for _, own in pieces) <= MOST_POINTS:
            break
    surfaces = surface_curves(system, pair, limits) if pair else []
    return {
        "names": [system.state_names[x] if pair else "t", system.state_names[y]],
        "limits": [[float(f"{value:.6g}") for value in own] for own in limits],
        "window": [float(f"{value:.12g}") for value in motion.times[[0, -1]]],
        "pieces": [[label, _steps(own)] for label, own in pieces],
        "surfaces": [_steps(_on_grid(own, limits, threshold)) for own in surfaces],
    }


def _steps(points: NDArray[np.float64]) -> str:
    return " ".join(map(str, np.diff(points.astype(int), axis=0, prepend=0).ravel().tolist()))


def _on_grid(
    points: NDArray[np.float64], limits: tuple[tuple[float, float], tuple[float, float]], threshold: float
) -> NDArray[np.float64]:
    """Convert a curve to integer grid steps, and remove points on the line between their neighbours."""
    from matplotlib.path import Path

    low, high = np.array(limits).T
    scaled = np.clip((points - low) / (high - low) * CELLS, -7 * CELLS, 7 * CELLS)
    if len(scaled) < 3:
        return np.rint(scaled)
    path = Path(scaled)
    path.simplify_threshold = threshold
    cleaned = path.cleaned(simplify=True)
    kept = np.asarray(cleaned.vertices)[np.asarray(cleaned.codes) != Path.STOP]
    return np.rint(np.vstack([scaled[:1], kept[1:], scaled[-1:]]))


PAPER, NIGHT = "#ffffff", "#15181c"
"""Background colours of the light and the dark page."""
MIN_CONTRAST = 3.0
"""Smallest contrast of a line with the background (WCAG 2.2, 1.4.11)."""


def solver_lines(solvers: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return colours (light and dark), dashes [line widths], marker and width of the line of each solver."""
    known, found = {"-": (), "--": (5, 3), ":": (1.5, 2.5), "-.": (5, 2, 1.5, 2)}, {}
    for name, line in lines_of(solvers).items():
        dashes = known[line.dashes] if isinstance(line.dashes, str) else line.dashes[1]
        found[name] = {
            "light": towards(line.colour, 0.0, PAPER),
            "dark": towards(line.colour, 1.0, NIGHT),
            "dashes": " ".join(f"{length:g}" for length in dashes),
            "marker": line.marker,
            "width": line.width,
        }
    return found


def towards(colour: str, end: float, background: str) -> str:
    """Mix a colour with black (0) or white (1) until its contrast with a background is sufficient.

    >>> towards("#000000", 1.0, "#15181c"), towards("#0072b2", 0.0, "#ffffff")
    ('#666666', '#0072b2')
    """
    for share in range(0, 101, 2):
        parts = ((1 - share / 100) * channel + share / 100 * end for channel in _channels(colour))
        mixed = "#" + "".join(f"{round(255 * part):02x}" for part in parts)
        if contrast(mixed, background) >= MIN_CONTRAST:
            break
    return mixed


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of two colours (WCAG 2.2).

    >>> round(contrast("#000000", "#ffffff"), 6)
    21.0
    """
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in _channels(colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _channels(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
