"""Expressions to exact SymPy: of a case file's text, without ever running text from a stranger, and of SymPy itself.

Either is read into operations (:mod:`henon_ref.casefile.parser`, :mod:`henon_ref.casefile.sympy_form`), over which one
walk goes, so that what is refused does not depend on how it is written. Every operation is checked before SymPy does
it, so that the work is bounded by the length of what is written: ``9**9**9**9`` is refused, not computed. What the
expressions of one model cost together is bounded as well (:mod:`henon_ref.casefile.work`); none is worked out twice.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TypeAlias

import sympy as sp

from henon_ref.casefile.grammar import CONSTANT_FUNCTIONS, CONSTANTS, FUNCTIONS, KINK_FUNCTIONS, MAX_DEPTH
from henon_ref.casefile.operations import Operation, checked_nesting
from henon_ref.casefile.parser import parsed
from henon_ref.casefile.work import CACHED, OPERATION, READ, Work, key_of, names_in, overlaid
from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import (
    MAX_TERMS,
    check_constant,
    check_domain,
    check_exponential,
    check_smooth,
    checked,
    power,
    terms,
    with_known_functions,
)

Written: TypeAlias = "str | sp.Expr"
"""An expression as it is given."""
KINKED = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Piecewise, sp.Heaviside)
"""SymPy's functions with kinks or jumps."""
SMOOTH = dict.fromkeys(FUNCTIONS, 1)
NUMBER, FIELD = SMOOTH | CONSTANT_FUNCTIONS, SMOOTH | KINK_FUNCTIONS
"""Functions of an expression whose value is a number, and of a field -> how many arguments they take."""
_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}
_NUMBERS: dict[str, sp.Expr] = dict(zip(CONSTANTS, (sp.pi, sp.E), strict=True))
_HALF = sp.Rational(1, 2)
# What SymPy raises where its own evaluation of an odd number fails (AttributeError: its cache, on a TypeError).
_SYMPY_FAILS = (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError)


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


