"""JSON Schema of case files, with which editors complete and check YAML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING
from decimal import Decimal
from typing import Any

from henon_ref.casefile.form import Form, Kind, Scalar, kind_of
from henon_ref.casefile.schema import NAME_PATTERN, READING_KEYS, CaseForm
from henon_ref.system.connections import KINDS, Key
from henon_ref.system.scene import KEYS

_EXPRESSION = {"type": ["number", "string"]}
_NAME = {"type": "string"}
_TWO_NAMES = {"type": "array", "items": _NAME, "minItems": 2, "maxItems": 2}
_Schema = dict[str, Any]


def schema_text() -> str:
    return json.dumps(case_schema(), indent=1) + "\n"


def case_schema() -> _Schema:
    forms: dict[str, _Schema] = {}
    whole, forms = _ordered(_form(CaseForm, forms)), _ordered(forms)
    overrides = {key: _override(value) for key, value in whole["properties"].items() if key in READING_KEYS}
    whole["properties"]["readings"] = {
        "type": "object",
        "description": "name: overrides of the keys above; mappings merge, other values replace, null removes",
        "additionalProperties": {"type": "object", "properties": overrides, "additionalProperties": False},
        "propertyNames": {"pattern": NAME_PATTERN},
    }
    # With readings, a required key may be in every reading instead of at the top.
    whole["required"] = ["schema", "name", "title"]
    forms |= {f"{name}Part": _part_of(form) for name, form in forms.items()}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$defs": forms, **whole}


def _ordered(value: Any, key: str = "") -> Any:
    """Return a schema with its keywords in alphabetical order; keys of the case file keep their order."""
    if isinstance(value, dict):
        names = value if key in ("properties", "default") else sorted(value)
        return {name: _ordered(value[name], name) for name in names}
    return [_ordered(item) for item in value] if isinstance(value, list) else value


# -- forms ----------------------------------------------------------------------------------------------


def _form(form: type[Form], forms: dict[str, _Schema]) -> _Schema:
    found: _Schema = {"title": _name(form), "type": "object", "additionalProperties": False, "properties": {}}
    if form.__doc__:
        found["description"] = form.__doc__
    if form.OTHERS is not None:
        found["additionalProperties"] = _kind(kind_of(form.OTHERS), "", forms)
    for name, kind in form.keys().items():
        schema = found["properties"][name] = _kind(kind, name, forms)
        if not kind.is_form:
            schema["title"] = name.replace("_", " ").title()
        if kind.description:
            schema["description"] = kind.description
        if kind.default is MISSING:
            found.setdefault("required", []).append(name)
        else:
            schema["default"] = _plain(kind.default)
    return found


def _name(form: type[Form]) -> str:
    return f"{form.__name__.removesuffix('Form')}Form"


def _plain(default: Any) -> Any:
    if isinstance(default, Form):
        return {name: kind.default for name, kind in default.keys().items()}
    if isinstance(default, tuple | Mapping):
        return [*default] if isinstance(default, tuple) else dict(default)
    return int(default) if isinstance(default, Decimal) else default


def _kind(kind: Kind, name: str, forms: dict[str, _Schema]) -> _Schema:
    """Return the schema of the value of a key, or of an entry of it."""
    sizes: _Schema = {way: size for way, size in (("min", kind.size.least or None), ("max", kind.size.most)) if size}
    found: _Schema
    if isinstance(kind.type, Scalar):
        found = dict(kind.type.schema)
    elif isinstance(kind.type, tuple):
        found = {"type": "string"} | ({"enum": list(kind.type)} if kind.type[1:] else {"const": kind.type[0]})
    elif kind.type is tuple:
        found = {"type": "array", "items": _kind(kind_of(kind.inner[0]), name, forms)}
        found |= {f"{way}Items": size for way, size in sizes.items()}
    elif kind.type is Any:
        bodies = [{"const": "fixed"}, *(_body(key, kind, unit) for key, (kind, unit) in KEYS.items())]
        found = {"anyOf": bodies if name == "bodies" else [_connection(kind) for kind in KINDS]}
    elif kind.is_form:
        forms[_name(kind.type)] = _form(kind.type, forms)
        found = {"$ref": f"#/$defs/{_name(kind.type)}"}
    else:
        found = {"type": "object", "additionalProperties": _kind(kind_of(kind.inner[1]), name, forms)}
        found |= {f"{way}Properties": size for way, size in sizes.items()}
    return {"anyOf": [found, {"type": "null"}]} if kind.optional else found


# -- scenes ---------------------------------------------------------------------------------------------


def _mapping(properties: _Schema, required: list[str]) -> _Schema:
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _body(key: str, kind: str, unit: str) -> _Schema:
    properties: _Schema = {key: _EXPRESSION | {"description": f"[{unit}]"}}
    if kind in ("mass", "rotor"):
        properties["states"] = _TWO_NAMES | {"description": "names of its states, position or angle first"}
    return _mapping(properties, [key])


def _connection(name: str) -> _Schema:
    kind = KINDS[name]
    properties: _Schema = (
        {"on": _NAME | {"description": "the body"}}
        if kind.on
        else {"between": _TWO_NAMES | {"description": "first and second body"}}
    )
    required = [*properties, *(key.name for key in kind.keys if not key.optional)]
    properties |= {key.name: _of_connection(key) for key in kind.keys}
    properties["name"] = _NAME | {"description": "symbol of its sign; default: made of the bodies' names"}
    return _mapping({name: _mapping(properties, required) | {"description": kind.meaning}}, [name])


def _of_connection(key: Key) -> _Schema:
    if key.words:
        return {"enum": list(key.words), "description": key.meaning}
    unit = f" [{key.unit}{f', between rotors {key.angular}' if key.angular != key.unit else ''}]"
    return _EXPRESSION | {"description": key.meaning + unit}


# -- readings -------------------------------------------------------------------------------------------


def _override(value: _Schema) -> _Schema:
    """Return the schema of what a reading may put in place of a value: part of a mapping, another value, or null."""
    described: _Schema = {key: value[key] for key in ("description", "title") if key in value}
    return {"anyOf": [*(_part(way) for way in value.get("anyOf", [value])), {"type": "null"}], **described}


def _part(value: _Schema) -> _Schema:
    if "$ref" in value:
        return {"$ref": f"{value['$ref']}Part"}
    return _part_of(value) if value.get("type") == "object" else value


def _part_of(mapping: _Schema) -> _Schema:
    """Return the schema of a mapping with every key optional and replaceable."""
    part = {key: value for key, value in mapping.items() if key not in ("required", "minProperties", "default")}
    if "properties" in part:
        part["properties"] = {key: _override(value) for key, value in part["properties"].items()}
    if isinstance(part.get("additionalProperties"), dict):
        part["additionalProperties"] = _override(part["additionalProperties"])
    return part
