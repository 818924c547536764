"""Machine code for the Taylor coefficients of a long tape: loops over nodes whose recurrences have the same shape.

A tape of thousands of operations has few kinds of them. As in heyoka's compact mode (Biscani and Izzo, *MNRAS* 504,
2021, Sec. 2.4) there is one function per shape and order. It loops over all nodes of the shape by a table of the places
that they read, so that compilation time does not grow with their number. The functions are written by the recurrences
of the straight-line code (:mod:`henon_ref.taylor.llvm.expansion`) for one node, cut into pieces
(:mod:`henon_ref.taylor.llvm.one_node`), and compute the same bits.

Series of states are in the rows of ``C``. Series of nodes are in memory ``S`` that is allocated for the call, which
also holds the sums of constants that are used as factors, each once, and the numbers for the choice of the step size.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
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
        self.rows: dict[int, int] = {}
        """Place in ``S`` of the row of each node."""

    def text(self) -> str:
        self._constants()
        self._node_rows()
        self._orders()
        if self.order >= 3:
            self._norms()
        else:
            self._outputs({})
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
            self._loop(("total", kind), bases, lambda kind=kind: total_lines(kind), self._table(rows))  # type: ignore[misc]

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
                    lines = self.pieces[shape].lines[k]
                    self._loop((shape, k), ["%S", *self._bases(shape)], lines.copy, table)
            for shape, pieces, table in rates if k < order else ():
                self._loop((shape, k), ["%C", *self._bases(shape)], pieces.lines[k].copy, table)

    def _outputs(self, ratios: dict[int, list[int]]) -> None:
        """Compute the rows of the outputs; ``ratios``: places of each row's ratios."""
        shapes, n = self.shapes, self.states
        for shape, members in _grouped(range(len(shapes.outputs)), lambda r: shapes.outputs[r][0]):
            rows = [
                [(n + r) * self.width, *self._places(shapes.outputs[r][1]), *ratios.get(n + r, ())] for r in members
            ]
            bases = ["%C", *self._bases(shape), "%S", "%S"]
            made = OneNode(shape, self.order)
            self._loop((shape, "row"), bases[: len(rows[0])], lambda made=made: made.output(), self._table(rows))  # type: ignore[misc]

    def _norms(self) -> None:
        """Compute the rows of the outputs, and the numbers after the rows."""
        shapes, order, n = self.shapes, self.order, self.states
        degrees = [*(shapes.degree(-1 - i) for i in range(n)), *(shape.degree for shape, _ in shapes.outputs)]
        counts = [sum(degree >= k for degree in degrees) for k in (order - 1, order)]
        places = [self._taken(count) for count in counts]
        free, ratios = list(places), {}
        for row, degree in enumerate(degrees):
            ratios[row] = [free[i] for i, k in enumerate((order - 1, order)) if degree >= k]
            free = [place + (degree >= k) for place, k in zip(free, (order - 1, order), strict=True)]
        for degree, members in _grouped(range(n), degrees.__getitem__):
            rows = [[i * self.width, *ratios[i]] for i in members]
            bases = ["%C", "%S", "%S"][: len(rows[0])]
            self._loop(("state", degree), bases, lambda d=degree: state_lines(d, order), self._table(rows))  # type: ignore[misc]
        self._outputs(ratios)
        steps = self._longest_step()
        both = self._taken(sum(counts))
        first, name, total = (n + len(shapes.outputs)) * self.width, self.name, sum(counts)
        larger = "%greater = fcmp ogt double %a, %b\n  %c = select i1 %greater, double %a, double %b"
        self.globals.append(_PAIRED.format(name=f"{name}.largest", operation=larger))
        self.globals.append(_PAIRED.format(name=f"{name}.total", operation="%c = fadd double %a, %b"))
        at = "  %{0} = getelementptr double, ptr %{1}, i64 {2}"
        self.calls += [
            *(at.format(*each) for each in (("before", "S", places[0]), ("last", "S", places[1]), ("both", "S", both))),
            f"  call void @{name}.copy(ptr %both, ptr %before, i64 {total}, i64 1)",
            f"  %norm0 = call double @{name}.largest(ptr %last, i64 {counts[1]})",
            f"  %norm1 = call double @{name}.largest(ptr %before, i64 {counts[0]})",
            f"  %norm2 = call double @{name}.total(ptr %both, i64 {total})",
            at.format("steps", "S", steps),
            "  %norm3 = load double, ptr %steps, align 8",
        ]
        for i in range(4):
            self.calls += [at.format(f"out{i}", "C", first + i), f"  store double %norm{i}, ptr %out{i}, align 8"]

    def _longest_step(self) -> int:
        """Compute the longest step that the exponentials allow; return its place in ``S``."""
        shapes, order, place = self.shapes, self.order, self._taken(1)
        self.calls += [
            f"  %step = getelementptr double, ptr %S, i64 {place}",
            f"  store double {literal(1e30)}, ptr %step, align 8",
        ]

        def kind(at: int) -> tuple[str, bool, int, int]:
            name, whole = shapes.argument(at)
            return self.tape.nodes[at].op, name < 0, shapes.degree(name), order if whole else order - 1

        growing = [at for at, node in enumerate(self.tape.nodes) if node.op in GROWING]
        for found, members in _grouped(growing, kind):
            names = [shapes.argument(at)[0] for at in members]
            rows = [[place, -(1 + name) * self.width if name < 0 else self.rows[name]] for name in names]
            bases = ["%S", "%C" if found[1] else "%S"]
            self._loop(("step", found), bases, lambda found=found: bound_lines(*found), self._table(rows))  # type: ignore[misc]
        return place


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


_PAIRED = """
define internal double @{name}(ptr noalias %values, i64 %count) noinline {{
entry:
  %none = icmp eq i64 %count, 0
  br i1 %none, label %nothing, label %round
round:
  %left = phi i64 [ %count, %entry ], [ %fewer, %odd ]
  %one = icmp eq i64 %left, 1
  br i1 %one, label %done, label %begin
begin:
  %half = lshr i64 %left, 1
  br label %pair
pair:
  %at = phi i64 [ 0, %begin ], [ %next, %pair ]
  %first = shl i64 %at, 1
  %second = add i64 %first, 1
  %p = getelementptr double, ptr %values, i64 %first
  %q = getelementptr double, ptr %values, i64 %second
  %a = load double, ptr %p, align 8
  %b = load double, ptr %q, align 8
  {operation}
  %r = getelementptr double, ptr %values, i64 %at
  store double %c, ptr %r, align 8
  %next = add i64 %at, 1
  %more = icmp ult i64 %next, %half
  br i1 %more, label %pair, label %odd
odd:
  %rest = and i64 %left, 1
  %fewer = add i64 %half, %rest
  %end = sub i64 %left, 1
  %s = getelementptr double, ptr %values, i64 %end
  %u = getelementptr double, ptr %values, i64 %half
  %v = load double, ptr %s, align 8
  store double %v, ptr %u, align 8
  br label %round
done:
  %result = load double, ptr %values, align 8
  ret double %result
nothing:
  ret double 0.0
}}
"""
"""Reduction of all numbers in pairs of pairs (:meth:`henon_ref.jit.ir_writer.IRWriter.paired`)."""
