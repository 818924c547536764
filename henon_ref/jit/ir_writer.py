"""Writer of LLVM IR: instructions that skip structural zeros, independent of their application.

The optimiser may not fuse, reorder or approximate. Fused operations are explicit (``llvm.fma``) and sums keep their
written order, so the digits do not depend on the processor.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from henon_ref.kernel.library import kernel

LANES: int = kernel.LANES
"""Number of doubles in a vector."""
VECTOR = f"<{LANES} x double>"
"""Its type."""
PAIR = "{double, double}"
"""Type of two numbers."""
_INTRINSICS = ("sqrt", "fabs", "fma", "rint")

Value = str | None
"""LLVM value, or None for a structural zero."""
ZERO = "0x0000000000000000"
ONE = "0x3FF0000000000000"
MINUS = "0xBFF0000000000000"


def row_length(order: int) -> int:
    """Doubles from one row of coefficients to the next: whole vectors, of which the last may be used in part."""
    length: int = kernel.row_length(order)
    return length


def literal(value: float) -> str:
    """Exact double in LLVM's notation."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


def declarations() -> str:
    """LLVM declarations of the functions that generated code calls."""
    functions = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log")
    of_libm = "nobuiltin readnone nounwind"  # no vector library (SVML, say), whose last digits differ, may replace them
    lines = [f"declare double @{f}(double) {of_libm}" for f in functions]
    lines.append(f"declare double @pow(double, double) {of_libm}")
    lines += [f"declare double @llvm.{f}.f64(double)" for f in _INTRINSICS if f != "fma"]
    lines.append("declare double @llvm.fma.f64(double, double, double)")
    for n in (2, 4):
        kind = f"<{n} x double>"
        lines.append(f"declare {kind} @llvm.fma.v{n}f64({kind}, {kind}, {kind})")
        lines += [f"declare {kind} @llvm.{f}.v{n}f64({kind})" for f in ("sqrt", "fabs")]
    lines += ["declare i64 @llvm.ctpop.i64(i64)", "declare noalias ptr @malloc(i64)", "declare void @free(ptr)"]
    return "\n".join(lines) + "\n"


def loop_function(name: str, arguments: str, body: Sequence[str]) -> str:
    """LLVM IR of an internal function that executes ``body`` for ``%at`` from 0 to its ``i64 %count`` - 1."""
    return "\n".join(
        [
            f"define internal void @{name}({arguments}) noinline {{",
            "entry:",
            "  %none = icmp eq i64 %count, 0",
            "  br i1 %none, label %end, label %loop",
            "loop:",
            "  %at = phi i64 [ 0, %entry ], [ %next, %latch ]",
            *body,
            "  br label %latch",
            "latch:",
            "  %next = add i64 %at, 1",
            "  %more = icmp ult i64 %next, %count",
            "  br i1 %more, label %loop, label %end",
            "end:",
            "  ret void",
            "}",
            "",
        ]
    )


def count(ir: str) -> int:
    """Count floating-point operations in LLVM IR: each lane of a vector counts, a fused multiply-add counts twice."""
    total = 0
    for line in ir.splitlines():
        if re.search(r"\b(fadd|fsub|fmul|fdiv)\b|llvm\.fma", line) and not line.startswith("declare"):
            lanes = re.search(r"<(\d+) x double>", line)
            total += (2 if "llvm.fma" in line else 1) * (int(lanes[1]) if lanes else 1)
    return total


