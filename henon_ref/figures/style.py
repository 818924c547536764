"""Common style of all figures: sizes, fonts and colours, descriptions for screen readers, and reproducible output."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape
from zlib import crc32

from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH = 7.2
"""Width of a figure [in]: text width of a page."""

BLUE, VERMILLION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
SKY, PURPLE, BLACK, GREY = "#56B4E9", "#AA4499", "#000000", "#767676"
BROWN, PINK, OLIVE = "#8C4A2F", "#CC79A7", "#6B6B00"
"""Palette of Okabe and Ito for colour-blind readers (purple darkened for contrast on white), and two more colours."""

STICK_SHADE, PLUS_SHADE, MINUS_SHADE = "#F6C48A", "#CFE3F3", "#FFFFFF"
"""Background of stick, of slip with s = +1, and of slip with s = -1."""

THIN = 1.1
"""Width of an ordinary line [pt]; highlighted solvers have wider lines."""
FONTS = "DejaVu Sans", "Verdana"
"""Fonts of all text: of two with nearly the same widths, a reader's machine has one."""
Dashes = str | tuple[int, tuple[int, ...]]
"""Dash pattern of a line: matplotlib's name, or offset and lengths of dashes and gaps [line widths]."""


@dataclass(frozen=True)
class Line:
    """Line style of a solver, equal in all figures."""

    colour: str
    marker: str
    dashes: Dashes = "-"
    width: float = THIN


_LINES = {
    "henon": Line(VERMILLION, "o", width=2.2),
    "henon-newton": Line(VERMILLION, "v", "--"),
    "henon-brent": Line(VERMILLION, "^", ":"),
    "henon-rk4": Line(ORANGE, "s"),
    "henon-listing": Line(ORANGE, "X", "--"),
    "heyoka": Line(BLACK, "D", width=1.6),
    "cvode-adams": Line(GREEN, "o"),
    "cvode-c-adams": Line(GREEN, "d", "--"),
    "cvode-bdf": Line("#004D38", "s", "--"),
    "cvode-c-bdf": Line("#004D38", "P", ":"),
    "ida": Line("#66CDAA", "^", ":"),
    "scipy-rk45": Line("#6CBFF2", "o"),
    "scipy-dop853": Line(BLUE, "D"),
    "scipy-radau": Line("#3B3F9E", "s", "--"),
    "scipy-bdf": Line("#6F8CEC", "^", "--"),
    "scipy-lsoda": Line("#12124F", "v", ":"),
    "scipy-smoothed": Line(GREY, "P", "--"),
    "scipy-sign": Line("#A6A6A6", "X", ":"),
    "diffrax-dopri8": Line(PURPLE, "p"),
    "diffrax-kvaerno5": Line(PURPLE, "h", "--"),
    "diffsol-tsit45": Line(BROWN, "d"),
    "diffsol-bdf": Line(BROWN, "<", "--"),
    "octave-ode45": Line(PINK, "*"),
    "siconos": Line(OLIVE, "8"),
    "nosnoc": Line(OLIVE, "h", "--"),
}
"""Line style of each solver. SUNDIALS is green, SciPy blue; their solvers differ in lightness, too, for colour-blind
readers."""

_THIRD = tuple(
    Line(colour, marker, dashes)
    for dashes, markers in (("-", "dph*"), ("--", "<>8H"), (":", "dph*"))
    for colour, marker in zip((PURPLE, BROWN, PINK, OLIVE), markers, strict=True)
)
"""Line styles of third-party solvers: purple, brown, pink and olive, with other markers than the built-in solvers."""

_VARIANTS: dict[str, Dashes] = {
    "numba": "-.",
    "event-free-step": (0, (4, 1, 1, 1, 1, 1)),
    "offset": (0, (4, 1)),
    "direction": (0, (1, 1)),
    "none": (0, (2, 2)),
}
"""Dashes of a solver's variants, by the text after ``+`` or ``@``; colour and marker are those of the solver."""


