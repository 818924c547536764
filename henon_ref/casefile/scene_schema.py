"""JSON Schema of a scene's bodies and connections, made of what the kinds say of their keys."""

from __future__ import annotations

from typing import Any

from henon_ref.casefile.bodies import KEYS
from henon_ref.casefile.connection import Key, Kind
from henon_ref.casefile.connections import KINDS

_EXPRESSION = {"type": ["number", "string"]}
_NAME = {"type": "string"}
_Schema = dict[str, Any]


def bodies_schema() -> _Schema:
    """Schema of ``bodies``: one key says what a body is."""
    forms: list[_Schema] = [{"const": "fixed"}]
    for key, (kind, unit) in KEYS.items():
        properties: _Schema = {key: _EXPRESSION | {"description": f"[{unit}]"}}
        if kind in ("mass", "rotor"):
            two = {"type": "array", "items": _NAME, "minItems": 2, "maxItems": 2}
            properties["states"] = two | {"description": "names of its states, position or angle first"}
        forms.append(_mapping(properties, [key]))
    return {"type": "object", "additionalProperties": {"anyOf": forms}, "minProperties": 1}


def connections_schema() -> _Schema:
    """Schema of ``connections``: a list of kinds with their keys."""
    entries = [
        _mapping({name: _kind(kind) | {"description": kind.meaning}}, [name]) for name, kind in sorted(KINDS.items())
    ]
    return {"type": "array", "items": {"anyOf": entries}}


def _kind(kind: Kind) -> _Schema:
    two = {"type": "array", "items": _NAME, "minItems": 2, "maxItems": 2, "description": "first and second body"}
    properties: _Schema = {"on": _NAME | {"description": "the body"}} if kind.on else {"between": two}
    required = [*properties, *(key.name for key in kind.keys if not key.optional)]
    properties |= {key.name: _key(key) for key in kind.keys}
    properties["name"] = _NAME | {"description": "the symbol of its sign, in place of one made of the bodies' names"}
    return _mapping(properties, required)


def _key(key: Key) -> _Schema:
    if key.words:
        return {"enum": list(key.words), "description": key.meaning}
    unit = f" [{key.unit}{f', between rotors {key.angular}' if key.angular != key.unit else ''}]"
    return _EXPRESSION | {"description": key.meaning + unit}


def _mapping(properties: _Schema, required: list[str]) -> _Schema:
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
