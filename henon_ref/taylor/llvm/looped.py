"""Machine code for the Taylor coefficients of a long tape: loops over nodes whose recurrences have the same shape.

A tape of thousands of operations has few kinds of them. As in heyoka's compact mode (Biscani and Izzo, *MNRAS* 504,
2021, Sec. 2.4) there is one function per shape and order. It loops over all nodes of the shape by a table of the places
that they read, so that compilation time does not grow with their number. The functions are written by the recurrences
of the straight-line code (:mod:`henon_ref.taylor.llvm.expansion`) for one node, cut into pieces
(:mod:`henon_ref.taylor.llvm.one_node`), and compute the same bits, except in the third norm: of this sum, only whether
it is finite is used, so that the order of its terms is free.

Series of states are in the rows of ``C``. Series of nodes are in memory ``S`` that is allocated for the call, which
also holds the sums of constants that are used as factors, each once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from functools import partial
from typing import TypeVar

from henon_ref.jit.ir_writer import literal, loop_function, row_length
from henon_ref.taylor.llvm.one_node import OneNode, Pieces, bound_lines, state_lines, total_lines
from henon_ref.taylor.llvm.shapes import Factors, Operands, Shape, Shapes
from henon_ref.taylor.llvm.step_bounds import GROWING
from henon_ref.taylor.tape import Tape

T = TypeVar("T")
Key = TypeVar("Key", bound=Hashable)
_POINTER = re.compile(r"%p(\d+)\b")
_TIMES = "double %unit, double %t_hi, double %t_lo"


def looped_expansion_ir(tape: Tape, states: int, order: int, name: str, width: int | None = None) -> str:
    """LLVM IR as :func:`henon_ref.taylor.llvm.expansion.expansion_ir`, with loops."""
    return _LoopedExpansion(tape, states, order, name, row_length(order) if width is None else width).text()


class _LoopedExpansion:
    def __init__(self, tape: Tape, states: int, order: int, name: str, width: int) -> None:
        self.tape, self.states, self.order, self.name, self.width = tape, states, order, name, width
        self.shapes = Shapes(tape, order)
        self.functions: dict[Hashable, str] = {}
        self.globals: list[str] = []
        self.calls: list[str] = []
        self.memory = 0
        """Number of doubles of ``S`` allocated so far."""
        self.totals: dict[Factors, int] = {}
        """Place in ``S`` of each sum of constants."""
        self.pieces: dict[Shape, Pieces] = {}
        self.norms = (states + len(tape.outputs)) * width
        """Place in ``C`` of the numbers after the rows."""
        self.rows: dict[int, int] = {}
        """Place in ``S`` of the row of each node."""

    def text(self) -> str:
        self._constants()
        self._node_rows()
        self._orders()
        if self.order >= 3:
            self._norms()
        self._outputs()
        body = "\n".join(self.calls)
        copy = f"  call void @{self.name}.copy(ptr %C, ptr %x, i64 {self.states}, i64 {self.width})\n"
        return (
            "\n".join(self.globals)
            + "\n"
            + _copy_ir(f"{self.name}.copy")
            + f"define void @{self.name}(double %t_hi, double %t_lo, double %unit, ptr noalias %x, ptr noalias %K, "
            f"ptr noalias %C) {{\nentry:\n  %S = call noalias ptr @malloc(i64 {8 * max(self.memory, 1)})\n"
            f"{copy}{body}\n  call void @free(ptr %S)\n  ret void\n}}\n"
        )

    def _taken(self, count: int) -> int:
        """Allocate doubles of ``S``."""
        first, self.memory = self.memory, self.memory + count
        return first

    def _loop(
        self, key: Hashable, bases: Sequence[str], lines: Callable[[], Iterable[str]], table: tuple[str, int]
    ) -> None:
        """Add a call of a loop over a table, and write its function if it does not exist yet."""
        if key not in self.functions:
            self.functions[key] = f"{self.name}.{len(self.functions)}"
            self.globals.append(_loop_ir(self.functions[key], bases, list(lines())))
        rows = f"ptr @{table[0]}, i64 {table[1]}"
        self.calls.append(f"  call void @{self.functions[key]}(ptr %C, ptr %S, ptr %K, {rows}, {_TIMES})")

    def _table(self, rows: Sequence[Sequence[int]]) -> tuple[str, int]:
        """Add a table of places as a constant of the module."""
        name = f"{self.name}.table{len(self.globals)}"
        numbers = ", ".join(f"i32 {place}" for row in rows for place in row)
        self.globals.append(f"@{name} = private constant [{sum(map(len, rows))} x i32] [{numbers}]")
        return name, len(rows)

    def _constants(self) -> None:
        """Compute all sums of constants, each once."""
        found = [*self.shapes.nodes.values(), *self.shapes.rates, *self.shapes.outputs]
        for _, operands in found:
            for factors in operands.constants:
                if factors not in self.totals:
                    self.totals[factors] = self._taken(1)
        signs = {factors: tuple((f.sign, len(f.constants)) for f in factors) for factors in self.totals}
        for kind, members in _grouped(self.totals, signs.__getitem__):
            rows = [[self.totals[each], *(i for f in each for i in f.constants)] for each in members]
            bases = ["%S", *["%K"] * (len(rows[0]) - 1)]
            self._loop(("total", kind), bases, partial(total_lines, kind), self._table(rows))

    def _node_rows(self) -> None:
        for at, (shape, _) in self.shapes.nodes.items():
            if shape not in self.pieces:
                self.pieces[shape] = OneNode(shape, self.order).pieces()
            self.rows[at] = self._taken(self.pieces[shape].room)

    def _places(self, operands: Operands) -> list[int]:
        series = [self.rows[at] if at >= 0 else (-1 - at) * self.width for at in operands.series]
        return [*series, *(self.totals[factors] for factors in operands.constants)]

    @staticmethod
    def _bases(shape: Shape) -> list[str]:
        return [*("%C" if state else "%S" for state, _ in shape.series), *["%S"] * shape.constants]

    def _orders(self) -> None:
        """Compute the coefficients of all nodes and the next ones of the states, order by order."""
        shapes, order = self.shapes, self.order
        groups = []
        for (_, shape, last), members in _grouped(
            sorted(shapes.nodes, key=shapes.levels.__getitem__),
            lambda at: (shapes.levels[at], shapes.nodes[at][0], at in shapes.last),
        ):
            rows = [[self.rows[at], *self._places(shapes.nodes[at][1])] for at in members]
            groups.append((shape, last, self._table(rows)))
        rates = []
        for shape, states in _grouped(range(len(shapes.rates)), lambda i: shapes.rates[i][0]):
            rows = [[i * self.width, *self._places(shapes.rates[i][1])] for i in states]
            rates.append((shape, OneNode(shape, order).rate_pieces(), self._table(rows)))
        for k in range(order + 1):
            for shape, last, table in groups:
                if k < order or order == 0 or last:
                    self._loop((shape, k), ["%S", *self._bases(shape)], self.pieces[shape].lines[k].copy, table)
            for shape, pieces, table in rates if k < order else ():
                self._loop((shape, k), ["%C", *self._bases(shape)], pieces.lines[k].copy, table)

    def _outputs(self) -> None:
        """Compute the rows of the outputs."""
        shapes, n = self.shapes, self.states
        for shape, members in _grouped(range(len(shapes.outputs)), lambda r: shapes.outputs[r][0]):
            rows = [[(n + r) * self.width, *self._places(shapes.outputs[r][1]), self.norms] for r in members]
            bases = ["%C", *self._bases(shape), "%C"]
            self._loop((shape, "row"), bases, OneNode(shape, self.order).output, self._table(rows))

    def _norms(self) -> None:
        """Start the numbers after the rows, which the outputs complete."""
        shapes, order = self.shapes, self.order
        for i, value in enumerate((0.0, 0.0, 0.0, 1e30)):
            self.calls += [
                f"  %norm{i} = getelementptr double, ptr %C, i64 {self.norms + i}",
                f"  store double {literal(value)}, ptr %norm{i}, align 8",
            ]
        for degree, members in _grouped(range(self.states), lambda i: shapes.degree(-1 - i)):
            rows = [[i * self.width, self.norms] for i in members]
            self._loop(("state", degree), ["%C", "%C"], partial(state_lines, degree, order), self._table(rows))

        def kind(at: int) -> tuple[str, bool, int, int]:
            name, whole = shapes.argument(at)
            return self.tape.nodes[at].op, name < 0, shapes.degree(name), order if whole else order - 1

        growing = [at for at, node in enumerate(self.tape.nodes) if node.op in GROWING]
        for found, members in _grouped(growing, kind):
            names = [shapes.argument(at)[0] for at in members]
            rows = [[self.norms + 3, -(1 + name) * self.width if name < 0 else self.rows[name]] for name in names]
            bases = ["%C", "%C" if found[1] else "%S"]
            self._loop(("step", found), bases, partial(bound_lines, *found), self._table(rows))


def _grouped(items: Iterable[T], key: Callable[[T], Key]) -> Iterator[tuple[Key, list[T]]]:
    """Group items by a key, in the order of the first occurrence of each key."""
    groups: dict[Key, list[T]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return iter(groups.items())


def _loop_ir(name: str, bases: Sequence[str], lines: list[str]) -> str:
    """Loop over the rows of a table: pointer i is entry i of the row, as an offset in doubles from base i."""
    pointers = []
    for i in sorted({int(found) for line in lines for found in _POINTER.findall(line)}):
        pointers += [
            f"  %e{i} = add i64 %row, {i}",
            f"  %f{i} = getelementptr i32, ptr %T, i64 %e{i}",
            f"  %g{i} = load i32, ptr %f{i}, align 4",
            f"  %h{i} = sext i32 %g{i} to i64",
            f"  %p{i} = getelementptr double, ptr {bases[i]}, i64 %h{i}",
        ]
    row = f"  %row = mul i64 %at, {len(bases)}"
    arguments = "ptr noalias %C, ptr noalias %S, ptr noalias %K, ptr noalias %T, i64 %count"
    return loop_function(name, f"{arguments}, {_TIMES}", [row, *pointers, *lines])


def _copy_ir(name: str) -> str:
    """Copy consecutive numbers to places ``%stride`` doubles apart."""
    lines = [
        "%place = mul i64 %at, %stride",
        "%source = getelementptr double, ptr %from, i64 %at",
        "%target = getelementptr double, ptr %to, i64 %place",
        "%value = load double, ptr %source, align 8",
        "store double %value, ptr %target, align 8",
    ]
    arguments = "ptr noalias %to, ptr noalias %from, i64 %count, i64 %stride"
    return loop_function(name, arguments, [f"  {line}" for line in lines])
