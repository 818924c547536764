"""Start of a run from plain Python numbers, in microseconds; reading general arguments takes a millisecond.

Parameters that are expressions in other parameters follow changed ones (:func:`following`, :class:`Number`). Initial
values, initial time and horizon may also be text, which is read once.

Arguments that need the reader (values of other types, unknown names, constants that are not finite) are left to it
(:mod:`henon_ref.simulation.arguments`); it also reports errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from graphlib import TopologicalSorter
from itertools import chain
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import HenonRefError, ModelError
from henon_ref.expressions.bounds import double_double
from henon_ref.expressions.evaluation import parse_expression
from henon_ref.integrator.constant_program import BITS, constant_program
from henon_ref.integrator.constants import ModeConstants
from henon_ref.integrator.integrator import Integrator, Start, run_template
from henon_ref.integrator.pairs import Pair, exact_expression, exact_number, pair_of, pairs_of
from henon_ref.kernel.library import kernel
from henon_ref.precision import one_at_a_time, working_precision
from henon_ref.simulation.system import System
from henon_ref.system.source import Source

CLEARLY = 1e-9
"""A condition on the parameters above this value holds, whatever the rounding."""


def following(system: System, moved: frozenset[str]) -> dict[str, sp.Expr]:
    """Return the parameters that depend on changed ones, as expressions in the changed ones only."""
    read = {name: expression for name, expression in system.parameter_expressions.items() if name not in moved}
    uses = {name: {s.name for s in expression.free_symbols} for name, expression in read.items()}
    known = {symbol: value for symbol, value in system.model.parameters.items() if symbol.name not in moved}
    found: dict[str, sp.Expr] = {}
    for name in TopologicalSorter(uses).static_order():  # each after the ones that it uses
        if name in read and uses[name] & (moved | found.keys()):
            found[name] = known[sp.Symbol(name, real=True)] = read[name].xreplace(known)
    return found


class Number:
    """Expression in parameters, evaluated exactly at the printed decimal numbers of their doubles.

    ModelError if no program evaluates a function in it.
    """

    def __init__(self, expression: sp.Expr) -> None:
        symbols = tuple(sorted(expression.free_symbols, key=lambda s: s.name))
        self.names = tuple(symbol.name for symbol in symbols)
        self._expression, self._symbols = expression, symbols
        self._program = constant_program(symbols, (expression,)) if symbols else None
        self._constant = (math.nan, 0.0) if symbols else double_double(expression)

    def pair(self, point: Sequence[float]) -> Pair:
        """Return its value as a pair of doubles at values of ``names``; NaN if a value is not finite."""
        if self._program is None:
            return self._constant
        if all(map(math.isfinite, point)):
            with working_precision(BITS):  # also for the difference, whose nearest double is wanted
                (exact,) = self._program.exact_values([exact_expression(value) for value in point])
                high = float(exact)
                if math.isfinite(high):
                    return high, float(exact - high)
        return math.nan, 0.0

    def pairs(self, columns: Mapping[str, NDArray[np.float64]], count: int) -> NDArray[np.float64]:
        """Return its values at many points, given as columns by name, shape (count, 2)."""
        if self._program is None:
            return np.broadcast_to(self.pair(()), (count, 2))
        points, places = np.unique(np.column_stack([columns[n] for n in self.names]), axis=0, return_inverse=True)
        return np.array([self.pair(point) for point in points.tolist()]).reshape(-1, 2)[places.ravel()]

    def exact(self, values: Mapping[str, float]) -> sp.Expr:
        """Return its exact value at values of the parameters."""
        return self._expression.xreplace({s: exact_expression(values[s.name]) for s in self._symbols})


class QuickStart:
    """Starts of one system at one local error of a step.

    ModelError if no program evaluates an expression of the system.
    """

    def __init__(self, system: System, integrator: Integrator, tolerance: float) -> None:
        self._system, self.integrator, self._stops = system, integrator, stops_of(system)
        self._template = run_template(integrator.mode_table.sizes, tolerance=tolerance)
        programs, self._own = integrator.programs, system.model.parameters
        self._values = [*chain.from_iterable(double_double(self._own[symbol]) for symbol in programs.parameters)]
        self._places = {symbol.name: 2 * at for at, symbol in enumerate(programs.parameters)}
        self._floats = {symbol.name: float(value) for symbol, value in self._own.items()}
        # The argument of a kink may lie at the edge of its domain, which decides whether its sign is open.
        self._in_kinks = bool(system.model.kinks) and not programs.start.is_rational
        self._changes, self._constants = lru_cache(64)(self._changes_of), lru_cache(64)(self._made)
        self._number = lru_cache(1024)(self._number_of)

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
        point = until, start, *map(initial.get, self._system.state)
        names, given = tuple(parameters or ()), _pairs_of_parameters(parameters)
        if given is None:
            return None
        numbers = pairs_of(point)
        if numbers is None:
            read = self._read(point, names, given)
            if read is None:
                return None
            point, numbers = read
        end, time = numbers[:2]
        if not (end[0] - time[0]) + (end[1] - time[1]) > 0.0:
            return None
        constants, entries = self._constants(names, given), self._entries(mode) if mode else {}
        if constants is None or entries is None or not entries.keys().isdisjoint(self._stops):
            return None
        if self._in_kinks and kernel.UNCLEAR_SIGN in constants.signs(numbers[1:]):
            return None
        exact = partial(_exact_numbers, point[1:], names, given)
        found = self.integrator.begin_at(constants, self._template, numbers, exact, entries)
        if found.refused is not None:
            wrong = bool(entries or self._stops or found.refused.status == "failed")
        else:
            reached = self.integrator.mode_table.mode(found.scalars.mode) if self._stops else ()
            wrong = any(reached[stop] < 0 for stop in self._stops)  # beyond a stop
        return None if wrong else found  # the reader reports the error

    def _read(
        self, values: Iterable[Any], names: tuple[str, ...], given: tuple[Pair, ...]
    ) -> tuple[tuple[Any, ...], tuple[Pair, ...]] | None:
        """Return values with a :class:`Number` for each text, and all of them as pairs; None if one needs the reader.

        ``names``, ``given``: changed parameters.
        """
        point, pairs, changed = list[Any](), list[Pair](), _numbers(names, given)
        for value in values:
            number = self._number(value, names) if isinstance(value, str) else value
            if isinstance(number, Number):
                pair: Pair | None = number.pair([changed[name] for name in number.names])
            else:
                pair = pair_of(number)
            if pair is None or not math.isfinite(pair[0]):
                return None
            point.append(number)
            pairs.append(pair)
        return tuple(point), tuple(pairs)

    def _number_of(self, text: str, changed: tuple[str, ...]) -> Number | None:
        """Return a text as a number, in terms of changed parameters; None if it needs the reader."""
        system, symbols = self._system, {symbol.name: symbol for symbol in self._own}
        with one_at_a_time(), suppress(HenonRefError):
            if not changed:
                return Number(system.number(text))
            own = system.model.parameter_values | following(system, frozenset(changed))
            known = {symbols[name]: value for name, value in own.items() if name not in changed}
            return Number(parse_expression(text, symbols).xreplace(known))
        return None

    def _entries(self, mode: Mapping[Any, Any]) -> dict[int, int] | None:
        """Return a mode by index of the surfaces; None if it is invalid."""
        names = self._system.model.sign_names
        if any(name not in names or type(entry) is not int or entry not in (-1, 0, 1) for name, entry in mode.items()):
            return None
        return {names.index(name): entry for name, entry in mode.items()}

    def _made(self, names: tuple[str, ...], given: tuple[Pair, ...]) -> ModeConstants | None:
        """Return the constants at changed values; None if they need the reader, or a constant is not finite."""
        changes = self._changes(names)
        if changes is None:
            return None
        pairs, values = given, self._values.copy()
        dependents, places = changes
        if names and (dependents or self._conditions):
            numbers = _numbers(names, given)
            pairs += tuple([own.pair([numbers[name] for name in own.names]) for own in dependents.values()])
            if not self._clearly_allowed(numbers | _numbers(dependents, pairs[len(given) :])):
                return None
        for place, pair in zip(places, pairs, strict=True):
            if place >= 0:
                values[place : place + 2] = pair
        made = ModeConstants(self.integrator.programs, tuple(values), partial(self._exact, names, given))
        return made if made.is_finite else None

    def _changes_of(self, names: tuple[str, ...]) -> tuple[Mapping[str, Number], tuple[int, ...]] | None:
        """Return the parameters that depend on given ones, and the places of the given ones, then of these, among the
        values (-1 of one in no equation); None if more changes than numbers (or an exponent)."""
        if not names:
            return {}, ()
        if not self._floats.keys() >= set(names):
            return None
        try:
            dependents = {name: Number(own) for name, own in following(self._system, frozenset(names)).items()}
        except ModelError:
            return None
        changed = *names, *dependents
        if not self._system.exponent_parameters.isdisjoint(changed):
            return None
        return dependents, tuple([self._places.get(name, -1) for name in changed])

    @cached_property
    def _conditions(self) -> Callable[..., list[float]] | None:
        """Function that evaluates the conditions on the parameters; compiled when a parameter is changed."""
        with one_at_a_time():
            wanted = self._system.model.conditions
            return sp.lambdify(list(self._own), wanted, "math") if wanted else None

    def _clearly_allowed(self, numbers: Mapping[str, float]) -> bool:
        """Whether numbers are finite, and the conditions on the parameters hold for them by more than rounding."""
        if not all(map(math.isfinite, numbers.values())):
            return False
        try:
            found = self._conditions(**{**self._floats, **numbers}) if self._conditions else ()
        except (ArithmeticError, ValueError):
            return False
        return all(condition > CLEARLY for condition in found)

    def _exact(self, names: tuple[str, ...], given: tuple[Pair, ...]) -> list[sp.Expr]:
        """Return the exact values of all parameters: changed ones as printed decimal numbers, and their dependents."""
        numbers, changes = _numbers(names, given), self._changes(names)
        assert changes is not None
        known = {**self._system.model.parameter_values}
        known |= {name: exact_expression(value) for name, value in numbers.items()}
        known |= {name: own.exact(numbers) for name, own in changes[0].items()}
        return [known[symbol.name] for symbol in self.integrator.programs.parameters]


def stops_of(system: System) -> tuple[int, ...]:
    """Return the hard stops of a scene: a start beyond one, or on one and moving into it, is refused."""
    return tuple(sorted(system.model.resets)) if Source(system.tree).has_scene else ()


def _pairs_of_parameters(parameters: Mapping[Any, Any] | None) -> tuple[Pair, ...] | None:
    """Return changed parameters as pairs; None if they need the reader.

    (Fractions need it: the exact value of a decimal number follows from its double, that of a fraction does not.)
    """
    if not parameters:
        return ()
    return None if Fraction in map(type, parameters.values()) else pairs_of(parameters.values())


def _exact_numbers(point: Sequence[Any], names: tuple[str, ...], given: tuple[Pair, ...]) -> list[Any]:
    """Return the exact numbers of a point (:meth:`QuickStart._read`) at changed parameters."""
    changed = _numbers(names, given)
    with one_at_a_time():
        return [value.exact(changed) if isinstance(value, Number) else exact_number(value) for value in point]


def _numbers(names: Iterable[str], pairs: Iterable[Pair]) -> dict[str, float]:
    return {name: high for name, (high, _) in zip(names, pairs, strict=True)}
