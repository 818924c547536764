"""Taylor series by a tape over any ring: doubles, balls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import add, mul, sub
from typing import Any

from flint import arb

from henon_ref.expressions.grammar import FUNCTIONS
from henon_ref.taylor.rules import (
    RULES,
    SELF,
    IntegralOfProduct,
    IntegralOfQuotient,
    Linear,
    Power,
    Product,
    Quotient,
    Root,
)
from henon_ref.taylor.tape import Node, Tape

Ring = Mapping[str, Callable[..., Any]]
"""Functions of a number type that has + - * / with itself and with int, by operation: ``sin`` ... ``sqrt`` of
:data:`henon_ref.expressions.grammar.FUNCTIONS`, and ``power`` of a base and a constant exponent."""
FLOAT: Ring = {name: getattr(math, name) for name in FUNCTIONS} | {"power": math.pow}
BALL: Ring = {name: getattr(arb, name) for name in FUNCTIONS} | {"power": arb.__pow__}


def expand(
    tape: Tape,
    constants: Sequence[Any],
    time: Any,
    state: Sequence[Any],
    order: int,
    ring: Ring = FLOAT,
    unit: Any = None,
    enough: Callable[[list[list[Any]], list[list[Any]]], bool] | None = None,
) -> tuple[list[list[Any]], list[list[Any]]]:
    """Taylor coefficients of the solution through (time, state), and of the tape's outputs along it.

    ``constants`` are ``tape.constants`` as numbers of the ring, and ``order`` is the highest order computed. ``unit``:
    time unit, a number of the ring; coefficient k is multiplied by ``unit**k`` (None: 1). ``enough`` is called after
    each order with the two lists below as far as computed; True stops the expansion.

    Returns n lists of ``order + 1`` coefficients of the states, or fewer if ``enough`` stopped the expansion, and
    ``len(tape.outputs)`` such lists.
    """
    solution = [[value] for value in state]
    series, steps = _recurrences(tape, constants, time, solution, ring, unit)
    links = [(target, series[source]) for target, source in zip(solution, tape.field, strict=False)]
    outputs = [series[i] for i in tape.outputs]
    for k in range(order + 1):
        for step in steps:
            step(k)
        if k == order or (enough is not None and enough(solution, outputs)):
            break
        part = None if unit is None else unit / (k + 1)
        for target, rate in links:
            target.append(rate[k] / (k + 1) if part is None else rate[k] * part)
    return solution, outputs


def along(
    tape: Tape, constants: Sequence[Any], time: Any, states: Sequence[Series], order: int, ring: Ring, unit: Any
) -> tuple[list[Series], list[Any]]:
    """Taylor coefficients of a tape's outputs along a known motion, and the first coefficient of every node.

    As :func:`expand`, but ``states`` are n lists of ``order + 1`` known coefficients, in the given time unit.
    """
    series, steps = _recurrences(tape, constants, time, states, ring, unit)
    for k in range(order + 1):
        for step in steps:
            step(k)
    return [series[i] for i in tape.outputs], [own[0] for own in series]


def _recurrences(
    tape: Tape, constants: Sequence[Any], time: Any, states: Sequence[Series], ring: Ring, unit: Any
) -> tuple[list[Series], list[Step]]:
    """Return the series of each node, and a step function for each node that is not a state."""
    series = [states[node.args[0]] if node.op == "state" else [] for node in tape.nodes]
    numbers = [[constants[i] for i in node.constants] for node in tape.nodes]
    steps = [
        _step(node, tape.nodes, own, [series[i] for i in node.args], c, time, 1 if unit is None else unit, ring)
        for node, own, c in zip(tape.nodes, series, numbers, strict=True)
        if node.op != "state"
    ]
    return series, steps


Series = list[Any]
Step = Callable[[int], None]
"""Appends coefficient k of one node to its series."""


def _step(
    node: Node, nodes: Sequence[Node], y: Series, args: Sequence[Series], c: Series, time: Any, unit: Any, ring: Ring
) -> Step:
    op = node.op
    if op in ("constant", "clock"):
        return _listed(y, c if op == "constant" else [c[0] + c[1] * time, c[1] * unit], 0 * c[0])
    a, b = args[0], args[-1]
    m, n = nodes[node.args[0]].degree, nodes[node.args[-1]].degree
    match RULES[op]:
        case Linear() as rule:
            return _linear(rule, y, a, b, c[0] if c else None)
        case Product():
            return _square(y, a, m) if a is b else _product(y, a, b, m, n)
        case Quotient(above=above):
            return _reciprocal(y, a, c[0], m) if above == "c" else _ratio(y, a, b, n)
        case Power():
            return _power(y, a, c[0], ring[op])
        case Root():
            return _root(y, a, ring[op])
        case IntegralOfProduct(sign, factor):
            q, n = (y, node.degree) if factor == SELF else (b, n)
            return _integral_of_product(y, a, q, m, n, sign, ring[op])
        case IntegralOfQuotient(sign):
            return _integral_of_quotient(y, a, b, n, sign, ring[op])


def _listed(y: Series, values: Series, zero: Any) -> Step:
    return lambda k: y.append(values[k] if k < len(values) else zero)


def _linear(rule: Linear, y: Series, a: Series, b: Series, c: Any) -> Step:
    if rule.second:
        combined = add if rule.second > 0 else sub
        return lambda k: y.append(combined(a[k], b[k]))
    if rule.constant == "factor":
        return lambda k: y.append(c * a[k])
    if rule.first < 0:
        return lambda k: y.append(-a[k] if k else c - a[0])
    return lambda k: y.append(a[k] if k else a[0] + c)


def _convolution(a: Series, b: Series, k: int, low: int, high: int) -> Any:
    """Return the sum of a[j] b[k - j] for j from ``low`` to ``high``: terms beyond a series' degree are zero."""
    return sum(map(mul, a[low : high + 1], b[k - high : k - low + 1][::-1])) if low <= high else 0 * b[0]


