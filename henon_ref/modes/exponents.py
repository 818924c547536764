"""Exponents that are parameters, written out: x**3 is smooth where x is 0, x**n is so for some n only."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import sympy as sp

from henon_ref.modes.system import FilippovSystem


def with_rational_exponents(system: FilippovSystem) -> FilippovSystem:
    """The system with the numbers of its parameters in every exponent that they make rational.

    An exponent decides what function a power is (a product, a root), and nothing that holds for the symbol holds
    for all its values. Powers of numbers and parameters, and parameters everywhere else, stay as they are written.
    """
    written = cache(partial(_written, system))  # overrides hold the field's own rates again and again
    overrides = {
        index: replace(
            override,
            field=tuple(map(written, override.field)),
            release=tuple(replace(r, when=written(r.when)) for r in override.release),
        )
        for index, override in system.overrides.items()
    }
    resets = {
        index: replace(reset, map={x: written(value) for x, value in reset.map.items()})
        for index, reset in system.resets.items()
    }
    return replace(
        system,
        surfaces=tuple(map(written, system.surfaces)),
        field=tuple(map(written, system.field)),
        valid=tuple(map(written, system.valid)),
        overrides=overrides,
        resets=resets,
    )


def parameters_in_exponents(system: FilippovSystem) -> set[sp.Symbol]:
    """Parameters whose values :func:`with_rational_exponents` looks at: with others the system is another one."""
    expressions = [*system.surfaces, *system.field, *system.valid]
    for override in system.overrides.values():
        expressions += [*override.field, *(r.when for r in override.release)]
    exponents = (power.exp for e in set(expressions) for power in e.atoms(sp.Pow))
    return {symbol for exponent in exponents for symbol in exponent.free_symbols} & set(system.parameters)


def _written(system: FilippovSystem, expression: sp.Expr) -> sp.Expr:
    constant = set(system.parameters)

    def open_exponent(e: sp.Basic) -> bool:
        return (
            isinstance(e, sp.Pow)
            and bool(e.exp.free_symbols & constant)
            and not e.base.free_symbols <= constant
            and bool(system.numeric(e.exp).is_Rational)
        )

    return expression.replace(open_exponent, lambda e: sp.Pow(e.base, system.numeric(e.exp)), simultaneous=False)
