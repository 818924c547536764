"""Which code is at work: a hash of its text, the same whether it is committed, changed or installed."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("henon_ref", "baselines")


@cache
def code_version() -> str:
    """A hash of the text of every module of these packages."""
    digest = hashlib.sha256()
    for name in PACKAGES:
        found = find_spec(name)
        for folder in (found and found.submodule_search_locations) or ():
            for path in sorted(Path(folder).rglob("*.py")):
                text = path.read_bytes()
                digest.update(f"{name}/{path.relative_to(folder).as_posix()} {len(text)}\n".encode() + text)
    return digest.hexdigest()
