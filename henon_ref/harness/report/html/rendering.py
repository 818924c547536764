"""A page put together: its template, with style, script and data in it, so that it needs no other file.

The data is JSON, compressed, as base64 text in a script element that is never run; it is read back from there.
"""

from __future__ import annotations

import json
import re
import zlib
from base64 import b64decode, b64encode
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from henon_ref.text import one_line

MOST_BYTES = 4 * 2**20
"""Bytes that a page may have: every solver and peer on every reading of the suite, with all its runs."""
_BLOCK = re.compile(r'<script type="application/zlib" id="data">(.*?)</script>', re.DOTALL)


def rendered(template: str, scripts: Sequence[str], data: Any, **context: Any) -> str:
    """A page as text: a template and the scripts that draw the data, by their files' names among the templates.

    ``context`` is what else the template shows; all of it is escaped, but for style, script and data.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("henon_ref.harness.report.html"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    folder = files("henon_ref.harness.report.html") / "templates"
    style, *code = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", *scripts))
    made = environment.get_template(template)
    return made.render(style=style, script="\n".join(code), data=embedded(data), **context).strip() + "\n"


def embedded(data: Any) -> str:
    """Data as text that may stand in a page: whatever is in it, it ends no element and begins none.

    Examples
    --------
    >>> unpacked(embedded({"name": "</script><b>"}))
    {'name': '</script><b>'}
    """
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def unpacked(text: str) -> Any:
    """The data behind what :func:`embedded` makes of it."""
    return json.loads(zlib.decompress(b64decode(text)))


def read_embedded(page: str) -> Any:
    """The data of a page; None where it has none."""
    block = _BLOCK.search(page)
    try:
        return None if block is None else unpacked(block[1])
    except (RecursionError, ValueError, zlib.error):
        return None


def rounded(value: object, places: int) -> object:
    """A number to so many significant places, a whole one without a point; anything else as it is, text printable."""
    if isinstance(value, str):
        return one_line(value)
    if not isinstance(value, float | int):
        return value
    short = float(f"{value:.{places}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short
