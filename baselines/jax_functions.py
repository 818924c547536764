"""The equations of one mode as jax functions, from the same expressions as every other adapter's.

Parameters stay arguments, so that one compiled function serves all their values; one that stands in an exponent is put
in, since ``x**2`` is a product and ``x**p`` a logarithm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import sympy as sp

from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.modes.equations import along
from henon_ref.taylor.tape import TIME


class ModeSource(NamedTuple):
    """One mode's equations, parameters as symbols: what is compiled, and what a compiled function is found by."""

    unknowns: tuple[sp.Symbol, ...]
    """The states, then a copy of each guard that is not linear in them."""
    states: int
    numbers: tuple[sp.Symbol, ...]
    """Parameters that are arguments."""
    right: tuple[sp.Expr, ...]
    """Time derivatives of the unknowns."""
    guards: tuple[sp.Expr, ...]


def mode_source(model: ModeFunctions) -> tuple[ModeSource, tuple[float, ...]]:
    """A mode's equations with parameters as symbols, and the parameters' values.

    Parameters
    ----------
    model : ModeFunctions
    """
    fields, guards = model.equations.field, tuple(g.expression for g in model.guards)
    parameters = model.system.parameters
    used = set().union(*(e.free_symbols for e in (*fields, *guards)))
    powers = {e.exp for f in (*fields, *guards) for e in f.atoms(sp.Pow)}
    fixed = {p: v for p, v in parameters.items() if any(p in e.free_symbols for e in powers)}
    fields, guards = (tuple(e.xreplace(fixed) for e in group) for group in (fields, guards))
    numbers = tuple(p for p in parameters if p in used and p not in fixed)
    copies = tuple(sp.Symbol(f"guard_{k}_", real=True) for k in model.followed)
    right = (*fields, *(along(guards[k], model.states, fields) for k in model.followed))
    source = ModeSource((*model.states, *copies), len(model.states), numbers, right, guards)
    return source, tuple(float(parameters[p]) for p in numbers)


def jax_function(source: ModeSource, expressions: Sequence[sp.Expr]) -> Callable[[Any, Any, Any], Any]:
    """``f(t, x, numbers)`` -> one jax array with an entry an expression (x an array of the unknowns)."""
    import jax.numpy as jnp

    arguments = [TIME, *source.unknowns, *source.numbers]
    function = sp.lambdify(arguments, list(expressions), modules="jax", cse=True, dummify=True)
    n, count = len(source.unknowns), len(source.numbers)

    def values(t: Any, x: Any, numbers: Any) -> Any:
        found = function(t, *(x[k] for k in range(n)), *(numbers[k] for k in range(count)))
        return jnp.stack([jnp.asarray(value, dtype=float) for value in found])

    return values