class IRWriter:
    """Writer of the instructions of one function; ``prefix``: of the names of values."""

    branches = True
    """Whether the code may branch."""

    def __init__(self, prefix: str = "v") -> None:
        self.lines: list[str] = []
        self._prefix, self._next = prefix, 0

    @cached_property
    def once(self) -> IRWriter:
        """This writer, but an instruction that ``once`` has already written is not repeated: its value is returned."""
        return _Once(self)

    def name(self) -> str:
        self._next += 1
        return f"{self._prefix}{self._next}"

    def emit(self, text: str) -> str:
        name = f"%{self.name()}"
        self.lines.append(f"  {name} = {text}")
        return name

    def binary(self, op: str, a: str, b: str) -> str:
        return self.emit(f"{op} double {a}, {b}")

    def mul(self, a: Value, b: Value) -> Value:
        if a is None or b is None:
            return None
        if a == ONE or b == ONE:
            return b if a == ONE else a
        return self.binary("fmul", a, b)

    def add(self, a: Value, b: Value) -> Value:
        if a is None or b is None:
            return a if b is None else b
        return self.binary("fadd", a, b)

    def fused(self, a: Value, b: Value, c: Value) -> Value:
        """a b + c, with one rounding."""
        if c is None or a is None or b is None:
            return c if a is None or b is None else self.mul(a, b)
        if ONE in (a, b):
            return self.add(c, b if a == ONE else a)
        if MINUS in (a, b):
            return self.sub(c, b if a == MINUS else a)
        return self.call("fma", a, b, c)

    def sub(self, a: Value, b: Value) -> Value:
        if b is None:
            return a
        return self.neg(b) if a is None else self.binary("fsub", a, b)

    def neg(self, a: Value) -> Value:
        return None if a is None else self.emit(f"fneg double {a}")

    def scaled(self, factor: float, a: Value) -> Value:
        return self.mul(literal(factor), a)

    def plus(self, a: str, b: str) -> str:
        return self.binary("fadd", a, b)

    def larger(self, a: str, b: str) -> str:
        """The larger of two non-negative numbers."""
        return self.emit(f"select i1 {self.emit(f'fcmp ogt double {a}, {b}')}, double {a}, double {b}")

    def smaller(self, a: str, b: str) -> str:
        return self.emit(f"select i1 {self.emit(f'fcmp olt double {a}, {b}')}, double {a}, double {b}")

    def paired(self, operation: Callable[[str, str], str], values: Sequence[str]) -> str:
        """Combine all values pairwise, as a binary tree; zero if there are none."""
        values = list(values)
        while len(values) > 1:
            pairs = [operation(values[i], values[i + 1]) for i in range(0, len(values) - 1, 2)]
            values = pairs + values[2 * len(pairs) :]
        return values[0] if values else ZERO

    def place(self, array: str, index: int) -> str:
        return self.emit(f"getelementptr double, ptr {array}, i64 {index}")

    def load(self, array: str, index: int, kind: str = "double") -> str:
        return self.emit(f"load {kind}, ptr {self.place(array, index)}, align 8")

    def store(self, value: str, array: str, index: int, kind: str = "double") -> None:
        self.lines.append(f"  store {kind} {value}, ptr {self.place(array, index)}, align 8")

    def call(self, name: str, *args: str) -> str:
        target = f"@llvm.{name}.f64" if name in _INTRINSICS else f"@{name}"
        return self.emit(f"call double {target}({', '.join(f'double {a}' for a in args)})")

    # -- vectors ----------------------------------------------------------------------------------------

    def vector(self, values: Sequence[str]) -> str:
        kind = f"<{len(values)} x double>"
        if all(v.startswith("0x") for v in values):
            return f"<{', '.join(f'double {v}' for v in values)}>"
        result = "poison"
        for at, value in enumerate(values):
            result = self.emit(f"insertelement {kind} {result}, double {value}, i64 {at}")
        return result

    def lanewise(self, op: str, lanes: int, a: str, b: str) -> str:
        return self.emit(f"{op} <{lanes} x double> {a}, {b}")

    def lanewise_fused(self, lanes: int, a: str, b: str, c: str) -> str:
        kind = f"<{lanes} x double>"
        return self.emit(f"call {kind} @llvm.fma.v{lanes}f64({kind} {a}, {kind} {b}, {kind} {c})")

    def shuffled(self, lanes: int, a: str, order: Sequence[int]) -> str:
        kind = f"<{lanes} x double>"
        mask = ", ".join(f"i32 {i}" for i in order)
        return self.emit(f"shufflevector {kind} {a}, {kind} poison, <{len(order)} x i32> <{mask}>")

    def lane(self, lanes: int, a: str, at: int) -> str:
        return self.emit(f"extractelement <{lanes} x double> {a}, i64 {at}")

    def transposed(self, rows: Sequence[str]) -> list[str]:
        """Columns of a square matrix of vectors."""

        def mixed(a: str, b: str, lanes: str) -> str:
            mask = ", ".join(f"i32 {i}" for i in lanes)
            return self.emit(f"shufflevector {VECTOR} {a}, {VECTOR} {b}, <{LANES} x i32> <{mask}>")

        (a, b), (c, d) = ([mixed(x, y, "0426"), mixed(x, y, "1537")] for x, y in (rows[:2], rows[2:]))
        return [mixed(a, c, "0145"), mixed(b, d, "0145"), mixed(a, c, "2367"), mixed(b, d, "2367")]

    def across(self, lanes: int, a: str) -> str:
        """Sum of a vector's lanes: the upper half is added to the lower half until one lane is left."""
        while lanes > 1:
            half = lanes // 2
            low, high = (self.shuffled(lanes, a, range(first, first + half)) for first in (0, half))
            a, lanes = self.lanewise("fadd", half, low, high), half
        return self.lane(1, a, 0)

    # -- sums -------------------------------------------------------------------------------------------

    def total_lanewise(self, lanes: int, pairs: Sequence[tuple[str, str]]) -> str:
        """Sum of products of vectors, in two chains."""

        def fused(a: str, b: str, c: Value) -> str:
            return self.lanewise("fmul", lanes, a, b) if c is None else self.lanewise_fused(lanes, a, b, c)

        first, second = _chained(pairs, fused)
        return self.lanewise("fadd", lanes, first or "", second) if second else first or ""

    def total(self, old: Sequence[tuple[Value, Value]], new: Sequence[tuple[Value, Value]] = ()) -> Value:
        """Sum of products: the ``old`` products in two chains, then each ``new`` product by one fused operation.

        A coefficient depends on the newest coefficients of its arguments. Their products are added last, to a sum
        computed before, so each operation adds only one instruction to the critical path from order to order.
        """
        chains = _chained([(a, b) for a, b in old if a is not None and b is not None], self.fused)
        total = self.add(chains[1], chains[0])
        for first, second in new:
            total = self.fused(first, second, total)
        return total


