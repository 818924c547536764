"""Expressions of a case file to exact SymPy, without ever running text from a stranger.

The text is scanned (:mod:`henon_ref.casefile.grammar`), parsed by Python's ``ast`` and walked node by node
through a whitelist (:mod:`henon_ref.casefile.syntax_walk`). ``eval``, ``sympify`` and ``parse_expr`` are never called.
What the texts of one file cost together is bounded (:mod:`henon_ref.casefile.work`), and none is worked out twice.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.syntax_walk import SyntaxWalk, read_text
from henon_ref.casefile.work import CACHED, Work, key_of, names_in, overlaid
from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import MAX_TERMS, check_constant, check_smooth, terms, with_known_functions


def parse_expression(text: str, names: Mapping[str, sp.Expr], work: Work | None = None) -> sp.Expr:
    """Read a smooth expression, such as a component of a field.

    Parameters
    ----------
    text : str
        Numbers, ``pi``, ``e``, the names given, ``+ - * / ** ^`` (the last two both mean power) and
        sin cos tan asin acos atan sinh cosh tanh exp log sqrt.
    names : mapping
        Name -> what it stands for: a real symbol, or an exact number.
    work : Work, optional
        That of the file which the text stands in.

    Returns
    -------
    Expr
        Exact: ``0.1`` is ``Rational(1, 10)``.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed and what is.
    """
    work = Work() if work is None else work
    work.charge(CACHED, 0)
    key = key_of("expression", text, names)
    if key not in work.values:
        work.values[key] = _smooth(SyntaxWalk(read_text(text, names, work), names, work).value())
    return work.values[key]


def parse_field(text: str, names: Mapping[str, sp.Expr], work: Work) -> tuple[sp.Expr, list[sp.Expr]]:
    """Read a component of a field, which may have kinks and jumps (see :mod:`henon_ref.casefile.kinks`).

    Returns
    -------
    expression : Expr
        With a :class:`henon_ref.casefile.kinks.Sgn` for the sign of each argument.
    arguments : list of Expr
        What these are signs of, in order of appearance.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed and what is.
    """
    work.charge(CACHED, 0)
    key = key_of("field", text, names)
    if key not in work.values:
        walker = SyntaxWalk(read_text(text, names, work, kinks=True), names, work)
        value = _smooth(walker.value())
        work.values[key] = value
        work.texts[key] = walker.kinks()
    return work.values[key], work.texts[key]


def _smooth(value: sp.Expr) -> sp.Expr:
    """The value of a text, if it may stand in a field."""
    value = with_known_functions(value)
    check_smooth(value)
    if value.is_number:
        check_constant(value, 0)
    if terms(value) > MAX_TERMS:
        raise ExpressionError(f"multiplied out it has more than {MAX_TERMS} terms; lower the powers of sums", 0)
    return value


def check_sides(
    text: str, names: Mapping[str, sp.Expr], signs: Mapping[str, sp.Symbol], work: Work, *, kinks: bool = False
) -> None:
    """Check that an expression has values with each sign at -1 and at +1.

    A sign that stands in sums and products alone can do no harm but by the size of the numbers: all such signs are
    tried at once. What else it stands in (divisors, powers, functions) is worked out with each sign by itself.

    Raises
    ------
    ExpressionError
        With the sign and its side.
    """
    signs = {name: signs[name] for name in names_in(text) if name in signs}
    names = overlaid(signs, names)
    key = key_of("sides", text, names)
    if key in work.values or not signs:
        return
    read = read_text(text, names, work, kinks=kinks)
    delicate = SyntaxWalk(read, names, work).delicate(signs)
    harmless = {name: symbol for name, symbol in signs.items() if not any(name in found for _, found in delicate)}
    for side in (-1, 1):
        sides = overlaid(dict.fromkeys(harmless, sp.Integer(side)), names)
        parse_field(text, sides, work) if kinks else parse_expression(text, sides, work)
    for node, found in delicate:
        for name in sorted(found):
            for side in (-1, 1):
                try:
                    SyntaxWalk(read, overlaid({name: sp.Integer(side)}, names), work).of(node)
                except ExpressionError as error:
                    raise ExpressionError(f"{error.message} (at {name} = {side:+d})", error.offset) from None
    work.values[key] = sp.S.Zero


def parse_number(text: str, names: Mapping[str, sp.Expr], work: Work | None = None) -> sp.Expr:
    """Read an expression whose value is a number: a parameter, an initial value, a time.

    Parameters
    ----------
    text : str
        As for :func:`parse_expression`, with ``abs`` and ``atan2`` besides.
    names : mapping
        Name -> exact number.
    work : Work, optional
        That of the file which the text stands in.

    Returns
    -------
    Expr
        An exact real number within the range of a double.

    Raises
    ------
    ExpressionError
        Also where the value is complex, infinite, undefined, or beyond the largest double.
    """
    work = Work() if work is None else work
    work.charge(CACHED, 0)
    key = key_of("number", text, names)
    if key not in work.values:
        value = SyntaxWalk(read_text(text, names, work, constant=True), names, work).value()
        check_constant(value, 0)
        work.values[key] = value
    return work.values[key]