def _product(y: Series, a: Series, b: Series, m: int, n: int) -> Step:
    return lambda k: y.append(_convolution(a, b, k, max(k - n, 0), min(k, m)))


def _square(y: Series, a: Series, m: int) -> Step:
    def step(k: int) -> None:
        half = 2 * _convolution(a, a, k, max(k - m, 0), (k - 1) // 2)
        y.append(half if k % 2 else half + a[k // 2] * a[k // 2])

    return step


def _ratio(y: Series, a: Series, b: Series, n: int) -> Step:
    return lambda k: y.append((a[k] - _convolution(y, b, k, max(k - n, 0), k - 1)) / b[0] if k else a[0] / b[0])


def _reciprocal(y: Series, a: Series, c: Any, m: int) -> Step:
    return lambda k: y.append(-_convolution(y, a, k, max(k - m, 0), k - 1) / a[0] if k else c / a[0])


def _root(y: Series, a: Series, root: Callable[[Any], Any]) -> Step:
    return lambda k: y.append((a[k] - sum(map(mul, y[1:], y[:0:-1]))) / (2 * y[0]) if k else root(a[0]))


def _power(y: Series, a: Series, c: Any, power: Callable[[Any, Any], Any]) -> Step:
    def step(k: int) -> None:
        if k == 0:
            y.append(power(a[0], c))
        else:
            y.append(sum((c * j - (k - j)) * a[j] * y[k - j] for j in range(1, k + 1)) / (k * a[0]))

    return step


def _integral_of_product(
    y: Series, a: Series, q: Series, m: int, n: int, sign: int, function: Callable[[Any], Any]
) -> Step:
    """y with y' = sign a' q."""
    slopes: Series = []

    def step(k: int) -> None:
        if k == 0:
            y.append(function(a[0]))
            return
        slopes.append(sign * k * a[k])
        y.append(_convolution(slopes, q, k - 1, max(k - 1 - n, 0), min(k, m) - 1) / k)

    return step


def _integral_of_quotient(y: Series, a: Series, q: Series, n: int, sign: int, function: Callable[[Any], Any]) -> Step:
    """y with y' q = sign a'."""
    slopes: Series = []

    def step(k: int) -> None:
        if k == 0:
            y.append(function(a[0]))
            return
        slope = (sign * k * a[k] - _convolution(slopes, q, k - 1, max(k - 1 - n, 0), k - 2)) / q[0]
        slopes.append(slope)
        y.append(slope / k)

    return step
