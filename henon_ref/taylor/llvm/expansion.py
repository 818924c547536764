"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR: every coefficient is one value, structural zeros (a
constant's derivatives, a clock's beyond the first) never become instructions, squares are halved, sums are taken
together (:mod:`henon_ref.taylor.llvm.linear_forms`), convolutions share the lanes of vectors
(:mod:`henon_ref.taylor.llvm.convolutions`). One object a node writes its coefficients in turn (``recurrences``,
``sums``, ``functions_of_time``); here they are made and called. Time is measured in a unit of about
the size of a step, so that coefficients neither overflow nor vanish whatever the units of the model.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, Value, row_length
from henon_ref.taylor import rules
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Functions
from henon_ref.taylor.llvm.convolutions import Convolutions, convolved
from henon_ref.taylor.llvm.functions_of_time import Clock, SineOfTime
from henon_ref.taylor.llvm.layout import store_combination, store_integral, store_values
from henon_ref.taylor.llvm.linear_forms import Form, Forms
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
from henon_ref.taylor.llvm.step_bounds import inverse_size, last_terms, longest_step
from henon_ref.taylor.llvm.sums import IntegralOfForm, LinearForm, StateIntegral
from henon_ref.taylor.tape import Node, Tape


def expansion_ir(tape: Tape, states: int, order: int, name: str, width: int | None = None) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double unit, double* x, double* K, double* C)``.

    ``t_hi + t_lo`` is the time at the start [s], ``unit`` the unit of time of the coefficients [s], ``x`` the state.
    ``K`` holds the constants rounded to double, then what that rounding lost. ``C`` receives the Taylor
    coefficients in that unit of time, a row a state, then one an output; and behind the rows, for ``order`` >= 3, the
    largest last and last but one coefficient relative to the row's size on a step of one unit, a sum that is not finite
    where any coefficient is not, and the longest step that the exponentials allow.

    Parameters
    ----------
    tape : Tape
    states : int
        Number of states n.
    order : int
        Highest coefficient; 0 gives the values of the outputs only.
    name : str
        Name of the function.
    width : int, optional
        Doubles from one row to the next where that is not the :func:`row_length` of the order (an order below 4).
    """
    w = IRWriter()
    expansion = Expansion(w, tape, states, order)
    expansion.run()
    width = row_length(order) if width is None else width
    expansion.store(width)
    if order >= 3:
        rows = [*expansion.solution, *expansion.outputs]
        exponentials = [(n.op, expansion.series[n.args[0]]) for n in tape.nodes if n.op in ("exp", "sinh", "tanh")]
        for at, value in enumerate([*last_terms(w, rows, expansion.sizes, order), longest_step(w, exponentials)]):
            w.store(value, "%C", len(rows) * width + at)
    return function_ir(w, name)


def values_ir(tape: Tape, states: int, name: str, places: Sequence[int]) -> str:
    """LLVM IR of the same kind of function, which puts the values of a tape's outputs, each at its place, and no more.

    Parameters
    ----------
    tape, states, name
        See :func:`expansion_ir`.
    places : sequence of int
        Of each output, in ``C``.
    """
    w = IRWriter()
    expansion = Expansion(w, tape, states, 0)
    expansion.run()
    for place, values in zip(places, expansion.outputs, strict=True):
        w.store(values[0] or ZERO, "%C", place)
    return function_ir(w, name)


def function_ir(w: IRWriter, name: str) -> str:
    """The function of the instructions written."""
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %unit, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


class Expansion:
    """Writes all recurrences of a tape, order by order."""

    def __init__(self, w: IRWriter, tape: Tape, states: int, order: int) -> None:
        self.w, self.tape, self.states, self.order = w, tape, states, order
        self.forms = Forms(tape)
        self.constants, self.functions = Constants(w, tape), Functions(w)
        self.solution = [Coefficients(w, [w.load("%x", i)]) for i in range(states)]
        self.series = {
            at: self.solution[node.args[0]] if node.op == "state" else Coefficients(w)
            for at, node in enumerate(tape.nodes)
        }
        field = [self.forms.of(root) for root in tape.field]
        self.output_forms = [self.forms.of(root) for root in tape.outputs]
        self.kept = {at: self.forms.of(at) for at in self.forms.kept}
        self.convolutions = Convolutions(w, self.series, convolved(tape, self.forms.denominator), order)
        starts = [row[0] for row in self.solution]
        self.rates = [
            IntegralOfForm(w, self.constants, form, self.series, start)
            for form, start in zip(field, starts, strict=False)
        ]
        self.integral_states = self._integral_states()
        self.integrals = {
            at: (self.solution[found.source], found.rate)
            for at, node in enumerate(tape.nodes)
            if node.op == "state" and (found := self.integral_states.get(node.args[0]))
        }
        self.targets = [self._linear(form) for form in self.output_forms]
        self.recurrences: dict[int, Recurrence] = {}
        for at, node in enumerate(tape.nodes):
            if at in self.kept:
                self.recurrences[at] = self._linear(self.kept[at])
            elif node.op not in (*rules.LINEAR, "state"):
                self.recurrences[at] = self._recurrence(at, node)
        self.outputs: list[list[Value]] = []
        self.sizes: list[str] = []

    def _linear(self, form: Form) -> LinearForm:
        return LinearForm(self.w, self.constants, self.functions, form, self.series, self.integrals)

    def _recurrence(self, at: int, node: Node) -> Recurrence:
        """What writes the coefficients of a node that is no sum."""
        w, functions, y = self.w, self.functions, self.series[at]
        numbers = [self.constants.value(index) for index in node.constants]
        if node.op == "constant":
            return Constant(numbers[0])
        if node.op == "clock":
            start, slope = node.constants
            return Clock(w, self.constants, start, slope, self.order)
        clock = self.recurrences.get(node.args[0])
        if isinstance(clock, Clock) and node.op in ("sin", "cos"):
            return SineOfTime(w, node.op, clock)
        a, b = self.series[node.args[0]], self.series[node.args[-1]]
        match rules.RULES[node.op]:
            case rules.Product():
                return Square(w, a) if a is b else Product(w, a, b, self.convolutions, (node.args[0], node.args[1], at))
            case rules.Quotient(above="c"):
                below = self.forms.below(node.args[0])
                (x,) = below.terms
                return Reciprocal(w, functions, numbers[0], self._linear(below), self._tail(x, at))
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

    def run(self) -> None:
        """Write the coefficients of all nodes that are wanted, of the states and of the outputs."""
        w, order = self.w, self.order
        last = self._read_by(leaf for form in self.output_forms for leaf in form.terms)
        for k in range(order + 1):
            self.convolutions.add_up(k)
            for at, recurrence in self.recurrences.items():
                wanted = k < order or order == 0 or at in last
                self.series[at].append(recurrence.coefficient(k) if wanted else None)
            if k < order:
                for row, rate in zip(self.solution, self.rates, strict=True):
                    row.append(rate.coefficient(k + 1))
            self.convolutions.pack(k)
            if k == 2 and order >= 3:  # divisions are waited for least where they begin early
                rows = [*self.solution, *([target.coefficient(j) for j in range(3)] for target in self.targets)]
                self.sizes = [inverse_size(w, values) for values in rows]
        self.outputs = [self._output(target) for target in self.targets]

    def store(self, width: int) -> None:
        """Store all rows: of a state that is another's integral and of an output from rows that are there already."""
        w, order = self.w, self.order
        for i, row in enumerate(self.solution):
            if i not in self.integral_states:
                store_values(w, row, i, width)
        for i, integral in self.integral_states.items():
            store_integral(w, self.solution[i], i, integral, order)
        for r, target, values in zip(count(self.states), self.targets, self.outputs, strict=False):
            if self._by_vectors(target):
                parts = {self._state(leaf): target.factor(leaf) for leaf in target.form.terms}
                store_combination(w, values[0], r, parts, order)
            else:
                store_values(w, values, r, width)

    def _output(self, target: LinearForm) -> list[Value]:
        """Coefficients of an output; of one that is linear in the states only those that the norms read."""
        ends = {0, 1, 2, self.order - 1, self.order}
        sparse = self._by_vectors(target)
        return [target.coefficient(k) if not sparse or k in ends else None for k in range(self.order + 1)]

    def _by_vectors(self, target: LinearForm) -> bool:
        """Whether the row of an output is combined from the states' rows (the rig: a run takes 2 to 16 % less)."""
        return self.order >= LANES and all(self._state(leaf) >= 0 for leaf in target.leaves)

    def _state(self, leaf: int) -> int:
        """Index of the state that a leaf is; -1 for any other."""
        node = self.tape.nodes[leaf]
        return node.args[0] if node.op == "state" else -1

    def _integral_states(self) -> dict[int, StateIntegral]:
        """States whose rate is a multiple of another state, which is no such one itself (Fig. 8: 4 to 6 % of a run)."""
        found: dict[int, StateIntegral] = {}
        sources: set[int] = set()
        for i, rate in enumerate(self.rates):
            if self.order >= LANES and len(rate.leaves) == 1 and not rate.form.constant and i not in sources:
                (leaf,) = rate.leaves
                source = self._state(leaf)
                if source not in (-1, i) and source not in found:
                    found[i] = StateIntegral(source, rate.rates[leaf])
                    sources.add(source)
        return found

    def _read_by(self, roots: Iterable[int]) -> set[int]:
        """Every node that these read, and these."""
        found: set[int] = set()
        waiting = list(roots)
        while waiting:
            at = waiting.pop()
            node = self.tape.nodes[at]
            if at not in found and node.op != "state":
                found.add(at)
                if at in self.kept:
                    waiting.extend(self.kept[at].terms)
                elif node.op == "recip":
                    waiting.append(self.forms.denominator(node.args[0]))
                else:
                    waiting.extend(node.args)
        return found
