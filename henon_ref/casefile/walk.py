"""The walk over the operations of an expression, which makes exact SymPy of them.

Every operation is checked before SymPy does it, so that the work is bounded by the length of what is written:
``9**9**9**9`` is refused, not computed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import sympy as sp

from henon_ref.casefile.grammar import CONSTANT_FUNCTIONS, CONSTANTS, FUNCTIONS, KINK_FUNCTIONS, MAX_DEPTH
from henon_ref.casefile.operations import Operation
from henon_ref.casefile.work import OPERATION, Work, key_of
from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import check_domain, check_exponential, checked, power

_SYMPY: dict[str, Callable[..., sp.Expr]] = {
    **{name: getattr(sp, name) for name in FUNCTIONS},
    "abs": sp.Abs,
    "atan2": sp.atan2,
}
_NUMBERS: dict[str, sp.Expr] = dict(zip(CONSTANTS, (sp.pi, sp.E), strict=True))
_HALF = sp.Rational(1, 2)
# What SymPy raises where its own evaluation of an odd number fails (AttributeError: its cache, on a TypeError).
_SYMPY_FAILS = (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError)


class Walk:
    """The walk over operations with some names.

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
        """What an operation is.

        Raises
        ------
        ExpressionError
            With the offset of what is not real, not finite or too much work.
        """
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
        if part.value == "piecewise":
            strict = [condition.kind in ("<", ">") for condition in part.arguments[1::2]]
            kinks.check_on_surface(arguments[::2], arguments[1::2], strict, part.offset)
        return kinks.call(str(part.value), arguments, part.offset)

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


def delicate(operation: Operation, signs: Collection[str]) -> list[tuple[Operation, list[str]]]:
    """Divisors, powers and functions that hold some signs, outermost ones, with these."""
    kinds = ("/", "^", "call")
    parts = (part for part in operation.parts(lambda part: part.kind not in kinds) if part.kind in kinds)
    held = ((part, sorted(name for name in part.names if name in signs)) for part in parts)
    return [(part, names) for part, names in held if names]
