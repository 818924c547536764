"""Examples as cards: a picture and a title each, which lead to the page."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
NOTEBOOKS = (
    ("notebooks/my_friction.md", "pictures/own_friction.png", "My friction model"),
    ("notebooks/identification.md", "pictures/stick_slip.png", "Identify friction with least_squares"),
    ("notebooks/bifurcation_and_basins.md", "pictures/bifurcation.png", "Bifurcation diagram and basins"),
    ("notebooks/score_my_solver.md", "../reports/stribeck_belt/default_cost.svg", "Score my solver"),
)
"""Page, picture and title of each notebook."""
_SCENE = re.compile(r"^## (?P<title>.+)\n\n!\[[^\]]*\]\((?P<picture>gallery/[^)]+)\)", re.MULTILINE)


def notebooks() -> str:
    """A card a notebook."""
    return _cards([(page, picture, title) for page, picture, title in NOTEBOOKS])


def scenes() -> str:
    """A card a scene of the gallery."""
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    found = [(own["title"], own["picture"]) for own in _SCENE.finditer(text)]
    return _cards([(f"gallery.md#{_anchor(title)}", picture, title.replace("\\", "")) for title, picture in found])


def _cards(entries: list[tuple[str, str, str]]) -> str:
    lines = [f"[![]({picture}) {title}]({page})" for page, picture, title in entries]
    return "\n\n".join(["````{container} cards", *lines, "````"])


def _anchor(title: str) -> str:
    """The name of a heading's place in a page."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
