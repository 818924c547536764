"""Values of all parameters of a system where some of them are swept: those that are expressions in them follow."""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import TopologicalSorter

import numpy as np
import sympy as sp

from henon_ref.casefile.expressions import parse_expression
from henon_ref.casefile.tree import ScalarNode, child
from henon_ref.simulation.system import System
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