def read(written: Written, names: Mapping[str, object], work: Work, functions: Mapping[str, int]) -> Operation:
    """The operations of an expression, read once for all names that it is worked out with."""
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
    """
    signs = {name: signs[name] for name in names_in(written) if name in signs}
    if not signs:
        return
    names = overlaid(signs, names)
    operation = read(written, names, work, FIELD if kinks else SMOOTH)
    key = key_of("sides", operation, names)
    if key in work.known:
        return
    found = _delicate(operation, signs)
    harmless = set(signs).difference(*(held for _, held in found))
    for side in (-1, 1):
        sides = overlaid(dict.fromkeys(harmless, sp.Integer(side)), names)
        _worked_out(written, sides, work, FIELD if kinks else SMOOTH)
    for part, held in found:
        for name in held:
            for side in (-1, 1):
                try:
                    Walk(overlaid({name: sp.Integer(side)}, names), work, kinked=kinks).value(part)
                except ExpressionError as error:
                    raise ExpressionError(f"{error.message} (at {name} = {side:+d})", error.offset) from None
    work.known[key] = None


def _delicate(operation: Operation, signs: Collection[str]) -> list[tuple[Operation, list[str]]]:
    """Divisors, powers and functions that hold some signs, outermost ones, with these."""
    kinds = ("/", "^", "call")
    parts = (part for part in operation.parts(lambda part: part.kind not in kinds) if part.kind in kinds)
    held = ((part, sorted(name for name in part.names if name in signs)) for part in parts)
    return [(part, names) for part, names in held if names]


class Walk:
    """The walk over operations with some names, which makes exact SymPy of them.

    Parameters
    ----------
    names : mapping
        Name -> what it stands for: a real symbol, or an exact number.
    work : Work
        What is found of a part with these names is kept here.
    kinked : bool
        Whether ``abs`` and its like are signs' symbols (in a field), or what they are of a number.
    """

    def __init__(self, names: Mapping[str, sp.Expr], work: Work, *, kinked: bool) -> None:
        self.names, self.work, self.kinked = names, work, kinked

    def value(self, operation: Operation) -> sp.Expr:
        """What an operation is."""
        try:
            return self._of(operation, 0)
        except (RecursionError, MemoryError):
            raise ExpressionError("nested too deeply", 0) from None
        except _SYMPY_FAILS as error:
            raise ExpressionError(f"SymPy cannot work this out ({type(error).__name__})", 0) from None

    def _of(self, part: Operation, depth: int) -> sp.Expr:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}", part.begin)
        match part.kind:
            case "number":
                return part.value
            case "name":
                name = str(part.value)
                return self.names[name] if name in self.names else _NUMBERS[name]
            case "-":
                return -self._of(part.arguments[0], depth + 1)
            case "/":
                return power(self._of(part.arguments[0], depth + 1), sp.S.NegativeOne, part.offset)
        key = key_of(f"value{'+' if self.kinked else ''}", part, self.names)
        if key not in self.work.values:
            self.work.charge(OPERATION + part.length, part.offset)
            value = self._operation(part, depth)
            if value.is_number and not value.is_Rational:  # its digits have been computed
                self.work.charge(2 * (OPERATION + part.length), part.offset)
            self.work.values[key] = value
        return self.work.values[key]

    def _operation(self, part: Operation, depth: int) -> sp.Expr:
        if self.kinked and part.kind == "call" and part.value in KINK_FUNCTIONS:
            return self._kinked(part, depth)
        values = [self._of(argument, depth + 1) for argument in part.arguments]
        match part.kind:
            case "+":
                return checked(sp.Add(*values), part.offset)
            case "*":
                return checked(sp.Mul(*values), part.offset)
            case "^":
                return self._power(values[0], values[1], part.offset)
            case _:
                return self._call(str(part.value), values, part.offset)

    def _kinked(self, part: Operation, depth: int) -> sp.Expr:
        from henon_ref.casefile import kinks  # many models have none

        arguments = [self._argument(argument, depth + 1) for argument in part.arguments]
        strict = [condition.kind in ("<", ">") for condition in part.arguments[1::2]]
        return kinks.call(str(part.value), arguments, part.offset, strict)

    def _argument(self, part: Operation, depth: int) -> sp.Expr:
        """An argument; of a comparison what is positive where it holds."""
        if part.kind not in ("<", "<=", ">", ">="):
            return self._of(part, depth)
        left, right = (self._of(side, depth) for side in part.arguments)
        return left - right if part.kind in (">", ">=") else right - left

    def _power(self, base: sp.Expr, exponent: sp.Expr, offset: int) -> sp.Expr:
        """A power; where it is a root of a square, with that one's kink."""
        value = power(base, exponent, offset)
        if not self.kinked or not value.has(sp.Abs):
            return value
        from henon_ref.casefile.kinks import call

        return value.replace(sp.Abs, lambda u: call("abs", [u], offset))

    def _call(self, name: str, arguments: list[sp.Expr], offset: int) -> sp.Expr:
        if name not in _SYMPY or len(arguments) != CONSTANT_FUNCTIONS.get(name, 1):
            raise ExpressionError(f"{name!r} is no function with {len(arguments)} arguments", offset)
        if name == "sqrt":
            return self._power(arguments[0], _HALF, offset)
        if name == "exp":
            check_exponential(arguments[0], offset)
        if arguments[0].is_number:
            check_domain(name, arguments[0], offset)
        return checked(_SYMPY[name](*arguments), offset)

    def kinks(self, operation: Operation) -> list[sp.Expr]:
        """What has a kink or jumps where it is 0, in order of appearance."""
        found: list[sp.Expr] = []
        for part in operation.parts():
            if part.kind == "call" and part.value in KINK_FUNCTIONS:
                from henon_ref.casefile.kinks import compared

                found += compared(str(part.value), [self._argument(a, 0) for a in part.arguments])
            elif part.kind == "^" or part.value == "sqrt":
                base, exponent = (*(self._of(a, 0) for a in part.arguments), _HALF)[:2]
                roots = sp.Pow(base, exponent).atoms(sp.Abs)  # what SymPy takes the absolute value of
                found += [root.args[0] for root in sorted(roots, key=sp.default_sort_key)]
        return found
