"""Run a tape whose states are polynomials in time by their form: a node is one polynomial, and no order is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from flint import arb, arb_poly

from henon_ref.taylor.tape import INFINITE, Tape

_OPERATIONS: dict[str, Callable[[arb_poly, arb_poly, arb_poly], arb_poly]] = {
    "constant": lambda a, b, c: c,
    "add": lambda a, b, c: a + b,
    "sub": lambda a, b, c: a - b,
    "mul": lambda a, b, c: a * b,
    "square": lambda a, b, c: a * a,
    "scale": lambda a, b, c: a * c,
    "shift": lambda a, b, c: a + c,
    "rsub": lambda a, b, c: c - a,
}
Step = tuple[str, int, int, int, int]
"""Operation, the node it makes, the nodes it reads (for a state its derivative), its first constant."""


def plan(tape: Tape, output: int) -> list[Step] | None:
    """What makes the states and an output of a tape, arguments first; None where one is no polynomial in time.

    Parameters
    ----------
    tape : Tape
    output : int
        Place of the output among ``tape.outputs``.
    """
    nodes, steps, made = tape.nodes, [], set[int]()
    waiting = [*range(len(tape.field)), tape.outputs[output]]
    while waiting:
        at = waiting[-1]
        node = nodes[at]
        if node.degree == INFINITE or node.op not in (*_OPERATIONS, "state", "clock"):
            return None
        args = (tape.field[node.args[0]],) if node.op == "state" else node.args
        missing = [a for a in args if a not in made]
        if at not in made and not missing:
            made.add(at)
            steps.append((node.op, at, *(*args, 0, 0)[:2], (*node.constants, 0)[0]))
        waiting = [*waiting, *missing] if missing else waiting[:-1]
    return steps


def polynomials(
    steps: Sequence[Step], tape: Tape, numbers: Sequence[arb_poly], time: arb, state: Sequence[arb], unit: arb
) -> list[arb_poly]:
    """The polynomials in the time since the start, in units of ``unit``, at the places of the tape's nodes.

    They are 0 where none was asked for.

    Parameters
    ----------
    steps : sequence
        :func:`plan`.
    tape : Tape
    numbers : sequence of arb_poly
        ``tape.constants``, as polynomials of degree 0.
    time, state
        Where the motion starts.
    unit : arb
    """
    made = [arb_poly()] * len(tape.nodes)
    for op, at, a, b, c in steps:
        if op == "state":
            made[at] = (made[a] * unit).integral() + state[at]
        elif op == "clock":
            made[at] = numbers[c] + numbers[tape.nodes[at].constants[1]] * arb_poly([time, unit])
        else:
            made[at] = _OPERATIONS[op](made[a], made[b], numbers[c])
    return made
