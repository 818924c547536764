"""Tree of a description, in which every key and value has its line and column in the case file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import sympy as sp

Scalar = str | int | bool | Decimal | None
PythonValue = Scalar | list["PythonValue"] | dict[str, "PythonValue"]


@dataclass(frozen=True, slots=True)
class Place:
    """Place in a file, 1-based."""

    line: int
    column: int


NOWHERE = Place(0, 0)
"""Place of values from Python, which have no line in a file."""


@dataclass(frozen=True, slots=True)
class ScalarNode:
    """Scalar: its value by the core schema of YAML, and its text as written (from Python also a SymPy expression)."""

    place: Place
    value: Scalar
    given: str | sp.Expr
    text_place: Place | None
    """Place of the first character of ``text``; None if text and file differ (escapes, folding)."""

    @property
    def text(self) -> str:
        """Text as written; for a SymPy expression, its text as in a case file."""
        if isinstance(self.given, str):
            return self.given
        from henon_ref.expressions.operations import spelled_out  # not needed for files

        return spelled_out(self.given)

    @property
    def size(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class SequenceNode:
    place: Place
    items: tuple[Node, ...]
    size: int
    """Number of nodes in it, aliases expanded."""


@dataclass(frozen=True, slots=True)
class MappingNode:
    """Mapping, in the order of the file."""

    place: Place
    entries: Mapping[str, Node]
    keys: Mapping[str, Place]
    size: int


Node = ScalarNode | SequenceNode | MappingNode


def mapping(
    entries: Mapping[str, Node], place: Place = NOWHERE, keys: Mapping[str, Place] | None = None
) -> MappingNode:
    """Return a mapping; by default each key has the place of its value."""
    keys = {key: entry.place for key, entry in entries.items()} if keys is None else keys
    return MappingNode(place, entries, keys, 1 + sum(entry.size for entry in entries.values()))


def sequence(items: Sequence[Node], place: Place = NOWHERE) -> SequenceNode:
    return SequenceNode(place, tuple(items), 1 + sum(item.size for item in items))


def to_python(node: Node) -> PythonValue:
    """Return the tree as Python values: dict, list, str, int, Decimal, bool, None."""
    return values(node, lambda scalar: scalar.value)


def as_written(node: Node) -> PythonValue:
    """Return the tree as values for a file: as :func:`to_python`, but non-integers as text with all digits."""
    return values(node, lambda n: n.value if n.value is None or isinstance(n.value, bool | int) else n.text)


def values(node: Node, of: Callable[[ScalarNode], Any]) -> Any:
    """Return the tree as dictionaries and lists of what ``of`` returns for its scalars."""
    if isinstance(node, MappingNode):
        return {key: values(value, of) for key, value in node.entries.items()}
    if isinstance(node, SequenceNode):
        return [values(item, of) for item in node.items]
    return of(node)


def words(node: Node) -> set[str]:
    """Return the words in the values of a tree, among them every name that an expression uses."""
    if isinstance(node, ScalarNode):
        return set(re.findall(r"\w+", node.text))
    return set().union(*map(words, node.entries.values() if isinstance(node, MappingNode) else node.items))


def locate(node: Node, path: Sequence[str | int], *, key: bool = False) -> Place:
    """Return the place of the node that a path of keys and indices leads to, or of the last node on the path.

    With ``key``, if the path ends in a key, return the place of that key instead of its value.
    """
    place = node.place
    for depth, part in enumerate(path):
        found = child(node, [part])
        if found is None:
            break
        at_key = key and depth == len(path) - 1
        place = node.keys[str(part)] if at_key and isinstance(node, MappingNode) else found.place
        node = found
    return place


def child(node: Node, path: Sequence[str | int]) -> Node | None:
    """Return the node that a path of keys and indices leads to, or None."""
    for part in path:
        if isinstance(node, MappingNode) and part in node.entries:
            node = node.entries[str(part)]
        elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.items):
            node = node.items[part]
        else:
            return None
    return node


def merged(base: MappingNode, overrides: MappingNode) -> MappingNode:
    """Return a mapping with overrides applied: mappings merge key by key, other values replace, null removes.

    Every node keeps its own place, so that an error points to the text in the file.
    """
    entries, keys = dict(base.entries), dict(base.keys)
    for name, new in overrides.entries.items():
        old = entries.get(name)
        if isinstance(new, ScalarNode) and new.value is None:
            entries.pop(name, None)
            keys.pop(name, None)
            continue
        keys[name] = overrides.keys[name]
        entries[name] = merged(old, new) if isinstance(old, MappingNode) and isinstance(new, MappingNode) else new
    return mapping(entries, overrides.place, keys)
