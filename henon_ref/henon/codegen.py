"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR: every coefficient is one value, structural
zeros (a constant's derivatives, a clock's beyond the first) never become instructions, squares are halved.
Time is measured in units of ``sigma``, about the size of a step, so that coefficients neither overflow nor
vanish whatever the units of the model.
"""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.taylor.tape import Node, Tape

LIBM = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt", "pow")
_FAST = "contract nsz arcp"
"""Fused multiply-adds are welcome; the order of a sum stays as written (newest coefficients come last)."""

Value = str | None
"""An LLVM value, or None for a structural zero."""


class _Writer:
    """Emits instructions; knows zeros and ones."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._next = 0

    def emit(self, text: str) -> str:
        name = f"%v{self._next}"
        self._next += 1
        self.lines.append(f"  {name} = {text}")
        return name

    def binary(self, op: str, a: str, b: str) -> str:
        return self.emit(f"{op} {_FAST} double {a}, {b}")

    def exact(self, op: str, a: str, b: str) -> str:
        """Without any licence to the optimiser: for double-double arithmetic."""
        return self.emit(f"{op} double {a}, {b}")

    def mul(self, a: Value, b: Value) -> Value:
        if a is None or b is None:
            return None
        return self.binary("fmul", a, b)

    def add(self, a: Value, b: Value) -> Value:
        if a is None or b is None:
            return a if b is None else b
        return self.binary("fadd", a, b)

    def sub(self, a: Value, b: Value) -> Value:
        if b is None:
            return a
        return self.neg(b) if a is None else self.binary("fsub", a, b)

    def neg(self, a: Value) -> Value:
        return None if a is None else self.emit(f"fneg {_FAST} double {a}")

    def scaled(self, factor: float, a: Value) -> Value:
        if a is None or factor == 1.0:
            return a
        return self.binary("fmul", _literal(factor), a)

    def call(self, name: str, *args: str) -> str:
        target = f"@llvm.{name}.f64" if name in ("sqrt", "fabs", "fma") else f"@{name}"
        return self.emit(f"call double {target}({', '.join(f'double {a}' for a in args)})")

    def total(self, products: Sequence[tuple[Value, Value]], start: Value = None) -> Value:
        """``start`` + sum of products, in two interleaved chains; the pairs in order of urgency, latest last."""
        pairs = [(a, b) for a, b in products if a is not None and b is not None]
        chains: list[Value] = [start, None]
        for at, (a, b) in enumerate(pairs):
            which = (at + len(pairs)) % 2 if len(pairs) > 3 else 0
            chains[which] = self.add(chains[which], self.mul(a, b))
        return self.add(chains[1], chains[0])


def _literal(value: float) -> str:
    import struct

    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


def expansion_ir(tape: Tape, states: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double sigma, double* x, double* K, double* C)``.

    ``K`` holds the constants rounded to double, then what that rounding lost. ``C`` receives the Taylor
    coefficients in units of sigma: ``order + 1`` a state, then ``order + 1`` an output (row-major).

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
    w = _Writer()
    constants: dict[tuple[int, bool], str] = {}

    def constant(index: int, low: bool = False) -> str:
        key = (index, low)
        if key not in constants:
            at = index + (len(tape.constants) if low else 0)
            pointer = w.emit(f"getelementptr double, ptr %K, i64 {at}")
            constants[key] = w.emit(f"load double, ptr {pointer}")
        return constants[key]

    for node in tape.nodes:
        for index in node.constants:
            constant(index)
            if node.op == "clock":
                constant(index, low=True)
    rates = [w.scaled(1.0 / (k + 1), "%sigma") for k in range(order)]
    solution: list[list[Value]] = []
    for i in range(states):
        pointer = w.emit(f"getelementptr double, ptr %x, i64 {i}")
        solution.append([w.emit(f"load double, ptr {pointer}")])
    expander = _Expander(w, tape, constant, solution)
    for k in range(order + 1):
        last = k == order and order > 0
        for at, node in enumerate(tape.nodes):
            if not last or at in expander.needed_last:
                expander.append(at, node, k)
            else:
                expander.series[at].append(None)
        if k < order:
            for target, source in zip(solution, tape.field, strict=True):
                target.append(w.mul(rates[k], expander.series[source][k]))
    rows = [*solution, *(expander.series[i] for i in tape.outputs)]
    for r, row in enumerate(rows):
        for k in range(order + 1):
            pointer = w.emit(f"getelementptr double, ptr %C, i64 {r * (order + 1) + k}")
            w.lines.append(f"  store double {row[k] or _literal(0.0)}, ptr {pointer}")
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %sigma, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


