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
_CARD = re.compile(r"^\[!\[\]\(.+$", re.MULTILINE)


def notebooks() -> str:
    """A card a notebook."""
    return _cards([f"[![]({picture}) {title}]({page})" for page, picture, title in NOTEBOOKS])


def scenes() -> str:
    """A card a scene, as the gallery has them."""
    return _cards(_CARD.findall((DOCS / "gallery.md").read_text(encoding="utf-8")))


def _cards(cards: list[str]) -> str:
    return "\n\n".join([":::{container} cards", *cards, ":::"])
