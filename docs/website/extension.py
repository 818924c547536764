"""The Sphinx extension: a comment ``<!-- made: NAME -->`` in a page is replaced by what NAME makes, at every build."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

from website import (
    cards,
    case_keys,
    command_reference,
    further_pages,
    page_texts,
    solver_choice,
    solver_list,
    tolerance_table,
)
from website.mathml import visit_block, visit_inline

DOCS = Path(__file__).resolve().parents[1]
MAKERS: Mapping[str, Callable[[], str]] = {
    "cards of notebooks": cards.notebooks,
    "cards of scenes": cards.scenes,
    "which solver, in short": solver_choice.in_short,
    "which solver, by kind of case": solver_choice.by_kind_of_case,
    "what the numbers come from": solver_choice.origin,
    "digits by tolerance": tolerance_table.table,
    "solvers": solver_list.table,
    "commands": command_reference.page,
    "keys of a case file": case_keys.tables,
    "further pages": lambda: further_pages.entries(DOCS),
}
"""What can be made, as markdown."""
PAGES = "docs/"
"""Beginning of the names of the pages that the contents lead to."""
_ANCHOR = re.compile(r'^<a id="([\w-]+)"></a>$', re.MULTILINE)
"""A place in a report that links lead to; it becomes a target of Sphinx, so that such links are checked."""
_WIDE = re.compile(r'<pre(?=>)|<div class="(?:table-wrapper|math|output text_html)[^"]*"')
_PICTURE = re.compile(r'<p>(?P<picture><img alt="(?P<words>[^"]+?)\.?"[^>]*>)</p>(?!\s*<p><em>)')
"""A picture that is a paragraph of its own, without a caption; its alternative text becomes its caption."""
_MARK = re.compile(r"<!-- made: (?P<name>[^>]*?) -->")


def made(text: str) -> str:
    """The text of a page with what is made at build in the place of its marks.

    Raises
    ------
    ExtensionError
        Where a mark names something that nobody makes.
    """

    def content(mark: re.Match[str]) -> str:
        if mark["name"] not in MAKERS:
            raise ExtensionError(f"nobody makes '{mark['name']}'; there are {', '.join(MAKERS)}")
        return MAKERS[mark["name"]]()

    return _MARK.sub(content, text)


def _read(app: Sphinx, name: str, source: list[str]) -> None:
    if name.startswith(PAGES):
        source[0] = made(source[0])
    else:  # a report, or the list of cases: led to by links, not by the contents
        source[0] = "---\norphan: true\n---\n" + _ANCHOR.sub(r"(\1)=", source[0])


def _always_new(app: Sphinx, *changes: object) -> list[str]:
    """Pages with marks: what is made in them may have changed although they have not."""
    pages = [path for path in DOCS.rglob("*.md") if _MARK.search(path.read_text(encoding="utf-8"))]
    return [path.relative_to(DOCS.parent).with_suffix("").as_posix() for path in pages]


def _readable(app: Sphinx, name: str, template: str, context: dict[str, Any], tree: object) -> None:
    """Give pictures captions, and do what axe-core requires: keys scroll what is wide, and a heading has a level."""
    if "body" in context:
        caption = r"<figure>\g<picture><figcaption><p>\g<words>.</p></figcaption></figure>"
        context["body"] = _PICTURE.sub(caption, context["body"])
        context["body"] = _WIDE.sub(r'\g<0> tabindex="0"', context["body"])
    if "furo_navigation_tree" in context:
        context["furo_navigation_tree"] = context["furo_navigation_tree"].replace(
            'role="heading"', 'role="heading" aria-level="2"'
        )


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.add_lexer("csv", TextLexer)  # which has no colours
    app.connect("source-read", _read)
    app.connect("env-get-outdated", _always_new)
    app.connect("html-page-context", _readable, priority=900)  # behind the theme
    app.connect("build-finished", page_texts.write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
