"""Error bounds of the rounding and underflow in the evaluation of expressions, as machine code.

Running error analysis (Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed., Sec. 3.3): each value has a
first-order bound of its error; every operation adds its own rounding error to the propagated errors of its arguments.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from henon_ref.jit.ir_writer import MINUS, ONE, ZERO, IRWriter, literal
from henon_ref.taylor import rules
from henon_ref.taylor.llvm.expansion import Expansion, function_ir
from henon_ref.taylor.llvm.linear_forms import Form
from henon_ref.taylor.tape import Node, Tape

UNDERFLOW = 2.0**-1022
"""Largest error of an operation by underflow: a number below the smallest normal double may be lost."""
MOST_LINES = 5000
"""Number of instructions above which the function is divided: the time to compile one grows with their square."""
ROWS = 10
"""Number of results of each part of a divided function."""
_NAME, _DEFINED = re.compile(r"%v\d+"), re.compile(r"  (%v\d+) = ")


def rounding_ir(tape: Tape, states: int, name: str) -> str:
    """LLVM IR of a function of the signature of :func:`henon_ref.taylor.llvm.expansion.expansion_ir`.

    ``unit`` is the relative rounding error of an operation; 0 gives the errors by underflow alone. ``C`` receives an
    error bound of each x', then of each output. In an output, the rounding of terms that are states, time or constants
    is not counted, since near a zero of the output the errors of the states themselves are larger.
    """
    w = IRWriter()
    expansion = Expansion(w, tape, states, 0)
    expansion.run()
    errors = _Errors(w, expansion)
    for at in expansion.recurrences:
        errors.add(at)
    found = [errors.of_form(rate, given=False) for rate in expansion.forms.field]
    found += [errors.of_form(target, given=True) for target in expansion.forms.outputs]
    for place, value in enumerate(found):
        w.store(value, "%C", place)
    return function_ir(w, name) if len(w.lines) <= MOST_LINES else _divided(w.lines, name)


def _divided(lines: Sequence[str], name: str) -> str:
    """LLVM IR of a function that calls others, each of which stores some results and computes what these depend on."""
    units: list[list[str]] = []
    """Instructions; a choice between two branches is one, from its condition to the values chosen."""
    labels = 0
    for line in lines:
        if labels or " = phi " in line:
            units[-1].append(line)
            labels -= line.endswith(":")
        else:
            units.append([line])
            labels = 3 if line.startswith("  br ") else 0
    defined = {found[1]: at for at, unit in enumerate(units) for line in unit if (found := _DEFINED.match(line))}
    stores = [at for at, unit in enumerate(units) if unit[0].startswith("  store ")]
    whole, texts = IRWriter(), []
    for first in range(0, len(stores), ROWS):
        needed, open_ends = set[int](), stores[first : first + ROWS]
        while open_ends:
            if (at := open_ends.pop()) not in needed:
                needed.add(at)
                read = _NAME.findall("\n".join(units[at]))
                open_ends += [defined[value] for value in read if value in defined]
        part = IRWriter()
        part.lines = [line for at in sorted(needed) for line in units[at]]
        texts.append(function_ir(part, f"{name}.{first}"))
        given = "double %t_hi, double %t_lo, double %unit, ptr %x, ptr %K, ptr %C"
        whole.lines.append(f"  call void @{name}.{first}({given})")
    return "".join([*texts, function_ir(whole, name)])


class _Errors:
    def __init__(self, w: IRWriter, expansion: Expansion) -> None:
        self.w, self.expansion = w, expansion
        self.bounds = {at: ZERO for at, node in enumerate(expansion.tape.nodes) if node.op == "state"}
        self._sizes: dict[int, str] = {}
        self._rounded_bounds: dict[int, str] = {}

    def add(self, at: int) -> None:
        """Compute the bound of a node from those of its arguments."""
        w, node = self.w, self.expansion.tape.nodes[at]
        if at in self.expansion.forms.kept:
            self.bounds[at] = self.of_form(self.expansion.forms.kept[at], given=False)
            return
        own = literal(UNDERFLOW)
        if node.args and self.expansion.clock_of(node) is None:
            own = w.plus(self._carried(at, node), own)
        self.bounds[at] = w.call("fma", "%unit", self._size(at), own)

    def of_form(self, form: Form, *, given: bool) -> str:
        """Bound of a sum; ``given``: the rounding of terms that are states, time or constants is not counted."""
        w, nodes = self.w, self.expansion.tape.nodes
        factors = {leaf: self.expansion.constants.total(form.terms[leaf]) or ZERO for leaf in form.leaves()}
        if not form.constant and len(factors) == 1 and set(factors.values()) <= {ONE, MINUS}:
            return self.bounds[next(iter(factors))]
        total = literal(UNDERFLOW)
        for leaf, factor in factors.items():
            if not (given and nodes[leaf].op in ("state", "clock")):
                error = self._rounded(leaf)
                total = (
                    w.plus(error, total)
                    if factor in (ONE, MINUS)
                    else w.call("fma", w.call("fabs", factor), error, total)
                )
        constant = None if given else self.expansion.constants.total(form.constant)
        return total if constant is None else w.call("fma", "%unit", w.call("fabs", constant), total)

    def _carried(self, at: int, node: Node) -> str:
        """Propagated errors of an operation's arguments."""
        w, made, y = self.w, self.expansion.made, self._size(at)
        if node.op == "recip":
            below = w.binary("fmul", y, self.of_form(self.expansion.forms.below(node.args[0]), given=False))
            above = w.call("fabs", self.expansion.constants.value(node.constants[0]))
            return w.call("fma", below, w.call("fabs", made.inverses[at]), w.binary("fmul", above, literal(UNDERFLOW)))
        a, b = self._size(node.args[0]), self._size(node.args[-1])
        first, second = self.bounds[node.args[0]], self.bounds.get(node.args[-1], ZERO)
        match rules.RULES[node.op]:
            case rules.Product():
                return w.call("fma", a, second, w.binary("fmul", b, first))
            case rules.Quotient():
                inverse = w.call("fabs", made.inverse(self.expansion.series[node.args[-1]][0]))
                above = w.binary("fmul", a, literal(UNDERFLOW))
                return w.call("fma", inverse, w.call("fma", y, second, first), above)
            case rules.Root():  # as large as the root itself if its argument is zero within its error
                below = w.plus(w.plus(y, w.call("sqrt", first)), literal(UNDERFLOW))
                return w.binary("fdiv", first, below)
            case rules.Power():
                exponent = self.expansion.constants.value(node.constants[0])
                beside = w.call("fabs", w.binary("fsub", w.call("pow", w.plus(a, first), exponent), y))
                part = w.binary("fdiv", w.binary("fmul", w.call("fabs", exponent), first), a)
                return w.call("fma", y, w.smaller(part, ONE), beside)
            case rules.IntegralOfProduct() as rule:
                return w.binary("fmul", self._size(rule.place(at, node.args)), first)
            case rules.IntegralOfQuotient() as rule:
                return w.binary("fdiv", first, self._size(rule.place(at, node.args)))
        raise NotImplementedError(node.op)

    def _rounded(self, at: int) -> str:
        """Bound of a node's error and that of rounding it."""
        if at not in self._rounded_bounds:
            self._rounded_bounds[at] = self.w.call("fma", "%unit", self._size(at), self.bounds[at])
        return self._rounded_bounds[at]

    def _size(self, at: int) -> str:
        if at not in self._sizes:
            self._sizes[at] = self.w.call("fabs", self.expansion.series[at][0] or ZERO)
        return self._sizes[at]
