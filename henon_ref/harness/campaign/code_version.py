"""Which code is at work: a hash of its text, the same whether it is committed, changed or installed."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from importlib.util import find_spec

PACKAGES = ("henon_ref", "baselines")
LANGUAGES = (".py", ".c", ".h", ".m")
"""How the names of modules, and of programs in other languages, end."""


@cache
def code_version() -> str:
    """A hash of the text of every module and program of these packages."""
    digest = hashlib.sha256()
    for name in PACKAGES:
        found = find_spec(name)
        for top in (found and found.submodule_search_locations) or ():
            for path in sorted(_modules(top)):
                with open(path, "rb") as file:
                    text = file.read()
                digest.update(f"{name} {path.removeprefix(top)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def _modules(top: str) -> list[str]:
    """Paths of the modules and programs below a folder (Path.rglob takes twenty times as long)."""
    return [
        os.path.join(folder, file) for folder, _, files in os.walk(top) for file in files if file.endswith(LANGUAGES)
    ]
