"""The texts of all pages as a script, from which a search page that is opened from disk takes its excerpts."""

from __future__ import annotations

import json
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx

_UNSEEN = (nodes.comment, nodes.raw, nodes.title)


def write(app: Sphinx, failure: Exception | None) -> None:
    """Write ``_static/page_texts.js`` at the end of a build."""
    if failure is None:
        texts = {f"{name}.html": _text(app, name) for name in sorted(app.env.found_docs)}
        content = f"setPageTexts({json.dumps(texts, ensure_ascii=False)});\n"
        Path(app.outdir, "_static", "page_texts.js").write_text(content, encoding="utf-8")


def _text(app: Sphinx, name: str) -> str:
    tree = app.env.get_doctree(name)
    for node in list(tree.findall(lambda node: isinstance(node, _UNSEEN))):
        node.parent.remove(node)
    return " ".join(tree.astext().split())
