"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR: every coefficient is one value, structural
zeros (a constant's derivatives, a clock's beyond the first) never become instructions, squares are halved,
sums are taken together (:mod:`henon_ref.taylor.llvm.linear_forms`), convolutions share the lanes of vectors
(:mod:`henon_ref.taylor.llvm.recurrences`). Time is measured in units of ``sigma``, about the size of a step, so
that coefficients neither overflow nor vanish whatever the units of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from henon_ref.jit.ir_writer import LANES, MINUS, ONE, Value, Writer, row_length
from henon_ref.taylor.llvm.convolutions import Convolutions, convolved
from henon_ref.taylor.llvm.layout import store_combination, store_integral, store_values
from henon_ref.taylor.llvm.linear_forms import Factor, Form, Forms
from henon_ref.taylor.llvm.recurrences import Recurrences
from henon_ref.taylor.llvm.step_bounds import inverse_size, longest, norms
from henon_ref.taylor.rules import LINEAR
from henon_ref.taylor.tape import Tape


def expansion_ir(tape: Tape, states: int, order: int, name: str, width: int | None = None) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double sigma, double* x, double* K, double* C)``.

    ``K`` holds the constants rounded to double, then what that rounding lost. ``C`` receives the Taylor
    coefficients in units of sigma, a row a state, then one an output; and behind the rows, for ``order`` >= 3, the
    largest last and last but one coefficient relative to the row's size on a step of sigma, a sum that is not finite
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
    w = Writer()
    expander = _Expander(w, tape, states, order)
    expander.run()
    width = row_length(order) if width is None else width
    expander.store(width)
    if order >= 3:
        rows = [*expander.solution, *expander.outputs]
        tails = [(n.op, expander.series(n.args[0])) for n in tape.nodes if n.op in ("exp", "sinh", "tanh")]
        for at, value in enumerate([*norms(w, rows, expander.sizes, order), longest(w, tails)]):
            w.store(value, "%C", len(rows) * width + at)
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %sigma, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