class _Once(IRWriter):
    def __init__(self, w: IRWriter) -> None:
        self._w, self.lines = w, w.lines
        self._known: dict[str, str] = {}

    def emit(self, text: str) -> str:
        if text not in self._known:
            self._known[text] = self._w.emit(text)
        return self._known[text]


class NumberWriter(IRWriter):
    """Writer of code without branches whose vectors are lists of numbers (for :func:`henon_ref.jit.lanes.in_lanes`).

    Each place in an array is a vector.
    """

    branches = False

    @cached_property
    def once(self) -> IRWriter:
        return _NumbersOnce(self)

    def load(self, array: str, index: int, kind: str = "double") -> Any:
        if kind == VECTOR:
            return [self.load(array, i) for i in range(index, index + LANES)]
        return super().load(array, LANES * index)

    def store(self, value: Any, array: str, index: int, kind: str = "double") -> None:
        if kind == VECTOR:
            for i, one in enumerate(value):
                self.store(one, array, index + i)
        else:
            super().store(value, array, LANES * index)

    def vector(self, values: Sequence[str]) -> Any:
        return list(values)

    def lanewise(self, op: str, lanes: int, a: Any, b: Any) -> Any:
        return [self.binary(op, x, y) for x, y in zip(a, b, strict=True)]

    def lanewise_fused(self, lanes: int, a: Any, b: Any, c: Any) -> Any:
        return [self.call("fma", *each) for each in zip(a, b, c, strict=True)]

    def shuffled(self, lanes: int, a: Any, order: Sequence[int]) -> Any:
        return [a[i] for i in order]

    def lane(self, lanes: int, a: Any, at: int) -> str:
        return str(a[at])


class _NumbersOnce(_Once, NumberWriter):
    pass


def _chained(pairs: Sequence[tuple[str, str]], fused: Callable[[str, str, Value], Value]) -> tuple[Value, Value]:
    """Sums of products in two independent chains; a single chain if there are few."""
    chains: list[Value] = [None, None]
    for at, (a, b) in enumerate(pairs):
        which = at % 2 if len(pairs) > 3 else 0
        chains[which] = fused(a, b, chains[which])
    return chains[0], chains[1]
