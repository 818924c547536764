"""The form of a model that comes from Python: what plainly fits is not put to pydantic, which takes longer to load."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from decimal import Decimal

from henon_ref.casefile.grammar import MOST_STATES, NAME
from henon_ref.casefile.tree import MappingNode, Node, ScalarNode, SequenceNode

DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}")
"""What YAML 1.1 takes for one."""
_LARGE = 10**15
"""Whole numbers below this are doubles."""
Check = Callable[[Node], bool]


def plainly_fits(tree: MappingNode) -> bool:
    """Whether some keys of a case file certainly have the form that :mod:`henon_ref.casefile.schema` wants of them.

    (But for the number of states and surfaces, which is larger here.)

    Where it says no, :func:`henon_ref.casefile.validation.check_model` decides, and says what is wrong.

    Parameters
    ----------
    tree : MappingNode
        The model (``system`` or ``scene``, ``sliding``, ``resets``); ``initial`` and ``until`` may stand beside it.
    """
    return _KEYS(tree) and ("system" in tree.entries) != ("scene" in tree.entries)


def _expression(node: Node) -> bool:
    if not isinstance(node, ScalarNode):
        return False
    value = node.value
    if isinstance(value, str):
        return not DATE.fullmatch(value.strip())
    return type(value) is int or (isinstance(value, Decimal) and value.is_finite())


def _number(node: Node) -> bool:
    value = node.value if isinstance(node, ScalarNode) else None
    return type(value) is int and abs(value) < _LARGE


def _name(node: Node) -> bool:
    return isinstance(node, ScalarNode) and isinstance(node.value, str) and bool(NAME.fullmatch(node.value))


def _word(*words: str) -> Check:
    return lambda node: isinstance(node, ScalarNode) and node.value in words


def _whole(*numbers: int) -> Check:
    return lambda node: isinstance(node, ScalarNode) and type(node.value) is int and node.value in numbers


def _any(node: Node) -> bool:
    return True


def _list(entry: Check, least: int = 0, most: float = math.inf) -> Check:
    return lambda node: (
        isinstance(node, SequenceNode) and least <= len(node.items) <= most and all(map(entry, node.items))
    )


def _mapping(entry: Check, least: int = 0, most: float = math.inf) -> Check:
    return lambda node: (
        isinstance(node, MappingNode) and least <= len(node.entries) <= most and all(map(entry, node.entries.values()))
    )


def _form(needed: Mapping[str, Check], others: Mapping[str, Check]) -> Check:
    """A mapping with some keys, and maybe others."""
    known = {**needed, **others}
    return lambda node: (
        isinstance(node, MappingNode)
        and needed.keys() <= node.entries.keys() <= known.keys()
        and all(known[key](entry) for key, entry in node.entries.items())
    )


_MODE = _mapping(_whole(-1, 0, 1))


def _initial(node: Node) -> bool:
    """Numbers by the names of states, ``t`` and a ``mode``."""
    return isinstance(node, MappingNode) and all(
        _MODE(entry) if key == "mode" else _expression(entry) for key, entry in node.entries.items()
    )


_EXPRESSIONS, _NAMED = _list(_expression), _mapping(_expression)
_RELEASE = _form({"when": _expression, "direction": _word("rising", "falling"), "to": _whole(-1, 1)}, {})
_KEYS = _form(
    {},
    {
        "system": _form(
            {"state": _list(_name, 1, MOST_STATES), "field": _EXPRESSIONS},
            {"parameters": _NAMED, "surfaces": _mapping(_expression, 0, MOST_STATES), "valid": _EXPRESSIONS},
        ),
        "scene": _form({"bodies": _mapping(_any, 1), "connections": _list(_any)}, {"parameters": _NAMED}),
        "sliding": _mapping(
            _form({"field": _EXPRESSIONS, "release": _list(_RELEASE, 1)}, {"entry": _word("attracting", "inside")})
        ),
        "resets": _mapping(_form({"map": _mapping(_expression, 1)}, {"when": _word("falling"), "priority": _number})),
        "initial": _initial,
        "until": _expression,
    },
)
