"""Recurrences of linear forms: a sum of nodes, and a state whose rate is a linear form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from henon_ref.jit.ir_writer import IRWriter, Value
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Functions
from henon_ref.taylor.llvm.linear_forms import Form


class StateIntegral(NamedTuple):
    """A state whose rate is a multiple of another state: coefficient k is rate / k times the source's k - 1."""

    source: int
    rate: Value
    """The factor, times the time unit."""


class LinearForm:
    """y = sum of factor times node, plus a constant.

    The newest coefficient of a state that is an integral of another one is computed from the other state's, so that the
    sum does not wait for it.
    """

    def __init__(
        self,
        w: IRWriter,
        constants: Constants,
        functions: Functions,
        form: Form,
        nodes: Mapping[int, Coefficients],
        integrals: Mapping[int, tuple[Coefficients, Value]],
    ) -> None:
        self.w, self.constants, self.functions, self.form = w, constants, functions, form
        self.leaves = form.leaves()
        self.nodes, self.integrals = nodes, integrals

    def factor(self, leaf: int) -> Value:
        return self.constants.total(self.form.terms[leaf])

    def coefficient(self, k: int) -> Value:
        w = self.w
        total = self.constants.total(self.form.constant) if k == 0 else None
        newest: list[tuple[Value, Value]] = []
        for leaf in self.leaves:
            factor = self.factor(leaf)
            if k > 0 and leaf in self.integrals:
                source, rate = self.integrals[leaf]
                newest.append((w.scaled(1.0 / k, self.functions.product(rate, factor)), source[k - 1]))
            else:
                total = w.fused(factor, self.nodes[leaf][k], total)
        for weight, value in newest:
            total = w.fused(weight, value, total)
        return total


class IntegralOfForm:
    """A state x with x' = linear form, from its initial value."""

    def __init__(
        self, w: IRWriter, constants: Constants, form: Form, nodes: Mapping[int, Coefficients], start: Value
    ) -> None:
        self.w, self.constants, self.form, self.start = w, constants, form, start
        self.leaves, self.nodes = form.leaves(), nodes
        self.rates = {leaf: w.mul(constants.total(factors), "%unit") for leaf, factors in form.terms.items()}
        """Factors of the nodes, times the time unit."""

    def coefficient(self, k: int) -> Value:
        if k == 0:
            return self.start
        w, before, part = self.w, k - 1, 1.0 / k
        total = w.mul(self.constants.total(self.form.constant), "%unit") if before == 0 else None
        for leaf in self.leaves[:-1]:
            total = w.fused(self.rates[leaf], self.nodes[leaf][before], total)
        total = w.scaled(part, total)
        if not self.leaves:
            return total
        last = self.leaves[-1]  # added last, because its coefficient is computed last
        return w.fused(w.scaled(part, self.rates[last]), self.nodes[last][before], total)
