"""The whitelisted walk over an expression's syntax tree, which makes exact SymPy of it.

Every operation is checked before SymPy does it, so that the work is bounded by the length of the text: ``9**9**9**9``
is refused, not computed.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import sympy as sp

from henon_ref.casefile import kinks
from henon_ref.casefile.grammar import (
    CONSTANT_FUNCTIONS,
    CONSTANTS,
    FUNCTIONS,
    KINK_FUNCTIONS,
    MAX_DEPTH,
    MAX_NESTING,
    Scanned,
    scan,
)
from henon_ref.casefile.work import OPERATION, SCAN, Work, key_of, names_in
from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import check_domain, check_exponential, checked, power

_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}
_NUMBERS: dict[str, sp.Expr] = dict(zip(CONSTANTS, (sp.pi, sp.E), strict=True))
# What SymPy raises where its own evaluation of an odd number fails (AttributeError: its cache, on a TypeError).
_SYMPY_FAILS = (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError)


@dataclass
class Text:
    """A text that reads well, and what has been made of it whatever its names stand for."""

    scanned: Scanned
    kinks: bool
    """Whether it may have kinks: ``abs`` is a sign's symbol then, else a number's."""
    tree: ast.expr | None = None
    delicate: dict[tuple[str, ...], list[tuple[ast.expr, set[str]]]] = field(default_factory=dict)


def read_text(
    text: str, names: Mapping[str, sp.Expr], work: Work, *, constant: bool = False, kinks: bool = False
) -> Text:
    """A text scanned, once for all that it is read with.

    Raises
    ------
    ExpressionError
        With the offset of what is not allowed.
    """
    key = (text, constant, kinks, tuple(name in names for name in names_in(text)))
    if key not in work.texts:
        work.charge(SCAN * len(text), 0)
        work.texts[key] = Text(scan(text, names, constant=constant, kinks=kinks), kinks)
    found: Text = work.texts[key]
    return found


class SyntaxWalk:
    """The whitelisted walk over the syntax tree."""

    def __init__(self, text: Text, names: Mapping[str, sp.Expr], work: Work) -> None:
        self.text = text
        self.scanned = text.scanned
        self.names = names
        self.work = work

    def value(self) -> sp.Expr:
        """The value of all of the text."""
        return self.of(None)

    def of(self, node: ast.expr | None) -> sp.Expr:
        """The value of all of the text, or of a power, a function or what a quotient's divisor makes of 1."""
        try:
            if node is None:
                return self._of(self._tree(), 0)
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
                return power(self._of(node.right, 0), sp.Integer(-1), self._operator_offset(node))
            return self._of(node, 0)
        except SyntaxError as error:
            offset = self.scanned.origin[min((error.offset or 1) - 1, len(self.scanned.origin) - 1)]
            raise ExpressionError("this does not read as an expression", offset) from None
        except (RecursionError, MemoryError):
            raise ExpressionError("nested too deeply", 0) from None
        except _SYMPY_FAILS as error:
            raise ExpressionError(f"SymPy cannot work this out ({type(error).__name__})", 0) from None

    def _tree(self) -> ast.expr:
        if self.text.tree is None:
            tree = ast.parse(self.scanned.python, mode="eval").body
            self._check_nesting(tree)
            self.text.tree = tree
        return self.text.tree

    def delicate(self, signs: Collection[str]) -> list[tuple[ast.expr, set[str]]]:
        """Quotients, powers and functions that hold some names (in the divisor), outermost ones, with these names."""
        key = tuple(signs)
        if key not in self.text.delicate:
            self.text.delicate[key] = self._delicate(signs)
        return self.text.delicate[key]

    def _delicate(self, signs: Collection[str]) -> list[tuple[ast.expr, set[str]]]:
        found = []
        waiting = [self._tree()]
        while waiting:
            node = waiting.pop()
            inner = [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
            part: ast.expr | None = None
            match node:
                case ast.BinOp(op=ast.Div(), left=left, right=right):
                    part, inner = right, [left]
                case ast.Call() | ast.BinOp(op=ast.Pow()):
                    part, inner = node, []
            if part is not None:
                held = {n.id for n in ast.walk(part) if isinstance(n, ast.Name) and n.id in signs}
                if held:
                    found.append((node, held))
            waiting += inner
        return found

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
        while self.scanned.python[at : at + 1] in (b" ", b")"):
            at += 1
        return self.scanned.origin[at]

    def _of(self, node: ast.expr, depth: int) -> sp.Expr:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}", self._offset(node))
        if isinstance(node, ast.BinOp | ast.Call):
            begin, end = node.col_offset, node.end_col_offset or 0
            kind = type(node).__name__ + ("+" if self.text.kinks else "")
            key = key_of(kind, self.scanned.python[begin:end].decode(), self.names)
            if key not in self.work.values:
                self.work.charge(OPERATION + end - begin, self._offset(node))
                value = self._operation(node, depth)
                if value.is_number and not value.is_Rational:  # its digits have been computed
                    self.work.charge(2 * (OPERATION + end - begin), self._offset(node))
                self.work.values[key] = value
            return self.work.values[key]
        return self._operation(node, depth)

    def _operation(self, node: ast.expr, depth: int) -> sp.Expr:
        match node:
            case ast.Constant():
                return self._number(node)
            case ast.Name(id=name):
                return self.names[name] if name in self.names else _NUMBERS[name]
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
                return self._power(base, exponent, self._operator_offset(node))
            case ast.Call(func=ast.Name(id=name), args=arguments) if self.text.kinks and name in KINK_FUNCTIONS:
                return self._kinked(name, arguments, node, depth)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, [self._of(a, depth + 1) for a in arguments], self._offset(node))
            case _:
                raise ExpressionError("this is not allowed in an expression", self._offset(node))

    def _kinked(self, name: str, written: list[ast.expr], node: ast.expr, depth: int) -> sp.Expr:
        arguments, offset = [self._argument(a, depth + 1) for a in written], self._offset(node)
        if name == "piecewise":
            strict = [isinstance(a, ast.Compare) and isinstance(a.ops[0], ast.Gt | ast.Lt) for a in written[1::2]]
            kinks.check_on_surface(arguments[::2], arguments[1::2], strict, offset)
        return kinks.call(name, arguments, offset)

    def _argument(self, node: ast.expr, depth: int) -> sp.Expr:
        """An argument; of a comparison what is positive where it holds."""
        if not isinstance(node, ast.Compare):
            return self._of(node, depth)
        left, right = self._of(node.left, depth), self._of(node.comparators[0], depth)
        return left - right if isinstance(node.ops[0], ast.Gt | ast.GtE) else right - left

    def kinks(self) -> list[sp.Expr]:
        """What has a kink or jumps where it is 0, in order of appearance."""
        found: list[sp.Expr] = []
        waiting: list[ast.expr] = [self._tree()]
        while waiting:
            node = waiting.pop()
            inner = [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in KINK_FUNCTIONS:
                found += kinks.compared(node.func.id, [self._argument(a, 0) for a in node.args])
            found += self._roots_of_squares(node)
            waiting += reversed(inner)
        return found

    def _roots_of_squares(self, node: ast.expr) -> list[sp.Expr]:
        """What SymPy takes the absolute value of where a power is written."""
        match node:
            case ast.BinOp(op=ast.Pow(), left=base, right=exponent):
                value = sp.Pow(self._of(base, 0), self._of(exponent, 0))
            case ast.Call(func=ast.Name(id="sqrt"), args=[base]):
                value = sp.sqrt(self._of(base, 0))
            case _:
                return []
        return [root.args[0] for root in sorted(value.atoms(sp.Abs), key=sp.default_sort_key)]

    def _power(self, base: sp.Expr, exponent: sp.Expr, offset: int) -> sp.Expr:
        """A power; where it is a root of a square, with that one's kink."""
        value = power(base, exponent, offset)
        return kinks.without_roots_of_squares(value, offset) if self.text.kinks else value

    def _number(self, node: ast.Constant) -> sp.Expr:
        text = self.scanned.python[node.col_offset : node.end_col_offset].decode()
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
        return checked(sp.Add(*reversed(terms)), self._offset(start))

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
            return self._power(arguments[0], sp.Rational(1, 2), offset)
        if name == "exp":
            check_exponential(arguments[0], offset)
        if arguments[0].is_number:
            check_domain(name, arguments[0], offset)
        return checked(_SYMPY[name](*arguments), offset)
