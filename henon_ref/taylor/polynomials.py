"""Run a tape whose states are polynomials in time by their form: a node is one polynomial, and no order is missing.

Functions of such states are power series in time, cut off at an order that is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from flint import arb, arb_poly, arb_series, ctx

from henon_ref.taylor.tape import INFINITE, Tape

_POLYNOMIALS: dict[str, Callable[[arb_poly, arb_poly, arb_poly], arb_poly]] = {
    "constant": lambda a, b, c: c,
    "add": lambda a, b, c: a + b,
    "sub": lambda a, b, c: a - b,
    "mul": lambda a, b, c: a * b,
    "square": lambda a, b, c: a * a,
    "scale": lambda a, b, c: a * c,
    "shift": lambda a, b, c: a + c,
    "rsub": lambda a, b, c: c - a,
}
_FUNCTIONS: dict[str, Callable[[arb_series, arb_series, arb_series], arb_series]] = {
    **_POLYNOMIALS,
    "div": lambda a, b, c: a / b,
    "recip": lambda a, b, c: c / a,
    "power": lambda a, b, c: a**c,
    "sqrt": lambda a, b, c: a.sqrt(),
    "exp": lambda a, b, c: a.exp(),
    "log": lambda a, b, c: a.log(),
    "sin": lambda a, b, c: a.sin(),
    "cos": lambda a, b, c: a.cos(),
    "tan": lambda a, b, c: a.tan(),
    "asin": lambda a, b, c: a.asin(),
    "acos": lambda a, b, c: a.acos(),
    "atan": lambda a, b, c: a.atan(),
}
_TWO = ("add", "sub", "mul", "div")
"""Operations of two nodes; the second of others is a partner that is not needed here."""
Step = tuple[str, int, int, int, int]
"""Operation, the node it makes, the nodes it reads (for a state its derivative), its first constant."""


@dataclass(frozen=True)
class Plan:
    """What makes the states and an output of a tape, arguments first."""

    motion: tuple[Step, ...]
    """Polynomials: all that the states need, and of the output what is one, too."""
    functions: tuple[Step, ...]
    """Of the output what is none."""


def plan(tape: Tape, output: int) -> Plan | None:
    """What makes the states and an output of a tape; None where a state is no polynomial in time.

    Parameters
    ----------
    tape : Tape
    output : int
        Place of the output among ``tape.outputs``.
    """
    nodes, made = tape.nodes, set[int]()
    motion: list[Step] = []
    functions: list[Step] = []
    waiting = [*range(len(tape.field)), tape.outputs[output]]
    while waiting:
        at = waiting[-1]
        node = nodes[at]
        polynomial = node.degree < INFINITE and node.op in (*_POLYNOMIALS, "state", "clock")
        if not polynomial and node.op not in _FUNCTIONS:
            return None
        args = node.args if node.op in _TWO else node.args[:1]
        if node.op == "state":
            args = (tape.field[node.args[0]],)
        missing = [a for a in args if a not in made]
        if at not in made and not missing:
            made.add(at)
            steps = motion if polynomial else functions
            steps.append((node.op, at, *(*args, 0, 0)[:2], (*node.constants, 0)[0]))
        waiting = [*waiting, *missing] if missing else waiting[:-1]
    return Plan(tuple(motion), tuple(functions))


def polynomials(
    steps: Sequence[Step], tape: Tape, numbers: Sequence[arb_poly], time: arb, state: Sequence[arb], unit: arb
) -> list[arb_poly]:
    """The polynomials in the time since the start, in units of ``unit``, at the places of the tape's nodes.

    They are 0 where none was asked for.

    Parameters
    ----------
    steps : sequence
        :attr:`Plan.motion`.
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
            made[at] = _POLYNOMIALS[op](made[a], made[b], numbers[c])
    return made


def function(
    plan: Plan, tape: Tape, numbers: Sequence[arb], made: Sequence[arb_poly], output: int, order: int
) -> arb_poly:
    """An output that is a function of polynomials, without its terms above an order.

    ``made`` are the :func:`polynomials`.
    """
    cap, ctx.cap = ctx.cap, order + 1
    try:
        series = {at: arb_series(made[at].coeffs()) for _, at, *_ in plan.motion}
        for op, at, a, b, c in plan.functions:
            series[at] = _FUNCTIONS[op](series[a], series.get(b, series[a]), numbers[c])
        return arb_poly(series[tape.outputs[output]].coeffs())
    finally:
        ctx.cap = cap
