"""Descriptions of figures: their ``<title>`` and ``<desc>``, which screen readers read aloud."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape
from zlib import crc32

from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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

    Examples
    --------
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
