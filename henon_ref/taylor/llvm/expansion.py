"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR. Every coefficient is one value; structural zeros (a
constant's derivatives, a clock's after the first) never become instructions; squares take half the products; sums are
flattened (:mod:`henon_ref.taylor.llvm.linear_forms`); convolutions share the lanes of vectors. Each node has a function
that writes its coefficients in turn (:mod:`henon_ref.taylor.llvm.recurrences`), called here. The time unit is about the
size of a step, so that coefficients neither overflow nor underflow in any units of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import count

from henon_ref.jit.ir_writer import LANES, VECTOR, ZERO, IRWriter, NumberWriter, Value, literal, row_length
from henon_ref.jit.lanes import in_lanes
from henon_ref.taylor import rules
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Convolutions
from henon_ref.taylor.llvm.linear_forms import Form, Forms
from henon_ref.taylor.llvm.recurrences import Recurrence, Recurrences
from henon_ref.taylor.llvm.sin_cos import sin_cos_ir
from henon_ref.taylor.llvm.step import GROWING, before_falls, inverse_size, last_terms, longest_step
from henon_ref.taylor.tape import Node, Tape

Row = tuple[str, int]
"""An array, and the offset of a row in it."""


def expansion_ir(tape: Tape, states: int, order: int, name: str, width: int | None = None) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double unit, double* x, double* K, double* C)``.

    ``t_hi + t_lo`` is the initial time [s], ``unit`` the time unit of the coefficients [s], ``x`` the state. ``K``
    holds the constants rounded to double, followed by their rounding errors. ``C`` receives the Taylor coefficients in
    the time unit: one row per state, then one per output. If ``order`` >= 3, the rows are followed by the largest last
    and the largest last but one coefficient relative to the row's size on a step of one unit, a sum that is not finite
    if any coefficient is not, and the longest step that exponentials and denominators allow.

    ``states``: number of states n. ``order``: highest order; 0 gives only the values of the outputs. ``width``: doubles
    from one row to the next, if it is not the :func:`row_length` of the order (an order below 4).
    """
    w = IRWriter()
    _write_expansion(w, tape, states, order, row_length(order) if width is None else width)
    return function_ir(w, name)


def lanes_expansion_ir(tape: Tape, states: int, order: int, name: str = "lanes") -> str:
    """LLVM IR of ``void name(double* times, double** x, double** K, double** C)``: several expansions at once.

    ``times`` holds the vectors ``t_hi``, ``t_lo`` and ``unit``, with one number for each lane. The other arguments of
    each lane, and its results, are those of :func:`expansion_ir`; so are the bits.
    """
    body, w, width = NumberWriter("number"), IRWriter(), row_length(order)
    _write_expansion(body, tape, states, order, width)
    arrays = {"x": states, "K": 2 * len(tape.constants), "C": (states + len(tape.outputs)) * width + LANES}
    w.lines += [f"  %{array} = alloca [{LANES * size} x double]" for array, size in arrays.items()]
    lanes = {array: [w.emit(f"load ptr, ptr {w.place(f'%{array}s', i)}") for i in range(LANES)] for array in arrays}
    for at, argument in enumerate(("%t_hi", "%t_lo", "%unit")):
        w.lines.append(f"  {argument}.lanes = load {VECTOR}, ptr {w.place('%times', LANES * at)}, align 8")
    for array in ("x", "K"):
        for at in range(arrays[array]):
            w.store(w.vector([w.load(lane, at) for lane in lanes[array]]), f"%{array}", LANES * at, VECTOR)
    for first in range(0, arrays["C"] - LANES, width):
        for at in range(first + order + 1, first + width):
            w.store(w.vector([ZERO] * LANES), "%C", LANES * at, VECTOR)
    w.lines += in_lanes(body.lines)
    for first in range(0, arrays["C"], LANES):
        written = [w.load("%C", LANES * at, VECTOR) for at in range(first, first + LANES)]
        for lane, row in zip(lanes["C"], w.transposed(written), strict=True):
            w.store(row, lane, first, VECTOR)
    text = "\n".join(w.lines)
    function = sin_cos_ir() if "@sin_cos" in text else ""
    return f"{function}define void @{name}(ptr %times, ptr %xs, ptr %Ks, ptr %Cs) {{\nentry:\n{text}\n  ret void\n}}\n"


def _write_expansion(w: IRWriter, tape: Tape, states: int, order: int, width: int) -> None:
    expansion = Expansion(w, tape, states, order)
    expansion.run()
    expansion.store(width)
    if order >= 3:
        rows = [*expansion.solution, *expansion.outputs]
        exponentials = [(n.op, expansion.series[n.args[0]]) for n in tape.nodes if n.op in GROWING]
        longest = longest_step(w, exponentials)
        if expansion.made.falls:
            longest = w.smaller(before_falls(w, w.paired(w.larger, expansion.made.falls)), longest)
        for at, value in enumerate([*last_terms(w, rows, expansion.sizes, order), longest]):
            w.store(value, "%C", len(rows) * width + at)


def values_ir(tape: Tape, states: int, name: str, places: Sequence[int]) -> str:
    """LLVM IR of a function as that of :func:`expansion_ir` that only stores the value of each output at its place."""
    w = IRWriter()
    expansion = Expansion(w, tape, states, 0)
    expansion.run()
    for place, values in zip(places, expansion.outputs, strict=True):
        w.store(values[0] or ZERO, "%C", place)
    return function_ir(w, name)


def function_ir(w: IRWriter, name: str) -> str:
    """Wrap the written instructions into a function; see :func:`expansion_ir`."""
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %unit, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


class Expansion:
    """Writer of all recurrences of a tape, order by order."""

    def __init__(self, w: IRWriter, tape: Tape, states: int, order: int) -> None:
        self.w, self.tape, self.states, self.order = w, tape, states, order
        nodes = tape.nodes
        self.forms = Forms(tape)
        self.constants = Constants(w, len(tape.constants), lambda index: ("%K", index))
        for node in nodes:
            for index in node.constants:
                self.constants.value(index)
                if node.op == "clock":
                    self.constants.lost(index)
        self.solution = [Coefficients(w, [w.load("%x", i)]) for i in range(states)]
        self.series = {
            at: self.solution[node.args[0]] if node.op == "state" else Coefficients(w) for at, node in enumerate(nodes)
        }
        convolutions = Convolutions(w, self.series, self.forms.convolved(), order)
        integrals: dict[int, tuple[Coefficients, Value]] = {}
        self.made = Recurrences(w, self.constants, self.series, convolutions, integrals, order)
        self.rates = [self.made.rate_factors(form) for form in self.forms.field]
        self.integral_states = {
            i: (self.forms.state(leaf), self.rates[i][leaf]) for i, leaf in self.forms.integral_states(order).items()
        }
        """State whose rate is a multiple of another state -> the other state, and the factor times the time unit."""
        for at, node in enumerate(nodes):
            if node.op == "state" and node.args[0] in self.integral_states:
                source, rate = self.integral_states[node.args[0]]
                integrals[at] = self.solution[source], rate
        self.recurrences: dict[int, Recurrence] = {}
        for at, node in enumerate(nodes):
            if at in self.forms.kept:
                self.recurrences[at] = partial(self.made.linear, self.forms.kept[at])
            elif node.op not in (*rules.LINEAR, "state"):
                below = self.forms.below(node.args[0]) if node.op == "recip" else None
                self.recurrences[at] = self.made.of(at, node, self.clock_of(node), below)
        self.outputs: list[list[Value]] = []
        self.sizes: list[str] = []

    def clock_of(self, node: Node) -> Node | None:
        """Argument of a sine or cosine, if it is a clock."""
        argument = self.tape.nodes[node.args[0]] if node.op in ("sin", "cos") else None
        return argument if argument is not None and argument.op == "clock" else None

    def run(self) -> None:
        """Write the required coefficients of the nodes, states and outputs."""
        w, order, made = self.w, self.order, self.made
        for k in range(order + 1):
            made.convolutions.add_up(k)
            for at, recurrence in self.recurrences.items():
                wanted = k < order or order == 0 or at in self.forms.last
                self.series[at].append(recurrence(k) if wanted else None)
            if k < order:
                for row, form, factors in zip(self.solution, self.forms.field, self.rates, strict=True):
                    row.append(made.state(form, factors, k + 1))
            made.convolutions.pack(k)
            if k == 2 and order >= 3:  # divisions have a long latency and start as early as possible
                rows = [*self.solution, *([made.linear(form, j) for j in range(3)] for form in self.forms.outputs)]
                self.sizes = [inverse_size(w, values) for values in rows]
        self.outputs = [self._output(form) for form in self.forms.outputs]

    def store(self, width: int) -> None:
        """Store all rows; rows of integral states and of linear outputs are computed from rows already stored."""
        w, order = self.w, self.order

        def row(i: int) -> Row:
            return "%C", i * width

        for i, values in enumerate(self.solution):
            if i not in self.integral_states:
                store_values(w, values, row(i))
        for i, (source, rate) in self.integral_states.items():
            store_integral(w, self.solution[i], row(i), row(source), rate, order)
        for r, form, found in zip(count(self.states), self.forms.outputs, self.outputs, strict=False):
            if self._by_vectors(form):
                parts = [(row(self.forms.state(leaf)), self.constants.total(form.terms[leaf])) for leaf in form.terms]
                store_combination(w, found[0], row(r), parts, order)
            else:
                store_values(w, found, row(r))

    def _output(self, form: Form) -> list[Value]:
        """Coefficients of an output; if it is linear in the states, only those that the norms read."""
        ends = {0, 1, 2, self.order - 1, self.order}
        sparse = self._by_vectors(form)
        return [self.made.linear(form, k) if not sparse or k in ends else None for k in range(self.order + 1)]

    def _by_vectors(self, form: Form) -> bool:
        """Whether the row of an output is combined from the states' rows, which saves 2 to 16 % of a run of the rig."""
        return self.order >= LANES and all(self.forms.state(leaf) >= 0 for leaf in form.terms)


