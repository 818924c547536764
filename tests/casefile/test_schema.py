"""The JSON Schema for editors agrees with what is read."""

from __future__ import annotations

import json
from decimal import Decimal
from pathlib import Path

import pytest
from json_schema import faults

from henon_ref.casefile.files import read_yaml
from henon_ref.casefile.json_schema import case_schema, schema_text
from henon_ref.casefile.schema import READING_KEYS, CaseForm
from henon_ref.system.tree import PythonValue, to_python

CASES = Path(__file__).parents[2] / "cases"
PUBLISHED = CASES / "case.schema.json"
FILES = [path for path in sorted(CASES.rglob("*.yaml")) if "truth" not in path.parts]
EDITORS = "# yaml-language-server: $schema="
"""What a case's first line begins with: editors with that language server look there for the schema."""


def test_the_json_schema_knows_every_key_and_no_other() -> None:
    schema = case_schema()
    keys = set(CaseForm.keys())
    assert set(schema["properties"]) == keys | {"readings"}
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["schema", "name", "title"]
    overrides = schema["properties"]["readings"]["additionalProperties"]
    assert set(overrides["properties"]) == READING_KEYS == keys - {"schema", "name"}


def test_the_published_schema_is_the_present_one() -> None:
    """``henon-ref schema > cases/case.schema.json`` makes it again."""
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text()
    assert json.loads(schema_text()) == case_schema()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_first_line_of_every_case_leads_editors_to_the_schema(path: Path) -> None:
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith(EDITORS)
    assert (path.parent / first.removeprefix(EDITORS)).resolve() == PUBLISHED


def content(path: Path) -> PythonValue:
    """A case file as an editor has it: numbers are numbers."""

    def numbers(value: PythonValue) -> PythonValue:
        if isinstance(value, dict):
            return {key: numbers(item) for key, item in value.items()}
        if isinstance(value, list):
            return [numbers(item) for item in value]
        return float(value) if isinstance(value, Decimal) else value

    return numbers(to_python(read_yaml(path)))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_schema_finds_no_fault_with_a_shipped_case(path: Path) -> None:
    """Readings too: each overrides a part of a mapping, or removes a key with null."""
    schema = case_schema()
    assert list(faults(content(path), schema, schema)) == []


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"untill": 3}, "/untill: not known"),
        ({"name": "Fig 8"}, "/name: pattern"),
        ({"system": {"state": ["x"]}}, "/system: anyOf"),
        ({"tolerances": [2]}, "/tolerances/0: exclusiveMaximum"),
        ({"readings": {"one": {"sytem": {}}}}, "/readings/one/sytem: not known"),
        ({"readings": {"one": {"system": {"field": "x"}}}}, "/readings/one/system: anyOf"),
        ({"readings": {"one": {"gate": {"henon": {"at": 7}}}}}, "/readings/one/gate: anyOf"),
        ({"readings": {"one": {"name": "two"}}}, "/readings/one/name: not known"),
    ],
)
def test_the_schema_finds_the_faults_that_a_file_has(change: dict[str, object], fault: str) -> None:
    schema = case_schema()
    case = content(CASES / "hard" / "two_roots.yaml")
    assert isinstance(case, dict)
    assert fault in list(faults({**case, **change}, schema, schema))
