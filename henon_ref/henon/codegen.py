"""Straight-line machine code for the Taylor coefficients of one mode, from its tape.

The tape is unrolled to a fixed order and written as LLVM IR: every coefficient is one value, structural
zeros (a constant's derivatives, a clock's beyond the first) never become instructions, squares are halved.
Time is measured in units of ``sigma``, about the size of a step, so that coefficients neither overflow nor
vanish whatever the units of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from henon_ref.taylor.tape import Node, Tape

LANES = 4
"""Doubles in a vector; a row of coefficients is padded with zeros to whole vectors."""
SWING = 8.0
"""How far the argument of an exponential may move on one step."""
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

    def larger(self, a: str, b: str) -> str:
        """The larger of two numbers that are not negative."""
        return self.emit(f"select i1 {self.emit(f'fcmp ogt double {a}, {b}')}, double {a}, double {b}")

    def store(self, value: str, array: str, index: int) -> None:
        pointer = self.emit(f"getelementptr double, ptr {array}, i64 {index}")
        self.lines.append(f"  store double {value}, ptr {pointer}")

    def vector(self, values: Sequence[str]) -> str:
        """A vector of scalar values."""
        kind = f"<{len(values)} x double>"
        result = "poison"
        for at, value in enumerate(values):
            result = self.emit(f"insertelement {kind} {result}, double {value}, i64 {at}")
        return result

    def call(self, name: str, *args: str) -> str:
        target = f"@llvm.{name}.f64" if name in ("sqrt", "fabs", "fma") else f"@{name}"
        return self.emit(f"call double {target}({', '.join(f'double {a}' for a in args)})")

    def total(self, old: Sequence[tuple[Value, Value]], new: Sequence[tuple[Value, Value]] = ()) -> Value:
        """Sum of products: the ``old`` ones in two chains, then the ``new`` ones, one fused operation each.

        A coefficient waits for the newest coefficients of its arguments; with their products added last,
        to a sum made before, each operation adds one instruction to the chain from order to order.
        """
        chains: list[Value] = [None, None]
        pairs = [(a, b) for a, b in old if a is not None and b is not None]
        for at, (a, b) in enumerate(pairs):
            which = at % 2 if len(pairs) > 3 else 0
            chains[which] = self.add(chains[which], self.mul(a, b))
        total: Value = self.add(chains[1], chains[0])
        for first, second in new:
            total = self.add(total, self.mul(first, second))
        return total


def _literal(value: float) -> str:
    import struct

    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


def expansion_ir(tape: Tape, states: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double t_hi, double t_lo, double sigma, double* x, double* K, double* C)``.

    ``K`` holds the constants rounded to double, then what that rounding lost. ``C`` receives the Taylor
    coefficients in units of sigma, a row of :func:`row_length` a state, then one an output; and behind the
    rows, for ``order`` >= 3, the largest last and last but one coefficient relative to the row's size on a
    step of sigma, a sum that is not finite where any coefficient is not, and the longest step that the
    exponentials allow.

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
    width = row_length(order)
    for r, row in enumerate(rows):
        for k in range(order + 1):
            w.store(row[k] or _literal(0.0), "%C", r * width + k)
    if order >= 3:
        for at, value in enumerate([*_norms(w, rows, order), _longest(w, expander)]):
            w.store(value, "%C", len(rows) * width + at)
    body = "\n".join(w.lines)
    return (
        f"define void @{name}(double %t_hi, double %t_lo, double %sigma, ptr noalias %x, ptr noalias %K, "
        f"ptr noalias %C) {{\nentry:\n{body}\n  ret void\n}}\n"
    )


def row_length(order: int) -> int:
    """Doubles from one row of coefficients to the next."""
    return -(-(order + 1) // LANES) * LANES if order else 1


def _norms(w: _Writer, rows: Sequence[Sequence[Value]], order: int) -> list[str]:
    """(largest last, largest last but one, sum of all): relative to each row's size on a step of sigma."""
    largest, total = ["", ""], ""
    for row in rows:
        size = _literal(1e-300)
        for value in row[:3]:
            if value is not None:
                size = w.binary("fadd", size, w.call("fabs", value))
        inverse = w.exact("fdiv", _literal(1.0), size)
        for at, k in enumerate((order, order - 1)):
            value = row[k]
            if value is None:
                continue
            ratio = w.binary("fmul", w.call("fabs", value), inverse)
            total = w.binary("fadd", total, ratio) if total else ratio
            largest[at] = w.larger(largest[at], ratio) if largest[at] else ratio
    return [value or _literal(0.0) for value in (*largest, total)]


