"""The keys of a case file, read off its JSON Schema."""

from __future__ import annotations

from typing import Any

from henon_ref.casefile.schema import case_schema
from henon_ref.report.text.tables import Table
from henon_ref.text import code


def tables() -> str:
    """A table for the top of the file, then one for each mapping in it."""
    schema = case_schema()
    parts = [_table(schema)]
    for name, form in schema["$defs"].items():
        if "properties" in form:
            parts.append(f"### {name}\n\n{form.get('description', '')}\n\n{_table(form)}")
    return "\n\n".join(parts)


def _table(form: dict[str, Any]) -> str:
    required = set(form.get("required", ()))
    rows = [
        (code(key), "yes" if key in required else "", " ".join(own.get("description", "").split()))
        for key, own in form["properties"].items()
    ]
    return Table(("key", "required", "meaning"), "lll", rows).markdown
