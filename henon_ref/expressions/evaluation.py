"""Conversion of expressions to exact SymPy: the text of a case file, which is never executed, and SymPy itself.

Text and SymPy are both read into operations (:mod:`~henon_ref.expressions.parser`,
:mod:`~henon_ref.expressions.operations`) and then evaluated by the same class, so that both forms obey the same rules.
Every operation is checked before SymPy evaluates it, so that the work is bounded by the length of the expression:
``9**9**9**9`` is refused, not computed. :class:`~henon_ref.expressions.operations.Work` bounds the total work for one
model and caches every value.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TypeAlias

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.expressions.bounds import (
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
from henon_ref.expressions.grammar import CONSTANT_FUNCTIONS, EULER, FUNCTIONS, KINK_FUNCTIONS, MAX_DEPTH
from henon_ref.expressions.operations import (
    CACHED,
    OPERATION,
    READ,
    Operation,
    Work,
    checked_nesting,
    key_of,
    names_in,
    operation_of,
    overlaid,
)
from henon_ref.expressions.parser import parsed

Written: TypeAlias = "str | sp.Expr"
Kinked = tuple[sp.Expr, list[sp.Expr]]
"""Expression, and the arguments of its kinks in order of appearance."""
SMOOTH = dict.fromkeys(FUNCTIONS, 1)
NUMBER, FIELD = SMOOTH | CONSTANT_FUNCTIONS, SMOOTH | KINK_FUNCTIONS
"""Function -> number of its arguments: in an expression whose value is a number, and in a component of a field."""
_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}


def parse_expression(written: Written, names: Mapping[str, sp.Expr]) -> sp.Expr:
    """Read a smooth expression, such as a component of a field, exactly: ``0.1`` is ``Rational(1, 10)``.

    ``written`` has numbers, ``pi``, ``e``, the names given (name -> real symbol or exact number), ``+ - * / ** ^`` (the
    last two both mean power) and sin cos tan asin acos atan sinh cosh tanh exp log sqrt; symbols of SymPy are matched
    by name. ExpressionError, with the offset and the fault, says what is allowed.
    """
    return evaluated(written, names, Work(), SMOOTH)[0]


def parse_number(written: Written, names: Mapping[str, sp.Expr]) -> sp.Expr:
    """Read an expression whose value is a number: a parameter, an initial value, a time.

    ``abs`` and ``atan2`` are allowed in addition; the value must be real and within the range of a double.
    """
    return evaluated(written, names, Work(), NUMBER)[0]


def read(written: Written, names: Mapping[str, object], work: Work, functions: Mapping[str, int]) -> Operation:
    """Return the operations of an expression; they are cached."""
    key = written, id(functions), tuple(name in names for name in names_in(written))
    if key not in work.known:
        if isinstance(written, str):
            work.charge(READ * len(written), 0)
            found = parsed(written, names.keys(), functions)
        else:
            found = operation_of(written, names.keys(), functions)
            work.charge(READ * found.length, 0)
        work.known[key] = checked_nesting(found)
    operation: Operation = work.known[key]
    return operation


def evaluated(written: Written, names: Mapping[str, sp.Expr], work: Work, functions: Mapping[str, int]) -> Kinked:
    """Return the value of an expression and the arguments of its kinks; both are cached.

    Kinks and jumps (see :mod:`henon_ref.expressions.kinks`) are allowed if ``functions`` is ``FIELD``; the value then
    has a :class:`henon_ref.expressions.kinks.Sgn` for each sign.
    """
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
    found: Kinked = work.known[key]
    return found


def _smooth(value: sp.Expr) -> sp.Expr:
    """Return the value of an expression after checking that it is smooth and of bounded size."""
    value = with_known_functions(value)
    check_smooth(value)
    if value.is_number:
        check_constant(value, 0)
    if terms(value) > MAX_TERMS:
        raise ExpressionError(f"multiplied out it has more than {MAX_TERMS} terms; lower the powers of sums", 0)
    return value


def check_sides(
    written: Written,
    names: Mapping[str, sp.Expr],
    signs: Mapping[str, sp.Symbol],
    work: Work,
    functions: Mapping[str, int],
) -> None:
    """Check that an expression has a value with each sign at -1 and at +1.

    Signs that occur only in sums and products affect only the size of the numbers: all of them are set at once.
    Divisors, powers and functions that contain signs are evaluated with one sign set at a time.
    """
    signs = {name: signs[name] for name in names_in(written) if name in signs}
    if not signs:
        return
    names = overlaid(signs, names)
    found = _delicate(read(written, names, work, functions), signs)
    harmless = set(signs).difference(*(held for _, held in found))
    for side in (-1, 1):
        sides = overlaid(dict.fromkeys(harmless, sp.Integer(side)), names)
        evaluated(written, sides, work, functions)
    for part, held in found:
        for name in held:
            for side in (-1, 1):
                try:
                    Walk(overlaid({name: sp.Integer(side)}, names), work, kinked=functions is FIELD).value(part)
                except ExpressionError as error:
                    raise ExpressionError(f"{error.message} (at {name} = {side:+d})", error.offset) from None


def _delicate(operation: Operation, signs: Collection[str]) -> list[tuple[Operation, list[str]]]:
    """Return the outermost divisors, powers and functions that contain some of the signs, each with those signs."""
    kinds = ("/", "^", "call")
    parts = (part for part in operation.parts(lambda part: part.kind not in kinds) if part.kind in kinds)
    held = ((part, sorted(name for name in part.names if name in signs)) for part in parts)
    return [(part, names) for part, names in held if names]


class Walk:
    """Evaluation of operations to exact SymPy, for given meanings of the names.

    ``kinked``: whether ``abs`` and the other functions with kinks become symbols of signs (as in a field).
    """

    def __init__(self, names: Mapping[str, sp.Expr], work: Work, *, kinked: bool) -> None:
        self.names, self.work, self.kinked = names, work, kinked

    def value(self, operation: Operation) -> sp.Expr:
        try:
            return self._of(operation, 0)
        except (RecursionError, MemoryError):
            raise ExpressionError("nested too deeply", 0) from None
        # SymPy's own evaluation of unusual numbers fails (AttributeError: its cache, after a TypeError).
        except (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError) as error:
            raise ExpressionError(f"SymPy cannot evaluate this ({type(error).__name__})", 0) from None

    def _of(self, part: Operation, depth: int) -> sp.Expr:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}", part.begin)
        match part.kind:
            case "number":
                return part.value
            case "name":
                name = str(part.value)
                return self.names.get(name, sp.E if name == EULER else sp.pi)
            case "-":
                return -self._of(part.arguments[0], depth + 1)
            case "/":
                return power(self._of(part.arguments[0], depth + 1), sp.S.NegativeOne, part.offset)
        key = key_of(f"value{'+' if self.kinked else ''}", part, self.names)
        if key not in self.work.known:
            self.work.charge(OPERATION + part.length, part.offset)
            value = self._operation(part, depth)
            if value.is_number and not value.is_Rational:  # its digits have been computed
                self.work.charge(2 * (OPERATION + part.length), part.offset)
            self.work.known[key] = value
        return self.work.known[key]

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
        from henon_ref.expressions import kinks  # imported only for models with kinks

        arguments = [self._argument(argument, depth + 1) for argument in part.arguments]
        strict = [condition.kind in ("<", ">") for condition in part.arguments[1::2]]
        return kinks.call(str(part.value), arguments, part.offset, strict)

    def _argument(self, part: Operation, depth: int) -> sp.Expr:
        """Return the value of an argument; for a comparison, an expression that is positive if it holds."""
        if part.kind not in ("<", "<=", ">", ">="):
            return self._of(part, depth)
        left, right = (self._of(side, depth) for side in part.arguments)
        return left - right if part.kind in (">", ">=") else right - left

    def _power(self, base: sp.Expr, exponent: sp.Expr, offset: int) -> sp.Expr:
        """Return a power; a root of a square becomes an absolute value, with its kink."""
        value = power(base, exponent, offset)
        if not self.kinked or not value.has(sp.Abs):
            return value
        from henon_ref.expressions.kinks import call

        return value.replace(sp.Abs, lambda u: call("abs", [u], offset))

    def _call(self, name: str, arguments: list[sp.Expr], offset: int) -> sp.Expr:
        if name not in _SYMPY or len(arguments) != CONSTANT_FUNCTIONS.get(name, 1):
            raise ExpressionError(f"{name!r} is not a function of {len(arguments)} arguments", offset)
        if name == "sqrt":
            return self._power(arguments[0], sp.S.Half, offset)
        if name == "exp":
            check_exponential(arguments[0], offset)
        if arguments[0].is_number:
            check_domain(name, arguments[0], offset)
        return checked(_SYMPY[name](*arguments), offset)

    def kinks(self, operation: Operation) -> list[sp.Expr]:
        """Return the expressions at whose zeros the operation has a kink or a jump, in order of appearance."""
        found: list[sp.Expr] = []
        for part in operation.parts():
            if part.kind == "call" and part.value in KINK_FUNCTIONS:
                from henon_ref.expressions.kinks import compared

                found += compared(str(part.value), [self._argument(a, 0) for a in part.arguments])
            elif part.kind == "^" or part.value == "sqrt":
                base, exponent = (*(self._of(a, 0) for a in part.arguments), sp.S.Half)[:2]
                roots = sp.Pow(base, exponent).atoms(sp.Abs)  # SymPy simplifies sqrt(u**2) to Abs(u)
                found += [root.args[0] for root in sorted(roots, key=sp.default_sort_key)]
        return found
