"""Run a Taylor tape over any ring: floats, balls."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from henon_ref.taylor.tape import Tape


@dataclass(frozen=True)
class Ring:
    """The elementary functions of a number type that has + - * / with itself and with int."""

    functions: dict[str, Callable[[Any], Any]]
    """sin, cos, tan, sinh, cosh, tanh, asin, acos, atan, exp, log, sqrt."""
    power: Callable[[Any, Any], Any]
    """(base, constant exponent) -> base**exponent."""


_NAMES = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt")
FLOAT = Ring({name: getattr(math, name) for name in _NAMES}, math.pow)
"""IEEE double."""


def expand(
    tape: Tape, constants: Sequence[Any], time: Any, state: Sequence[Any], order: int, ring: Ring = FLOAT
) -> tuple[list[list[Any]], list[list[Any]]]:
    """Taylor coefficients of the solution through (time, state), and of the tape's outputs along it.

    Parameters
    ----------
    tape : Tape
    constants : sequence
        ``tape.constants`` as numbers of the ring.
    time, state
        Where the solution starts.
    order : int
        Highest coefficient wanted.

    Returns
    -------
    states : list of n lists of ``order + 1`` coefficients
    outputs : list of ``len(tape.outputs)`` lists of ``order + 1`` coefficients
    """
    series: list[list[Any]] = [[] for _ in tape.nodes]
    solution = [[value] for value in state]
    for k in range(order + 1):
        for node, own in zip(tape.nodes, series, strict=True):
            if node.op == "state":
                own.append(solution[node.args[0]][k])
            else:
                own.append(_coefficient(node, own, series, k, constants, time, ring))
        if k < order:
            for target, source in zip(solution, tape.field, strict=True):
                target.append(series[source][k] / (k + 1))
    return solution, [series[i] for i in tape.outputs]


def _dot(a: list[Any], b: list[Any], first: int, last: int, total: int) -> Any:
    """Sum of a[j] b[total - j] over first <= j <= last (0 where there is none)."""
    result: Any = 0
    for j in range(first, last + 1):
        result = result + a[j] * b[total - j]
    return result


def _derived(a: list[Any], q: list[Any], k: int) -> Any:
    """Coefficient k of y with y' = a' q."""
    result: Any = 0
    for j in range(1, k + 1):
        result = result + j * a[j] * q[k - j]
    return result / k


def _quotient(y: list[Any], a: list[Any], q: list[Any], k: int) -> Any:
    """Coefficient k of y with y' q = a'."""
    result = k * a[k]
    for j in range(1, k):
        result = result - j * y[j] * q[k - j]
    return result / (k * q[0])


def _coefficient(
    node: Any, y: list[Any], series: list[list[Any]], k: int, constants: Sequence[Any], time: Any, ring: Ring
) -> Any:
    op, c = node.op, [constants[i] for i in node.constants]
    if op == "constant":
        return c[0] if k == 0 else 0 * c[0]
    if op == "clock":
        return c[0] + c[1] * time if k == 0 else c[1] if k == 1 else 0 * c[1]
    a = series[node.args[0]]
    if op in ("add", "sub", "mul", "div"):
        b = series[node.args[1]]
        if op == "add":
            return a[k] + b[k]
        if op == "sub":
            return a[k] - b[k]
        return _dot(a, b, 0, k, k) if op == "mul" else (a[k] - _dot(y, b, 0, k - 1, k)) / b[0]
    if op == "square":
        half = 2 * _dot(a, a, 0, (k - 1) // 2, k)
        return half if k % 2 else half + a[k // 2] * a[k // 2]
    if op == "scale":
        return c[0] * a[k]
    if op == "shift":
        return a[k] + c[0] if k == 0 else a[k]
    if op == "rsub":
        return c[0] - a[k] if k == 0 else -a[k]
    if op == "recip":
        return c[0] / a[0] if k == 0 else -_dot(y, a, 0, k - 1, k) / a[0]
    return _transcendental(op, y, a, series[node.args[1]] if len(node.args) > 1 else y, k, c, ring)


def _transcendental(op: str, y: list[Any], a: list[Any], q: list[Any], k: int, c: list[Any], ring: Ring) -> Any:
    if k == 0:
        return ring.power(a[0], c[0]) if op == "power" else ring.functions[op](a[0])
    if op == "sqrt":
        return (a[k] - _dot(y, y, 1, k - 1, k)) / (2 * y[0])
    if op == "power":
        result: Any = 0
        for j in range(1, k + 1):
            result = result + (c[0] * j - (k - j)) * a[j] * y[k - j]
        return result / (k * a[0])
    if op == "exp":
        return _derived(a, y, k)
    if op == "log":
        return _quotient(y, a, a, k)
    if op in ("atan", "asin"):
        return _quotient(y, a, q, k)
    if op == "acos":
        return _quotient(y, [-value for value in a], q, k)
    value = _derived(a, q, k)
    return -value if op == "cos" else value
