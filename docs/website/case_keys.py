"""The keys of a case file, read off its JSON Schema."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from henon_ref.casefile.json_schema import case_schema
from henon_ref.harness.table import Table
from henon_ref.text import code

_FORM = re.compile(r'"\$ref": "#/\$defs/(\w+)"')
READINGS = "readings"
"""The key whose own keys are those of the file again."""


def tables() -> str:
    """A table for the top of the file, then one for each mapping in it, under the name of its key."""
    schema = case_schema()
    forms = schema["$defs"]
    parts = [_table(schema, forms)]
    for key, form in _mappings(schema["properties"], forms):
        meaning = _without_roles(forms[form].get("description", ""))
        parts.append(f"### {code(key)}\n\n{meaning}\n\n{_table(forms[form], forms)}")
    return "\n\n".join(parts)


def _mappings(properties: dict[str, Any], forms: dict[str, Any], inside: str = "") -> Iterator[tuple[str, str]]:
    """Keys that hold a mapping with keys of its own, and the name of its form; those inside of them behind them."""
    for key, own in properties.items():
        form = None if key == READINGS else _form(own)
        if form is not None and "properties" in forms[form]:
            yield f"{inside}{key}", form
            yield from _mappings(forms[form]["properties"], forms, f"{inside}{key}.")


def _form(own: dict[str, Any]) -> str | None:
    found = _FORM.search(json.dumps(own))
    return found[1] if found else None


def _table(form: dict[str, Any], forms: dict[str, Any]) -> str:
    required = set(form.get("required", ()))
    rows = [
        (code(key), "yes" if key in required else _default(own), _meaning(key, own, forms))
        for key, own in form["properties"].items()
    ]
    return Table(("key", "required, or default", "meaning"), "lll", rows).markdown


def _default(own: dict[str, Any]) -> str:
    value = own.get("default")
    return code(json.dumps(value)) if value not in (None, [], {}) and _form(own) is None else ""


def _meaning(key: str, own: dict[str, Any], forms: dict[str, Any]) -> str:
    form = None if key == READINGS else _form(own)
    words = own.get("description") or (forms[form].get("description", "") if form else "")
    return _without_roles(words)


def _without_roles(docstring: str) -> str:
    """A docstring on one line, roles of Sphinx as code."""
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", " ".join(docstring.split()))
