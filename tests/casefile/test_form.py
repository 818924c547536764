"""A form is read into its dataclass, or refused; a model from Python has that of a case file."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import pytest

import henon_ref as hr
from henon_ref.casefile.files import parse_yaml
from henon_ref.casefile.form import read_form
from henon_ref.casefile.schema import CaseForm, Gate, Published, check_form
from henon_ref.errors import CaseError
from henon_ref.system.python_arguments import tree_of
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode

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
    """What is said of a model, as one of a file or from Python."""
    tree = tree_of({**REST, **model} if of_file else model, "the model")
    assert isinstance(tree, MappingNode)
    try:
        read_form(CaseForm, Source(tree)) if of_file else check_form(tree)
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
    found = refusal(model, of_file=False)
    assert found is not None
    assert found == refusal(model, of_file=True)


def test_a_form_holds_what_is_read() -> None:
    text = """\
{schema: 1, name: a, title: "b\n c", initial: {x: 1}, until: 2, tolerances: [1e-3], solvers: ~,
 published: {stick_durations: [1.00]}, gate: {henon: {at: 1e-3}}}
"""
    found = read_form(CaseForm, Source(parse_yaml(text)))
    assert (found.title, found.tolerances, found.solvers, found.steps) == ("b c", (1e-3,), None, (1e-3,))
    assert found.published == Published((Decimal("1.00"),))
    assert str(found.published.stick_durations[0]) == "1.00"
    assert found.gate == {"henon": Gate(at=1e-3)}


def test_messages_are_those_of_a_file() -> None:
    with pytest.raises(hr.ArgumentError, match=r"'field' in 'system': must be a list, as in \[1, 2\]"):
        hr.System(["x"], {}, {"s": "x"}, "1 - s")  # type: ignore[arg-type]
    with pytest.raises(hr.ArgumentError, match="unknown key 'whn'"):
        hr.System(["x"], {}, {"s": "x"}, ["1"], resets={"s": {"map": {"x": "1"}, "whn": "falling"}})
