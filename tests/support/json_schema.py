"""Validation by a JSON Schema, for the keywords in the schema of a case file; any other keyword is an error."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

SILENT = {"title", "description", "default", "$defs", "$schema"}
"""Keywords that refuse nothing."""
TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "null": (type(None),),
    "boolean": (bool,),
}


def faults(value: Any, schema: dict[str, Any], whole: dict[str, Any], place: str = "") -> Iterator[str]:
    """Where a value is not what a schema wants, and by which keyword; ``whole`` has the definitions."""
    for keyword, wanted in schema.items():
        if keyword in SILENT:
            continue
        if keyword == "$ref":
            yield from faults(value, whole["$defs"][wanted.rsplit("/", 1)[1]], whole, place)
        elif keyword == "anyOf":
            if all(list(faults(value, way, whole, place)) for way in wanted):
                yield f"{place}: anyOf"
        elif keyword == "properties":
            for key in value.keys() & wanted.keys() if isinstance(value, dict) else ():
                yield from faults(value[key], wanted[key], whole, f"{place}/{key}")
        elif keyword == "additionalProperties":
            for key in value.keys() - schema.get("properties", {}).keys() if isinstance(value, dict) else ():
                if wanted is False:
                    yield f"{place}/{key}: not known"
                elif isinstance(wanted, dict):
                    yield from faults(value[key], wanted, whole, f"{place}/{key}")
        elif keyword == "patternProperties":
            for key in value if isinstance(value, dict) else ():
                for pattern, own in wanted.items():
                    if re.search(pattern, key):
                        yield from faults(value[key], own, whole, f"{place}/{key}")
        elif keyword == "propertyNames":
            for key in value:
                yield from faults(key, wanted, whole, f"{place}/{key}")
        elif keyword == "items":
            for number, item in enumerate(value if isinstance(value, list) else ()):
                yield from faults(item, wanted, whole, f"{place}/{number}")
        elif not _holds(keyword, wanted, value):
            yield f"{place}: {keyword}"


def _holds(keyword: str, wanted: Any, value: Any) -> bool:
    """Whether a value meets a keyword that looks at nothing within it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if keyword == "type":
        kinds = [wanted] if isinstance(wanted, str) else wanted
        if isinstance(value, bool):
            return "boolean" in kinds
        return any(isinstance(value, TYPES[kind]) for kind in kinds)
    if keyword in ("enum", "const"):
        return value in (wanted if keyword == "enum" else [wanted])
    if keyword == "required":
        return not isinstance(value, dict) or value.keys() >= set(wanted)
    if keyword == "pattern":
        return not isinstance(value, str) or re.search(wanted, value) is not None
    bounds = {
        "minItems": isinstance(value, list) and len(value) < wanted,
        "maxItems": isinstance(value, list) and len(value) > wanted,
        "minProperties": isinstance(value, dict) and len(value) < wanted,
        "maxProperties": isinstance(value, dict) and len(value) > wanted,
        "minLength": isinstance(value, str) and len(value) < wanted,
        "maxLength": isinstance(value, str) and len(value) > wanted,
        "maximum": number and value > wanted,
        "minimum": number and value < wanted,
        "exclusiveMinimum": number and value <= wanted,
        "exclusiveMaximum": number and value >= wanted,
    }
    return not bounds[keyword]
