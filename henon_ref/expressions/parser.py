"""Parser of the text of an expression into operations; refuses everything that can be refused before evaluation.

It checks characters, names, parentheses and the order of operands and operators; each message has its offset.
``eval``, ``sympify`` and ``parse_expr`` are never called.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.expressions.grammar import (
    ANY_NUMBER,
    LETTER,
    LOOKALIKES,
    MAX_DEPTH,
    MAX_DIGITS,
    MAX_LENGTH,
    MAX_TOKENS,
    TWO_CONDITIONS,
    check_name,
)
from henon_ref.expressions.operations import Operation
from henon_ref.text import shortened

_TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|(?P<name>[{LETTER}_][{LETTER}0-9_]*)"
    r"|(?P<operator>\*\*|[-+*/^])|(?P<bracket>[(),])|(?P<comparison>[<>]=?)",
    re.ASCII,
)
_CONNECTIVES = ("and", "or", "not")


def parsed(text: str, names: Collection[str], functions: Mapping[str, int]) -> Operation:
    """Return the operations of a text; allowed are ``names``, ``pi``, ``e``, and functions (name -> arity)."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"an expression of {len(text)} characters; at most {MAX_LENGTH} are allowed", 0)
    return _Parser(text, names, functions).whole()


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    """``number``, ``name``, ``operator``, ``bracket`` or ``comparison``."""
    text: str
    offset: int


class _Parser:
    """Recursive-descent parser; powers bind as in Python: ``-x^2`` is ``-(x^2)``, ``2^3^2`` is ``2^(3^2)``."""

    def __init__(self, text: str, names: Collection[str], functions: Mapping[str, int]) -> None:
        self.text, self.names, self.functions = text, names, functions
        self.conditions: list[bool] = []
        """For each open parenthesis, whether it is at a condition of ``piecewise``."""
        self.tokens = self._tokens()
        self.last: _Token | None = None
        self.token = next(self.tokens, None)

    def _tokens(self) -> Iterator[_Token]:
        position = count = 0
        while position < len(self.text):
            match = _TOKEN.match(self.text, position)
            if match is None:
                raise _bad_character(self.text, position)
            if match.lastgroup != "space":
                count += 1
                if count > MAX_TOKENS:
                    raise ExpressionError(f"more than {MAX_TOKENS} numbers, names and operators", position)
                yield _Token(str(match.lastgroup), match.group(), position)
            position = match.end()

    def _advance(self) -> _Token | None:
        """Consume the token and read the next one; return the consumed token."""
        self.last, self.token = self.token, next(self.tokens, None)
        return self.last

    def _takes(self, *texts: str) -> _Token | None:
        """Consume and return the next token if its text is one of ``texts``; else return None."""
        return self._advance() if self.token is not None and self.token.text in texts else None

    def whole(self) -> Operation:
        found = self._sum()
        if self.token is not None:  # a bracket or a comma
            raise ExpressionError(f"'{self.token.text}' without a '(' before it", self.token.offset)
        return found

    def _sum(self) -> Operation:
        return self._chain("+", "-", self._product)

    def _product(self) -> Operation:
        return self._chain("*", "/", self._power)

    def _chain(self, kind: str, inverse: str, part: Callable[[], Operation]) -> Operation:
        """Parse a sum or a product; return its first part if it has only one."""
        first = part()
        parts = list(first.arguments) if first.kind == kind else [first]
        count = len(parts)
        while operator := self._takes(kind, inverse):
            found = part()
            parts.append(Operation(inverse, (found,), "", operator.offset) if operator.text == inverse else found)
        return first if len(parts) == count else Operation(kind, tuple(parts), "", first.begin)

    def _power(self) -> Operation:
        """Parse a tower of powers, each with the signs before it; in a loop, since the tower may be high."""
        levels, operators = [(self._signed(), self._operand())], []
        while operator := self._takes("**", "^"):
            operators.append(operator.offset)
            levels.append((self._signed(), self._operand()))
        negative, found = levels.pop()
        for (sign, base), offset in zip(reversed(levels), reversed(operators), strict=True):
            exponent = Operation("-", (found,), "", found.begin) if negative else found
            negative, found = sign, Operation("^", (base, exponent), "", offset)
        return Operation("-", (found,), "", found.begin) if negative else found

    def _signed(self) -> bool:
        """Consume the signs before an operand; return whether they negate it."""
        count, negative = 0, False
        while sign := self._takes("+", "-"):
            count += 1
            if count > MAX_DEPTH:
                raise ExpressionError(f"more than {MAX_DEPTH} signs in a row", sign.offset)
            negative ^= sign.text == "-"
        return negative

    def _operand(self) -> Operation:
        token = self.token
        if token is None:
            raise self._ended()
        if token.text == "(":
            found = self._brackets(None)[0]
        elif token.kind in ("number", "name"):
            found = self._named(token)
        else:
            raise self._missing(token)
        self._check_next()
        return found

    def _ended(self) -> ExpressionError:
        if self.last is None:
            return ExpressionError("an empty expression; write a number or a formula", 0)
        ends = f"the expression ends after '{self.last.text}'; a number or a name is missing"
        return ExpressionError(ends, len(self.text))

    def _missing(self, token: _Token) -> ExpressionError:
        """Error for an operator, a bracket or a comparison in place of an operand."""
        if token.kind == "bracket":
            before = self.last.text if self.last is not None else "the beginning"
            between = f"a number or a name is missing between '{before}' and '{token.text}'"
            return ExpressionError(between, token.offset)
        if token.kind == "comparison" and not any(self.conditions[-1:]):
            return self._misplaced(token)
        after = f" after '{self.last.text}'" if self.last is not None and token.kind == "operator" else ""
        return ExpressionError(f"a number or a name is missing{after} before '{token.text}'", token.offset)

    def _check_next(self) -> None:
        """Raise ExpressionError if the next token cannot follow an operand."""
        token, last = self.token, self.last
        if token is None or last is None:
            return
        if token.text in _CONNECTIVES and token.text not in self.names:
            raise ExpressionError(f"'{token.text}' is not an operator here; {TWO_CONDITIONS}", token.offset)
        if token.kind in ("number", "name"):
            what = f"an operator is missing between '{last.text}' and '{token.text}'"
        elif token.text == "(":
            what = f"'{last.text}' is not a function" if last.kind == "name" else "an operator is missing before '('"
        elif token.kind == "comparison" and not any(self.conditions[-1:]):
            raise self._misplaced(token)
        else:
            return
        raise ExpressionError(f"{what}; a product is written with *", token.offset)

    def _misplaced(self, token: _Token) -> ExpressionError:
        if any(self.conditions):
            return ExpressionError(f"a comparison must not have its own parentheses; {TWO_CONDITIONS}", token.offset)
        return ExpressionError(f"'{token.text}' is allowed in a condition of 'piecewise' only", token.offset)

    def _named(self, token: _Token) -> Operation:
        name = token.text
        if token.kind == "number":
            _check_number(token)
            self._advance()
            return Operation("number", (), sp.Rational(name), token.offset)
        if name in _CONNECTIVES and name not in self.names:
            raise ExpressionError(f"'{name}' is not an operator here; {TWO_CONDITIONS}", token.offset)
        check_name(name, self.names, self.functions, token.offset)
        self._advance()
        if name not in self.functions:
            return Operation("name", (), name, token.offset)
        if self.token is None or self.token.text != "(":
            raise ExpressionError(f"the function '{name}' needs its argument: {name}(...)", token.offset)
        return Operation("call", tuple(self._brackets(token)), name, token.offset)

    def _brackets(self, function: _Token | None) -> list[Operation]:
        """Parse the contents of parentheses: arguments of a function, or one expression."""
        bracket = self._advance()
        assert bracket is not None
        if len(self.conditions) == MAX_DEPTH:
            raise ExpressionError(f"parentheses nest deeper than {MAX_DEPTH}", bracket.offset)
        self.conditions.append(False)
        arity = self.functions[function.text] if function is not None else 1
        arguments = [self._argument()]
        while comma := self._takes(","):
            if len(arguments) >= arity:
                several = f"'{function.text}' takes {arity} argument{'s' if arity > 1 else ''}" if function else ""
                what = several or "',' is allowed between arguments only"
                raise ExpressionError(f"{what}; a decimal point is written '.'", comma.offset)
            # In piecewise, every second argument except the last is a condition.
            self.conditions[-1] = function is not None and function.text == "piecewise" and len(arguments) % 2 == 1
            arguments.append(self._argument())
        if not self._takes(")"):
            raise ExpressionError("'(' is never closed", bracket.offset)
        self.conditions.pop()
        if function is not None:
            _check_arguments(function, arity, len(arguments))
        return arguments

    def _argument(self) -> Operation:
        """Parse an argument; a condition is a comparison."""
        found = self._sum()
        compared = False
        while operator := self._takes("<", "<=", ">", ">="):
            if compared:
                raise ExpressionError(TWO_CONDITIONS, operator.offset)
            compared = True
            found = Operation(operator.text, (found, self._sum()), "", found.begin)
        if self.conditions[-1] and not compared and self.token is not None:
            raise ExpressionError("a condition has one comparison, as in x < 1", self.token.offset)
        return found


