"""Code of one node of a shape: the body of a loop of :mod:`henon_ref.taylor.llvm.looped`.

Pointer ``%p0`` is the row that is computed. Further pointers are the rows and numbers that it reads.
"""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import LANES, IRWriter, Value, literal
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Functions
from henon_ref.taylor.llvm.convolutions import Convolutions
from henon_ref.taylor.llvm.functions_of_time import Clock, SineOfTime
from henon_ref.taylor.llvm.layout import store_combination, store_values
from henon_ref.taylor.llvm.linear_forms import Factor, Form
from henon_ref.taylor.llvm.node_recurrences import NodeRecurrences
from henon_ref.taylor.llvm.pieces import Pieces, PiecewiseWriter
from henon_ref.taylor.llvm.recurrences import Recurrence
from henon_ref.taylor.llvm.shapes import Shape
from henon_ref.taylor.llvm.step_bounds import inverse_size, longest_step
from henon_ref.taylor.llvm.sums import IntegralOfForm
from henon_ref.taylor.tape import Node


class _Series(Coefficients):
    """Coefficients in memory, each loaded once."""

    def __init__(self, w: IRWriter, pointer: str, degree: int) -> None:
        super().__init__(w)
        self._pointer, self._degree = pointer, degree
        self._read: dict[int, Value] = {}

    def __getitem__(self, k: int) -> Value:  # type: ignore[override]
        if k > self._degree:
            return None
        if k not in self._read:
            self._read[k] = self._w.load(self._pointer, k)
        return self._read[k]


class _Constants(Constants):
    """Constants of one node by their index among its operands; a clock's two are followed by their rounding errors."""

    def __init__(self, w: IRWriter, first: int, count: int) -> None:
        self._w, self._first, self._count = w, first, count // 2
        self._loaded, self._products, self._sums = {}, {}, {}

    def value(self, index: int) -> str:
        if index not in self._loaded:
            self._loaded[index] = self._w.load(f"%p{self._first + index}", 0)
        return self._loaded[index]


class OneNode:
    """Writer of the code of one node of a shape. Pointers: ``%p0`` its row, then its series, then its constants."""

    def __init__(self, shape: Shape, order: int) -> None:
        self.shape, self.order, own = shape, order, len(shape.series)
        self.w = w = PiecewiseWriter()
        w.begin()
        self.constants, functions = _Constants(w, 1 + own, shape.constants), Functions(w)
        self.series: dict[int, Coefficients] = {
            label: _Series(w, f"%p{1 + label}", degree) for label, (_, degree) in enumerate(shape.series)
        }
        self.y = self.series[own] = Coefficients(w)
        pair = (shape.args[0], shape.args[1], own) if shape.op == "mul" else (own - 1, own, own)
        self.convolutions = Convolutions(w, self.series, [pair] if shape.in_vectors else [], order)
        integrals = {
            label: (self.series[of], w.mul(self.constants.total(rate), "%unit")) for label, of, rate in shape.integrals
        }
        self.made = NodeRecurrences(w, self.constants, functions, self.series, self.convolutions, integrals, order)
        self.form = Form({label: list(found) for label, found in shape.terms}, list(shape.constant))

    def recurrence(self) -> Recurrence:
        """Recurrence of a node that is not a rate."""
        shape, own = self.shape, len(self.shape.series)
        if shape.op in ("sum", "output"):
            return self.made.linear(self.form)
        if shape.op.endswith(" of time"):
            clock = Clock(self.w, self.constants, 0, 1, self.order)
            clock.coefficient(0)  # its phase is in two numbers
            return SineOfTime(self.w, shape.op[:3], clock)
        numbers = (0, 1) if shape.op == "clock" else tuple(range(shape.constants))
        if shape.op == "recip":
            return self.made.of(own, Node("recip", (0,), (0,)), None, self.form)
        return self.made.of(own, Node(shape.op, shape.args, numbers), None, None)

    def pieces(self) -> Pieces:
        """Code of a node, one piece per order."""
        recurrence, y = self.recurrence(), self.y
        for k in range(self.order + 1):
            if k:
                self.w.begin()
            self.convolutions.add_up(k)
            y.append(recurrence.coefficient(k))
            self.convolutions.pack(k)
        return self.w.pieces({k: (k, v) for k, v in enumerate(y) if v is not None}, "%p0", self.order + 1)

    def rate_pieces(self) -> Pieces:
        """Code of a state: the next coefficient from each order."""
        state = IntegralOfForm(self.w, self.constants, self.form, self.series, None)
        results = {}
        for k in range(self.order):
            if k:
                self.w.begin()
            results[k + 1] = k, state.coefficient(k + 1)
        return self.w.pieces(results, "%p0", self.order + 1)

    def output(self) -> list[str]:
        """Lines of an output: its row, and its ratios as stored by :func:`_ratios`."""
        w, order, target = self.w, self.order, self.made.linear(self.form)
        in_rows = order >= LANES and all(self.shape.series[label][0] for label in self.form.terms)
        wanted = {0, 1, 2, order - 1, order} if in_rows else range(order + 1)
        values = [target.coefficient(k) if k in wanted else None for k in range(order + 1)]
        if in_rows:
            parts = [((f"%p{1 + label}", 0), target.factor(label)) for label in self.form.terms]
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
    w.store(_Constants(w, 1, first).total(factors) or literal(0.0), "%p0", 0)
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
