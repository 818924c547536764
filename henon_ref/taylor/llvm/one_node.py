"""Code of one node of a shape: the body of a loop of :mod:`henon_ref.taylor.llvm.looped`.

Pointer ``%p0`` is the row that is computed. Further pointers are the rows and numbers that it reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from henon_ref.jit.ir_writer import LANES, IRWriter, Value, literal
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Convolutions
from henon_ref.taylor.llvm.expansion import store_combination, store_values
from henon_ref.taylor.llvm.linear_forms import Factor, Form
from henon_ref.taylor.llvm.pieces import Pieces, in_pieces
from henon_ref.taylor.llvm.recurrences import Recurrence, Recurrences
from henon_ref.taylor.llvm.shapes import Shape
from henon_ref.taylor.llvm.step_bounds import inverse_size, longest_step
from henon_ref.taylor.tape import Node


class _Series(Coefficients):
    """Coefficients in memory, each loaded once."""

    def __init__(self, w: IRWriter, pointer: str, degree: int) -> None:
        super().__init__(w)
        self._pointer, self._degree = pointer, degree

    def __getitem__(self, k: int) -> Value:  # type: ignore[override]
        return None if k > self._degree else self._w.once.load(self._pointer, k)


def _constants(w: IRWriter, first: int, count: int) -> Constants:
    """Constants of one node by their index among its operands; a clock's two are followed by their rounding errors."""
    return Constants(w, count // 2, lambda index: (f"%p{first + index}", 0))


class OneNode:
    """Writer of the code of one node of a shape. Pointers: ``%p0`` its row, then its series, then its constants."""

    def __init__(self, shape: Shape, order: int) -> None:
        self.shape, self.order, own = shape, order, len(shape.series)
        self.w = w = IRWriter()
        self.constants = _constants(w, 1 + own, shape.constants)
        series: dict[int, Coefficients] = {
            label: _Series(w, f"%p{1 + label}", degree) for label, (_, degree) in enumerate(shape.series)
        }
        self.y = series[own] = Coefficients(w)
        pair = (shape.args[0], shape.args[1], own) if shape.op == "mul" else (own - 1, own, own)
        convolutions = Convolutions(w, series, [pair] if shape.in_vectors else [], order)
        integrals = {
            label: (series[of], w.mul(self.constants.total(rate), "%unit")) for label, of, rate in shape.integrals
        }
        self.made = Recurrences(w, self.constants, series, convolutions, integrals, order)
        self.form = Form({label: list(found) for label, found in shape.terms}, list(shape.constant))

    def recurrence(self) -> Recurrence:
        """Recurrence of a node that is not a rate."""
        shape, own, clock = self.shape, len(self.shape.series), Node("clock", (), (0, 1))
        if shape.op == "sum":
            return partial(self.made.linear, self.form)
        if shape.op.endswith(" of time"):
            self.made.clock(own, clock)(0)  # its phase is in two numbers
            return self.made.sine_of_time(shape.op[:3], own, clock)
        if shape.op == "clock":
            return self.made.clock(own, clock)
        if shape.op == "recip":
            return self.made.of(own, Node("recip", (0,), (0,)), None, self.form)
        return self.made.of(own, Node(shape.op, shape.args, tuple(range(shape.constants))), None, None)

    def pieces(self) -> Pieces:
        """Code of a node, one piece per order."""
        recurrence, y, starts = self.recurrence(), self.y, [0]
        for k in range(self.order + 1):
            if k:
                starts.append(len(self.w.lines))
            self.made.convolutions.add_up(k)
            y.append(recurrence(k))
            self.made.convolutions.pack(k)
        results = {k: (k, v) for k, v in enumerate(y) if v is not None}
        return in_pieces(self.w.lines, starts, results, "%p0", self.order + 1)

    def rate_pieces(self) -> Pieces:
        """Code of a state: the next coefficient from each order."""
        factors, results, starts = self.made.rate_factors(self.form), {}, [0]
        for k in range(self.order):
            if k:
                starts.append(len(self.w.lines))
            results[k + 1] = k, self.made.state(self.form, factors, k + 1)
        return in_pieces(self.w.lines, starts, results, "%p0", self.order + 1)

    def output(self) -> list[str]:
        """Lines of an output: its row, and its ratios as stored by :func:`_ratios`."""
        w, order = self.w, self.order
        in_rows = order >= LANES and all(self.shape.series[label][0] for label in self.form.terms)
        wanted = {0, 1, 2, order - 1, order} if in_rows else range(order + 1)
        values = [self.made.linear(self.form, k) if k in wanted else None for k in range(order + 1)]
        if in_rows:
            parts = [((f"%p{1 + label}", 0), self.constants.total(found)) for label, found in self.form.terms.items()]
            store_combination(w, values[0], ("%p0", 0), parts, order)
        else:
            store_values(w, values, ("%p0", 0))
        if order >= 3:
            _ratios(w, values, 1 + len(self.shape.series) + self.shape.constants)
        return w.lines


def _ratios(w: IRWriter, values: Sequence[Value], pointer: int) -> None:
    """Store a row's last two coefficients, relative to its size, at a pointer and the next one."""
    inverse = inverse_size(w, values[:3])
    for value in values[-2:]:
        if value is not None:
            w.store(w.binary("fmul", w.call("fabs", value), inverse), f"%p{pointer}", 0)
            pointer += 1


def total_lines(kind: Sequence[tuple[int, int]]) -> list[str]:
    """Store a sum of products at ``%p0``; ``kind``: sign and number of constants of each product."""
    w, factors, first = IRWriter(), [], 0
    for sign, count in kind:
        factors.append(Factor(sign, tuple(range(first, first + count))))
        first += count
    w.store(_constants(w, 1, first).total(factors) or literal(0.0), "%p0", 0)
    return w.lines


def state_lines(degree: int, order: int) -> list[str]:
    """Store the ratios of a state; coefficients above its degree are zero already."""
    w = IRWriter()
    row = _Series(w, "%p0", degree)
    _ratios(w, [row[k] for k in range(order + 1)], 1)
    return w.lines


def bound_lines(op: str, state: bool, degree: int, highest: int) -> list[str]:
    """Replace the number at ``%p0`` by the longest step that a function's argument allows, if that is shorter."""
    w = IRWriter()
    argument = _Series(w, "%p1", degree)
    bound = longest_step(w, [(op, [argument[k] for k in range(highest + 1)])])
    w.store(w.smaller(bound, w.load("%p0", 0)), "%p0", 0)
    return w.lines
