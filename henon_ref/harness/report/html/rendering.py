"""Render an HTML page from a template as a single file with its style, scripts and data.

The data is compressed JSON, as base64 text in a script element that the browser does not run. It can be read back.
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
"""Largest size of a page with all runs of every solver and peer on the whole suite [bytes]."""
_BLOCK = re.compile(r'<script type="application/zlib" id="data">(.*?)</script>', re.DOTALL)


def rendered(template: str, scripts: Sequence[str], data: Any, **context: Any) -> str:
    """Render a page from the file names of its template and of the scripts that draw the data.

    ``context`` holds the other variables of the template. They are escaped; style, scripts and data are not.
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
    """Encode data as text that contains no HTML markup.

    Examples
    --------
    >>> unpacked(embedded({"name": "</script><b>"}))
    {'name': '</script><b>'}
    """
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def unpacked(text: str) -> Any:
    """Decode the text of :func:`embedded`."""
    return json.loads(zlib.decompress(b64decode(text)))


def read_embedded(page: str) -> Any:
    """Read the data of a page; None if it has none."""
    block = _BLOCK.search(page)
    try:
        return None if block is None else unpacked(block[1])
    except (RecursionError, ValueError, zlib.error):
        return None


def rounded(value: object, places: int) -> object:
    """Round a number to significant digits, as an integer if possible; make text printable."""
    if isinstance(value, str):
        return one_line(value)
    if not isinstance(value, float | int):
        return value
    short = float(f"{value:.{places}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short
