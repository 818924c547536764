"""The JSON Schema for editors agrees with what is read."""

from __future__ import annotations

from henon_ref.casefile.schema import MAX_STATES, READING_KEYS, CaseForm, case_schema


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
