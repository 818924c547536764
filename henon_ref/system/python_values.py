"""Values from Python as the nodes of a case file's tree: names, numbers, expressions, lists and mappings.

A system from Python is thus checked by the same code as one from a file (:mod:`henon_ref.system`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real
from typing import Any

import numpy as np
import sympy as sp

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.expressions.evaluation import Written
from henon_ref.expressions.grammar import LONGEST_WHOLE, MAX_DIGITS, MAX_LENGTH, MAX_STATES, MOST_STATES
from henon_ref.expressions.operations import Work, spelled_out
from henon_ref.expressions.traversal import size
from henon_ref.system.source import Source
from henon_ref.system.tree import NOWHERE, MappingNode, Node, Place, ScalarNode, SequenceNode, child, mapping, sequence
from henon_ref.text import did_you_mean, listed, shortened

MOST_ENTRIES = 10_000
"""Largest number of entries of a list or mapping."""
DEEPEST = 8
"""Largest nesting depth of lists and mappings."""
Number = int | Fraction | Any
"""Exact number: integer, rational, or a SymPy number such as ``sqrt(3)/9``."""


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
    if isinstance(value, bool) or not isinstance(value, Real | Decimal):
        wanted = "wanted a number (int, float, Fraction), text or a SymPy expression"
        raise ArgumentError(f"{what} is {_shown(value)}; {wanted}")
    if isinstance(value, Rational):
        if max(int(value.numerator).bit_length(), int(value.denominator).bit_length()) > LONGEST_WHOLE:
            raise ArgumentError(f"{what} is a number of more than {MAX_DIGITS} digits")
        return str(int(value)) if isinstance(value, Integral) else f"{value.numerator}/{value.denominator}"
    if not math.isfinite(value):
        raise ArgumentError(f"{what} is {value}; a number must be finite")
    return str(value) if isinstance(value, Decimal) else float.__repr__(float(value))


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
        if len(value) > MOST_ENTRIES or depth > DEEPEST:
            raise ArgumentError(f"{what} has more than {MOST_ENTRIES} entries, or nests deeper than {DEEPEST}")
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


def mapping_of(
    value: object, what: str, kind: str = "", known: Collection[str] = (), example: str = "{name: value}"
) -> MappingNode:
    """Return a mapping as a node (:func:`tree_of`); ArgumentError if it is none.

    ``kind``: what its names are, such as ``parameter``, if only ``known`` names are allowed.
    """
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{what} must be a mapping, as in {example}; here it is of type {type(value).__name__}")
    node = tree_of(value, what)
    assert isinstance(node, MappingNode)
    for name in node.entries if kind else ():
        if name not in known:
            raise ArgumentError(f"'{name[:60]}' is no {kind}{did_you_mean(name, known)}; {kind}s: {listed(known)}")
    return node


def python_number(number: sp.Expr) -> Number:
    """Return an exact number as int or Fraction if it is rational."""
    if number.is_Integer:
        return int(number)
    return Fraction(int(number.p), int(number.q)) if number.is_Rational else number


def argument_error(error: HenonRefError, declared: Sequence[str] = ()) -> ArgumentError:
    """Convert an error of the reader, with the name of the declaration in place of line and column."""
    message, line = getattr(error, "message", str(error)), getattr(error, "line", None)
    return ArgumentError(f"{declared[line - 1]}: {message}" if declared and line else message)


def source_of(tree: MappingNode) -> Source:
    """Source of a model from Python; its allowed work grows with the number of states."""
    state = child(tree, ["system", "state"])
    parts = len(state.items) // MAX_STATES if isinstance(state, SequenceNode) else 0
    return Source(tree, work=Work(files=1 + parts), most_states=MOST_STATES)


def _shown(value: object) -> str:
    try:
        return shortened(repr(value))[1:-1]
    except Exception:  # noqa: BLE001 - a foreign __repr__ may raise anything
        return f"a {type(value).__name__}"
