"""The form of a model from Python is that of a case file's, and what is wrong is said in the same words."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import henon_ref as hr
from henon_ref.casefile.model_form import check_form
from henon_ref.casefile.tree import MappingNode
from henon_ref.casefile.validation import validated
from henon_ref.errors import CaseError
from henon_ref.simulation.written import tree_of

REST: dict[str, Any] = {"schema": 1, "name": "system", "title": "system", "initial": {}, "until": 1}
SYSTEM = {"state": ["x", "v"], "field": ["v", "-x - F*s"], "surfaces": {"s": "v"}, "parameters": {"F": 0.5}}
RELEASE = {"when": "x", "direction": "rising", "to": 1}
FITTING: list[dict[str, Any]] = [
    {"system": SYSTEM},
    {"system": {**SYSTEM, "valid": ["3 - x"]}, "initial": {"x": 1, "v": "F/2", "t": 0, "mode": {"s": 0}}, "until": 3},
    {"system": SYSTEM, "sliding": {"s": {"field": ["v", 0], "release": [RELEASE], "entry": "inside"}}},
    {"system": SYSTEM, "resets": {"s": {"map": {"v": "-v"}, "when": "falling", "priority": 0.5}}},
    {"scene": {"bodies": {"a": {"mass": 1}}, "connections": []}},
]
OTHERS: list[tuple[str, Any]] = [
    ("system.state", []), ("system.state", "x"), ("system.state", [1, "v"]),
    ("system.field", "v"), ("system.field", [["v"]]), ("system.field", ["2001-2-3", "v"]), ("system.field", None),
    ("system.surfaces", ["v"]), ("system.more", 1), ("system.parameters", {"F": None}), ("system", {"state": ["x"]}),
    ("sliding", {"s": {"field": ["v", "0"]}}), ("sliding", {"s": {"field": [], "release": []}}),
    ("sliding", {"s": {"field": [], "release": [{**RELEASE, "to": 0}]}}),
    ("sliding", {"s": {"field": [], "release": [{**RELEASE, "direction": "up"}]}}),
    ("resets", {"s": {"map": {}}}), ("resets", {"s": {"map": {"v": "-v"}, "priority": "x"}}),
    ("resets", {"s": {"map": {"v": "-v"}, "when": "rising"}}), ("initial", {"mode": {"s": 2}}),
    ("initial", {"mode": 1}), ("initial", {"mode": {"s": 0.0}}),
    ("sliding", {"s": {"field": [], "release": [{**RELEASE, "to": 1.0}]}}),
    ("until", []), ("scene", {"bodies": {}, "connections": []}), ("resets", []),
]  # fmt: skip


def refusal(model: dict[str, Any], *, of_file: bool) -> str | None:
    """What is said of a model, by the form of a case file or that of a model from Python."""
    tree = tree_of({**REST, **model} if of_file else model, "the model")
    assert isinstance(tree, MappingNode)
    try:
        validated(tree, file=None) if of_file else check_form(tree)
    except CaseError as error:
        return error.message
    return None


@pytest.mark.parametrize("model", FITTING)
def test_what_fits_a_file_fits(model: dict[str, Any]) -> None:
    assert refusal(model, of_file=False) is None
    assert refusal(model, of_file=True) is None


@pytest.mark.parametrize(("path", "value"), OTHERS)
def test_what_does_not_fit_is_refused_in_the_words_for_a_file(path: str, value: Any) -> None:
    model: dict[str, Any] = {"system": dict(SYSTEM)}
    part, _, key = path.rpartition(".")
    (model[part] if part else model)[key] = value
    ours, theirs = refusal(model, of_file=False), refusal(model, of_file=True)
    assert ours is not None
    assert theirs is not None
    assert ours.partition("; here it is")[0].split(": ")[0] == theirs.partition("; here it is")[0].split(": ")[0]


WORDS = st.sampled_from(
    ["x", "v", "s", "t", "state", "field", "map", "when", "falling", "rising", "to", "2001-2-3", ""]
)
VALUES = st.recursive(
    st.none() | WORDS | st.integers(-2, 2) | st.floats(-2, 2),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_what_fits_here_fits_a_file_and_the_other_way_round(data: st.DataObject) -> None:
    """Any part of a model, or several, replaced by anything."""
    model: dict[str, Any] = {
        key: dict(value) for key, value in data.draw(st.sampled_from(FITTING[:4])).items() if isinstance(value, dict)
    }
    for _ in range(data.draw(st.integers(1, 2))):
        part = model[data.draw(st.sampled_from(sorted(model)))]
        key = data.draw(st.sampled_from([*sorted(part), "x", "s"]))
        part[key] = data.draw(VALUES)
    assert (refusal(model, of_file=False) is None) == (refusal(model, of_file=True) is None)


def test_messages_are_those_of_a_file() -> None:
    with pytest.raises(hr.ArgumentError, match=r"'field' in 'system': must be a list, as in \[1, 2\]"):
        hr.System(["x"], {}, {"s": "x"}, "1 - s")  # type: ignore[arg-type]
    with pytest.raises(hr.ArgumentError, match="unknown key 'whn'"):
        hr.System(["x"], {}, {"s": "x"}, ["1"], resets={"s": {"map": {"x": "1"}, "whn": "falling"}})
