"""A start from numbers that need no reading: microseconds, where the exact way takes a millisecond.

What it cannot decide by itself is left to the exact way, which also says what is wrong: other values than int and
float, names that are not the system's, a start on a surface, constants that are not finite.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from functools import lru_cache
from typing import Any

import sympy as sp
from flint import arb, fmpq

from henon_ref.errors import ModelError
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.selection import mode_by_signs
from henon_ref.henon.double_constants import DoubleConstants
from henon_ref.henon.integrator import Integrator
from henon_ref.henon.pairs import Pair, Three, exact_expression, exact_number, pair_of, three_of
from henon_ref.henon.records import HENON
from henon_ref.henon.start import Start
from henon_ref.kernel.shared import kernel
from henon_ref.simulation.clear_signs import sign_function
from henon_ref.simulation.dependent_parameters import DependentParameters
from henon_ref.simulation.system import System
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

KEPT = 64
"""Parameter values of which the constants are kept."""
CLEARLY = 1e-9
"""What a condition on the parameters is above where rounding cannot have made it so."""
Values = tuple[Three, ...]
"""Of the parameters that stand in the equations."""
Changes = tuple[tuple[str, float], ...]
"""Parameters, and the values that they have in place of the system's."""


class QuickStart:
    """Starts of one system at one tolerance.

    Parameters
    ----------
    system : System
    integrator : Integrator
        Of its structure.
    tolerance : float
        Local error of a step.
    """

    def __init__(self, system: System, integrator: Integrator, tolerance: float) -> None:
        self._system, self._integrator, self._tolerance = system, integrator, tolerance
        programs, self._own = integrator.programs, system.model.parameters
        self._values: Values = tuple(three_of(double_double(self._own[symbol])) for symbol in programs.parameters)
        self._places = {symbol.name: at for at, symbol in enumerate(programs.parameters)}
        self._dependents: dict[tuple[str, ...], DependentParameters | None] = {}
        self._conditions = sp.lambdify(list(self._own), system.conditions, "math") if system.conditions else None
        self._floats = {symbol.name: float(value) for symbol, value in self._own.items()}
        self._constants = lru_cache(maxsize=KEPT)(self._made)
        model = integrator.system
        inputs = (TIME, *model.states, *programs.parameters)
        self._signs = sign_function(inputs, [*model.surfaces, *model.valid])

    @classmethod
    def of(cls, system: System, integrator: Integrator, tolerance: float) -> QuickStart | None:
        """None for a system with expressions that no program evaluates, and one with exponents in time or states."""
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
        """Where a run starts; None where that is to be found in the exact way."""
        plain = type(initial) is dict and (parameters is None or type(parameters) is dict)
        if not plain or not (mode is None or type(mode) is dict):
            return None
        values = self._values if not parameters else self._changed(parameters)
        changes = tuple(parameters.items()) if parameters else ()
        time, end = pair_of(start), pair_of(until)
        names = self._system.state
        if values is None or time is None or end is None or len(initial) != len(names):
            return None
        x = []
        for name in names:
            pair = pair_of(initial.get(name))
            if pair is None:
                return None
            x.append(pair)
        constants = self._constants(values, changes)
        if constants is None or not (end[0] - time[0]) + (end[1] - time[1]) > 0.0:
            return None
        integrator, refused, zeros = self._integrator, None, self._integrator.no_zeros
        row = None if mode else self._row_off_surfaces(constants, time, x)
        if row is None:
            signs = self._exact_signs(start, initial, parameters or {})
            found = signs and self._decided(constants, signs, time[0], [high for high, _ in x], mode)
            if not found:
                return None
            refused, row, zeros = found
        return Start(time, end, tuple(x), refused, row, zeros, integrator.order, self._tolerance, HENON, constants)

    def _row_off_surfaces(self, constants: DoubleConstants, time: Pair, x: list[Pair]) -> int | None:
        """Row of the mode at the start; None where that may be on a surface, and where the model may not hold."""
        count = len(self._integrator.system.surfaces)
        if self._signs is None:
            signs: tuple[int, ...] | None = constants.start_signs(time, x)
        else:
            signs = self._signs(time[0], *[high for high, _ in x], *constants.doubles)
        if signs is None or kernel.UNCLEAR_SIGN in signs or 0 in signs or -1 in signs[count:]:
            return None
        return self._integrator.mode_table.known(signs[:count])

    def _exact_signs(
        self, start: Any, initial: Mapping[str, Any], parameters: Mapping[str, Any]
    ) -> tuple[int, ...] | None:
        """Signs of the surfaces, then of the ``valid`` expressions; None where fractions do not give them."""
        program = self._integrator.programs.start
        values = self._exact(tuple(parameters.items()))
        if not program.is_rational or not all(value.is_Rational for value in values):
            return None
        point = (exact_number(start), *(exact_number(initial[name]) for name in self._system.state))
        rational = [fmpq(number.numerator, number.denominator) for number in point]
        rational += [fmpq(int(value.p), int(value.q)) for value in values]
        try:
            found = program.over_ring(rational, lambda number: fmpq(int(number.p), int(number.q)), arb.sqrt)
        except ZeroDivisionError:
            return None
        return tuple((value > 0) - (value < 0) for value in found)

    def _decided(
        self,
        constants: DoubleConstants,
        signs: tuple[int, ...],
        t: float,
        x: list[float],
        mode: Mapping[Any, Any] | None,
    ) -> tuple[Trajectory | None, int, tuple[int, ...]] | None:
        """What every run comes to that cannot begin, else None; row and known zeros of the mode at the start.

        None where a mode that is given is not one of the system's, or is contradicted by a sign.
        """
        integrator, names = self._integrator, self._system.model.sign_names
        given: dict[int, int] = {}
        for name, entry in (mode or {}).items():
            index = names.index(name) if name in names else -1
            if index < 0 or type(entry) is not int or entry not in (-1, 0, 1) or signs[index] not in (0, entry):
                return None
            given[index] = entry
        if not given:
            row, zeros = integrator.clear_start(constants, signs, t, x)
            if row >= 0:
                return None, row, zeros
        surfaces, valid = signs[: len(names)], signs[len(names) :]
        decision = mode_by_signs(constants.in_doubles.at(t, x), surfaces, valid, given)
        if 0 in given.values() and decision.mode is not None and integrator.mode_table.row(decision.mode) is None:
            return None
        return integrator.entered(constants, t, x, decision, surfaces, valid)

    def _changed(self, parameters: Mapping[Any, Any]) -> Values | None:
        """Values of the parameters, some of them others; None where they are not to be had like that.

        (A fraction could not be told from its pair afterwards, a decimal number can.)
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
        pairs |= dependents.pairs(parameters)
        values = list(self._values)
        for name, pair in pairs.items():
            if not math.isfinite(pair[0]):
                return None
            place = self._places.get(name)
            if place is not None:  # else nothing depends on it
                values[place] = three_of(pair)
        if self._conditions is not None and not self._clearly_allowed(
            {name: high for name, (high, _) in pairs.items()}
        ):
            return None
        return tuple(values)

    def _dependents_of(self, names: tuple[str, ...]) -> DependentParameters | None:
        """What follows some parameters; None where that is not all that they change."""
        if names not in self._dependents:
            try:
                found: DependentParameters | None = DependentParameters.of(self._system, frozenset(names))
            except ModelError:
                found = None
            if found is not None and not self._system.exponent_parameters.isdisjoint((*names, *found.names)):
                found = None
            self._dependents[names] = found
        return self._dependents[names]

    def _clearly_allowed(self, parameters: Mapping[str, float]) -> bool:
        """Whether a scene allows these values beyond what rounding could change."""
        assert self._conditions is not None
        try:
            found = self._conditions(**{**self._floats, **parameters})
        except (ArithmeticError, ValueError):
            return False
        return all(condition > CLEARLY for condition in found)

    def _made(self, values: Values, changes: Changes) -> DoubleConstants | None:
        """Constants at some values; None where some of them are not finite."""
        programs = self._integrator.programs
        made = DoubleConstants(programs, values, lambda: self._exact(changes))
        return made if made.is_finite else None

    def _exact(self, changes: Changes) -> list[sp.Expr]:
        """Exact values: the system's own, or the decimal numbers that others are printed as, and what follows these."""
        given = dict(changes)
        known = {symbol.name: value for symbol, value in self._own.items()}
        known |= {name: exact_expression(value) for name, value in given.items()}
        dependents = self._dependents_of(tuple(given))
        if dependents is not None:
            known |= dependents.exact(given)
        return [known[symbol.name] for symbol in self._integrator.programs.parameters]
