"""The case file's form as JSON Schema, for editors that complete and check YAML."""

from __future__ import annotations

import json
from typing import Any

from henon_ref.casefile.schema import NAME_PATTERN, READING_KEYS, CaseForm


def case_schema() -> dict[str, Any]:
    """JSON Schema of a case file, for editors that complete and check YAML."""
    schema = CaseForm.model_json_schema(by_alias=True)
    schema["$defs"] |= {f"{name}{_PART}": _part_of(form) for name, form in schema["$defs"].items()}
    overrides = {key: _override(value) for key, value in schema["properties"].items() if key in READING_KEYS}
    schema["properties"]["readings"] = {
        "type": "object",
        "description": "name: overrides of the keys above; mappings merge, anything else replaces, null removes",
        "additionalProperties": {"type": "object", "properties": overrides, "additionalProperties": False},
        "propertyNames": {"pattern": NAME_PATTERN},
    }
    # With readings, a required key may stand in every reading instead of at the top.
    schema["required"] = ["schema", "name", "title"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


_PART = "Part"
"""Behind the name of a form: a part of it, as a reading may have it."""


def _override(value: dict[str, Any]) -> dict[str, Any]:
    """What a reading may lay over a value: a part of a mapping, anything else whole, or null."""
    described: dict[str, Any] = {key: value[key] for key in ("description", "title") if key in value}
    return {"anyOf": [*(_part(way) for way in value.get("anyOf", [value])), {"type": "null"}], **described}


def _part(value: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in value:
        return {"$ref": value["$ref"] + _PART}
    return _part_of(value) if value.get("type") == "object" else value


def _part_of(mapping: dict[str, Any]) -> dict[str, Any]:
    """A mapping of which every key may be left out, and be overridden in its turn."""
    part = {key: value for key, value in mapping.items() if key not in ("required", "minProperties", "default")}
    if "properties" in part:
        part["properties"] = {key: _override(value) for key, value in part["properties"].items()}
    if isinstance(part.get("additionalProperties"), dict):
        part["additionalProperties"] = _override(part["additionalProperties"])
    return part


def schema_text() -> str:
    """The JSON Schema as a file holds it: ``cases/case.schema.json`` is this text."""
    return json.dumps(case_schema(), indent=1) + "\n"