def lines_of(solvers: Iterable[str]) -> dict[str, Line]:
    """Return the line style of each solver; up to a dozen third-party solvers have distinct styles.

    A variant (``+numba``, ``@offset``) has the colour and marker of its solver, and its own dashes. The style of a
    third-party solver is derived from its name: it is the same in all figures unless another solver has taken it.

    >>> lines_of(["henon"])["henon"].marker
    'o'
    """
    names = dict.fromkeys(solvers)
    bases = {name: re.split("[+@]", name) for name in names}
    unknown = sorted({base for base, *_ in bases.values() if base not in _LINES})
    own = dict(_LINES)
    free = list(range(len(_THIRD)))
    for base in unknown:
        first = crc32(base.encode()) % len(_THIRD)
        free = free or list(range(len(_THIRD)))
        place = min(free, key=lambda k: (k - first) % len(_THIRD))
        free.remove(place)
        own[base] = _THIRD[place]
    return {
        name: replace(own[base], dashes=_VARIANTS.get(variant[-1], "-.")) if variant else own[base]
        for name, (base, *variant) in bases.items()
    }


def line_of(solver: str) -> Line:
    """Return the line style of a single solver, or of one among built-in solvers."""
    return lines_of([solver])[solver]


def pyplot_figure(height: float, width: float = WIDTH, **how: Any) -> Figure:
    """Create an empty pyplot figure, which a notebook shows; draw in it within :func:`report_style`.

    The first pyplot figure selects a backend, which sets global parameters. Within a style these would be reset, and a
    notebook would show only the first figure; the figure is therefore created outside the style.
    """
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(width, height), **how)


def report_style() -> AbstractContextManager[None]:
    """Return the style of the reports as a context."""
    import matplotlib

    parameters: dict[Any, Any] = {
        "font.size": 9.0,
        "axes.labelsize": 9.0,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titley": 1.0,  # the default; if unset, matplotlib lays out every tick label again
        "xtick.labelsize": 8.0,
        "ytick.labelsize": 8.0,
        "legend.fontsize": 8.0,
        "legend.frameon": False,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.7,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#E3E3E3",
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.2,
        "lines.markersize": 4.5,
        "font.sans-serif": list(FONTS),
        "mathtext.fontset": "dejavusans",
        "path.simplify": False,  # keeps transitions as corners, and all samples of an arc
        "svg.hashsalt": "henon-ref",
        "svg.fonttype": "none",  # text is text: searchable, and a fraction of the bytes of its outlines
    }
    return matplotlib.rc_context(parameters)


@contextmanager
def figure(height: float, *, width: float = WIDTH) -> Iterator[Figure]:
    """Yield a figure in the style of the reports; sizes in inches."""
    from matplotlib.figure import Figure

    with report_style():
        yield Figure(figsize=(width, height))


def image(figure: Figure, kind: str = "svg") -> bytes:
    """Return a figure as a file (SVG with title and description, PNG or PDF) that is the same in every run."""
    from matplotlib.patheffects import Normal

    buffer = io.BytesIO()
    metadata = {"Date": None, "Creator": None} if kind == "svg" else None
    with report_style():
        for formula in figure.findobj(_needs_outlines) if kind == "svg" else ():
            formula.set_path_effects([Normal()])  # which makes outlines of its letters
        figure.savefig(buffer, format=kind, metadata=metadata, dpi=150)
    if kind != "svg":
        return buffer.getvalue()
    fonts = ", ".join(map(repr, FONTS)) + ", sans-serif"
    text = buffer.getvalue().decode().replace(f"'{FONTS[0]}'\"", f'{fonts}"')  # in formulas
    text = text.replace("</style>", "text{white-space: pre}</style>", 1)  # SVG joins spaces otherwise
    return with_description(text, *description_of(figure)).encode()


def _needs_outlines(artist: Artist) -> bool:
    """Check whether a text is a formula with a symbol (a root, a large parenthesis) that few fonts have."""
    from matplotlib.cbook import is_math_text
    from matplotlib.mathtext import MathTextParser
    from matplotlib.text import Text

    if not (isinstance(artist, Text) and artist.get_parse_math() and is_math_text(artist.get_text())):
        return False
    parsed = MathTextParser("path").parse(artist.get_text(), 72, artist.get_fontproperties())
    return any(font.family_name != FONTS[0] for font, *_ in parsed.glyphs)


