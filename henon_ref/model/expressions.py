"""Expressions of a case file to exact SymPy, without ever running text from a stranger.

The text is scanned (:mod:`henon_ref.model.grammar`), parsed by Python's ``ast`` and walked node by node
through a whitelist. ``eval``, ``sympify`` and ``parse_expr`` are never called. Every operation is checked
before SymPy does it, so that the work is bounded by the length of the text: ``9**9**9**9`` is refused, not
computed.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from math import comb

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.model.grammar import CONSTANT_FUNCTIONS, CONSTANTS, FUNCTIONS, MAX_DEPTH, Scanned, scan, shortened

MAX_BITS = 4_096
"""Bits that numerator or denominator of an exact number may have."""
MAX_POWER = 64
"""Largest absolute integer exponent over anything that is not a number."""
MAX_TERMS = 20_000
"""Terms an expression may have once its powers and products are multiplied out."""
LARGEST = sp.Float("1.7976931348623157e308", 20)
"""Largest absolute value a number may have: a double must be able to hold it."""

_DIGITS = 25
_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}
_NUMBERS: dict[str, sp.Expr] = dict(zip(CONSTANTS, (sp.pi, sp.E), strict=True))
_SMOOTH = (sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log)


def parse_expression(text: str, names: Mapping[str, sp.Expr]) -> sp.Expr:
    """Read a smooth expression, such as a component of a field.

    Parameters
    ----------
    text : str
        Numbers, ``pi``, ``e``, the names given, ``+ - * / ** ^`` (the last two both mean power) and
        sin cos tan asin acos atan sinh cosh tanh exp log sqrt.
    names : mapping
        Name -> what it stands for: a real symbol, or an exact number.

    Returns
    -------
    Expr
        Exact: ``0.1`` is ``Rational(1, 10)``.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed and what is.
    """
    walker = _Walker(scan(text, names), names)
    value = _with_known_functions(walker.value())
    _check_smooth(value)
    if value.is_number:
        _check_constant(value, 0)
    if _terms(value) > MAX_TERMS:
        raise ExpressionError(f"multiplied out it has more than {MAX_TERMS} terms; lower the powers of sums", 0)
    return value


def parse_number(text: str, names: Mapping[str, sp.Expr]) -> sp.Expr:
    """Read an expression whose value is a number: a parameter, an initial value, a time.

    Parameters
    ----------
    text : str
        As for :func:`parse_expression`, with ``abs`` and ``atan2`` besides.
    names : mapping
        Name -> exact number.

    Returns
    -------
    Expr
        An exact real number within the range of a double.

    Raises
    ------
    ExpressionError
        Also where the value is complex, infinite, undefined, or beyond the largest double.
    """
    value = _Walker(scan(text, names, constant=True), names).value()
    _check_constant(value, 0)
    return value


class _Walker:
    """The whitelisted walk over the syntax tree."""

    def __init__(self, scanned: Scanned, names: Mapping[str, sp.Expr]) -> None:
        self.scanned = scanned
        self.names = names

    def value(self) -> sp.Expr:
        try:
            tree = ast.parse(self.scanned.python, mode="eval")
            return self._of(tree.body, 0)
        except SyntaxError as error:
            offset = self.scanned.origin[min((error.offset or 1) - 1, len(self.scanned.origin) - 1)]
            raise ExpressionError("this does not read as an expression", offset) from None
        except (RecursionError, MemoryError):
            raise ExpressionError("nested too deeply", 0) from None

    def _offset(self, node: ast.expr) -> int:
        return self.scanned.origin[node.col_offset]

    def _operator_offset(self, node: ast.BinOp) -> int:
        """Where the operator stands: after the left operand, past the parentheses that close it."""
        at = node.left.end_col_offset or 0
        while self.scanned.python[at] in " )":
            at += 1
        return self.scanned.origin[at]

    def _of(self, node: ast.expr, depth: int) -> sp.Expr:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}", self._offset(node))
        match node:
            case ast.Constant():
                return self._number(node)
            case ast.Name(id=name):
                return _NUMBERS[name] if name in _NUMBERS else self.names[name]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self._of(operand, depth + 1)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._of(operand, depth + 1)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self._sum(node, depth)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self._product(node, depth)
            case ast.BinOp(op=ast.Pow()):
                base = self._of(node.left, depth + 1)
                exponent = self._of(node.right, depth + 1)
                return _power(base, exponent, self._operator_offset(node))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, [self._of(a, depth + 1) for a in arguments], self._offset(node))
            case _:
                raise ExpressionError("this is not allowed in an expression", self._offset(node))

    def _number(self, node: ast.Constant) -> sp.Expr:
        text = self.scanned.python[node.col_offset : node.end_col_offset]
        mantissa, _, exponent = text.lower().partition("e")
        whole, _, decimals = mantissa.partition(".")
        shift = int(exponent or 0) - len(decimals)
        digits = int(whole + decimals)
        return sp.Rational(digits * 10 ** max(shift, 0), 10 ** max(-shift, 0))

    def _sum(self, node: ast.expr, depth: int) -> sp.Expr:
        # A long sum is a deep tree that leans left; it is taken apart in a loop.
        start, terms = node, []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            term = self._of(node.right, depth + 1)
            terms.append(-term if isinstance(node.op, ast.Sub) else term)
            node = node.left
        terms.append(self._of(node, depth + 1))
        return _checked(sp.Add(*reversed(terms)), self._offset(start))

    def _product(self, node: ast.expr, depth: int) -> sp.Expr:
        start, factors = node, []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            factor = self._of(node.right, depth + 1)
            if isinstance(node.op, ast.Div):
                factor = _power(factor, sp.Integer(-1), self._operator_offset(node))
            factors.append(factor)
            node = node.left
        factors.append(self._of(node, depth + 1))
        return _checked(sp.Mul(*reversed(factors)), self._offset(start))

    def _call(self, name: str, arguments: list[sp.Expr], offset: int) -> sp.Expr:
        if name not in _SYMPY or len(arguments) != CONSTANT_FUNCTIONS.get(name, 1):
            raise ExpressionError(f"{name!r} is no function with {len(arguments)} arguments", offset)
        if name == "sqrt":
            return _power(arguments[0], sp.Rational(1, 2), offset)
        if name == "exp":
            _check_exponential(arguments[0], offset)
        return _checked(_SYMPY[name](*arguments), offset)


def _power(base: sp.Expr, exponent: sp.Expr, offset: int) -> sp.Expr:
    """base**exponent, once it is known that SymPy will not compute a giant."""
    _check_power(base, exponent, offset)
    return _checked(sp.Pow(base, exponent), offset)


def _check_power(base: sp.Expr, exponent: sp.Expr, offset: int) -> None:
    if base.is_number:
        if base.is_zero and not exponent.is_positive:
            raise ExpressionError("division by zero" if exponent.is_negative else "a power of zero", offset)
        if exponent.is_negative and not base.is_Rational and base.evalf(_DIGITS)._prec == 1:
            raise ExpressionError(f"division by {_shown(base)}, which cannot be told from zero", offset)
        if base.is_negative and not exponent.is_integer:
            raise ExpressionError("a power of a negative number is real for integer exponents only", offset)
    if exponent.is_Rational:
        size = abs(exponent)
        if not base.is_number and size > MAX_POWER:
            raise ExpressionError(f"the exponent {_shown(exponent)} is too large; at most {MAX_POWER}", offset)
        if base not in (0, 1, -1) and size * _bits(base) > MAX_BITS:
            raise ExpressionError(
                f"a power of {_shown(base)} with exponent {_shown(exponent)} is too large; "
                f"exact numbers may have {MAX_BITS} bits",
                offset,
            )


def _check_exponential(argument: sp.Expr, offset: int) -> None:
    """exp(c*log(b)) is made b**c by SymPy: the check of powers holds for it, too."""
    for term in sp.Add.make_args(argument):
        factors = sp.Mul.make_args(term)
        for factor in factors:
            if factor.func == sp.log:
                _check_power(factor.args[0], sp.Mul(*(f for f in factors if f != factor)), offset)


def _checked(value: sp.Expr, offset: int) -> sp.Expr:
    """The value of one operation, if it may go on."""
    if value.is_number:
        _check_constant(value, offset)
        return value
    if value.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
        raise ExpressionError("division by zero, or another value that is not finite", offset)
    if value.has(sp.I):
        raise ExpressionError("the value is not real", offset)
    for factor in sp.Mul.make_args(value):
        if factor.is_Pow and factor.exp.is_Rational and abs(factor.exp) > MAX_POWER:
            raise ExpressionError(f"the exponent {_shown(factor.exp)} is too large; at most {MAX_POWER}", offset)
    if max(_bits(value.as_coeff_Mul()[0]), _bits(value.as_coeff_Add()[0])) > MAX_BITS:
        raise ExpressionError(f"exact numbers may have {MAX_BITS} bits", offset)
    return value


def _check_constant(value: sp.Expr, offset: int) -> None:
    """Refuse a number that is not real, not finite, or too large."""
    if value.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
        raise ExpressionError("division by zero, or another value that is not finite", offset)
    if value.is_Rational:
        if _bits(value) > MAX_BITS:
            raise ExpressionError(f"exact numbers may have {MAX_BITS} bits", offset)
        number = value
    else:
        number = sp.nan if value.is_real is False else value.evalf(_DIGITS)
        if not number.is_Float and not number.is_Rational:
            raise ExpressionError(f"the value {_shown(value)} is not a real number", offset)
    if abs(number) > LARGEST:
        raise ExpressionError("the value is larger than the largest double, 1.8e308", offset)


def _check_smooth(value: sp.Expr) -> None:
    for function in value.atoms(sp.Function):
        if isinstance(function, sp.Abs):
            raise ExpressionError(
                f"{_shown(function)} (the root of a square) has a kink; name a surface h and use its sign s: s*h", 0
            )
        if not isinstance(function, _SMOOTH):
            raise ExpressionError(f"{_shown(function)} is not allowed in a field", 0)


def _with_known_functions(value: sp.Expr) -> sp.Expr:
    """SymPy turns tan(x + pi/2) into -cot(x), which nothing downstream knows."""
    return value.replace(sp.cot, lambda a: sp.cos(a) / sp.sin(a)) if value.has(sp.cot) else value


def _bits(value: sp.Expr) -> int:
    """Bits of the largest exact number in an expression."""
    return max((max(abs(n.p).bit_length(), n.q.bit_length()) for n in value.atoms(sp.Rational)), default=1)


def _terms(value: sp.Expr) -> int:
    """Terms of an expression multiplied out, at most; counting stops past the limit."""
    if value.is_Add:
        return min(sum(_terms(a) for a in value.args), MAX_TERMS + 1)
    if value.is_Mul:
        total = 1
        for a in value.args:
            total = min(total * _terms(a), MAX_TERMS + 1)
        return total
    if value.is_Pow and value.exp.is_Integer:
        n = abs(int(value.exp))
        return min(comb(_terms(value.base) + n - 1, n), MAX_TERMS + 1)
    return 1


def _shown(value: sp.Expr) -> str:
    if value.is_Rational and _bits(value) > 200:
        return f"a number of {_bits(value)} bits"
    return shortened(str(value)).strip("'")
