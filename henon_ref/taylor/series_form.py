"""What the form of a tape tells of its series: branch points, and gaps."""

from __future__ import annotations

from collections.abc import Iterable

from henon_ref.taylor.tape import INFINITE, Tape


def has_branch_points(tape: Tape, rows: Iterable[int]) -> bool:
    """Return whether given nodes depend on an operation with branch points."""
    return any(tape.nodes[at].op in ("sqrt", "power", "asin", "acos") for at in tape.needed(rows))


def own_gaps(tape: Tape) -> list[bool]:
    """Return whether the series of each state and output may end in a gap that is in no other series.

    It may not if it is a polynomial by its form, the integral of another state (unless the integrals form a cycle), or
    a linear combination of states.
    """
    source = {i: tape.nodes[at].args[0] for i, at in enumerate(tape.field) if tape.nodes[at].op == "state"}
    found = []
    for i, at in enumerate(tape.field):
        end, seen = source.get(i, i), {i}
        while end in source and end not in seen:
            seen.add(end)
            end = source[end]
        found.append(tape.nodes[at].degree == INFINITE and end == i)
    linear: list[bool] = []
    for node in tape.nodes:
        scaled = node.op == "mul" and any(tape.nodes[at].degree == 0 for at in node.args)
        kept = (scaled or node.op in ("add", "sub", "scale", "shift", "rsub")) and all(linear[at] for at in node.args)
        linear.append(kept or node.op in ("state", "clock") or node.degree == 0)
    return found + [tape.nodes[at].degree == INFINITE and not linear[at] for at in tape.outputs]
