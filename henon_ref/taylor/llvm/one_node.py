"""Code of one node of a shape: the body of a loop of :mod:`henon_ref.taylor.llvm.looped`, cut into pieces.

Each order has a piece, which stores the values that later pieces read.

Pointer ``%p0`` is the row that is computed. Further pointers are the rows and numbers that it reads.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, Value, literal
from henon_ref.taylor.llvm.coefficients import Coefficients, Constants, Convolutions
from henon_ref.taylor.llvm.expansion import store_combination, store_values
from henon_ref.taylor.llvm.linear_forms import Factor, Form
from henon_ref.taylor.llvm.recurrences import Recurrence, Recurrences
from henon_ref.taylor.llvm.shapes import Shape
from henon_ref.taylor.llvm.step_bounds import inverse_size, longest_step
from henon_ref.taylor.tape import Node

CHEAP = 3
"""Largest number of operations for which a value is computed again instead of stored."""
_DEFINED = re.compile(r"  (%v\d+) = (.*)")
_NAME = re.compile(r"%v\d+")
_FREE = re.compile(r"getelementptr|load")
_SHORT = re.compile(r"fneg|fadd|fsub|fmul|insertelement|shufflevector|extractelement")
_VECTOR = re.compile(r"<\d+ x double>")


class Pieces(NamedTuple):
    """Lines of each piece, and the number of doubles of memory that the pieces use."""

    lines: list[list[str]]
    room: int


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
        """Lines of an output: its row, and its part in the norms (:func:`_include`)."""
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
            _include(w, values, f"%p{1 + len(self.shape.series) + self.shape.constants}")
        return w.lines


def _include(w: IRWriter, values: Sequence[Value], norms: str) -> None:
    """Include a row in the norms: largest last and last but one coefficient relative to the row's size, and a sum."""
    inverse = inverse_size(w, values[:3])
    for place, value in zip((1, 0), values[-2:], strict=True):
        if value is not None:
            ratio = w.binary("fmul", w.call("fabs", value), inverse)
            w.store(w.larger(w.load(norms, place), ratio), norms, place)
            w.store(w.plus(w.load(norms, 2), ratio), norms, 2)


def total_lines(kind: Sequence[tuple[int, int]]) -> list[str]:
    """Store a sum of products at ``%p0``; ``kind``: sign and number of constants of each product."""
    w, factors, first = IRWriter(), [], 0
    for sign, count in kind:
        factors.append(Factor(sign, tuple(range(first, first + count))))
        first += count
    w.store(_constants(w, 1, first).total(factors) or literal(0.0), "%p0", 0)
    return w.lines


def state_lines(degree: int, order: int) -> list[str]:
    """Include a state in the norms; coefficients above its degree are zero already."""
    w = IRWriter()
    row = _Series(w, "%p0", degree)
    _include(w, [row[k] for k in range(order + 1)], "%p1")
    return w.lines


def bound_lines(op: str, state: bool, degree: int, highest: int) -> list[str]:
    """Replace the number at ``%p0`` by the longest step that a function's argument allows, if that is shorter."""
    w = IRWriter()
    argument = _Series(w, "%p1", degree)
    bound = longest_step(w, [(op, [argument[k] for k in range(highest + 1)])])
    w.store(w.smaller(bound, w.load("%p0", 0)), "%p0", 0)
    return w.lines


def in_pieces(
    lines: Sequence[str], starts: Sequence[int], results: Mapping[int, tuple[int, Value]], own: str, room: int
) -> Pieces:
    """Cut straight-line code into pieces that can be compiled separately.

    Parameters
    ----------
    lines : sequence of str
    starts : sequence of int
        Index of the first line of each piece.
    results : mapping
        Place in memory -> (index of the piece that stores the value there, the value).
    own : str
        Pointer to the memory, available in all pieces.
    room : int
        First free place in the memory, for values that later pieces read.
    """
    return _Cut(lines, starts, own, room).made(results)


class _Cut:
    def __init__(self, lines: Sequence[str], starts: Sequence[int], own: str, room: int) -> None:
        self.own, self.room = own, room
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
        return Pieces(lines, self.room)

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
                self.room += int(_type(text)[1]) if _type(text) != "double" else 1
                cost = 0
            self._costs[name] = cost
        return self._costs[name]

    def _stored(self, value: str, place: int) -> list[str]:
        """Code that stores a value in memory."""
        at, kind = f"%to{place}", _type(self.texts.get(value, "double"))
        return [
            f"  {at} = getelementptr double, ptr {self.own}, i64 {place}",
            f"  store {kind} {value}, ptr {at}, align 8",
        ]

    def _again(self, name: str, lines: dict[str, str]) -> None:
        """Add the code that loads or recomputes a value of an earlier piece; ``lines``: the code of each value."""
        if name in lines or name not in self.texts:
            return
        text, load = self.texts[name], ""
        if name in self.kept:
            place = self.kept[name]
            load = f"  %from{place} = getelementptr double, ptr {self.own}, i64 {place}\n"
            text = f"load {_type(text)}, ptr %from{place}, align 8"
        else:
            for each in _NAME.findall(text):
                self._again(each, lines)
        lines[name] = f"{load}  {name} = {text}"


def _type(text: str) -> str:
    """Result type of an instruction: double or a vector of doubles."""
    found = _VECTOR.search(text)
    if found is None or text.startswith("extractelement"):
        return "double"
    return found[0]
