"""Relative links of the pages in a folder: those that lead nowhere become text."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:[^\[\]\\]|\\.)*)\]\((?P<address>[^()\s]+)\)")
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:|/|#", re.IGNORECASE)
_CODE = re.compile(r"^```.*?^```$|^ {4}.*?$|`[^`\n]+`", re.DOTALL | re.MULTILINE)


def dead_links(text: str, folder: Path) -> Iterator[str]:
    """Addresses of relative links in markdown that lead to no file; ``folder`` is where the page lies."""
    code = [found.span() for found in _CODE.finditer(text)]
    for found in _LINK.finditer(text):
        inside = any(begin <= found.start() < end for begin, end in code)
        if not inside and not _leads_somewhere(found["address"], folder):
            yield found["address"]


def without_dead_links(text: str, folder: Path) -> str:
    """Markdown in which what a dead link is put on stands as text, and a dead picture's caption is gone.

    Parameters
    ----------
    text : str
    folder : Path
        Where the page lies, or will.
    """
    dead = set(dead_links(text, folder))

    def kept(found: re.Match[str]) -> str:
        if found["address"] not in dead:
            return found[0]
        return "" if found["picture"] else found["text"]

    return _LINK.sub(kept, text)


def _leads_somewhere(address: str, folder: Path) -> bool:
    if _ELSEWHERE.match(address):
        return True
    return os.path.exists(folder / unquote(address.partition("#")[0]))
