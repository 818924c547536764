"""Arguments from Python: their values as the nodes of a case file's tree, and errors of calls with wrong names.

A system from Python is thus checked by the same code as one from a file (:mod:`henon_ref.system`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import wraps
from inspect import Parameter, isfunction, signature
from numbers import Integral, Rational, Real
from typing import Any, ParamSpec, TypeVar

import numpy as np
import sympy as sp

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.expressions.evaluation import Written
from henon_ref.expressions.grammar import LONGEST_WHOLE, MAX_DIGITS, MAX_LENGTH, MAX_STATES, MOST_STATES
from henon_ref.expressions.operations import Work, spelled_out
from henon_ref.expressions.traversal import is_longer
from henon_ref.system.source import Source
from henon_ref.system.tree import NOWHERE, MappingNode, Node, Place, ScalarNode, SequenceNode, child, mapping, sequence
from henon_ref.text import did_you_mean, listed, shortened

MOST_ENTRIES = 10_000
"""Largest number of entries of a list or mapping."""
DEEPEST = 8
"""Largest nesting depth of lists and mappings."""
SCIPY = {
    "t_eval": "the run is known at every time: write run.sol(times), or run.to_dataframe(times)",
    "args": "parameters go by name: System(..., parameters={'F': 1}), and simulate(..., parameters={'F': 2})",
    "t_span": "write until=10, and start=1 where it does not begin at 0",
    "y0": "write initial={'x': 1, 'v': 0}",
    "events": "every surface of the system is located: see run.transitions; stop={'s': 'falling'} ends the run on one",
    "method": "leave it out; there is one method, whose accuracy rtol sets",
    "atol": "leave it out; rtol is relative to each state's own size, whatever its unit",
    "jac": "derivatives are taken from the system's expressions",
    **dict.fromkeys(("max_step", "min_step", "first_step"), "steps follow from rtol, and pass over no event"),
    **dict.fromkeys(("vectorized", "jac_sparsity", "lband", "uband"), "leave it out; it has no equivalent here"),
}
"""Arguments of SciPy's solve_ivp -> the equivalent here, for functions with ``rtol``."""
Number = int | Fraction | Any
"""Exact number: integer, rational, or a SymPy number such as ``sqrt(3)/9``."""
P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")


def written_name(value: object, what: str) -> str:
    """Return the name of a state, parameter or surface, given as text or a symbol; ``what`` names it in messages."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, sp.Symbol):
        return str(value.name)
    raise ArgumentError(f"{what}: {_shown(value)} is no name; wanted text, as in 'x'")


def without_dimensions(value: Any) -> Any:
    """Return the entry of an array without dimensions, such as ``np.array(0.2)``; any other value unchanged."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


def written(value: object, what: str) -> str:
    """Return a number or an expression as the text of a case file.

    ``value`` is an int, float, Fraction, Decimal, text or SymPy expression, or one as an array without dimensions; a
    float stands for the decimal number that Python prints (0.1 is 1/10). ArgumentError if it is of another type, not
    finite, or too long.
    """
    value = without_dimensions(value)
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
    if is_longer(value, MAX_LENGTH):
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


class CallError(ArgumentError, TypeError):
    """Unknown or missing arguments of a function."""


def explained(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function: a call with unknown or missing arguments raises a :class:`CallError`."""

    @wraps(function)
    def called(*arguments: P.args, **options: P.kwargs) -> R:
        try:
            return function(*arguments, **options)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:  # raised inside the function
                raise
            raise CallError(_misfit(function, arguments, options) or str(error)) from None

    return called


def explained_methods(cls: type[C]) -> type[C]:
    """Decorate the constructor and the public methods of a class with :func:`explained`."""
    for name, own in list(vars(cls).items()):
        if isfunction(own) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, explained(own))
    return cls


def check_words(function: str, given: Iterable[str], known: Sequence[str], others: Sequence[str] = ()) -> None:
    """Raise CallError for an unknown keyword; ``others`` are also allowed, but not listed in the message."""
    for word in given:
        if word not in known and word not in others:
            meant = did_you_mean(word, [*known, *others])
            more = " and matplotlib's keywords" if others else ""
            raise CallError(f"{function} has no argument '{word[:60]}'{meant}; it takes {listed(known, 20)}{more}")


def _misfit(function: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> str:
    """Return the message for a wrong call; empty if an argument is missing (Python's message is used)."""
    name = function.__qualname__.removesuffix(".__init__")
    parameters = signature(function).parameters
    own, given = [p for p in parameters.values() if p.name != "self"], len(arguments) - ("self" in parameters)
    known = [p.name for p in own]
    for word in options:
        if word in SCIPY and word not in known and "rtol" in known:
            return f"{name} has no argument '{word}': {SCIPY[word]}"
    check_words(name, options, known)
    places = [p.name for p in own if p.kind == Parameter.POSITIONAL_OR_KEYWORD]
    by_name = [p.name for p in own if p.kind == Parameter.KEYWORD_ONLY]
    if given > len(places) and by_name:
        return f"{name} takes {listed(places)} without a name; write what follows by name, as in {by_name[0]}=..."
    return ""
