"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR: every coefficient is one value, structural
zeros (a constant's derivatives, a clock's beyond the first) never become instructions, squares are halved,
sums are taken together (:mod:`henon_ref.henon.linear`), convolutions share the lanes of vectors
(:mod:`henon_ref.henon.recurrences`). Time is measured in units of ``sigma``, about the size of a step, so
that coefficients neither overflow nor vanish whatever the units of the model.
"""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.henon.emitter import MINUS, ONE, ZERO, Value, Writer, literal
from henon_ref.henon.emitter import declarations as _declarations
from henon_ref.henon.linear import LINEAR, Factor, Form, Forms
from henon_ref.henon.recurrences import LANES, Convolutions, Recurrences, convolved
from henon_ref.taylor.tape import Tape

SWING = 8.0
"""How far the argument of an exponential may move on one step."""


def declarations() -> str:
    """LLVM declarations of the functions that the generated code calls."""
    return _declarations(LANES)


def row_length(order: int) -> int:
    """Doubles from one row of coefficients to the next: whole vectors, padded with zeros."""
    return -(-(order + 1) // LANES) * LANES if order else 1


def expansion_ir(tape: Tape, states: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double sigma, double* x, double* K, double* C)``.

    ``K`` holds the constants rounded to double, then what that rounding lost. ``C`` receives the Taylor
    coefficients in units of sigma, a row of :func:`row_length` a state, then one an output; and behind the
    rows, for ``order`` >= 3, the largest last and last but one coefficient relative to the row's size on a
    step of sigma, a sum that is not finite where any coefficient is not, and the longest step that the
    exponentials allow.

    Parameters
    ----------
    tape : Tape
    states : int
        Number of states n.
    order : int
        Highest coefficient; 0 gives the values of the outputs only.
    name : str
        Name of the function.
    """
    w = Writer()
    expander = _Expander(w, tape, states, order)
    expander.run()
    rows = [*expander.solution, *expander.outputs]
    width = row_length(order)
    for r in range(states):
        for k, value in enumerate(rows[r]):
            w.store(value or ZERO, "%C", r * width + k)
    for r, root in enumerate(tape.outputs, states):
        expander.store_output(root, rows[r], r)
    if order >= 3:
        for at, value in enumerate([*_norms(w, rows, expander.sizes, order), _longest(w, expander)]):
            w.store(value, "%C", len(rows) * width + at)
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %sigma, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