def store_values(w: IRWriter, values: Sequence[Value], row: Row) -> None:
    array, first = row
    for k, value in enumerate(values):
        w.store(value or ZERO, array, first + k)


def store_integral(w: IRWriter, values: Sequence[Value], row: Row, source: Row, factor: Value, order: int) -> None:
    """Store the row of a state whose rate is a multiple of another state, from the stored row of the other state.

    Coefficient k is factor / k times coefficient k - 1 of the other state.
    """
    store_values(w, values[:LANES], row)
    scale = w.vector([factor or ZERO] * LANES)
    for k in range(LANES, row_length(order), LANES):
        parts = w.vector([literal(1.0 / j if j <= order else 0.0) for j in range(k, k + LANES)])
        before = w.load(source[0], source[1] + k - 1, VECTOR)
        after = w.lanewise("fmul", LANES, before, w.lanewise("fmul", LANES, scale, parts))
        w.store(after, row[0], row[1] + k, VECTOR)


def store_combination(w: IRWriter, first: Value, row: Row, parts: Sequence[tuple[Row, Value]], order: int) -> None:
    """Store a sum of rows times factors; its first coefficient is passed, since it may contain a constant."""
    factors = [(source, w.vector([factor or ZERO] * LANES)) for source, factor in parts]
    for k in range(0, row_length(order), LANES):
        total = ""
        for (array, begin), factor in factors:
            values = w.load(array, begin + k, VECTOR)
            if total:
                total = w.lanewise_fused(LANES, factor, values, total)
            else:
                total = w.lanewise("fmul", LANES, factor, values)
        w.store(total or w.vector([ZERO] * LANES), row[0], row[1] + k, VECTOR)
    w.store(first or ZERO, *row)
