"""Pages that the contents in index.md do not name: a new file in docs/ is found without an entry of its own."""

from __future__ import annotations

from pathlib import Path

INDEX = "index.md"


def entries(docs: Path) -> str:
    """A line a page, for the last list of the contents.

    Parameters
    ----------
    docs : Path
        The folder of the pages.
    """
    named = {line.strip() for line in (docs / INDEX).read_text(encoding="utf-8").splitlines()}
    pages = sorted(page.relative_to(docs).with_suffix("").as_posix() for page in docs.rglob("*.md"))
    return "\n".join(page for page in pages if page not in {*named, Path(INDEX).stem})
