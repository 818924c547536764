"""Code of one node of a shape: the body of a loop of :mod:`henon_ref.taylor.llvm.looped`, cut into pieces.

Each order has a piece, which stores the values that later pieces read.

Pointer ``%p0`` is the column that is computed. Further pointers are the columns and numbers that it reads. ``%N`` is
the array of the norms.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise

from henon_ref.jit.ir_writer import LANES, VECTOR, ZERO, IRWriter, Value, literal, row_length
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Convolutions
from henon_ref.taylor.llvm.linear_forms import Factor, Form, Pair
from henon_ref.taylor.llvm.recurrences import Recurrence, Recurrences
from henon_ref.taylor.llvm.shapes import Shape
from henon_ref.taylor.llvm.step import inverse_size, longest_step
from henon_ref.taylor.tape import Node

CHEAP = 3
"""Largest number of operations for which a value is computed again instead of stored."""
_DEFINED = re.compile(r"  (%v\d+) = (.*)")
_NAME = re.compile(r"%v\d+")
_FREE = re.compile(r"getelementptr|load")
_SHORT = re.compile(r"fneg|fadd|fsub|fmul")

Pieces = tuple[list[list[str]], int]
"""Lines of each piece, and the number of rows of the matrix that the pieces use."""


class _Series(Coefficients):
    """Coefficients in memory, ``stride`` doubles apart, each loaded once."""

    def __init__(self, w: IRWriter, pointer: str, degree: int, stride: int) -> None:
        super().__init__(w)
        self._pointer, self._degree, self._stride = pointer, degree, stride

    def __getitem__(self, k: int) -> Value:  # type: ignore[override]
        return None if k > self._degree else self._w.once.load(self._pointer, k * self._stride)


class _OneConvolution(Convolutions):
    """Sums of products of one node, number by number, in the order in which lanes of vectors add them."""

    def parts(self, pair: Pair, k: int) -> tuple[Value, Value]:
        early = super().parts(pair, k)[1]
        if k < 5 or pair not in self.grouped:
            return None, early
        v, older = self.series[pair[1]], range((k - 1) // 2, 1, -1)
        first = self.w.total([(self.left(pair, j), v[k - j]) for j in older])
        return self.w.add(first, self.w.total([(v[j], self.left(pair, k - j)) for j in older])), early


def _constants(w: IRWriter, first: int, count: int) -> Constants:
    """Constants of one node by their index among its operands; a clock's two are followed by their rounding errors."""
    return Constants(w, count // 2, lambda index: (f"%p{first + index}", 0))


class OneNode:
    """Writer of the code of one node of a shape. Pointers: ``%p0`` its column, then its series, then its constants.

    ``stride``: distance of the coefficients of a column.
    """

    def __init__(self, shape: Shape, order: int, stride: int) -> None:
        self.shape, self.order, self.stride, own = shape, order, stride, len(shape.series)
        self.w = w = IRWriter()
        self.constants = _constants(w, 1 + own, shape.constants)
        series: dict[int, Coefficients] = {
            label: _Series(w, f"%p{1 + label}", degree, stride) for label, (_, degree) in enumerate(shape.series)
        }
        self.y = series[own] = Coefficients(w)
        pair = (shape.args[0], shape.args[1], own) if shape.op == "mul" else (own - 1, own, own)
        convolutions = _OneConvolution(w, series, [pair] if shape.in_vectors else [], order)
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
        """Code of a node, or of a state's rate, one piece per order; of an output in one piece."""
        if self.shape.op == "output":
            return [self._output()], self.order + 1
        if self.shape.op == "rate":
            return self._rate_pieces()
        recurrence, y, starts = self.recurrence(), self.y, [0]
        for k in range(self.order + 1):
            if k:
                starts.append(len(self.w.lines))
            y.append(recurrence(k))
            if k == 2 and self.made.falls:
                (found,) = self.made.falls
                self.w.store(self.w.larger(self.w.load("%N", 3 * LANES), found), "%N", 3 * LANES)
        results = {k: (k, v) for k, v in enumerate(y) if v is not None}
        return in_pieces(self.w.lines, starts, results, self.order + 1, self.stride)

    def _rate_pieces(self) -> Pieces:
        """Code of a state: the next coefficient from each order."""
        factors, results, starts = self.made.rate_factors(self.form), {}, [0]
        for k in range(self.order):
            if k:
                starts.append(len(self.w.lines))
            results[k + 1] = k, self.made.state(self.form, factors, k + 1)
        return in_pieces(self.w.lines, starts, results, self.order + 1, self.stride)

    def _output(self) -> list[str]:
        """Lines of an output: its column, and its part in the norms (:func:`_include`)."""
        w, order = self.w, self.order
        of_states = order >= LANES and all(self.shape.series[label][0] for label in self.form.terms)
        wanted = {0, 1, 2, order - 1, order} if of_states else range(order + 1)
        values = [self.made.linear(self.form, k) if k in wanted else None for k in range(order + 1)]
        column = [values[0], *map(self._combination, range(1, order + 1))] if of_states else values
        for k, value in enumerate(column):
            w.store(value or ZERO, "%p0", k * self.stride)
        if order >= 3:
            _include(w, values)
        return w.lines

    def _combination(self, k: int) -> Value:
        """Coefficient of an output that is linear in the states, in the order of sums of `store_combination`."""
        total: Value = None
        for label, factors in self.form.terms.items():
            total = self.w.fused(self.constants.total(factors), self.made.series[label][k], total)
        return total


def _include(w: IRWriter, values: Sequence[Value]) -> None:
    """Include a row in the norms: largest last and last but one coefficient relative to the row's size, and a sum."""
    inverse = inverse_size(w, values[:3])
    ratios = [(i, w.binary("fmul", w.call("fabs", v), inverse)) for i, v in zip((1, 0), values[-2:], strict=True) if v]
    for i, ratio in ratios:
        w.store(w.larger(w.load("%N", LANES * i), ratio), "%N", LANES * i)
    if ratios:
        w.store(w.plus(w.load("%N", 2 * LANES), w.paired(w.plus, [ratio for _, ratio in ratios])), "%N", 2 * LANES)


def total_lines(kind: Sequence[tuple[int, int]]) -> list[str]:
    """Store a sum of products at ``%p0``; ``kind``: sign and number of constants of each product."""
    w, factors, first = IRWriter(), [], 0
    for sign, count in kind:
        factors.append(Factor(sign, tuple(range(first, first + count))))
        first += count
    w.store(_constants(w, 1, first).total(factors) or literal(0.0), "%p0", 0)
    return w.lines


def state_lines(order: int, stride: int) -> list[str]:
    """Include a state in the norms."""
    w = IRWriter()
    column = _Series(w, "%p0", order, stride)
    _include(w, [column[k] for k in range(order + 1)])
    return w.lines


def copy_lines() -> list[str]:
    """Copy a number from ``%p1`` to ``%p0``."""
    w = IRWriter()
    w.store(w.load("%p1", 0), "%p0", 0)
    return w.lines


def row_lines(order: int, stride: int) -> list[str]:
    """Copy four neighbouring columns from ``%p0`` to the rows ``%p1`` to ``%p4``.

    Rows that are not required point to that of the first column, which is stored last.
    """
    w, kind, width = IRWriter(), VECTOR, row_length(order)
    for k in range(0, width, LANES):
        rows = [
            w.load("%p0", j * stride, kind) if j <= order else w.vector([ZERO] * LANES) for j in range(k, k + LANES)
        ]
        columns = w.transposed(rows)
        for i in reversed(range(LANES)):
            if width % LANES == 0:
                w.store(columns[i], f"%p{1 + i}", k, kind)
            else:
                for j in range(width):
                    w.store(w.lane(LANES, columns[i], j), f"%p{1 + i}", j)
    return w.lines


def bound_lines(op: str, stride: int, degree: int, highest: int) -> list[str]:
    """Replace the number at ``%p0`` by the longest step that a function's argument allows, if that is shorter."""
    w = IRWriter()
    argument = _Series(w, "%p1", degree, stride)
    bound = longest_step(w, [(op, [argument[k] for k in range(highest + 1)])])
    w.store(w.smaller(bound, w.load("%p0", 0)), "%p0", 0)
    return w.lines


def in_pieces(
    lines: Sequence[str], starts: Sequence[int], results: Mapping[int, tuple[int, Value]], room: int, stride: int
) -> Pieces:
    """Cut straight-line code into pieces that can be compiled separately.

    Parameters
    ----------
    lines : sequence of str
    starts : sequence of int
        Index of the first line of each piece.
    results : mapping
        Place in memory -> (index of the piece that stores the value there, the value).
    room : int
        First free place in the memory, for values that later pieces read.
    stride : int
        Distance of the places from ``%p0``, in doubles.
    """
    return _Cut(lines, starts, room, stride).made(results)


class _Cut:
    def __init__(self, lines: Sequence[str], starts: Sequence[int], room: int, stride: int) -> None:
        self.room, self.stride = room, stride
        self.bodies = [lines[start:end] for start, end in pairwise([*starts, len(lines)])]
        self.texts: dict[str, str] = {}
        self.piece: dict[str, int] = {}
        for number, body in enumerate(self.bodies):
            for line in body:
                if found := _DEFINED.match(line):
                    self.texts[found[1]], self.piece[found[1]] = found[2], number
        self.kept: dict[str, int] = {}
        """Value -> its place in memory."""
        self._costs: dict[str, int] = {}

    def made(self, results: Mapping[int, tuple[int, Value]]) -> Pieces:
        stores: list[list[tuple[str, int]]] = [[] for _ in self.bodies]
        for place, (number, value) in results.items():
            if value in self.piece and value not in self.kept:
                self.kept[value] = place
            else:
                stores[number].append((value or ZERO, place))
        read = [self._earlier(number) for number in range(len(self.bodies))]
        for names in read:
            for name in names:
                self._keep_for(name)
        lines = []
        for number, (body, names) in enumerate(zip(self.bodies, read, strict=True)):
            before: dict[str, str] = {}
            for name in (*names, *(value for value, _ in stores[number])):
                if self.piece.get(name, number) < number:
                    self._again(name, before)
            new = [found for found in self.kept.items() if self.piece[found[0]] == number]
            ends = [line for found in (*stores[number], *new) for line in self._stored(*found)]
            lines.append([*before.values(), *body, *ends])
        return lines, self.room

    def _earlier(self, number: int) -> list[str]:
        """Values of earlier pieces that a piece reads."""
        found: dict[str, None] = {}
        for line in self.bodies[number]:
            names = _NAME.findall(line)
            found.update((name, None) for name in names if self.piece.get(name, number) < number)
        return list(found)

    def _keep_for(self, name: str) -> int:
        """Number of operations to compute a value again; 0 if it would exceed CHEAP and the value is stored."""
        if name in self.kept:
            return 0
        if name not in self._costs:
            text = self.texts[name]
            cost = 0 if _FREE.match(text) else 1 if _SHORT.match(text) else CHEAP + 1
            if cost <= CHEAP:
                cost += sum(self._keep_for(each) for each in _NAME.findall(text))
            if cost > CHEAP:
                self.kept[name] = self.room
                self.room += 1
                cost = 0
            self._costs[name] = cost
        return self._costs[name]

    def _stored(self, value: str, place: int) -> list[str]:
        """Code that stores a value in memory."""
        return [
            f"  %to{place} = getelementptr double, ptr %p0, i64 {place * self.stride}",
            f"  store double {value}, ptr %to{place}, align 8",
        ]

    def _again(self, name: str, lines: dict[str, str]) -> None:
        """Add the code that loads or recomputes a value of an earlier piece; ``lines``: the code of each value."""
        if name in lines or name not in self.texts:
            return
        if name in self.kept:
            place = self.kept[name]
            lines[f"%from{place}"] = f"  %from{place} = getelementptr double, ptr %p0, i64 {place * self.stride}"
            lines[name] = f"  {name} = load double, ptr %from{place}, align 8"
        else:
            for each in _NAME.findall(self.texts[name]):
                self._again(each, lines)
            lines[name] = f"  {name} = {self.texts[name]}"
