"""Start of a run from plain Python numbers, in microseconds; reading general arguments takes a millisecond.

Arguments that need the reader (values other than int and float, unknown names, constants that are not finite) are left
to it (:mod:`henon_ref.simulation.arguments`); it also reports errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any, cast

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import double_double
from henon_ref.integrator.constants import ModeConstants
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.pairs import Pair, exact_expression, exact_number, pair_of
from henon_ref.integrator.start import Start, begin, run_template
from henon_ref.kernel.shared import kernel
from henon_ref.precision import one_at_a_time
from henon_ref.simulation.system import System

if TYPE_CHECKING:
    from henon_ref.simulation.dependent_parameters import Number

KEPT = 64
"""Number of cached sets of parameter values."""
CLEARLY = 1e-9
"""A condition on the parameters above this value holds, whatever the rounding."""
Values = tuple[float, ...]
"""Values of the parameters in the equations, a pair of doubles each."""
Changes = tuple[tuple[str, float], ...]
"""(name, value) of the parameters whose values differ from the system's."""


class QuickStart:
    """Starts of one system at one local error of a step."""

    def __init__(self, system: System, integrator: Integrator, tolerance: float) -> None:
        self._system, self.integrator = system, integrator
        self._template = run_template(integrator.mode_table.sizes, tolerance=tolerance)
        programs, self._own = integrator.programs, system.model.parameters
        values = chain.from_iterable(double_double(self._own[symbol]) for symbol in programs.parameters)
        self._values: Values = tuple(values)
        self._places = {symbol.name: 2 * at for at, symbol in enumerate(programs.parameters)}
        self._dependents: dict[tuple[str, ...], dict[str, Number] | None] = {}
        self._floats = {symbol.name: float(value) for symbol, value in self._own.items()}
        # The argument of a kink may lie at the edge of its domain, which decides whether its sign is open.
        self._in_kinks = bool(system.model.kinks) and not programs.start.is_rational
        self._constants = lru_cache(maxsize=KEPT)(self._made)

    @classmethod
    def of(cls, system: System, integrator: Integrator, tolerance: float) -> QuickStart | None:
        """Return None if no program evaluates an expression of the system, or an exponent depends on time or states."""
        try:
            return None if system.has_moving_exponents else cls(system, integrator, tolerance)
        except ModelError:
            return None

    def __call__(
        self,
        initial: Mapping[Any, Any],
        until: Any,
        start: Any,
        parameters: Mapping[Any, Any] | None,
        mode: Mapping[Any, Any] | None,
    ) -> Start | None:
        """Return the start of a run; None if the arguments need the reader."""
        plain = type(initial) is dict and (parameters is None or type(parameters) is dict)
        if not plain or not (mode is None or type(mode) is dict) or len(initial) != len(self._system.state):
            return None
        point = start, *map(initial.get, self._system.state)
        pairs = list(map(pair_of, (until, *point)))
        if None in pairs:
            return None
        end, time, *x = cast(list[Pair], pairs)
        if not (end[0] - time[0]) + (end[1] - time[1]) > 0.0:
            return None
        constants, given = self._constants_of(parameters), self._entries(mode) if mode else {}
        if constants is None or given is None:
            return None
        if self._in_kinks and kernel.UNCLEAR_SIGN in constants.signs(time, x):
            return None
        exact = lambda: list(map(exact_number, point))  # noqa: E731
        workspace = self.integrator.workspace()
        found = begin(workspace, constants, self._template, time, end, tuple(x), exact, given)
        self.integrator.free.append(workspace)
        wrong = found.refused is not None and (given or found.refused.status == "failed")
        return None if wrong else found  # the reader reports the error

    def _entries(self, mode: Mapping[Any, Any]) -> dict[int, int] | None:
        """Return a mode by index of the surfaces; None if it is invalid."""
        names = self._system.model.sign_names
        if any(name not in names or type(entry) is not int or entry not in (-1, 0, 1) for name, entry in mode.items()):
            return None
        return {names.index(name): entry for name, entry in mode.items()}

    def _constants_of(self, parameters: Mapping[Any, Any] | None) -> ModeConstants | None:
        """Return the constants at the system's values, some of them changed; None if the values need the reader."""
        if not parameters:
            return self._constants(self._values, ())
        values = self._changed(parameters)
        return None if values is None else self._constants(values, tuple(parameters.items()))

    def _changed(self, parameters: Mapping[Any, Any]) -> Values | None:
        """Return the values with some parameters changed; None if they need the reader.

        (Fractions need it: the exact value of a decimal number follows from its double, that of a fraction does not.)
        """
        pairs = {}
        for name, value in parameters.items():
            pair = pair_of(value)
            if pair is None or name not in self._floats or type(value) is Fraction:
                return None
            pairs[name] = pair
        dependents = self._dependents_of(tuple(parameters))
        if dependents is None:
            return None
        for name, number in dependents.items():
            pairs[name] = number.pair([parameters[own] for own in number.names])
        values = list(self._values)
        for name, pair in pairs.items():
            if not math.isfinite(pair[0]):
                return None
            place = self._places.get(name)
            if place is not None:  # the equations depend on it
                values[place : place + 2] = pair
        if self._conditions is not None and not self._clearly_allowed(
            {name: high for name, (high, _) in pairs.items()}
        ):
            return None
        return tuple(values)

    def _dependents_of(self, names: tuple[str, ...]) -> dict[str, Number] | None:
        """Return the parameters that depend on given ones; None if more than numbers changes (or an exponent)."""
        if names not in self._dependents:
            from henon_ref.simulation.dependent_parameters import Number, following

            try:
                expressions = following(self._system, frozenset(names))
                found: dict[str, Number] | None = {name: Number(own) for name, own in expressions.items()}
            except ModelError:
                found = None
            if found is not None and not self._system.exponent_parameters.isdisjoint((*names, *found)):
                found = None
            self._dependents[names] = found
        return self._dependents[names]

    @cached_property
    def _conditions(self) -> Callable[..., list[float]] | None:
        """Function that evaluates the conditions of a scene on its parameters; compiled when a parameter is changed."""
        with one_at_a_time():
            wanted = self._system.conditions
            return sp.lambdify(list(self._own), wanted, "math") if wanted else None

    def _clearly_allowed(self, parameters: Mapping[str, float]) -> bool:
        """Whether the conditions of the scene hold for these values by more than rounding."""
        assert self._conditions is not None
        try:
            found = self._conditions(**{**self._floats, **parameters})
        except (ArithmeticError, ValueError):
            return False
        return all(condition > CLEARLY for condition in found)

    def _made(self, values: Values, changes: Changes) -> ModeConstants | None:
        """Return the constants at given values; None if a constant is not finite."""
        programs = self.integrator.programs
        made = ModeConstants(programs, values, lambda: self._exact(changes))
        return made if made.is_finite else None

    def _exact(self, changes: Changes) -> list[sp.Expr]:
        """Return the exact values of all parameters: changed ones as printed decimal numbers, and their dependents."""
        given = dict(changes)
        known = {symbol.name: value for symbol, value in self._own.items()}
        known |= {name: exact_expression(value) for name, value in given.items()}
        dependents = self._dependents_of(tuple(given)) or {}
        known |= {name: number.exact(given) for name, number in dependents.items()}
        return [known[symbol.name] for symbol in self.integrator.programs.parameters]