def closing_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double theta, double* C, double* out)``: what a step needs of its coefficients.

    ``out`` receives, for each state, its change over the step (all terms but the first, so that adding it
    rounds once), then for each output a bound from below on (0, theta]: its first coefficient plus its
    negative terms.
    """
    w = Writer()
    vector = f"<{LANES} x double>"
    width = row_length(order)
    square = w.exact("fmul", "%theta", "%theta")
    fourth = w.exact("fmul", square, square)
    strides = [w.vector([fourth] * LANES)]
    powers = w.vector([ONE, "%theta", square, w.exact("fmul", square, "%theta")])
    zero = w.vector([ZERO] * LANES)
    for r in range(states + outputs):
        terms = []
        for v in range(width // LANES):
            term = w.load("%C", r * width + v * LANES, vector)
            if v == 0:
                term = w.emit(f"insertelement {vector} {term}, double {ZERO}, i64 0")
            if r >= states:
                below = w.emit(f"fcmp olt {vector} {term}, {zero}")
                term = w.emit(f"select <{LANES} x i1> {below}, {vector} {term}, {vector} {zero}")
            terms.append(term)
        total = _estrin(w, terms, strides)
        total = w.lanewise("fmul", LANES, total, powers)
        start = w.load("%C", r * width) if r >= states else literal(-0.0)
        w.store(
            w.emit(f"call reassoc double @llvm.vector.reduce.fadd.v{LANES}f64(double {start}, {vector} {total})"),
            "%out",
            r,
        )
    body = "\n".join(w.lines)
    return f"define void @{name}(double %theta, ptr noalias %C, ptr noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


def _estrin(w: Writer, terms: list[str], strides: list[str]) -> str:
    """sum of terms_v stride^v, in pairs; ``strides``: its powers 1, 2, 4 ... as far as they are made."""
    level = 0
    while len(terms) > 1:
        if level == len(strides):
            strides.append(w.lanewise("fmul", LANES, strides[-1], strides[-1]))
        paired = [w.lanewise_fused(LANES, terms[i + 1], strides[level], terms[i]) for i in range(0, len(terms) - 1, 2)]
        terms = paired + terms[2 * len(paired) :]
        level += 1
    return terms[0]


def _norms(w: Writer, rows: Sequence[Sequence[Value]], sizes: Sequence[str], order: int) -> list[str]:
    """(largest last, largest last but one, sum of all), relative; ``sizes``: inverse size of each row."""
    largest, total = ["", ""], ""
    for row, inverse in zip(rows, sizes, strict=True):
        for at, k in enumerate((order, order - 1)):
            value = row[k]
            if value is None:
                continue
            ratio = w.binary("fmul", w.call("fabs", value), inverse)
            total = w.binary("fadd", total, ratio) if total else ratio
            largest[at] = w.larger(largest[at], ratio) if largest[at] else ratio
    return [value or ZERO for value in (*largest, total)]


def _inverse_size(w: Writer, row: Sequence[Value]) -> str:
    """1 / (size of a row's first three terms on a step of sigma)."""
    size = literal(1e-300)
    for value in row[:3]:
        if value is not None:
            size = w.binary("fadd", size, w.call("fabs", value))
    return w.exact("fdiv", ONE, size)


def _longest(w: Writer, expander: _Expander) -> str:
    """Longest step, in units of sigma, on which no exponential's argument moves by more than SWING.

    An exponential that is zero in double precision (a drive that sleeps) has no Taylor coefficient that could
    tell of its waking: its argument does.
    """
    result = literal(1e30)
    for node in expander.tape.nodes:
        if node.op in ("exp", "sinh", "tanh"):
            terms = [w.call("fabs", a) for a in expander.series(node.args[0])[1:3] if a is not None]
            if terms:
                total = terms[0] if len(terms) == 1 else w.binary("fadd", terms[0], terms[1])
                ratio = w.exact("fdiv", literal(SWING), w.binary("fadd", total, literal(1e-300)))
                result = w.emit(
                    f"select i1 {w.emit(f'fcmp olt double {ratio}, {result}')}, double {ratio}, double {result}"
                )
    return result


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
        bases = self.forms.bases
        pairs = convolved(tape, lambda at: bases[at][0] if at in bases else at)
        self.convolutions = Convolutions(w, self.series, pairs, order)
        self.recurrences = Recurrences(w, tape, self.constant, self.convolutions, self.series, order)
        self.field = [self.forms.of(root) for root in tape.field]
        self.targets = [self.forms.of(root) for root in tape.outputs]
        self.kept = {at: self.forms.of(at) for at in self.forms.kept}
        self.absorbed = self._absorbed()
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
        rates = [self._rates(form) for form in self.field]
        for k in range(order + 1):
            self.convolutions.add_up(k)
            for at in wanted:
                if k < order or order == 0 or at in self.needed_last:
                    self._series[at].append(self._value(at, k))
                else:
                    self._series[at].append(None)
            if k < order:
                for target, form, rate in zip(self.solution, self.field, rates, strict=True):
                    target.append(self._slope(form, rate, k))
            self.convolutions.pack(k)
            if k == 2 and order >= 3:  # divisions are waited for least where they begin early
                rows = [*self.solution, *([self.linear(form, j) for j in range(3)] for form in self.targets)]
                self.sizes = [_inverse_size(w, row) for row in rows]
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
        total = self.factor(form.constant) if k == 0 and form.constant else None
        for leaf in form.leaves():
            total = self._added(total, form.terms[leaf], self._series[leaf][k])
        return total

    def _added(self, total: Value, factors: Sequence[Factor], value: Value) -> Value:
        return self.w.fused(self.factor(factors), value, total)

    def _rates(self, form: Form) -> dict[int, Value]:
        """Factors of a state's rate, times sigma."""
        return {
            leaf: self.w.mul(self.factor(factors), "%sigma")
            for leaf, factors in form.terms.items()
            if self.order and leaf not in self.absorbed
        }

    def _slope(self, form: Form, rate: dict[int, Value], k: int) -> Value:
        """Coefficient k + 1 of a state whose rate is this form."""
        w = self.w
        leaves = form.leaves()
        part = literal(1.0 / (k + 1))
        constant = w.mul(self.factor(form.constant), "%sigma") if k == 0 and form.constant else None
        if len(leaves) == 1 and constant is None and leaves[0] not in self.absorbed:
            return w.mul(w.mul(rate[leaves[0]], part), self._series[leaves[0]][k])
        total: Value = constant
        for leaf in leaves[:-1]:
            total = w.fused(rate.get(leaf, ONE), self._series[leaf][k], total)
        # The newest term apart: what waits for it is one operation.
        last = leaves[-1] if leaves else -1
        weight = part if last in self.absorbed else w.mul(rate[last], part) if leaves else None
        return w.fused(weight, self._series[last][k] if leaves else None, w.mul(part, total))

    def _output(self, form: Form) -> list[Value]:
        """Coefficients of an output; of one that is linear in the states only those that the norms read."""
        ends = {0, 1, 2, self.order - 1, self.order}
        sparse = self._by_vectors(form)
        return [self.linear(form, k) if not sparse or k in ends else None for k in range(self.order + 1)]

    def _by_vectors(self, form: Form) -> bool:
        return self.order >= LANES and all(self.tape.nodes[leaf].op == "state" for leaf in form.terms)

    def store_output(self, root: int, values: Sequence[Value], row: int) -> None:
        """Store an output's row: from the states' rows where it is linear in them."""
        w, width = self.w, row_length(self.order)
        form = self.targets[row - self.states]
        if not self._by_vectors(form):
            for k, value in enumerate(values):
                w.store(value or ZERO, "%C", row * width + k)
            return
        kind = f"<{LANES} x double>"
        factors = {leaf: w.vector([self.factor(f) or ZERO] * LANES) for leaf, f in form.terms.items()}
        for v in range(width // LANES):
            total = ""
            for leaf in form.leaves():
                state = self.tape.nodes[leaf].args[0]
                values_of = w.load("%C", state * width + v * LANES, kind)
                factor = factors[leaf]
                total = (
                    w.lanewise_fused(LANES, factor, values_of, total)
                    if total
                    else w.lanewise("fmul", LANES, factor, values_of)
                )
            w.store(total or w.vector([ZERO] * LANES), "%C", row * width + v * LANES, kind)
        w.store(values[0] or ZERO, "%C", row * width)

    # -- the other nodes --------------------------------------------------------------------------------

    def _value(self, at: int, k: int) -> Value:
        node = self.tape.nodes[at]
        if at in self.kept:
            return self.linear(self.kept[at], k)
        if node.op != "recip":
            return self.recurrences.value(at, node, k)
        made = self.recurrences.made
        numerator = made(at, "numerator", make=lambda: self._numerator(at))
        argument = node.args[0]
        if argument in self.forms.bases:
            base, form = self.forms.bases[argument]
            start = made(at, "start", make=lambda: self.linear(form, 0))
            slope = self.factor(form.terms[base])
        else:
            base, start, slope = argument, self._series[argument][0], ONE
        return self.recurrences.reciprocal(at, k, numerator or ZERO, (base, start or ZERO, slope or ZERO))

    def _numerator(self, at: int) -> Value:
        constant: Value = self.constant(self.tape.nodes[at].constants[0], False)
        if at in self.absorbed:
            constant = self.w.mul(self.w.mul(self.factor(self.absorbed[at]), constant), "%sigma")
        return constant

    def _absorbed(self) -> dict[int, Sequence[Factor]]:
        """Reciprocals read nowhere but in one rate: their numerators take its factor, and sigma."""
        if self.order == 0:
            return {}
        readers: dict[int, int] = {}
        for form in (*self.field, *self.targets, *self.kept.values()):
            for leaf in form.terms:
                readers[leaf] = readers.get(leaf, 0) + 1
        for node in self.tape.nodes:
            if node.op not in (*LINEAR, "state"):
                for at in node.args:
                    readers[at] = readers.get(at, 0) + 2
        return {
            leaf: factors
            for form in self.field
            for leaf, factors in form.terms.items()
            if self.tape.nodes[leaf].op == "recip" and readers[leaf] == 1
        }

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