def _check_arguments(function: _Token, arity: int, count: int) -> None:
    """Raise ExpressionError if a call has too few arguments, or a ``piecewise`` does not end with a value."""
    if function.text == "piecewise" and (count < 3 or count % 2 == 0):
        raise ExpressionError(
            f"'{function.text}' takes pairs of a value and a condition, then the value otherwise, "
            "as in piecewise(1, x < 0, 2)",
            function.offset,
        )
    if count < (2 if arity == ANY_NUMBER else arity):
        several = "two arguments or more" if arity == ANY_NUMBER else f"{arity} arguments"
        raise ExpressionError(f"'{function.text}' takes {several}", function.offset)


def _check_number(token: _Token) -> None:
    mantissa, _, exponent = token.text.lower().partition("e")
    if len(mantissa) > MAX_DIGITS or len(exponent) > 5 or abs(int(exponent or 0)) > MAX_DIGITS:
        raise ExpressionError(
            f"the number {shortened(token.text, 24)} is too long; at most {MAX_DIGITS} digits and an exponent "
            f"between -{MAX_DIGITS} and {MAX_DIGITS} are allowed",
            token.offset,
        )


def _bad_character(text: str, offset: int) -> ExpressionError:
    character = text[offset]
    if character in "&|=!" and text[:offset].rfind("piecewise") >= 0:
        equal = "an equation holds only at single points: compare with <, <=, > or >="
        return ExpressionError(equal if character in "=!" else TWO_CONDITIONS, offset)
    like = LOOKALIKES.get(character)
    hint = f"; write {like}" if like else ""
    allowed = "numbers, names, + - * / ** ^ and parentheses"
    return ExpressionError(f"{character!r} is not allowed in an expression{hint}; allowed: {allowed}", offset)
