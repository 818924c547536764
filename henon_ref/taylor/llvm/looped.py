"""Machine code for the Taylor coefficients of a long tape: loops over nodes whose recurrences have the same shape.

A tape of thousands of operations has few kinds of them. As in heyoka's compact mode (Biscani and Izzo, *MNRAS* 504,
2021, Sec. 2.4) there is one function per shape and order. It loops over all nodes of the shape by a table of the places
that they read, so that compilation time does not grow with their number. The functions are written by the recurrences
of the straight-line code (:mod:`henon_ref.taylor.llvm.expansion`) for one node, cut into pieces
(:mod:`henon_ref.taylor.llvm.one_node`), and compute the same bits, except in the third norm: of this sum, only whether
it is finite is used, so that the order of its terms is free.

Each pass of a loop computes several nodes, one in each lane of vectors (:mod:`henon_ref.jit.lanes`). For this, all
series are columns of one matrix ``S`` (row k: coefficient k), in which those of one shape are neighbours. ``S`` is
allocated for the call and also holds the sums of constants that are used as factors, each once. At the end the columns
of states and outputs are copied to the rows of ``C``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import partial

from henon_ref.grouping import grouped
from henon_ref.jit.ir_writer import LANES, IRWriter, literal, loop_function, row_length
from henon_ref.jit.lanes import arrangement, can_be_in_lanes, in_lanes, splat
from henon_ref.taylor.llvm.one_node import OneNode, bound_lines, copy_lines, row_lines, state_lines, total_lines
from henon_ref.taylor.llvm.shapes import Factors, Shapes
from henon_ref.taylor.llvm.step import GROWING, before_falls
from henon_ref.taylor.tape import Tape

Pointers = Sequence[tuple[str, str]]
"""Name of the pointer of each entry of a table's row, and the array into which it points."""
Arranged = tuple[str, ...]
"""Where the numbers of the lanes are (:func:`henon_ref.jit.lanes.arrangement`); empty if a pass is for one series."""
_POINTER = re.compile(r"%p\d+")
_TIMES = "double %unit, double %t_hi, double %t_lo"


def looped_expansion_ir(tape: Tape, states: int, order: int, name: str, width: int | None = None) -> str:
    """LLVM IR as :func:`henon_ref.taylor.llvm.expansion.expansion_ir`, with loops."""
    return _LoopedExpansion(tape, states, order, name, row_length(order) if width is None else width).text()


