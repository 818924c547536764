"""The form of a model that comes from Python: which keys there are, and what they hold.

A file has the same form by :mod:`henon_ref.casefile.schema`, of which a system from Python needs neither the classes
nor what they take to load; what is wrong is said in the same words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import NamedTuple

from henon_ref.casefile.grammar import MOST_STATES
from henon_ref.casefile.tree import MappingNode, Node, ScalarNode, SequenceNode
from henon_ref.errors import CaseError
from henon_ref.text import did_you_mean, listed, shortened

DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}")
"""What YAML 1.1 takes for one."""
LIST, MAPPING = "must be a list, as in [1, 2]", "must be a mapping, as in {key: value}"
NAMED = "must be a mapping, as in {name: value}"


class _At(NamedTuple):
    """Where a node stands, for messages."""

    node: Node
    key: str = ""
    within: str = ""

    def error(self, message: str, *, shows: bool = False) -> CaseError:
        name = f"'{self.key}'" if self.key else "an entry"
        where = f" in '{self.within}'" if self.within else ""
        place = self.node.place
        text = f"{name}{where}: {message}{given(self.node) if shows else ''}"
        return CaseError(text, line=place.line, column=place.column)


Check = Callable[[_At], None]


def given(node: Node) -> str:
    """What stands where something else has to, for a message."""
    if isinstance(node, ScalarNode):
        shown = f"the text {shortened(node.text)}" if isinstance(node.value, str) else node.text
        return f"; here it is {shown or 'empty'}"
    return "; here it is a mapping" if isinstance(node, MappingNode) else "; here it is a list"


def check_form(tree: MappingNode) -> None:
    """Check the form of a model: ``system`` or ``scene``, ``sliding``, ``resets``; and of a start and a horizon.

    Raises
    ------
    CaseError
        For the first key or value that does not fit.
    """
    _MODEL(_At(tree))


def _expression(at: _At) -> None:
    value = at.node.value if isinstance(at.node, ScalarNode) else None
    if value is None or isinstance(value, bool):
        raise at.error("must be a number or an expression (text)")
    if isinstance(value, Decimal) and not value.is_finite():
        raise at.error("must be a finite number or an expression")
    if isinstance(value, str) and DATE.fullmatch(value.strip()):
        raise at.error(f"{value.strip()} is a date; a difference is written with blanks, as in 3 - 2 - 1")


def _number(at: _At) -> None:
    value = at.node.value if isinstance(at.node, ScalarNode) else None
    if type(value) is not int and not (isinstance(value, Decimal) and value.is_finite()):
        raise at.error("must be a number", shows=True)


def _name(at: _At) -> None:
    if not isinstance(at.node, ScalarNode) or not isinstance(at.node.value, str) or not at.node.value.strip():
        raise at.error("must be text (a number or a word such as true stands in quotes)")


def _one_of(*values: str | int) -> Check:
    shown = [repr(value) for value in values]
    message = f"must be {', '.join(shown[:-1])}{' or ' if shown[1:] else ''}{shown[-1]}"

    def check(at: _At) -> None:
        value = at.node.value if isinstance(at.node, ScalarNode) else None
        if isinstance(value, bool) or value not in values:
            raise at.error(message, shows=True)

    return check


def _any(at: _At) -> None:
    pass


def _list(entry: Check, least: int = 0) -> Check:
    def check(at: _At) -> None:
        if not isinstance(at.node, SequenceNode):
            raise at.error(LIST, shows=True)
        _check_count(at, len(at.node.items), least)
        for item in at.node.items:
            entry(_At(item, "", at.key))

    return check


def _mapping(entry: Check, least: int = 0) -> Check:
    def check(at: _At) -> None:
        if not isinstance(at.node, MappingNode):
            raise at.error(NAMED, shows=True)
        _check_count(at, len(at.node.entries), least)
        for key, item in at.node.entries.items():
            entry(_At(item, key, at.key))

    return check


def _check_count(at: _At, count: int, least: int) -> None:
    if count < least:
        raise at.error("must have at least one entry")
    if at.key in ("state", "surfaces") and count > MOST_STATES:
        raise at.error(f"may have at most {MOST_STATES} entries")


def _form(needed: Mapping[str, Check], others: Mapping[str, Check]) -> Check:
    """A mapping with some keys, and maybe others."""
    known = {**needed, **others}

    def check(at: _At) -> None:
        if not isinstance(at.node, MappingNode):
            raise at.error(MAPPING, shows=True)
        where = f" in '{at.key}'" if at.key else ""
        for key in at.node.entries:
            if key not in known:
                meant = f"{did_you_mean(key, known)}; allowed: {listed(known)}"
                raise CaseError(f"unknown key '{key}'{where}{meant}", line=at.node.place.line)
        for key in needed:
            if key not in at.node.entries:
                raise CaseError(f"the key '{key}' is missing{where}", line=at.node.place.line)
        for key, item in at.node.entries.items():
            known[key](_At(item, key, at.key))

    return check


def _initial(at: _At) -> None:
    """Numbers by the names of states, ``t`` and a ``mode``."""
    assert isinstance(at.node, MappingNode)
    for key, item in at.node.entries.items():
        (_MODE if key == "mode" else _expression)(_At(item, key, at.key))


_MODE = _mapping(_one_of(-1, 0, 1))
_EXPRESSIONS, _NAMED = _list(_expression), _mapping(_expression)
_RELEASE = _form({"when": _expression, "direction": _one_of("rising", "falling"), "to": _one_of(-1, 1)}, {})
_SLIDING = _form({"field": _EXPRESSIONS, "release": _list(_RELEASE, 1)}, {"entry": _one_of("attracting", "inside")})
_SYSTEM = _form(
    {"state": _list(_name, 1), "field": _EXPRESSIONS},
    {"parameters": _NAMED, "surfaces": _NAMED, "valid": _EXPRESSIONS},
)
_MODEL = _form(
    {},
    {
        "system": _SYSTEM,
        "scene": _form({"bodies": _mapping(_any, 1), "connections": _list(_any)}, {"parameters": _NAMED}),
        "sliding": _mapping(_SLIDING),
        "resets": _mapping(_form({"map": _mapping(_expression, 1)}, {"when": _one_of("falling"), "priority": _number})),
        "initial": _initial,
        "until": _expression,
    },
)