def describe(figure: Figure, title: str, description: str) -> None:
    """Attach a title to a figure, and a description of its axes and content."""
    figure.set_label(f"{one_line(title)}\n{one_line(description)}")


def description_of(figure: Figure) -> tuple[str, str]:
    """Return title and description of a figure; by default from its own titles and axis labels."""
    title, _, description = str(figure.get_label()).partition("\n")
    if description:
        return title, description
    panels = " ".join(filter(None, map(_panel, figure.axes)))
    titles = list(filter(None, map(_title, figure.axes)))
    titles = titles or [" over ".join(filter(None, (axes.get_ylabel(), axes.get_xlabel()))) for axes in figure.axes]
    title = figure.get_suptitle() or "; ".join(titles)
    return _spoken(title) or "Figure", _spoken(panels) or "A figure without axes."


def _title(axes: Axes) -> str:
    return next((own for place in ("left", "center", "right") if (own := axes.get_title(loc=place))), "")


def _spoken(text: str) -> str:
    """Return text without the markup of mathematical typesetting."""
    return re.sub(r"[\\${}]", "", re.sub(r"\\[,;: ]", " ", text))


def _panel(axes: Axes) -> str:
    labels = [f"{side}: {own}" for side, own in (("across", axes.get_xlabel()), ("upward", axes.get_ylabel())) if own]
    if not labels:
        return ""
    curves = [str(own) for own in axes.get_legend_handles_labels()[1]]
    shown = f"; shown are {', '.join(curves)}" if curves else ""
    return f"{_title(axes) or 'Panel'}, {', '.join(labels)}{shown}."


def with_description(svg: str, title: str, description: str) -> str:
    """Return an SVG with the role of an image, a title and a description.

    The ids of the elements are derived from their text, so that two figures in one page do not share them.

    >>> print(with_description('<svg width="1">\\n</svg>', "A < B", "Of A and B."))
    <svg role="img" aria-labelledby="title-c3ee58ff desc-c3ee58ff" width="1">
    <title id="title-c3ee58ff">A &lt; B</title>
    <desc id="desc-c3ee58ff">Of A and B.</desc>
    </svg>
    """
    mark = f"{crc32(f'{title} {description}'.encode()):08x}"
    head = f'<svg role="img" aria-labelledby="title-{mark} desc-{mark}"'
    elements = (
        f'<title id="title-{mark}">{escape(one_line(title))}</title>\n'
        f'<desc id="desc-{mark}">{escape(one_line(description))}</desc>'
    )
    return re.sub(r"<svg\b([^>]*)>", lambda found: f"{head}{found.group(1)}>\n{elements}", svg, count=1)


def power_of_ten(value: float) -> str:
    """Return a power of ten as text.

    >>> power_of_ten(1e-12), power_of_ten(1.0)
    ('10⁻¹²', '1')
    """
    exponent = round(math.log10(value)) if value > 0 else 0
    superscript = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return "1" if exponent == 0 else "10" + str(exponent).translate(superscript)


def time_text(seconds: float) -> str:
    """Return a time with two digits, in a suitable unit.

    >>> [time_text(10.0**k) for k in range(-7, 3)]
    ['0.1 µs', '1 µs', '10 µs', '0.1 ms', '1 ms', '10 ms', '0.1 s', '1 s', '10 s', '100 s']
    >>> time_text(1.37e-4), time_text(0.0), time_text(2e-9), time_text(2345.0)
    ('0.14 ms', '0 s', '2 ns', '2345 s')
    """
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.0999 * size or seconds == 0:
            value = seconds / size
            return f"{value:.0f} {unit}" if value >= 100 else f"{value:.2g} {unit}"
    return f"{seconds * 1e9:.2g} ns"


def decades(axis: Axis, text: Callable[[float], str] = power_of_ten) -> None:
    """Label at most nine decades of a logarithmic axis with set limits by ``text``, without slow mathtext."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = axis.get_view_interval()
    span = math.log10(high / low)
    axis.set_major_locator(LogLocator(10, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axis.set_minor_locator(LogLocator(10, subs=range(2, 10), numticks=12) if span < 6 else NullLocator())
    axis.set_minor_formatter(NullFormatter())
