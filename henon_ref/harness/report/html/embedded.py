"""Data within a page: JSON in a script element that is never run, and read back from there."""

from __future__ import annotations

import json
import re
from typing import Any

_BLOCK = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)
_ESCAPES = {ord(mark): f"\\u{ord(mark):04x}" for mark in "<>&\u2028\u2029"}


def embedded(data: Any) -> str:
    """Data as JSON that may stand in a page: whatever is in it, it ends no element and begins none.

    Examples
    --------
    >>> print(embedded({"name": "</script><b>"}))
    {"name":"\\u003c/script\\u003e\\u003cb\\u003e"}
    """
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.translate(_ESCAPES)


def read_embedded(page: str) -> Any:
    """The data of a page; None where it has none."""
    block = _BLOCK.search(page)
    try:
        return None if block is None else json.loads(block[1])
    except (RecursionError, ValueError):
        return None
