"""Kinks of a model's surfaces and rates, as more surfaces: what has none does without this."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import sympy as sp

from henon_ref.casefile.kinks import MAX_INNER, Kinks, at_signs, without_signs
from henon_ref.casefile.source import Names, Path, Source

Kinked = tuple[sp.Expr, list[sp.Expr]]
"""An expression, and what it has kinks for in order of appearance."""


def with_kinks(
    source: Source, names: Names, surfaces: Mapping[sp.Symbol, Kinked], rates: Sequence[Kinked]
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr], frozenset[int], tuple[sp.Expr, ...]]:
    """Surfaces of a system and of its kinks, and its field by their signs.

    Parameters
    ----------
    source : Source
    names : Names
    surfaces : mapping
        Sign -> its surface.
    rates : sequence
        Of the states.

    Returns
    -------
    surfaces : dict
        The system's own, branches of such as have kinks, and those of kinks.
    field : list of Expr
    kinks : frozenset of int
        Surfaces that stand for kinks.
    sections : tuple of Expr
        Signs of surfaces that have kinks, by those of their branches.

    Raises
    ------
    CaseError
        At the place of a kink that cannot be one.
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
    signs = list(names.signs)
    _check_guards(source, names, signs, own)
    _check_names(source, kinks, {*names.states, *(sign.name for sign in own), *names.parameters})
    branches = {sign for sign in own if sign.name not in signs or values[sign] != sign}
    made = {**own, **kinks.surfaces}
    numbers = frozenset(i for i, sign in enumerate(made) if sign in kinks.surfaces or sign in branches)
    return made, field, numbers, tuple(value for sign, value in values.items() if value != sign)


def resolved(
    source: Source,
    path: Path,
    kinks: Kinks,
    written: Kinked,
    signs: Collection[sp.Symbol] = (),
) -> sp.Expr:
    """An expression with symbols for the signs of its kinks, and a value at both sides of each.

    Where a kink's argument holds some of ``signs``, it is one kink for each of their sides.
    """
    expression, arguments = written
    if any(len(argument.free_symbols & set(signs)) > MAX_INNER for argument in arguments):
        raise source.error(path, f"a kink of what holds more than {MAX_INNER} signs; name surfaces and use their signs")
    expression = without_signs(expression, signs)
    arguments = [part for argument in arguments for part in at_signs(argument, signs)]
    check_kinks(source, path, kinks, arguments)
    found = kinks.resolved(expression, arguments)
    for sign in kinks.used(found):
        for side in (-1, 1):
            if found.xreplace({sign: sp.Integer(side), **kinks.parameters}).has(sp.zoo, sp.nan, sp.oo, -sp.oo):
                raise source.error(path, f"division by zero (where {kinks.surfaces[sign]} has the sign {side:+d})")
    return found


def check_kinks(source: Source, path: Path, kinks: Kinks, arguments: Sequence[sp.Expr]) -> None:
    """Refuse kinks of parameters alone: what they are may change with these, when the equations are made."""
    still = [a for a in arguments if a.free_symbols and a.free_symbols <= set(kinks.parameters)]
    if still:
        message = f"{still[0]} holds neither t nor a state, and no kink: make what is written of it a parameter"
        raise source.error(path, f"{message} (where abs(...) is allowed)")


def _check_guards(source: Source, names: Names, signs: list[str], surfaces: dict[sp.Symbol, sp.Expr]) -> None:
    """Refuse a surface with kinks whose branches' names are taken."""
    taken = {*names.states, *names.parameters}
    for sign in surfaces:
        if sign.name in signs:
            name = sign.name
            continue
        path: Path = ("system", "surfaces", name)
        if sign.name in taken:
            raise source.error(path, f"'{sign.name}' is the name of a branch of '{name}'; rename what has it", key=True)


def _check_names(source: Source, kinks: Kinks, taken: set[str]) -> None:
    for sign in kinks.surfaces:
        if sign.name in taken:
            message = f"kink1, kink2, ... are the names of what has a kink here; '{sign.name}' is taken: rename it"
            raise source.error(("system", "field"), message, key=True)
    if len(kinks.surfaces) > source.most_states:
        message = f"'field' has {len(kinks.surfaces)} kinks; at most {source.most_states} are allowed"
        raise source.error(("system", "field"), message, key=True)
