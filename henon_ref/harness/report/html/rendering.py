"""A page put together: its template, with style, script and data in it, so that it needs no other file."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from henon_ref.harness.report.html.embedded import embedded

if TYPE_CHECKING:
    from jinja2 import Environment

MOST_BYTES = 4 * 2**20
"""Bytes that a page may have: every solver and peer on every reading of the suite, with all its runs."""


def rendered(template: str, style: str, scripts: Sequence[str], data: Any, **context: Any) -> str:
    """A page as text.

    Parameters
    ----------
    template : str
        Name of its file among the templates.
    style : str
        CSS.
    scripts : sequence of str
        Names of JavaScript files among the templates, in their order.
    data
        What the script draws, fit for JSON.
    context
        What else the template shows; all of it is escaped, but for style, script and data.
    """
    code = "\n".join(source(name).strip() for name in scripts)
    made = _environment().get_template(template)
    return made.render(style=style, script=code, data=embedded(data), **context).strip() + "\n"


def source(name: str) -> str:
    """The text of a file among the templates."""
    return (files("henon_ref.harness.report.html") / "templates" / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("henon_ref.harness.report.html"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
