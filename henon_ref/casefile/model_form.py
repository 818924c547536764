"""The form of a model that comes from Python: which keys there are, and what they hold.

A file has the same form by :mod:`henon_ref.casefile.schema`, of which a system from Python needs neither the classes
nor what they take to load; what is wrong is said in the same words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import Any

from henon_ref.casefile.grammar import MOST_STATES
from henon_ref.casefile.tree import MappingNode, Node, ScalarNode, SequenceNode
from henon_ref.errors import CaseError
from henon_ref.text import did_you_mean, listed, shortened

DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}")
"""What YAML 1.1 takes for one."""
LIST, MAPPING = "must be a list, as in [1, 2]", "must be a mapping, as in {key: value}"
NAMED, FEW = "must be a mapping, as in {name: value}", "must have at least one entry"
_FULL = ("state", "release", "map", "bodies")
"""Keys of what has at least one entry."""
_MANY = ("state", "surfaces")
"""Keys of what may have ``MOST_STATES``."""
_Value = str | int | Decimal | bool | None
_Scalar = Callable[[_Value], str]
"""Says what is wrong with the value of a scalar; empty if nothing is."""


def given(node: Node) -> str:
    """What stands where something else has to, for a message."""
    if isinstance(node, ScalarNode):
        shown = f"the text {shortened(node.text)}" if isinstance(node.value, str) else node.text
        return f"; here it is {shown or 'empty'}"
    return "; here it is a mapping" if isinstance(node, MappingNode) else "; here it is a list"


def _expression(value: _Value) -> str:
    if isinstance(value, str) and DATE.fullmatch(value.strip()):
        return f"{value.strip()} is a date; a difference is written with blanks, as in 3 - 2 - 1"
    if isinstance(value, Decimal) and not value.is_finite():
        return "must be a finite number or an expression"
    return "must be a number or an expression (text)" if value is None or isinstance(value, bool) else ""


def _number(value: _Value) -> str:
    finite = type(value) is int or (isinstance(value, Decimal) and value.is_finite())
    return "" if finite else "must be a number"


def _name(value: _Value) -> str:
    text = isinstance(value, str) and value.strip()
    return "" if text else "must be text (a number or a word such as true stands in quotes)"


def _one_of(*values: str | int) -> _Scalar:
    message = f"must be {' or '.join([', '.join(map(repr, values[:-1])), repr(values[-1])]).removeprefix(' or ')}"
    kind = type(values[0])  # 0.0 and False equal 0, and are none of these
    return lambda value: "" if type(value) is kind and value in values else message


_MODE = {...: _one_of(-1, 0, 1)}
_RELEASE = {"when": _expression, "direction": _one_of("rising", "falling"), "to": _one_of(-1, 1)}
_SLIDING = {"field": [_expression], "release": [_RELEASE], "entry?": _one_of("attracting", "inside")}
_RESET = {"map": {...: _expression}, "when?": _one_of("falling"), "priority?": _number}
_SYSTEM = {
    "state": [_name],
    "parameters?": {...: _expression},
    "surfaces?": {...: _expression},
    "field": [_expression],
    "valid?": [_expression],
}
_MODEL: dict[Any, Any] = {
    "system?": _SYSTEM,
    "scene?": {"parameters?": {...: _expression}, "bodies": {...: None}, "connections": [None]},
    "initial?": {"mode?": _MODE, ...: _expression},
    "until?": _expression,
    "sliding?": {...: _SLIDING},
    "resets?": {...: _RESET},
}
"""Keys, those that may be left out with a ``?``, and what they hold: a list, a mapping (``...``: of any names), a
scalar by what says what is wrong with it, or anything (None)."""


def check_form(tree: MappingNode) -> None:
    """Check the form of a model: ``system`` or ``scene``, ``sliding``, ``resets``; and of a start and a horizon.

    Raises
    ------
    CaseError
        For the first key or value that does not fit.
    """
    _check(tree, _MODEL, "", "")


def _check(node: Node, form: Any, key: str, within: str) -> None:
    """Check that a node has a form; ``key`` and ``within`` say where it stands."""
    message, shows = "", True
    entries: Mapping[str, Node] = node.entries if isinstance(node, MappingNode) else {}
    items = node.items if isinstance(node, SequenceNode) else tuple(entries.values())
    if isinstance(form, list | dict) and not isinstance(node, SequenceNode if isinstance(form, list) else MappingNode):
        message = LIST if isinstance(form, list) else NAMED if ... in form else MAPPING
    elif callable(form):
        message = form(node.value if isinstance(node, ScalarNode) else None)
        shows = form is not _expression and form is not _name
    elif key in _FULL and not items:
        message, shows = FEW, False
    elif key in _MANY and len(items) > MOST_STATES:
        message, shows = f"may have at most {MOST_STATES} entries", False
    if message:
        name, where = f"'{key}'" if key else "an entry", f" in '{within}'" if within else ""
        raise CaseError(f"{name}{where}: {message}{given(node) if shows else ''}", line=node.place.line)
    if isinstance(form, list):
        for item in items:
            _check(item, form[0], "", key)
    elif isinstance(form, dict):
        _check_keys(node, form, entries, key)
        for name, entry in entries.items():
            _check(entry, form.get(name, form.get(f"{name}?", form.get(...))), name, key)


def _check_keys(node: Node, form: Mapping[Any, Any], entries: Mapping[str, Node], key: str) -> None:
    """Refuse a key that is not known, and the lack of one that is needed."""
    where = f" in '{key}'" if key else ""
    known = [name.removesuffix("?") for name in form if name is not ...]
    for name in entries:
        if name not in known and ... not in form:
            meant = f"{did_you_mean(name, known)}; allowed: {listed(known)}"
            raise CaseError(f"unknown key '{name}'{where}{meant}", line=node.place.line)
    for name in form:
        if name is not ... and not name.endswith("?") and name not in entries:
            raise CaseError(f"the key '{name}' is missing{where}", line=node.place.line)
