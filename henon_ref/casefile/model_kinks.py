"""Kinks of a model's surfaces and rates, as additional surfaces (imported only for models with kinks)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import sympy as sp

from henon_ref.casefile.kinks import MAX_INNER, Sgn, at_signs, branches, chosen, sgn, without_signs
from henon_ref.casefile.source import Names, Path, Source
from henon_ref.modes.algebra import signed_form
from henon_ref.modes.bounds import exact_sign
from henon_ref.modes.switched_field import up_to_a_number

Kinked = tuple[sp.Expr, list[sp.Expr]]
"""Expression, and the arguments of its kinks in order of appearance."""


class Kinks:
    """Collection of the surfaces of a model's kinks; signs of expressions in parameters alone become numbers."""

    def __init__(self, parameters: Mapping[sp.Symbol, sp.Expr]) -> None:
        """``parameters``: parameter -> exact value."""
        self.parameters = dict(parameters)
        self.surfaces: dict[sp.Symbol, sp.Expr] = {}
        """Sign -> its argument, as written first."""
        self.declared: dict[sp.Symbol, sp.Expr] = {}
        """Sign of a surface of the model -> the surface."""
        self.conditions: list[sp.Expr] = []
        """Expressions in parameters that were taken as positive, from the parameters' values."""
        self.declared_late = False
        """Whether a kink equals a surface that was declared after it."""
        self._waiting: dict[sp.Symbol, sp.Expr] = {}
        """Declared surfaces whose normal forms have not been computed."""
        self._signs: dict[sp.Expr, sp.Expr] = {}
        """Normal form -> its sign: a symbol, minus a symbol, or a number."""
        self._known: dict[object, sp.Expr] = {}
        """Form of :func:`henon_ref.modes.algebra.signed_form` -> its sign, a symbol or minus a symbol."""

    def declare(self, sign: sp.Symbol, surface: sp.Expr) -> None:
        """Declare a surface of the model: a kink that equals it up to a factor shares its sign."""
        self.declared[sign] = self._waiting[sign] = surface
        if self.surfaces:
            self._take_in()

    def _take_in(self) -> None:
        """Compute the forms of the declared surfaces (postponed because models without kinks do not need them)."""
        for sign, surface in self._waiting.items():
            form, way = signed_form(surface, self.parameters)
            own = self._known.setdefault(form, way * sign)
            self.declared_late |= not own.free_symbols.isdisjoint(self.surfaces)
        self._waiting.clear()

    def resolved(self, expression: sp.Expr, arguments: Sequence[sp.Expr]) -> sp.Expr:
        """Return an expression with symbols for its signs; ``arguments`` of its kinks in order of appearance."""
        for argument in (part for whole in arguments for part in branches(whole)):
            form, way = (argument, 1) if argument.is_number else up_to_a_number(argument)
            if form not in self._signs and expression.has(Sgn(form)):
                self._signs[form] = way * self._sign(argument)
        found = ((sign, self._signs.get(sign.args[0])) for sign in expression.atoms(Sgn))
        return expression.xreplace({sign: value for sign, value in found if value is not None})

    def guard(
        self, sign: sp.Symbol, expression: sp.Expr, arguments: Sequence[sp.Expr]
    ) -> tuple[dict[sp.Symbol, sp.Expr], sp.Expr]:
        """Return the surfaces of a guard that may have kinks, and its sign as an expression in their signs.

        Without kinks the surface is the guard itself; with kinks each branch is a surface: ``s``, ``s_2``, ...
        """
        surfaces: dict[sp.Symbol, sp.Expr] = {}
        signs: dict[sp.Expr, sp.Expr] = {}
        parts = branches(expression)
        for part in parts:
            form, way = (part, 1) if part.is_number else up_to_a_number(part)
            if Sgn(form) not in signs and not part.free_symbols <= set(self.parameters):
                own = sp.Symbol(f"{sign.name}_{len(surfaces) + 1}", real=True) if surfaces else sign
                surfaces[own] = part
                signs[Sgn(form)] = way * own
        return surfaces, self.resolved(sgn(expression).xreplace(signs), [*arguments, *parts])

    def positive_part(self, expression: sp.Expr, arguments: Sequence[sp.Expr] = ()) -> sp.Expr:
        """Return max(0, expression); the expression may have kinks, of ``arguments``."""
        return self.resolved(chosen(expression, expression, sp.S.Zero), [*arguments, expression])

    def limited(self, expression: sp.Expr, bound: sp.Expr) -> sp.Expr:
        """Return the expression limited to [-bound, bound]."""
        above, below = bound + expression, bound - expression
        return self.resolved((sgn(above) * above - sgn(below) * below) / 2, [above, below])

    def used(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        """Return the kinks whose signs occur in an expression."""
        held = expression.free_symbols
        return {sign: surface for sign, surface in self.surfaces.items() if sign in held}

    def _sign(self, argument: sp.Expr) -> sp.Expr:
        if argument.free_symbols <= set(self.parameters):
            value = exact_sign(argument.xreplace(self.parameters))
            self.conditions.append(-argument if value < 0 else argument)
            return sp.Integer(value)
        self._take_in()
        form, way = signed_form(argument, self.parameters)
        if form not in self._known:
            sign = sp.Symbol(f"kink{len(self.surfaces) + 1}", real=True)
            self.surfaces[sign], self._known[form] = argument, way * sign
        return way * self._known[form]


def with_kinks(
    source: Source, names: Names, surfaces: Mapping[sp.Symbol, Kinked], rates: Sequence[Kinked]
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr], frozenset[int], tuple[sp.Expr, ...]]:
    """Return the surfaces of a system and of its kinks, and the field in terms of their signs.

    Returns
    -------
    surfaces : dict
        Surfaces of the system (for a surface with kinks, its branches), followed by those of kinks.
    field : list of Expr
    kinks : frozenset of int
        Indices of the surfaces that belong to kinks.
    sections : tuple of Expr
        Signs of the surfaces that have kinks, in terms of the signs of their branches.
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
    return made, field, numbers, tuple(value for sign, value in values.items() if value != sign)


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
            if found.xreplace({sign: sp.Integer(side), **kinks.parameters}).has(sp.zoo, sp.nan, sp.oo, -sp.oo):
                raise source.error(path, f"division by zero (where {kinks.surfaces[sign]} has the sign {side:+d})")
    return found


def check_kinks(source: Source, path: Path, kinks: Kinks, arguments: Sequence[sp.Expr]) -> None:
    """Raise CaseError if the argument of a kink contains parameters alone: its sign would be fixed by their values."""
    still = [a for a in arguments if a.free_symbols and a.free_symbols <= set(kinks.parameters)]
    if still:
        message = f"the argument {still[0]} contains neither t nor a state, so this is not a kink: define a parameter"
        raise source.error(path, f"{message} by this expression (abs(...) is allowed there)")


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
