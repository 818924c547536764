"""Expressions of a case file to exact SymPy, without ever running text from a stranger.

The text is scanned (:mod:`henon_ref.model.grammar`), parsed by Python's ``ast`` and walked node by node
through a whitelist. ``eval``, ``sympify`` and ``parse_expr`` are never called. Every operation is checked
before SymPy does it, so that the work is bounded by the length of the text: ``9**9**9**9`` is refused, not
computed.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.model.bounds import (
    MAX_TERMS,
    check_constant,
    check_domain,
    check_exponential,
    check_smooth,
    checked,
    is_zero_in_disguise,
    power,
    shown,
    terms,
    with_known_functions,
)
from henon_ref.model.grammar import CONSTANT_FUNCTIONS, CONSTANTS, FUNCTIONS, MAX_DEPTH, MAX_NESTING, Scanned, scan

_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}
_NUMBERS: dict[str, sp.Expr] = dict(zip(CONSTANTS, (sp.pi, sp.E), strict=True))
# What SymPy raises where its own evaluation of an odd number fails (AttributeError: its cache, on a TypeError).
_SYMPY_FAILS = (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError)


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
    value = with_known_functions(walker.value())
    check_smooth(value)
    if value.is_number:
        check_constant(value, 0)
    if terms(value) > MAX_TERMS:
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
    check_constant(value, 0)
    return value


class _Walker:
    """The whitelisted walk over the syntax tree."""

    def __init__(self, scanned: Scanned, names: Mapping[str, sp.Expr]) -> None:
        self.scanned = scanned
        self.names = names

    def value(self) -> sp.Expr:
        try:
            tree = ast.parse(self.scanned.python, mode="eval")
            self._check_nesting(tree.body)
            return self._of(tree.body, 0)
        except SyntaxError as error:
            offset = self.scanned.origin[min((error.offset or 1) - 1, len(self.scanned.origin) - 1)]
            raise ExpressionError("this does not read as an expression", offset) from None
        except (RecursionError, MemoryError):
            raise ExpressionError("nested too deeply", 0) from None
        except _SYMPY_FAILS as error:
            raise ExpressionError(f"SymPy cannot work this out ({type(error).__name__})", 0) from None

    def _check_nesting(self, root: ast.expr) -> None:
        # A long sum is a deep tree: no recursion here.
        waiting = [(root, 0)]
        while waiting:
            node, level = waiting.pop()
            if isinstance(node, ast.Call) or (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)):
                level += 1
            if level > MAX_NESTING:
                raise ExpressionError(f"functions and powers nest deeper than {MAX_NESTING}", self._offset(node))
            waiting += [(child, level) for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]

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
                return power(base, exponent, self._operator_offset(node))
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
        value = sp.Add(*reversed(terms))
        if value.is_number and not value.is_Rational and is_zero_in_disguise(value):
            raise ExpressionError(f"{shown(value)} cannot be told from zero; write 0", self._offset(start))
        return checked(value, self._offset(start))

    def _product(self, node: ast.expr, depth: int) -> sp.Expr:
        start, factors = node, []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            factor = self._of(node.right, depth + 1)
            if isinstance(node.op, ast.Div):
                factor = power(factor, sp.Integer(-1), self._operator_offset(node))
            factors.append(factor)
            node = node.left
        factors.append(self._of(node, depth + 1))
        return checked(sp.Mul(*reversed(factors)), self._offset(start))

    def _call(self, name: str, arguments: list[sp.Expr], offset: int) -> sp.Expr:
        if name not in _SYMPY or len(arguments) != CONSTANT_FUNCTIONS.get(name, 1):
            raise ExpressionError(f"{name!r} is no function with {len(arguments)} arguments", offset)
        if name == "sqrt":
            return power(arguments[0], sp.Rational(1, 2), offset)
        if name == "exp":
            check_exponential(arguments[0], offset)
        if arguments[0].is_number:
            check_domain(name, arguments[0], offset)
        return checked(_SYMPY[name](*arguments), offset)
