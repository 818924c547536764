"""Expressions to exact SymPy: of a case file's text, without ever running text from a stranger, and of SymPy itself.

Either is read into operations (:mod:`henon_ref.casefile.parser`, :mod:`henon_ref.casefile.sympy_form`), over which one
walk goes (:mod:`henon_ref.casefile.walk`): what is refused does not depend on how it is written. What the expressions
of one model cost together is bounded (:mod:`henon_ref.casefile.work`), and none is worked out twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import sympy as sp

from henon_ref.casefile.grammar import CONSTANT_FUNCTIONS, FUNCTIONS, KINK_FUNCTIONS
from henon_ref.casefile.operations import Operation, checked_nesting
from henon_ref.casefile.parser import parsed
from henon_ref.casefile.walk import Walk, delicate
from henon_ref.casefile.work import CACHED, READ, Work, key_of, names_in, overlaid
from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import MAX_TERMS, check_constant, check_smooth, terms, with_known_functions

Written: TypeAlias = "str | sp.Expr"
"""An expression as it is given."""
KINKED = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Piecewise, sp.Heaviside)
"""SymPy's functions with kinks or jumps."""
SMOOTH = dict.fromkeys(FUNCTIONS, 1)
NUMBER, FIELD = SMOOTH | CONSTANT_FUNCTIONS, SMOOTH | KINK_FUNCTIONS
"""Functions of an expression whose value is a number, and of a field -> how many arguments they take."""


def read(written: Written, names: Mapping[str, object], work: Work, functions: Mapping[str, int]) -> Operation:
    """The operations of an expression, read once for all names that it is worked out with.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed.
    """
    key = written, id(functions), tuple(name in names for name in names_in(written))
    if key not in work.known:
        if isinstance(written, str):
            work.charge(READ * len(written), 0)
            found = parsed(written, names.keys(), functions)
        else:
            from henon_ref.casefile.sympy_form import operation_of  # what files and text do without

            found = operation_of(written, names.keys(), functions)
            work.charge(READ * found.length, 0)
        work.known[key] = checked_nesting(found)
    operation: Operation = work.known[key]
    return operation


def parse_expression(written: Written, names: Mapping[str, sp.Expr], work: Work | None = None) -> sp.Expr:
    """Read a smooth expression, such as a component of a field.

    Parameters
    ----------
    written : str or Expr
        Numbers, ``pi``, ``e``, the names given, ``+ - * / ** ^`` (the last two both mean power) and
        sin cos tan asin acos atan sinh cosh tanh exp log sqrt. Symbols of SymPy go by their names.
    names : mapping
        Name -> what it stands for: a real symbol, or an exact number.
    work : Work, optional
        That of the file which the expression stands in.

    Returns
    -------
    Expr
        Exact: ``0.1`` is ``Rational(1, 10)``.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed and what is.
    """
    return _worked_out(written, names, Work() if work is None else work, SMOOTH)[0]


def parse_field(written: Written, names: Mapping[str, sp.Expr], work: Work) -> tuple[sp.Expr, list[sp.Expr]]:
    """Read a component of a field likewise, which may have kinks and jumps (see :mod:`henon_ref.casefile.kinks`).

    Returns
    -------
    expression : Expr
        With a :class:`henon_ref.casefile.kinks.Sgn` for the sign of each argument.
    arguments : list of Expr
        What these are signs of, in order of appearance.
    """
    return _worked_out(written, names, work, FIELD)


def parse_number(written: Written, names: Mapping[str, sp.Expr], work: Work | None = None) -> sp.Expr:
    """Read an expression whose value is a number likewise: a parameter, an initial value, a time.

    It may have ``abs`` and ``atan2`` besides, and is a real number within the range of a double.
    """
    return _worked_out(written, names, Work() if work is None else work, NUMBER)[0]


def _worked_out(
    written: Written, names: Mapping[str, sp.Expr], work: Work, functions: Mapping[str, int]
) -> tuple[sp.Expr, list[sp.Expr]]:
    """The value of an expression, and what it has kinks for; once for the same operations and names."""
    work.charge(CACHED, 0)
    operation = read(written, names, work, functions)
    key = key_of(f"all, {id(functions)}", operation, names)
    if key not in work.known:
        walk = Walk(names, work, kinked=functions is FIELD)
        value = walk.value(operation)
        if functions is NUMBER:
            check_constant(value, 0)
        else:
            value = _smooth(value)
        work.known[key] = value, walk.kinks(operation) if functions is FIELD else []
    found: tuple[sp.Expr, list[sp.Expr]] = work.known[key]
    return found


def _smooth(value: sp.Expr) -> sp.Expr:
    """The value of an expression, if it may stand in a field."""
    value = with_known_functions(value)
    check_smooth(value)
    if value.is_number:
        check_constant(value, 0)
    if terms(value) > MAX_TERMS:
        raise ExpressionError(f"multiplied out it has more than {MAX_TERMS} terms; lower the powers of sums", 0)
    return value


def check_sides(
    written: Written, names: Mapping[str, sp.Expr], signs: Mapping[str, sp.Symbol], work: Work, *, kinks: bool = False
) -> None:
    """Check that an expression has values with each sign at -1 and at +1.

    A sign that stands in sums and products alone can do no harm but by the size of the numbers: all such signs are
    tried at once. What else it stands in (divisors, powers, functions) is worked out with each sign by itself.

    Raises
    ------
    ExpressionError
        With the sign and its side.
    """
    signs = {name: signs[name] for name in names_in(written) if name in signs}
    if not signs:
        return
    names = overlaid(signs, names)
    operation = read(written, names, work, FIELD if kinks else SMOOTH)
    key = key_of("sides", operation, names)
    if key in work.known:
        return
    found = delicate(operation, signs)
    harmless = set(signs).difference(*(held for _, held in found))
    for side in (-1, 1):
        sides = overlaid(dict.fromkeys(harmless, sp.Integer(side)), names)
        parse_field(written, sides, work) if kinks else parse_expression(written, sides, work)
    for part, held in found:
        for name in held:
            for side in (-1, 1):
                try:
                    Walk(overlaid({name: sp.Integer(side)}, names), work, kinked=kinks).value(part)
                except ExpressionError as error:
                    raise ExpressionError(f"{error.message} (at {name} = {side:+d})", error.offset) from None
    work.known[key] = None
