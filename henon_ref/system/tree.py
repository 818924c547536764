"""Tree of a description, in which every key and value has its line and column in the case file.

Values from Python become nodes of such a tree, so that a system from Python is checked by the code for files.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real
from typing import Any

import numpy as np
import sympy as sp

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.expressions.evaluation import Written
from henon_ref.expressions.grammar import LONGEST_WHOLE, MAX_DIGITS, MAX_LENGTH
from henon_ref.expressions.operations import spelled_out
from henon_ref.expressions.traversal import size
from henon_ref.text import shortened

Scalar = str | int | bool | Decimal | None
PythonValue = Scalar | list["PythonValue"] | dict[str, "PythonValue"]


@dataclass(frozen=True, slots=True)
class Place:
    """Place in a file, 1-based."""

    line: int
    column: int


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
        return self.given if isinstance(self.given, str) else spelled_out(self.given)

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


def to_python(node: Node) -> PythonValue:
    """Return the tree as Python values: dict, list, str, int, Decimal, bool, None."""
    return _values(node, lambda scalar: scalar.value)


def as_written(node: Node) -> PythonValue:
    """Return the tree as values for a file: as :func:`to_python`, but non-integers as text with all digits."""
    return _values(node, lambda n: n.value if n.value is None or isinstance(n.value, bool | int) else n.text)


def _values(node: Node, of: Callable[[ScalarNode], Scalar]) -> PythonValue:
    if isinstance(node, MappingNode):
        return {key: _values(value, of) for key, value in node.entries.items()}
    if isinstance(node, SequenceNode):
        return [_values(item, of) for item in node.items]
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
    return MappingNode(overrides.place, entries, keys, 1 + sum(e.size for e in entries.values()))


# -- values from Python ---------------------------------------------------------------------------------

NOWHERE = Place(0, 0)
"""Place of values from Python, which have no line in a file."""
Number = int | Fraction | Any
"""Exact number: integer, rational, or a SymPy number such as ``sqrt(3)/9``."""
_OTHER = "wanted a number (int, float, Fraction), text or a SymPy expression"


def written_name(value: object, what: str) -> str:
    """Return the name of a state, parameter or surface, given as text or a symbol; ``what`` names it in messages."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, sp.Symbol):
        return str(value.name)
    raise ArgumentError(f"{what}: {_shown(value)} is no name; wanted text, as in 'x'")


def written(value: object, what: str) -> str:
    """Return a number or an expression as the text of a case file.

    ``value`` is an int, float, Fraction, Decimal, text or SymPy expression; a float stands for the decimal number that
    Python prints (0.1 is 1/10). ArgumentError if it is of another type, not finite, or too long.
    """
    if isinstance(value, str):
        return str(value)
    if isinstance(value, sp.Expr):
        return spelled_out(value)
    if isinstance(value, bool):
        raise ArgumentError(f"{what} is {value}; {_OTHER}")
    if isinstance(value, Rational):
        if max(int(value.numerator).bit_length(), int(value.denominator).bit_length()) > LONGEST_WHOLE:
            raise ArgumentError(f"{what} is a number of more than {MAX_DIGITS} digits")
        return str(int(value)) if isinstance(value, Integral) else f"{value.numerator}/{value.denominator}"
    if isinstance(value, Real | Decimal):
        if not math.isfinite(value):
            raise ArgumentError(f"{what} is {value}; a number must be finite")
        return str(value) if isinstance(value, Decimal) else float.__repr__(float(value))
    raise ArgumentError(f"{what} is {_shown(value)}; {_OTHER}")


def as_given(value: object, what: str) -> Written:
    """Return a SymPy expression unchanged, and any other number or expression as text (:func:`written`).

    The limits on operations (each occurrence counts) and on the length of numbers are those of text.
    """
    if not isinstance(value, sp.Expr):
        return written(value, what)
    if size(value, MAX_LENGTH) > MAX_LENGTH:
        raise ArgumentError(f"{what} has more than {MAX_LENGTH} operations")
    if any(max(n.p.bit_length(), n.q.bit_length()) > LONGEST_WHOLE for n in value.atoms(sp.Rational)):
        raise ArgumentError(f"{what} holds a number of more than {MAX_DIGITS} digits")
    return value


def tree_of(value: object, what: str, depth: int = 0, place: Place = NOWHERE) -> Node:
    """Return a value as a node of a case file's tree, with all its nodes at one place.

    ``value`` is a mapping, list, tuple, array, matrix, None, or accepted by :func:`written`; ``depth`` lists and
    mappings enclose it. ArgumentError if a case file cannot contain it.
    """
    if isinstance(value, np.ndarray | sp.MatrixBase):
        value = value.tolist() if isinstance(value, np.ndarray) else list(value)
    if isinstance(value, Mapping | Sequence) and not isinstance(value, str):
        if len(value) > 10_000 or depth > 8:
            raise ArgumentError(f"{what} has more than 10000 entries, or nests deeper than 8")
        if isinstance(value, Mapping):
            names = [written_name(key, what) for key in value]
            return mapping(
                {
                    name: tree_of(entry, f"'{name[:60]}' of {what}", depth + 1, place)
                    for name, entry in zip(names, value.values(), strict=True)
                },
                place,
            )
        return sequence(
            [tree_of(entry, f"entry {k + 1} of {what}", depth + 1, place) for k, entry in enumerate(value)], place
        )
    if value is None:
        return ScalarNode(place, None, "", None)
    found = as_given(value, what)
    if not isinstance(found, str):
        return ScalarNode(place, "", found, None)
    if isinstance(value, Integral):
        return ScalarNode(place, int(value), found, None)
    return ScalarNode(place, Decimal(found) if isinstance(value, float | Decimal) else found, found, None)


def mapping(entries: Mapping[str, Node], place: Place = NOWHERE) -> MappingNode:
    """Return a mapping node; each key has the place of its value."""
    keys = {key: entry.place for key, entry in entries.items()}
    return MappingNode(place, entries, keys, 1 + sum(entry.size for entry in entries.values()))


def sequence(items: Sequence[Node], place: Place = NOWHERE) -> SequenceNode:
    """Return a sequence node."""
    return SequenceNode(place, tuple(items), 1 + sum(item.size for item in items))


def python_number(number: sp.Expr) -> Number:
    """Return an exact number as int or Fraction if it is rational."""
    if number.is_Integer:
        return int(number)
    return Fraction(int(number.p), int(number.q)) if number.is_Rational else number


def argument_error(error: HenonRefError, declared: Sequence[str] = ()) -> ArgumentError:
    """Convert an error of the reader, with the name of the declaration in place of line and column."""
    message, line = getattr(error, "message", str(error)), getattr(error, "line", None)
    return ArgumentError(f"{declared[line - 1]}: {message}" if declared and line else message)


def _shown(value: object) -> str:
    """Return the beginning of a value's repr."""
    try:
        return shortened(repr(value))[1:-1]
    except Exception:  # noqa: BLE001 - a foreign __repr__ may raise anything
        return f"a {type(value).__name__}"