def _longest(w: _Writer, expander: _Expander) -> str:
    """Longest step, in units of sigma, on which no exponential's argument moves by more than SWING.

    An exponential that is zero in double precision (a drive that sleeps) has no Taylor coefficient that could
    tell of its waking: its argument does.
    """
    result = _literal(1e30)
    for node in expander.tape.nodes:
        if node.op in ("exp", "sinh", "tanh"):
            terms = [w.call("fabs", a) for a in expander.series[node.args[0]][1:3] if a is not None]
            if terms:
                total = terms[0] if len(terms) == 1 else w.binary("fadd", terms[0], terms[1])
                ratio = w.exact("fdiv", _literal(SWING), w.binary("fadd", total, _literal(1e-300)))
                result = w.emit(
                    f"select i1 {w.emit(f'fcmp olt double {ratio}, {result}')}, double {ratio}, double {result}"
                )
    return result


def closing_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double theta, double* C, double* out)``: what a step needs of its coefficients.

    ``out`` receives, for each state, its change over the step (all terms but the first, so that adding it
    rounds once), then for each output a bound from below on (0, theta]: its first coefficient plus its
    negative terms.
    """
    w = _Writer()
    vector = f"<{LANES} x double>"
    width = row_length(order)
    square = w.exact("fmul", "%theta", "%theta")
    lanes = [_literal(1.0), "%theta", square, w.exact("fmul", square, "%theta")]
    jump = w.exact("fmul", square, square)
    powers = [w.vector(lanes)]
    stride = w.vector([jump] * LANES)
    for v in range(1, width // LANES):
        if v == 2:
            stride = w.emit(f"fmul {vector} {stride}, {stride}")
        powers.append(w.emit(f"fmul {vector} {powers[v - 1 if v == 1 else v - 2]}, {stride}"))
    powers[0] = w.vector([_literal(0.0), *lanes[1:]])
    zero = w.vector([_literal(0.0)] * LANES)
    for r in range(states + outputs):
        total = ""
        for v in range(len(powers) - 1, -1, -1):  # small terms first
            pointer = w.emit(f"getelementptr double, ptr %C, i64 {r * width + v * LANES}")
            term = w.emit(f"load {vector}, ptr {pointer}, align 8")
            term = w.emit(f"fmul contract {vector} {term}, {powers[v]}")
            if r >= states:
                below = w.emit(f"fcmp olt {vector} {term}, {zero}")
                mask = f"<{LANES} x i1> {below}"
                term = w.emit(f"select {mask}, {vector} {term}, {vector} {zero}")
            total = w.emit(f"fadd contract {vector} {total}, {term}") if total else term
        start = _literal(-0.0)
        if r >= states:
            pointer = w.emit(f"getelementptr double, ptr %C, i64 {r * width}")
            start = w.emit(f"load double, ptr {pointer}")
        w.store(
            w.emit(f"call reassoc double @llvm.vector.reduce.fadd.v{LANES}f64(double {start}, {vector} {total})"),
            "%out",
            r,
        )
    body = "\n".join(w.lines)
    return f"define void @{name}(double %theta, ptr noalias %C, ptr noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


def declarations() -> str:
    """LLVM declarations of the mathematical functions the expansions call."""
    lines = [f"declare double @{f}(double) readnone nounwind" for f in LIBM if f not in ("sqrt", "pow")]
    lines.append("declare double @pow(double, double) readnone nounwind")
    lines += ["declare double @llvm.sqrt.f64(double)", "declare double @llvm.fabs.f64(double)"]
    lines.append(f"declare double @llvm.vector.reduce.fadd.v{LANES}f64(double, <{LANES} x double>)")
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
        self.made: dict[tuple[int, str], Value] = {}
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
            if k == 0:
                return w.mul(a[0], a[0])
            old = self._halved_square(a, k)
            return w.add(old, w.mul(self._made(node.args[0], "twice", lambda: w.add(a[0], a[0])), a[k]))
        if op == "scale":
            return w.mul(c[0], a[k])
        if op == "shift":
            return w.add(a[k], c[0]) if k == 0 else a[k]
        if op == "rsub":
            return w.sub(c[0], a[k]) if k == 0 else w.neg(a[k])
        if op == "recip":
            inverse = self._inverse(node.args[0])
            if k == 0:
                return w.mul(c[0], inverse)
            # -(sum over j < k of y_j a_(k-j)) / a_0, the newest coefficient a_k apart
            slope = self._made(at, "slope", lambda: w.neg(w.mul(y[0], inverse)))
            old = w.total([(y[j], a[k - j]) for j in range(1, k)])
            return w.add(w.neg(w.mul(old, inverse)), w.mul(slope, a[k]))
        return self._transcendental(node, y, a, k, c)

    def _binary(self, op: str, node: Node, y: list[Value], a: list[Value], k: int) -> Value:
        w, b = self.w, self.series[node.args[1]]
        if op == "add":
            return w.add(a[k], b[k])
        if op == "sub":
            return w.sub(a[k], b[k])
        if op == "mul":
            new = [(a[k], b[0]), (a[0], b[k])] if k else [(a[0], b[0])]
            return w.total([(a[j], b[k - j]) for j in range(1, k)], new)
        rest = w.total([(y[j], b[k - j]) for j in range(1, k)], [(y[0], b[k])] if k else [])
        return w.mul(w.sub(a[k], rest), self._inverse(node.args[1]))

    def _halved_square(self, a: list[Value], k: int) -> Value:
        """Sum of a_j a_(k-j) over 1 <= j <= k - 1, each product formed once."""
        w = self.w
        half = w.total([(a[j], a[k - j]) for j in range(1, (k - 1) // 2 + 1)])
        double = w.add(half, half)
        return double if k % 2 else w.add(double, w.mul(a[k // 2], a[k // 2]))

    def _made(self, node: int, what: str, make: Callable[[], Value]) -> Value:
        """A value made at order zero and used at all later ones."""
        if (node, what) not in self.made:
            self.made[node, what] = make()
        return self.made[node, what]

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
            inner = self._halved_square(y, k)
            return w.mul(w.scaled(0.5, w.sub(a[k], inner)), self._inverse_of(y[0]))
        if op == "power":
            terms = []
            for j in range(1, k + 1):
                if a[j] is None or y[k - j] is None:
                    continue
                weight = w.sub(w.scaled(float(j), c[0]), _literal(float(k - j)))
                terms.append((w.mul(weight, a[j]), y[k - j]))
            return w.scaled(1.0 / k, w.mul(w.total(terms[:-1], terms[-1:]), self._inverse(node.args[0])))
        if op in ("exp", "sin", "cos", "sinh", "cosh", "tan", "tanh"):
            q = y if op == "exp" else self.series[node.args[1]]
            terms = [(self._weighted(node.args[0], j), q[k - j]) for j in range(1, k + 1)]
            value = w.scaled(1.0 / k, w.total(terms[1:-1], terms[:1] + terms[1:][-1:]))
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
