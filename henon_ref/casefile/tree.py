"""A case file as a tree in which every key and value knows its line and column."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy as sp

Scalar = str | int | bool | Decimal | None
PythonValue = Scalar | list["PythonValue"] | dict[str, "PythonValue"]


@dataclass(frozen=True, slots=True)
class Place:
    """1-based place in a file."""

    line: int
    column: int


@dataclass(frozen=True, slots=True)
class ScalarNode:
    """A scalar: its value by the core schema, and its text as written; from Python also an expression of SymPy."""

    place: Place
    value: Scalar
    given: str | sp.Expr
    text_place: Place | None
    """Where the first character of ``text`` stands, or None where text and file differ (escapes, folding)."""

    @property
    def text(self) -> str:
        """As it is written, or an expression of SymPy in the words of a case file."""
        if isinstance(self.given, str):
            return self.given
        from henon_ref.casefile.sympy_form import spelled_out  # what a tree of text alone does without

        return spelled_out(self.given)

    @property
    def size(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class SequenceNode:
    """A sequence."""

    place: Place
    items: tuple[Node, ...]
    size: int
    """Nodes in it, aliases written out."""


@dataclass(frozen=True, slots=True)
class MappingNode:
    """A mapping, in the order of the file."""

    place: Place
    entries: Mapping[str, Node]
    keys: Mapping[str, Place]
    size: int
    """Nodes in it, aliases written out."""


Node = ScalarNode | SequenceNode | MappingNode


def to_python(node: Node) -> PythonValue:
    """The tree as Python values: dict, list, str, int, Decimal, bool, None."""
    return _values(node, lambda scalar: scalar.value)


def as_written(node: Node) -> PythonValue:
    """The tree as values for a file: as :func:`to_python`, but numbers that are not whole are text, with all digits."""
    return _values(node, lambda n: n.value if n.value is None or isinstance(n.value, bool | int) else n.text)


def _values(node: Node, of: Callable[[ScalarNode], Scalar]) -> PythonValue:
    if isinstance(node, MappingNode):
        return {key: _values(value, of) for key, value in node.entries.items()}
    if isinstance(node, SequenceNode):
        return [_values(item, of) for item in node.items]
    return of(node)


def locate(node: Node, path: Sequence[str | int], *, key: bool = False) -> Place:
    """The place of what a path of keys and indices leads to, or of the last part of it that is there.

    With ``key`` that of the last key, where the path ends in one, rather than of its value.
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
    """The node that a path of keys and indices leads to, or None."""
    for part in path:
        if isinstance(node, MappingNode) and part in node.entries:
            node = node.entries[str(part)]
        elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.items):
            node = node.items[part]
        else:
            return None
    return node


def merged(base: MappingNode, overrides: MappingNode) -> MappingNode:
    """Overrides laid over a mapping: mappings merge key by key, anything else replaces, null removes.

    Every node keeps its own place, so that an error in the result points to where its text stands.
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
    return MappingNode(overrides.place, entries, keys, 1 + sum(e.size for e in entries.values()))