class _LoopedExpansion:
    """Writer of the code. The series of a node has its number, that of state i is -1 - i, and outputs follow the nodes.

    Arrays: ``S`` and ``C`` (see above); ``K``, constants; ``N``, four numbers after the rows, in lanes.
    """

    def __init__(self, tape: Tape, states: int, order: int, name: str, width: int) -> None:
        self.tape, self.order, self.name, self.width = tape, order, name, width
        self.shapes = shapes = Shapes(tape, order)
        self.states = range(-1, -1 - states, -1)
        outputs = range(len(tape.nodes), len(tape.nodes) + len(tape.outputs))
        self.rows = [*self.states, *outputs]
        """Series in the rows of ``C``."""
        self.found = {
            **shapes.nodes,
            **dict(zip(self.states, shapes.rates, strict=False)),
            **dict(zip(outputs, shapes.outputs, strict=True)),
        }
        """Shape and operands of each series."""
        self.functions: dict[Hashable, str] = {}
        self.globals: list[str] = []
        self.calls: list[str] = []
        levels, last = shapes.levels, shapes.last
        nodes = sorted(shapes.nodes, key=levels.__getitem__)
        self.nodes = [*grouped(nodes, lambda at: (levels[at], shapes.nodes[at][0], at in last)).values()]
        self.rates = [*grouped(self.states[: len(shapes.rates)], lambda at: self.found[at][0]).values()]
        self.outputs = [*grouped(outputs, lambda at: self.found[at][0]).values()]
        self.columns: dict[int, int] = {}
        """Column of ``S`` of each series; first those in the rows of ``C``."""
        for group in (self.states[len(shapes.rates) :], *self.rates, *self.outputs):
            self.columns |= {at: len(self.columns) + i for i, at in enumerate(group)}
        for group in self.nodes:  # in the order of what they read, so that neighbours read neighbours
            group.sort(key=lambda at: [self.columns.get(each, 0) for each in self.found[at][1].series])
            self.columns |= {at: len(self.columns) + i for i, at in enumerate(group)}
        self.stride = max(len(self.columns), LANES)
        """Distance from one row of ``S`` to the next, in doubles."""
        if self.stride % 8 == 0:
            self.stride += 4  # otherwise the numbers of a column are in few sets of the cache
        found = {shape for shape, _ in self.found.values()}
        self.pieces = {shape: OneNode(shape, order, self.stride).pieces() for shape in found}
        self.straight = {shape: [*map(can_be_in_lanes, lines)] for shape, (lines, _) in self.pieces.items()}
        """Whether the code of a piece can be in lanes."""
        self.memory = self.stride * max([1, *(room for _, room in self.pieces.values())])
        """Number of doubles of ``S`` allocated so far."""
        self.totals: dict[Factors, int] = {}
        """Place in ``S`` of each sum of constants."""
        self.passes: dict[tuple[int, bool], dict[Arranged, str]] = {}
        """Results of :meth:`_passes`, by the first series of the group and whether lanes are used."""

    def text(self) -> str:
        self._constants()
        rows = [(self.columns[at], i) for i, at in enumerate(self.states)]
        self._loop("start", _pointers("SC"), copy_lines, self._table(rows), states="%x")
        self._orders()
        for group in self.outputs:
            self._piece(group, 0)
        self._rows()
        if self.order >= 3:
            self._norms()
        body = "\n".join(self.calls)
        return (
            "\n".join(self.globals)
            + f"\ndefine void @{self.name}(double %t_hi, double %t_lo, double %unit, ptr noalias %x, ptr noalias %K, "
            f"ptr noalias %C) {{\nentry:\n  %N = alloca [{4 * LANES} x double], align 32\n"
            f"  store [{4 * LANES} x double] zeroinitializer, ptr %N, align 32\n"
            f"  %S = call noalias ptr @malloc(i64 {8 * self.memory})\n"
            f"{body}\n  call void @free(ptr %S)\n  ret void\n}}\n"
        )

    def _loop(
        self, key: Hashable, pointers: Pointers, lines: Callable[[], Iterable[str]], table: str, states: str = "%C"
    ) -> None:
        """Add a call of a loop over a table, and write its function if there is none; ``states`` is passed as %C."""
        if key not in self.functions:
            self.functions[key] = f"{self.name}.{len(self.functions)}"
            self.globals.append(_loop_ir(self.functions[key], pointers, list(lines())))
        arrays = f"ptr {states}, ptr %S, ptr %K, ptr %N"
        self.calls.append(f"  call void @{self.functions[key]}({arrays}, {table}, {_TIMES})")

    def _table(self, rows: Sequence[Sequence[int]]) -> str:
        """Add a table of places as a constant of the module; return it and its length as arguments of a loop."""
        name = f"{self.name}.table{len(self.globals)}"
        numbers = ", ".join(f"i64 {place}" for row in rows for place in row)
        self.globals.append(f"@{name} = private constant [{sum(map(len, rows))} x i64] [{numbers}]")
        return f"ptr @{name}, i64 {len(rows)}"

    def _constants(self) -> None:
        """Compute all sums of constants, each once; those that a group reads as one operand are neighbours."""
        for group in (*self.nodes, *self.rates, *self.outputs):
            for found in zip(*(self.found[at][1].constants for at in group), strict=True):
                for factors in found:
                    if factors not in self.totals:
                        self.totals[factors] = self.memory
                        self.memory += 1
        signs = {factors: tuple((f.sign, len(f.constants)) for f in factors) for factors in self.totals}
        for kind, members in grouped(self.totals, signs.__getitem__).items():
            rows = [[self.totals[each], *(i for f in each for i in f.constants)] for each in members]
            pointers = _pointers("S" + "K" * (len(rows[0]) - 1))
            self._loop(("total", kind), pointers, partial(total_lines, kind), self._table(rows))

    def _orders(self) -> None:
        """Compute the coefficients of all nodes and the next ones of the states, order by order."""
        for k in range(self.order + 1):
            for group in self.nodes:
                if k < self.order or self.order == 0 or group[0] in self.shapes.last:
                    self._piece(group, k)
            for group in self.rates if k < self.order else ():
                self._piece(group, k)

    def _piece(self, group: Sequence[int], k: int) -> None:
        shape, _ = self.found[group[0]]
        self._for_all(group, k, self.pieces[shape][0][k], self.straight[shape][k])

    def _for_all(self, group: Sequence[int], key: Hashable, lines: list[str], straight: bool) -> None:
        """Call the code of one series, ``lines``, for all series of a group; in lanes if it is ``straight``."""
        for arranged, table in self._passes(group, straight).items() if lines else ():
            pointers = _pointers("S" * (1 + sum(map(len, self.found[group[0]][1]))))
            write = partial(_in_lanes, lines, arranged) if arranged else lines.copy
            self._loop((self.found[group[0]][0], key, arranged), pointers, write, table)

    def _passes(self, group: Sequence[int], straight: bool) -> dict[Arranged, str]:
        """Tables of the passes over a group, by the arrangement of the operands in the lanes.

        The last pass repeats series if necessary; where the operands of neighbours are apart, a pass is for one series.
        """
        key = group[0], straight
        if key not in self.passes:
            rows: dict[Arranged, list[list[int]]] = {}
            for first in range(0, len(group), LANES):
                now = [self._places(at) for at in group[max(min(first, len(group) - LANES), 0) :][:LANES]]
                arranged = arrangement(now) if straight and len(now) == LANES else ()
                found = now[:1] if arranged else map(self._places, group[first : first + LANES])
                rows.setdefault(arranged, []).extend(found)
            self.passes[key] = {arranged: self._table(found) for arranged, found in rows.items()}
        return self.passes[key]

    def _places(self, at: int) -> list[int]:
        """Places of a series, of its operands and constants in ``S``."""
        series, constants = self.found[at][1]
        return [*(self.columns[each] for each in (at, *series)), *(self.totals[each] for each in constants)]

    def _rows(self) -> None:
        """Copy the columns of states and outputs to the rows of ``C``."""
        found = sorted((self.columns[at], i * self.width) for i, at in enumerate(self.rows))
        table = []
        for first in range(0, len(found), LANES):
            now = found[max(min(first, len(found) - LANES), 0) :][:LANES]
            table.append([now[0][0], *(row for _, row in now), *[now[0][1]] * (LANES - len(now))])
        self._loop(
            "rows", _pointers("S" + "C" * LANES), partial(row_lines, self.order, self.stride), self._table(table)
        )

    def _norms(self) -> None:
        """Compute the numbers after the rows: largest last and last but one coefficient, sum of all, longest step."""
        shapes, order, stride = self.shapes, self.order, self.stride
        for group in self.rates:
            self._for_all(group, "norms", state_lines(order, stride), straight=True)
        norms = len(self.rows) * self.width
        w = IRWriter()
        for i in range(4):
            parts = [w.load("%N", LANES * i + lane) for lane in range(LANES)]
            total = w.paired(w.plus if i == 2 else w.larger, parts)
            w.store(w.smaller(before_falls(w, total), literal(1e30)) if i == 3 else total, "%C", norms + i)
        self.calls += w.lines

        def kind(at: int) -> tuple[str, int, int, int]:
            name, whole = shapes.argument(at)
            return self.tape.nodes[at].op, stride, shapes.degree(name), order if whole else order - 1

        growing = [at for at, node in enumerate(self.tape.nodes) if node.op in GROWING]
        for found, members in grouped(growing, kind).items():
            rows = [[norms + 3, self.columns[shapes.argument(at)[0]]] for at in members]
            self._loop(("step", found), _pointers("CS"), partial(bound_lines, *found), self._table(rows))


def _in_lanes(lines: Iterable[str], arranged: Arranged) -> list[str]:
    return [*splat("%unit.lanes", "%unit"), *in_lanes(lines, arranged)]


def _pointers(arrays: str) -> Pointers:
    return [(f"%p{i}", f"%{array}") for i, array in enumerate(arrays)]


def _loop_ir(name: str, pointers: Pointers, lines: list[str]) -> str:
    """Loop over the rows of a table: each entry is the offset of a pointer, in doubles, from the start of its array."""
    used = {found for line in lines for found in _POINTER.findall(line)}
    row = [f"  %from = mul i64 %at, {len(pointers)}", "  %row = getelementptr i64, ptr %T, i64 %from"]
    for i, (pointer, array) in enumerate(pointers):
        if pointer in used:
            row += [
                f"  %entry{i} = getelementptr i64, ptr %row, i64 {i}",
                f"  %offset{i} = load i64, ptr %entry{i}, align 8",
                f"  {pointer} = getelementptr double, ptr {array}, i64 %offset{i}",
            ]
    arguments = "ptr noalias %C, ptr noalias %S, ptr noalias %K, ptr noalias %N, ptr noalias %T, i64 %count"
    return loop_function(name, f"{arguments}, {_TIMES}", [*row, *lines])
