"""Creation of the recurrences of a tape's nodes from the series, constants and convolutions that they read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from henon_ref.jit.ir_writer import IRWriter, Value
from henon_ref.taylor import rules
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Functions
from henon_ref.taylor.llvm.convolutions import Convolutions
from henon_ref.taylor.llvm.functions_of_time import Clock, SineOfTime
from henon_ref.taylor.llvm.linear_forms import Form
from henon_ref.taylor.llvm.recurrences import (
    Constant,
    IntegralOfProduct,
    IntegralOfQuotient,
    Power,
    Product,
    Quotient,
    QuotientTail,
    Reciprocal,
    Recurrence,
    Root,
    Square,
)
from henon_ref.taylor.llvm.sums import LinearForm
from henon_ref.taylor.tape import Node


@dataclass(frozen=True, eq=False)
class NodeRecurrences:
    w: IRWriter
    constants: Constants
    functions: Functions
    series: Mapping[int, Coefficients]
    convolutions: Convolutions
    integrals: Mapping[int, tuple[Coefficients, Value]]
    """States that are integrals of other states: the other state's series, and the factor."""
    order: int

    def linear(self, form: Form) -> LinearForm:
        return LinearForm(self.w, self.constants, self.functions, form, self.series, self.integrals)

    def of(self, at: int, node: Node, clock: Clock | None, below: Form | None) -> Recurrence:
        """Recurrence of a node that is not a sum.

        ``clock``: the argument, if it is a clock; ``below``: the denominator of a reciprocal.
        """
        w, functions, y = self.w, self.functions, self.series[at]
        numbers = [self.constants.value(index) for index in node.constants]
        if node.op == "constant":
            return Constant(numbers[0])
        if node.op == "clock":
            start, slope = node.constants
            return Clock(w, self.constants, start, slope, self.order)
        if clock is not None and node.op in ("sin", "cos"):
            return SineOfTime(w, node.op, clock)
        if below is not None:
            (x,) = below.terms
            return Reciprocal(w, functions, numbers[0], self.linear(below), self._tail(x, at))
        a, b = self.series[node.args[0]], self.series[node.args[-1]]
        match rules.RULES[node.op]:
            case rules.Product():
                return Square(w, a) if a is b else Product(w, a, b, self.convolutions, (node.args[0], node.args[1], at))
            case rules.Quotient():
                return Quotient(w, functions, a, b, self._tail(node.args[1], at))
            case rules.Root():
                return Root(w, functions, a, y)
            case rules.Power():
                return Power(w, functions, numbers[0], a, y)
            case rules.IntegralOfProduct(sign) as rule:
                factor = self.series[rule.place(at, node.args)]
                return IntegralOfProduct(w, functions, node.op, sign, a, factor)
            case rules.IntegralOfQuotient(sign) as rule:
                factor = self.series[rule.place(at, node.args)]
                return IntegralOfQuotient(w, functions, node.op, sign, a, factor, y)
        raise NotImplementedError(node.op)

    def _tail(self, x: int, at: int) -> QuotientTail:
        return QuotientTail(self.w, self.series[x], self.series[at], self.convolutions, (x, at, at))
