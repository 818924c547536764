"""The kinds of connections, each a file here, found by its name: ``spring.py`` is what a scene calls ``spring``.

A file defines ``KIND`` (a :class:`henon_ref.casefile.connection.Kind`). What a scene does not name is not built.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules

from henon_ref.casefile.connection import Kind

KINDS: Mapping[str, Kind] = {name: import_module(f"{__name__}.{name}").KIND for _, name, _ in iter_modules(__path__)}
"""Name -> kind, in alphabetical order."""
