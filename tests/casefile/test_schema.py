"""The JSON Schema for editors agrees with what is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from henon_ref.casefile.schema import MAX_STATES, READING_KEYS, CaseForm, case_schema, schema_text

CASES = Path(__file__).parents[2] / "cases"
PUBLISHED = CASES / "case.schema.json"
FILES = [path for path in sorted(CASES.rglob("*.yaml")) if "truth" not in path.parts]
EDITORS = "# yaml-language-server: $schema="
"""What a case's first line begins with: editors with that language server look there for the schema."""


def test_the_json_schema_knows_every_key_and_no_other() -> None:
    schema = case_schema()
    keys = {info.alias or name for name, info in CaseForm.model_fields.items()}
    assert set(schema["properties"]) == keys | {"readings"}
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["schema", "name", "title"]
    overrides = schema["properties"]["readings"]["additionalProperties"]
    assert set(overrides["properties"]) == READING_KEYS == keys - {"schema", "name"}


def test_the_bounds_are_in_the_json_schema() -> None:
    schema = case_schema()
    system = schema["$defs"]["SystemForm"]["properties"]
    assert (system["state"]["minItems"], system["state"]["maxItems"]) == (1, MAX_STATES)
    assert (system["surfaces"]["minProperties"], system["surfaces"]["maxProperties"]) == (1, MAX_STATES)
    assert schema["properties"]["name"]["pattern"] == "^[a-z0-9_]{1,64}$"
    assert "required" not in schema["$defs"]["ExpectForm"]


def test_expressions_may_be_numbers_or_text_in_the_json_schema() -> None:
    schema = case_schema()
    assert schema["properties"]["until"]["type"] == ["number", "string"]
    assert schema["properties"]["schema"]["const"] == 1
    assert schema["$defs"]["SystemForm"]["properties"]["field"]["items"] == {"type": ["number", "string"]}


def test_the_published_schema_is_the_present_one() -> None:
    """``henon-ref schema > cases/case.schema.json`` makes it again."""
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_first_line_of_every_case_leads_editors_to_the_schema(path: Path) -> None:
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith(EDITORS)
    assert (path.parent / first.removeprefix(EDITORS)).resolve() == PUBLISHED
