"""Values of all parameters of a system where some of them are swept: those that are expressions in them follow."""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import TopologicalSorter

import numpy as np
import sympy as sp

from henon_ref.casefile.expressions import parse_expression
from henon_ref.casefile.tree import ScalarNode, child
from henon_ref.simulation.system import System
from henon_ref.simulation.written import written
from henon_ref.sweeps.runs import Vector


def parameter_values(system: System, swept: Mapping[str, Vector], count: int) -> dict[str, Vector]:
    """Every parameter -> its values, shape (count,).

    Parameters
    ----------
    system : System
    swept : mapping
        Parameter -> values, shape (count,).
    count : int
    """
    found = {name: np.full(count, float(sp.N(value))) for name, value in system.parameters.items()} | dict(swept)
    for name, expression in following(system, frozenset(swept)).items():
        symbols = sorted(expression.free_symbols, key=lambda s: s.name)
        with np.errstate(all="ignore"):
            value = sp.lambdify(symbols, expression, "numpy")(*(found[s.name] for s in symbols))
        found[name] = np.broadcast_to(np.asarray(value, dtype=np.float64), (count,)).copy()
    return found


def number_values(system: System, value: object, parameters: Mapping[str, Vector], moved: frozenset[str]) -> Vector:
    """A number at each point: one that is text in parameters follows those that are swept.

    Parameters
    ----------
    system : System
    value : number or str
    parameters : mapping
        Every parameter -> its values, shape (K,).
    moved : frozenset of str
        Parameters that are swept, and those that follow them.
    """
    count = len(next(iter(parameters.values()))) if parameters else 1
    expression = parse_expression(written(value, "a number"), {name: sp.Symbol(name, real=True) for name in parameters})
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    if not moved & {s.name for s in symbols}:
        return np.full(count, float(sp.N(system.number(value))))
    with np.errstate(all="ignore"):
        found = sp.lambdify(symbols, expression, "numpy")(*(parameters[s.name] for s in symbols))
    return np.broadcast_to(np.asarray(found, dtype=np.float64), (count,)).copy()


def following(system: System, swept: frozenset[str]) -> dict[str, sp.Expr]:
    """Parameters that are expressions in swept ones, directly or not, each behind those that it uses."""
    symbols = {name: sp.Symbol(name, real=True) for name in system.parameters}
    key = "system" if "system" in system.tree.entries else "scene"
    written = {name: child(system.tree, (key, "parameters", name)) for name in symbols}
    read = {
        name: parse_expression(node.text, symbols)
        for name, node in written.items()
        if isinstance(node, ScalarNode) and isinstance(node.value, str) and name not in swept
    }
    uses = {name: {s.name for s in expression.free_symbols} for name, expression in read.items()}
    moved = set(swept)
    order = [name for name in TopologicalSorter(uses).static_order() if name in read]
    found: dict[str, sp.Expr] = {}
    for name in order:
        if uses[name] & moved:
            moved.add(name)
            found[name] = read[name]
    return found
