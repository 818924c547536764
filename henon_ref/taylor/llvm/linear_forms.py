"""Linear nodes of a tape, flattened to sums of nodes that are not linear.

The recurrence of a flattened sum costs one fused multiply-add per term, whereas a chain of `scale`, `add`, `shift`
nodes costs one operation per node. A state's rate is folded into the factors of the terms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

from henon_ref.jit.ir_writer import LANES
from henon_ref.taylor.rules import LINEAR, RULES, Linear
from henon_ref.taylor.tape import INFINITE, Tape


@dataclass(frozen=True, slots=True)
class Factor:
    """A product of the tape's constants, with a sign."""

    sign: int = 1
    constants: tuple[int, ...] = ()

    def signed(self, sign: int) -> Factor:
        return Factor(sign * self.sign, self.constants)

    def times(self, constant: int) -> Factor:
        return Factor(self.sign, (*self.constants, constant))


@dataclass
class Form:
    """sum of (sum of factors) leaf + (sum of factors): leaves are nodes, in the order of the tape."""

    terms: dict[int, list[Factor]] = field(default_factory=dict)
    constant: list[Factor] = field(default_factory=list)

    def leaves(self) -> list[int]:
        return sorted(self.terms)


Pair = tuple[int, int, int]
"""Nodes u and v, and the node whose recurrence uses the sum of u_j v_(k-j)."""


class Forms:
    """The linear forms of a tape.

    Attributes
    ----------
    kept : dict
        Forms of the linear nodes whose own coefficients are required (because a product reads them). A form ends at
        kept nodes and at nodes that are not linear.
    field, outputs : list
        Forms of the states' rates and of the outputs.
    affine_arguments : dict
        Denominator of a reciprocal, if it is ``a x + b`` -> (x, its form); the recurrence reads x instead of it.
    last : set of int
        Nodes whose coefficient of the highest order is required.
    """

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        reading = [node for node in tape.nodes if node.op != "state"]
        uses = Counter([*(a for node in reading for a in node.args), *tape.field, *tape.outputs])
        nonlinear = {a for node in reading if node.op not in LINEAR for a in node.args}
        others = {a for node in reading if node.op not in (*LINEAR, "recip") for a in node.args}
        self.affine_arguments: dict[int, tuple[int, Form]] = {}
        for at in [node.args[0] for node in reading if node.op == "recip"]:
            form = self._flat(at, ())
            if at not in others and tape.nodes[at].op in LINEAR and len(form.terms) == 1:
                (leaf,) = form.terms
                if tape.nodes[leaf].op not in ("clock", "constant"):
                    self.affine_arguments[at] = leaf, form
        self.kept = {
            at: Form()
            for at, node in enumerate(tape.nodes)
            if node.op in LINEAR
            and at not in self.affine_arguments
            and (at in nonlinear or (uses[at] > 1 and node.op in ("add", "sub")))
        }
        self.kept = {at: self.of(at) for at in self.kept}
        self.field, self.outputs = ([self.of(root) for root in roots] for roots in (tape.field, tape.outputs))
        self.last = self._read_by([leaf for form in self.outputs for leaf in form.terms])

    def of(self, at: int) -> Form:
        """Form of a node; a kept node is expanded too."""
        return self._flat(at, self.kept)

    def denominator(self, at: int) -> int:
        """Node that a reciprocal reads: x if its denominator is ``a x + b`` (saves 5 to 12 % of a run of Fig. 8)."""
        return self.affine_arguments[at][0] if at in self.affine_arguments else at

    def below(self, at: int) -> Form:
        """The denominator as a form of that node."""
        return self.affine_arguments[at][1] if at in self.affine_arguments else Form({at: [Factor()]})

    def state(self, leaf: int) -> int:
        """Index of the state that a leaf is, or -1."""
        node = self.tape.nodes[leaf]
        return node.args[0] if node.op == "state" else -1

    def integral_states(self, order: int) -> dict[int, int]:
        """States whose rate is a multiple of another state that is not such a state itself, each with its leaf.

        (This saves 4 to 6 % of a run of Fig. 8.)
        """
        found: dict[int, int] = {}
        sources: set[int] = set()
        for i, form in enumerate(self.field):
            if order >= LANES and len(form.terms) == 1 and not form.constant and i not in sources:
                (leaf,) = form.terms
                source = self.state(leaf)
                if source not in (-1, i) and source not in found:
                    found[i] = leaf
                    sources.add(source)
        return found

    def convolved(self) -> list[Pair]:
        """Products that use the lanes of vectors: of nodes that are not polynomials in time."""
        pairs: list[Pair] = []
        for at, node in enumerate(self.tape.nodes):
            if node.op == "mul":
                pairs.append((node.args[0], node.args[1], at))
            elif node.op in ("recip", "div"):
                pairs.append((self.denominator(node.args[-1]), at, at))
        return [pair for pair in pairs if all(self.tape.nodes[i].degree == INFINITE for i in pair)]

    def _read_by(self, waiting: list[int]) -> set[int]:
        """Nodes that the given nodes depend on, including themselves but not states."""
        found: set[int] = set()
        while waiting:
            at = waiting.pop()
            node = self.tape.nodes[at]
            if at not in found and node.op != "state":
                found.add(at)
                if at in self.kept:
                    waiting += self.kept[at].terms
                else:
                    waiting += [self.denominator(node.args[0])] if node.op == "recip" else node.args
        return found

    def _flat(self, at: int, stops: Collection[int]) -> Form:
        """Expand a node into a form of nodes that are not linear or are in ``stops``; the node itself is expanded."""
        form = Form()
        waiting = [(at, Factor())]
        while waiting:
            current, factor = waiting.pop()
            node = self.tape.nodes[current]
            if node.op == "constant":
                form.constant.append(factor.times(node.constants[0]))
            elif node.op not in LINEAR or (current != at and current in stops):
                form.terms.setdefault(current, []).append(factor)
            else:
                rule = RULES[node.op]
                assert isinstance(rule, Linear)
                if rule.constant == "term":
                    form.constant.append(factor.times(node.constants[0]))
                elif rule.constant == "factor":
                    factor = factor.times(node.constants[0])
                signs = (rule.first, rule.second)[: len(node.args)]
                waiting += [(a, factor.signed(sign)) for a, sign in zip(node.args, signs, strict=True)]
        return form