def declarations() -> str:
    """LLVM declarations of the mathematical functions the expansions call."""
    lines = [f"declare double @{f}(double) readnone nounwind" for f in LIBM if f not in ("sqrt", "pow")]
    lines.append("declare double @pow(double, double) readnone nounwind")
    lines += ["declare double @llvm.sqrt.f64(double)", "declare double @llvm.fabs.f64(double)"]
    lines.append("declare double @llvm.fma.f64(double, double, double)")
    return "\n".join(lines) + "\n"


class _Expander:
    """The recurrences of every operation, writing code instead of computing."""

    def __init__(self, w: _Writer, tape: Tape, constant, solution: list[list[Value]]) -> None:  # type: ignore[no-untyped-def]
        self.w = w
        self.tape = tape
        self.constant = constant
        self.solution = solution
        self.series: list[list[Value]] = [[] for _ in tape.nodes]
        self.low: dict[int, str] = {}
        self.inverse: dict[int, str] = {}
        self.weighted: dict[tuple[int, int], Value] = {}
        self.calls: dict[tuple[str, str], str] = {}
        self.needed_last = _ancestors(tape, tape.outputs)

    def append(self, at: int, node: Node, k: int) -> None:
        self.series[at].append(self._value(at, node, k))

    def _value(self, at: int, node: Node, k: int) -> Value:
        w, op = self.w, node.op
        if op == "state":
            return self.solution[node.args[0]][k]
        if op == "constant":
            return self.constant(node.constants[0]) if k == 0 else None
        if op == "clock":
            return self._clock(at, node, k)
        y = self.series[at]
        a = self.series[node.args[0]]
        c = [self.constant(i) for i in node.constants]
        if op in ("add", "sub", "mul", "div"):
            return self._binary(op, node, y, a, k)
        if op == "square":
            half = w.total([(a[j], a[k - j]) for j in _late_last((k - 1) // 2 + 1)])
            double = w.add(half, half)
            return double if k % 2 else w.add(double, w.mul(a[k // 2], a[k // 2]))
        if op == "scale":
            return w.mul(c[0], a[k])
        if op == "shift":
            return w.add(a[k], c[0]) if k == 0 else a[k]
        if op == "rsub":
            return w.sub(c[0], a[k]) if k == 0 else w.neg(a[k])
        if op == "recip":
            if k == 0:
                return w.mul(c[0], self._inverse(node.args[0]))
            rest = w.total([(y[j], a[k - j]) for j in range(1, k)] + ([(y[0], a[k])] if k else []))
            return w.neg(w.mul(rest, self._inverse(node.args[0])))
        return self._transcendental(node, y, a, k, c)

    def _binary(self, op: str, node: Node, y: list[Value], a: list[Value], k: int) -> Value:
        w, b = self.w, self.series[node.args[1]]
        if op == "add":
            return w.add(a[k], b[k])
        if op == "sub":
            return w.sub(a[k], b[k])
        if op == "mul":
            ends = [(a[0], b[k])] + ([(a[k], b[0])] if k else [])
            return w.total([(a[j], b[k - j]) for j in range(1, k)] + ends)
        rest = w.total([(y[j], b[k - j]) for j in range(k)])
        return w.mul(w.sub(a[k], rest), self._inverse(node.args[1]))

    def _inverse(self, node: int) -> str:
        """1 / (order-zero value), made once: a division costs more than all the products of an order."""
        if node not in self.inverse:
            value = self.series[node][0] or _literal(0.0)
            self.inverse[node] = self.w.exact("fdiv", _literal(1.0), value)
        return self.inverse[node]

    def _clock(self, at: int, node: Node, k: int) -> Value:
        """c0 + c1 t in double-double, so that a phase loses nothing at large times."""
        w = self.w
        c0, c1 = node.constants
        if k == 1:
            return w.mul(self.constant(c1), "%sigma")
        if k > 1:
            return None
        slope = self.constant(c1)
        product = w.exact("fmul", slope, "%t_hi")
        negative = w.emit(f"fneg double {product}")
        error = w.call("fma", slope, "%t_hi", negative)
        error = w.exact("fadd", error, w.exact("fmul", self.constant(c1, low=True), "%t_hi"))
        error = w.exact("fadd", error, w.exact("fmul", slope, "%t_lo"))
        shift = self.constant(c0)
        total = w.exact("fadd", product, shift)  # two-sum
        part = w.exact("fsub", total, product)
        lost = w.exact(
            "fadd",
            w.exact("fsub", product, w.exact("fsub", total, part)),
            w.exact("fsub", shift, part),
        )
        low = w.exact("fadd", w.exact("fadd", error, lost), self.constant(c0, low=True))
        value = w.exact("fadd", total, low)
        self.low[at] = w.exact("fsub", low, w.exact("fsub", value, total))
        return value

    def _transcendental(self, node: Node, y: list[Value], a: list[Value], k: int, c: list[str]) -> Value:
        w, op = self.w, node.op
        if k == 0:
            return self._start(node, a, c)
        if op == "sqrt":
            inner = w.total([(y[j], y[k - j]) for j in range(1, (k - 1) // 2 + 1)])
            inner = w.add(inner, inner)
            if k % 2 == 0:
                inner = w.add(inner, w.mul(y[k // 2], y[k // 2]))
            return w.mul(w.scaled(0.5, w.sub(a[k], inner)), self._inverse_of(y[0]))
        if op == "power":
            terms = []
            for j in range(1, k + 1):
                if a[j] is None or y[k - j] is None:
                    continue
                weight = w.sub(w.scaled(float(j), c[0]), _literal(float(k - j)))
                terms.append((w.mul(weight, a[j]), y[k - j]))
            return w.scaled(1.0 / k, w.mul(w.total(terms), self._inverse(node.args[0])))
        if op in ("exp", "sin", "cos", "sinh", "cosh", "tan", "tanh"):
            q = y if op == "exp" else self.series[node.args[1]]
            terms = [(self._weighted(node.args[0], j), q[k - j]) for j in range(1, k + 1)]
            value = w.scaled(1.0 / k, w.total(terms))
            return w.neg(value) if op == "cos" else value
        # log, atan, asin, acos: y' q = a'
        at = node.args[0] if op == "log" else node.args[1]
        q = self.series[at]
        total: Value = None
        for j in range(1, k):
            total = w.add(total, w.scaled(float(j), w.mul(y[j], q[k - j])))
        rest = w.neg(a[k]) if op == "acos" else a[k]
        return w.mul(w.sub(rest, w.scaled(1.0 / k, total)), self._inverse(at))

    def _start(self, node: Node, a: list[Value], c: list[str]) -> Value:
        w, op = self.w, node.op
        argument = a[0] or _literal(0.0)
        if op == "power":
            return w.call("pow", argument, c[0])
        value = self._called(op, argument)
        if op in ("sin", "cos") and node.args[0] in self.low:
            partner = self._called("cos" if op == "sin" else "sin", argument)
            correction = w.exact("fmul", self.low[node.args[0]], partner)
            return w.exact("fadd" if op == "sin" else "fsub", value, correction)
        return value

    def _called(self, op: str, argument: str) -> str:
        if (op, argument) not in self.calls:
            self.calls[op, argument] = self.w.call(op, argument)
        return self.calls[op, argument]

    def _weighted(self, node: int, j: int) -> Value:
        if (node, j) not in self.weighted:
            self.weighted[node, j] = self.w.scaled(float(j), self.series[node][j])
        return self.weighted[node, j]

    def _inverse_of(self, value: Value) -> str:
        key = -1 - hash(value)
        if key not in self.inverse:
            self.inverse[key] = self.w.exact("fdiv", _literal(1.0), value or _literal(0.0))
        return self.inverse[key]


def _late_last(count: int) -> range:
    """Indices j of products a[j] a[k - j] with the newest coefficient (j = 0) last."""
    return range(count - 1, -1, -1)


def _ancestors(tape: Tape, roots: Sequence[int]) -> set[int]:
    """Every node the roots read, and the roots."""
    found: set[int] = set()
    waiting = list(roots)
    while waiting:
        at = waiting.pop()
        if at not in found:
            found.add(at)
            if tape.nodes[at].op != "state":
                waiting.extend(tape.nodes[at].args)
    return found
