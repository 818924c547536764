"""Kinks of a model's surfaces and rates as additional surfaces, with checks (imported only for models with kinks)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import sympy as sp

from henon_ref.expressions.bounds import NOT_FINITE
from henon_ref.expressions.evaluation import Kinked
from henon_ref.expressions.kinks import MAX_INNER, Kinks, at_signs, without_signs
from henon_ref.system.source import Names, Path, Source


def with_kinks(
    source: Source, names: Names, surfaces: Mapping[sp.Symbol, Kinked], rates: Sequence[Kinked]
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr], frozenset[int], tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """Return the surfaces of a system and of its kinks, and the field in terms of their signs.

    The surfaces of the system (for a surface with kinks, its branches) are followed by those of kinks. Returned in
    addition are the indices of the surfaces that belong to kinks, the signs of the surfaces that have kinks, in terms
    of the signs of their branches, and the conditions on the parameters (:attr:`FilippovSystem.conditions`).
    """
    kinks = Kinks(names.exact_parameters())
    for sign, (surface, arguments) in surfaces.items():
        if not arguments:
            kinks.declare(sign, surface)
    own: dict[sp.Symbol, sp.Expr] = {}
    values: dict[sp.Symbol, sp.Expr] = {}
    for sign, (surface, arguments) in surfaces.items():
        found, values[sign] = kinks.guard(sign, surface, arguments)
        own |= found
    field = []
    for i, rate in enumerate(rates):
        field.append(resolved(source, ("system", "field", i), kinks, rate, names.signs.values()).xreplace(values))
    _check_names(source, names, list(own), list(kinks.surfaces))
    parts = {sign for sign in own if sign.name not in names.signs or values[sign] != sign}
    made = {**own, **kinks.surfaces}
    numbers = frozenset(i for i, sign in enumerate(made) if sign in kinks.surfaces or sign in parts)
    sections = tuple(value for sign, value in values.items() if value != sign)
    return made, field, numbers, sections, tuple(kinks.conditions)


def resolved(
    source: Source,
    path: Path,
    kinks: Kinks,
    written: Kinked,
    signs: Collection[sp.Symbol] = (),
) -> sp.Expr:
    """Return an expression with symbols for the signs of its kinks, after checking its value on both sides of each.

    A kink whose argument contains some of ``signs`` becomes one kink for each choice of their values.
    """
    expression, arguments = written
    if any(len(argument.free_symbols & set(signs)) > MAX_INNER for argument in arguments):
        raise source.error(
            path, f"the argument of a kink has more than {MAX_INNER} signs; define surfaces and use their signs"
        )
    expression = without_signs(expression, signs)
    arguments = [part for argument in arguments for part in at_signs(argument, signs)]
    check_kinks(source, path, kinks, arguments)
    found = kinks.resolved(expression, arguments)
    for sign in kinks.used(found):
        for side in (-1, 1):
            if found.xreplace({sign: sp.Integer(side), **kinks.parameters}).has(*NOT_FINITE):
                raise source.error(path, f"division by zero (where {kinks.surfaces[sign]} has the sign {side:+d})")
    return found


def check_kinks(source: Source, path: Path, kinks: Kinks, arguments: Sequence[sp.Expr]) -> None:
    """Raise CaseError if the argument of a kink contains parameters alone: its sign would be fixed by their values."""
    still = [a for a in arguments if a.free_symbols and a.free_symbols <= set(kinks.parameters)]
    if still:
        message = f"the argument {still[0]} contains neither t nor a state, so this is not a kink: define a parameter"
        there = "abs(p) is allowed there; max(p, q) is (p + q + abs(p - q))/2, and sign(p) is p/abs(p)"
        raise source.error(path, f"{message} by this expression ({there})")


def _check_names(source: Source, names: Names, surfaces: list[sp.Symbol], kinks: list[sp.Symbol]) -> None:
    """Raise CaseError if the name of a branch or a kink is taken, or if there are too many kinks."""
    taken = {*names.states, *names.parameters}
    for sign in surfaces:
        if sign.name in names.signs:
            name = sign.name
        elif sign.name in taken:
            message = f"'{sign.name}' is the name of a branch of '{name}'; rename the state or parameter"
            raise source.error(("system", "surfaces", name), message, key=True)
    taken |= {sign.name for sign in surfaces}
    for sign in kinks:
        if sign.name in taken:
            message = f"kink1, kink2, ... are the names of kinks; rename the '{sign.name}' of the model"
            raise source.error(("system", "field"), message, key=True)
    if len(kinks) > source.most_states:
        message = f"'field' has {len(kinks)} kinks; at most {source.most_states} are allowed"
        raise source.error(("system", "field"), message, key=True)
