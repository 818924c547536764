"""What plainly fits is what the form of a case file takes; everything else is put to that, which says what is wrong."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import henon_ref as hr
from henon_ref.casefile.model_form import plainly_fits
from henon_ref.casefile.tree import MappingNode
from henon_ref.casefile.validation import validated
from henon_ref.errors import CaseError
from henon_ref.simulation.written import mapping, tree_of

REST: dict[str, Any] = {"schema": 1, "name": "system", "title": "system", "initial": {}, "until": 1}
SYSTEM = {"state": ["x", "v"], "field": ["v", "-x - F*s"], "surfaces": {"s": "v"}, "parameters": {"F": 0.5}}
RELEASE = {"when": "x", "direction": "rising", "to": 1}
FITTING: list[dict[str, Any]] = [
    {"system": SYSTEM},
    {"system": {**SYSTEM, "valid": ["3 - x"]}, "initial": {"x": 1, "v": "F/2", "t": 0, "mode": {"s": 0}}, "until": 3},
    {"system": SYSTEM, "sliding": {"s": {"field": ["v", 0], "release": [RELEASE], "entry": "inside"}}},
    {"system": SYSTEM, "resets": {"s": {"map": {"v": "-v"}, "when": "falling", "priority": 2}}},
    {"scene": {"bodies": {"a": {"mass": 1}}, "connections": []}},
]
OTHERS: list[tuple[str, Any]] = [
    ("system.state", []), ("system.state", "x"), ("system.state", ["x y", "v"]), ("system.state", ["x"] * 5000),
    ("system.field", "v"), ("system.field", [["v"]]), ("system.field", ["2001-2-3", "v"]), ("system.field", None),
    ("system.surfaces", ["v"]), ("system.more", 1), ("system.parameters", {"F": None}),
    ("sliding", {"s": {"field": ["v", "0"]}}), ("sliding", {"s": {"field": [], "release": []}}),
    ("sliding", {"s": {"field": [], "release": [{**RELEASE, "to": 0}]}}),
    ("sliding", {"s": {"field": [], "release": [{**RELEASE, "direction": "up"}]}}),
    ("resets", {"s": {"map": {}}}), ("resets", {"s": {"map": {"v": "-v"}, "priority": 0.5}}),
    ("resets", {"s": {"map": {"v": "-v"}, "when": "rising"}}), ("initial", {"mode": {"s": 2}}),
    ("initial", {"mode": 1}), ("initial", []), ("until", []), ("scene", {"bodies": {}}),
]  # fmt: skip


def fits(model: dict[str, Any]) -> bool:
    """By the form of a case file."""
    tree = tree_of({**REST, **model}, "the model")
    assert isinstance(tree, MappingNode)
    try:
        validated(tree, file=None)
    except CaseError:
        return False
    return True


def plainly(model: dict[str, Any]) -> bool:
    return plainly_fits(mapping({key: tree_of(value, key) for key, value in model.items()}))


@pytest.mark.parametrize("model", FITTING)
def test_what_fits_is_seen_without_the_form(model: dict[str, Any]) -> None:
    assert plainly(model)
    assert fits(model)


@pytest.mark.parametrize(("path", "value"), OTHERS)
def test_what_does_not_fit_is_left_to_the_form(path: str, value: Any) -> None:
    model: dict[str, Any] = {"system": dict(SYSTEM)}
    part, _, key = path.rpartition(".")
    (model[part] if part else model)[key] = value
    assert not plainly(model)


WORDS = st.sampled_from(
    ["x", "v", "s", "t", "state", "field", "map", "when", "falling", "rising", "to", "2001-2-3", ""]
)
VALUES = st.recursive(
    st.none() | WORDS | st.integers(-2, 2) | st.floats(-2, 2),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_what_plainly_fits_fits(data: st.DataObject) -> None:
    """Any part of a model, or several, replaced by anything."""
    model: dict[str, Any] = {
        key: dict(value) for key, value in data.draw(st.sampled_from(FITTING[:4])).items() if isinstance(value, dict)
    }
    for _ in range(data.draw(st.integers(1, 2))):
        part = model[data.draw(st.sampled_from(sorted(model)))]
        key = data.draw(st.sampled_from([*sorted(part), "x", "s"]))
        part[key] = data.draw(VALUES)
    assert fits(model) or not plainly(model)


def test_messages_are_those_of_a_file() -> None:
    with pytest.raises(hr.ArgumentError, match=r"'field' in 'system': must be a list, as in \[1, 2\]"):
        hr.System(["x"], {}, {"s": "x"}, "1 - s")  # type: ignore[arg-type]
    with pytest.raises(hr.ArgumentError, match="unknown key 'whn'"):
        hr.System(["x"], {}, {"s": "x"}, ["1"], resets={"s": {"map": {"x": "1"}, "whn": "falling"}})
