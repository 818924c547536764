"""Which code is at work: a hash of its text, the same whether it is committed, changed or installed."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from importlib import import_module

BASELINES = "baselines"
"""A folder of ``henon_ref`` where it is installed, and beside it in a checkout."""
PACKAGES = ("henon_ref", f"henon_ref.{BASELINES}")
LANGUAGES = (".py", ".c", ".h", ".m")
"""How the names of modules, and of programs in other languages, end."""


@cache
def code_version() -> str:
    """A hash of the text of every module and program of these packages."""
    digest = hashlib.sha256()
    for name in PACKAGES:
        for top in import_module(name).__path__:
            for path in sorted(_modules(top)):
                with open(path, "rb") as file:
                    text = file.read()
                digest.update(f"{name} {path.removeprefix(top)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def _modules(top: str) -> list[str]:
    """Paths of a package's modules and programs, the baselines aside (Path.rglob takes twenty times as long)."""
    found = []
    for folder, below, files in os.walk(top):
        if folder == top and BASELINES in below:
            below.remove(BASELINES)
        found += [os.path.join(folder, file) for file in files if file.endswith(LANGUAGES)]
    return found
