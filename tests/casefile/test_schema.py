"""The JSON Schema for editors agrees with what is read."""

from __future__ import annotations

import json
from decimal import Decimal
from pathlib import Path

import fastjsonschema
import pytest

from henon_ref.casefile.files import read_yaml
from henon_ref.casefile.json_schema import case_schema, schema_text
from henon_ref.casefile.schema import READING_KEYS, CaseForm
from henon_ref.system.tree import PythonValue, to_python

CASES = Path(__file__).parents[2] / "cases"
PUBLISHED = CASES / "case.schema.json"
FILES = [path for path in sorted(CASES.rglob("*.yaml")) if "truth" not in path.parts]
EDITORS = "# yaml-language-server: $schema="
"""What a case's first line begins with: editors with that language server look there for the schema."""
CHECK = fastjsonschema.compile(case_schema())
"""Raises an error at the first fault of a case."""


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
    assert CHECK(content(path))["schema"] == 1


@pytest.mark.parametrize(
    ("change", "place", "rule"),
    [
        ({"untill": 3}, "data", "additionalProperties"),
        ({"name": "Fig 8"}, "data.name", "pattern"),
        ({"system": {"state": ["x"]}}, "data.system", "anyOf"),
        ({"tolerances": [2]}, "data.tolerances[0]", "exclusiveMaximum"),
        ({"readings": {"one": {"sytem": {}}}}, "data.readings.one", "additionalProperties"),
        ({"readings": {"one": {"system": {"field": "x"}}}}, "data.readings.one.system", "anyOf"),
        ({"readings": {"one": {"gate": {"henon": {"at": 7}}}}}, "data.readings.one.gate", "anyOf"),
        ({"readings": {"one": {"name": "two"}}}, "data.readings.one", "additionalProperties"),
    ],
)
def test_the_schema_finds_the_faults_that_a_file_has(change: dict[str, object], place: str, rule: str) -> None:
    case = content(CASES / "hard" / "two_roots.yaml")
    assert isinstance(case, dict)
    with pytest.raises(fastjsonschema.JsonSchemaValueException) as error:
        CHECK({**case, **change})
    assert (error.value.name, error.value.rule) == (place, rule)