class _Expander:
    """Goes through the tape order by order."""

    def __init__(self, w: Writer, tape: Tape, states: int, order: int) -> None:
        self.w, self.tape, self.states, self.order = w, tape, states, order
        self.forms = Forms(tape)
        self._constants: dict[tuple[int, bool], str] = {}
        self._factors: dict[Factor, Value] = {}
        self._series: list[list[Value]] = [[] for _ in tape.nodes]
        for node in tape.nodes:  # loads first: they wait for nothing
            for index in node.constants:
                self.constant(index, False)
                if node.op == "clock":
                    self.constant(index, True)
        self.solution: list[list[Value]] = [[w.load("%x", i)] for i in range(states)]
        for at, node in enumerate(tape.nodes):
            if node.op == "state":
                self._series[at] = self.solution[node.args[0]]
        self.field = [self.forms.of(root) for root in tape.field]
        self.targets = [self.forms.of(root) for root in tape.outputs]
        self.kept = {at: self.forms.of(at) for at in self.forms.kept}
        self.convolutions = Convolutions(w, self.series, convolved(tape, self._base), order)
        self.recurrences = Recurrences(w, tape, self.constant, self.convolutions, self.series, order)
        self.rates = [self._rates(form) for form in self.field]
        self.followed = self._followed()
        self.needed_last = self._needed([leaf for form in self.targets for leaf in form.terms])
        self.outputs: list[list[Value]] = []
        self.sizes: list[str] = []

    def constant(self, index: int, low: bool) -> str:
        """A constant of the tape, or what rounding it lost."""
        key = (index, low)
        if key not in self._constants:
            at = index + (len(self.tape.constants) if low else 0)
            self._constants[key] = self.w.load("%K", at)
        return self._constants[key]

    def series(self, at: int) -> list[Value]:
        """Coefficients of a node known so far."""
        return self._series[at]

    def run(self) -> None:
        """Write the coefficients of all nodes that are wanted, of the states and of the outputs."""
        w, order = self.w, self.order
        wanted = [at for at, n in enumerate(self.tape.nodes) if at in self.kept or n.op not in (*LINEAR, "state")]
        for k in range(order + 1):
            self.convolutions.add_up(k)
            for at in wanted:
                if k < order or order == 0 or at in self.needed_last:
                    self._series[at].append(self._value(at, k))
                else:
                    self._series[at].append(None)
            if k < order:
                for target, form, rate in zip(self.solution, self.field, self.rates, strict=True):
                    target.append(self._slope(form, rate, k))
            self.convolutions.pack(k)
            if k == 2 and order >= 3:  # divisions are waited for least where they begin early
                rows = [*self.solution, *([self.linear(form, j) for j in range(3)] for form in self.targets)]
                self.sizes = [inverse_size(w, row) for row in rows]
        self.outputs = [self._output(form) for form in self.targets]

    # -- linear parts -----------------------------------------------------------------------------------

    def factor(self, factors: Sequence[Factor]) -> Value:
        """A sum of products of constants (1 for an empty product)."""
        total: Value = None
        for f in factors:
            if f not in self._factors:
                product: Value = ONE
                for index in f.constants:
                    product = self.w.mul(product, self.constant(index, False))
                if f.sign < 0:
                    product = MINUS if product == ONE else self.w.neg(product)
                self._factors[f] = product
            total = self.w.add(total, self._factors[f])
        return total

    def linear(self, form: Form, k: int) -> Value:
        """Coefficient k of a form."""
        w = self.w
        total = self.factor(form.constant) if k == 0 and form.constant else None
        newest: list[tuple[Value, Value]] = []
        for leaf in form.leaves():
            factor = self.factor(form.terms[leaf])
            if k > 0 and self._state(leaf) in self.followed:  # not by way of the state: from what its rate reads
                source, rate = self.followed[self._state(leaf)]
                newest.append((w.scaled(1.0 / k, self._product(rate, factor)), self.solution[source][k - 1]))
            else:
                total = w.fused(factor, self._series[leaf][k], total)
        for weight, value in newest:
            total = w.fused(weight, value, total)
        return total

    def _product(self, a: Value, b: Value) -> Value:
        return self.recurrences.made("product", a, b, make=lambda: self.w.mul(a, b))

    def _rates(self, form: Form) -> dict[int, Value]:
        """Factors of a state's rate, times sigma."""
        return {leaf: self.w.mul(self.factor(factors), "%sigma") for leaf, factors in form.terms.items()}

    def _slope(self, form: Form, rate: dict[int, Value], k: int) -> Value:
        """Coefficient k + 1 of a state whose rate is this form."""
        w = self.w
        leaves, part = form.leaves(), 1.0 / (k + 1)
        total = w.mul(self.factor(form.constant), "%sigma") if k == 0 and form.constant else None
        for leaf in leaves[:-1]:
            total = w.fused(rate[leaf], self._series[leaf][k], total)
        total = w.scaled(part, total)  # the last leaf is what is waited for
        return w.fused(w.scaled(part, rate[leaves[-1]]), self._series[leaves[-1]][k], total) if leaves else total

    def _state(self, leaf: int) -> int:
        """Index of the state that a leaf is; -1 for any other."""
        node = self.tape.nodes[leaf]
        return node.args[0] if node.op == "state" else -1

    def _followed(self) -> dict[int, tuple[int, Value]]:
        """States whose rate is a multiple of another state, which is no such one itself: that state, the factor."""
        found: dict[int, tuple[int, Value]] = {}
        sources: set[int] = set()
        for i, (form, rate) in enumerate(zip(self.field, self.rates, strict=True)):
            if self.order >= LANES and len(form.terms) == 1 and not form.constant and i not in sources:
                (leaf,) = form.terms
                source = self._state(leaf)
                if source not in (-1, i) and source not in found:
                    found[i] = source, rate[leaf]
                    sources.add(source)
        return found

    def store(self, width: int) -> None:
        """Store all rows: of a state that follows another one and of an output from rows that are there already."""
        w, order = self.w, self.order
        for i, values in enumerate(self.solution):
            if i not in self.followed:
                store_values(w, values, i, width)
        for i, (source, rate) in self.followed.items():
            store_integral(w, self.solution[i], i, (source, rate), order)
        for r, form, values in zip(count(self.states), self.targets, self.outputs, strict=False):
            if self._by_vectors(form):
                parts = {self._state(leaf): self.factor(factors) for leaf, factors in form.terms.items()}
                store_combination(w, values[0], r, parts, order)
            else:
                store_values(w, values, r, width)

    def _output(self, form: Form) -> list[Value]:
        """Coefficients of an output; of one that is linear in the states only those that the norms read."""
        ends = {0, 1, 2, self.order - 1, self.order}
        sparse = self._by_vectors(form)
        return [self.linear(form, k) if not sparse or k in ends else None for k in range(self.order + 1)]

    def _by_vectors(self, form: Form) -> bool:
        return self.order >= LANES and all(self.tape.nodes[leaf].op == "state" for leaf in form.terms)

    # -- the other nodes --------------------------------------------------------------------------------

    def _value(self, at: int, k: int) -> Value:
        node = self.tape.nodes[at]
        if at in self.kept:
            return self.linear(self.kept[at], k)
        if node.op != "recip":
            return self.recurrences.value(at, node, k)
        argument = node.args[0]
        if argument in self.forms.bases:
            base, form = self.forms.bases[argument]
            start = self.recurrences.made(at, "start", make=lambda: self.linear(form, 0))
            slope = self.factor(form.terms[base])
        else:
            base, start, slope = argument, self._series[argument][0], ONE
        return self.recurrences.reciprocal(at, k, (base, start, slope))

    def _base(self, at: int) -> int:
        """What a reciprocal of a node reads."""
        return self.forms.bases[at][0] if at in self.forms.bases else at

    def _needed(self, roots: Sequence[int]) -> set[int]:
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
                elif node.op == "recip" and node.args[0] in self.forms.bases:
                    waiting.append(self.forms.bases[node.args[0]][0])
                else:
                    waiting.extend(node.args)
        return found
