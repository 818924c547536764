"""Pages that no contents name: a new file in docs/ is found without an entry of its own."""

from __future__ import annotations

from pathlib import Path

CONTENTS = ("index.md", "gallery.md")
"""Pages with a list of others."""


def entries(docs: Path) -> str:
    """A line a page, for the last list of the contents.

    Parameters
    ----------
    docs : Path
        The folder of the pages.
    """
    texts = [(docs / page).read_text(encoding="utf-8") for page in CONTENTS]
    named = {"index", *(line.strip() for text in texts for line in text.splitlines())}
    pages = sorted(page.relative_to(docs).with_suffix("").as_posix() for page in docs.rglob("*.md"))
    return "\n".join(page for page in pages if page not in named)
