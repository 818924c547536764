"""What the runs of a chunk leave behind, as arrays over all of them: observations are computed from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.integrator.start import MOST_STEPS
from henon_ref.modes.algebra import signed_form
from henon_ref.modes.bounds import double_double
from henon_ref.modes.kinks import HiddenKinks
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.simulation.system import System
from henon_ref.simulation.written import python_number
from henon_ref.text import listed


class Section(NamedTuple):
    """Where an expression stands among the surfaces of a system."""

    surface: int
    orientation: int
    """+1 or -1: the sign of the expression is that of the surface's, times this."""


def with_sections(system: System, expressions: Sequence[sp.Expr]) -> tuple[System, dict[sp.Expr, Section]]:
    """A system that has some expressions among its surfaces, and where each stands.

    An expression that is a surface times a factor which always has one sign is that surface. Fields do not depend on
    the sign of one that is added: its normal velocity is the same on both sides, and it is always crossed.

    Parameters
    ----------
    system : System
    expressions : sequence of Expr
        In time, states and parameters.
    """
    model = system.model
    added: dict[sp.Symbol, sp.Expr] = {}
    known: dict[object, tuple[int, int]] = {}
    for index, surface in enumerate(model.surfaces):
        form, way = signed_form(surface, model.parameters)
        known.setdefault(form, (index, way))
    found: dict[sp.Expr, Section] = {}
    for expression in expressions:
        if expression in found:
            continue
        form, way = signed_form(expression, model.parameters)
        if form not in known:
            known[form] = len(model.surfaces) + len(added), way
            added[sp.Symbol(f"section {len(added) + 1}", real=True)] = expression  # no name has a blank
        index, own = known[form]
        found[expression] = Section(index, way * own)
    return (system.with_surfaces(added) if added else system), found


Vector = NDArray[np.float64]
Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Settings:
    """What all runs of a sweep have in common.

    Numbers are int, float, Fraction or text, as :func:`henon_ref.simulation.simulate.simulate` takes them.
    """

    system: System
    initial: Mapping[str, Any]
    start: Any
    until: Any
    rtol: float
    mode: Mapping[str, int] | None = None
    max_steps: int = MOST_STEPS

    @cached_property
    def exact_parameters(self) -> dict[tuple[float, float], sp.Expr]:
        """The system's own values by their pairs of doubles."""
        return {double_double(value): value for value in self.system.model.parameters.values()}


def told(point: int, values: Mapping[str, Any]) -> str:
    """A point in words: its number, and the first of its values."""
    words = [f"{name} = {repr(float(value)).removesuffix('.0')}" for name, value in values.items()]
    return f"point {point} ({listed(words, 4)})"


@dataclass(frozen=True, eq=False)
class Runs:
    """K runs of one system, and their R transitions.

    Parameters
    ----------
    settings : Settings
    sections : mapping
        Expression, as an observation has it -> surface of the system that was integrated.
    values : mapping
        Parameter or state -> its value in each run, shape (K,); what is not there is as in the settings.
    parameters : mapping
        Every parameter of the system -> its value in each run, shape (K,).
    start : ndarray, shape (K,)
        Initial time [s].
    start_state : ndarray, shape (K, n)
    status, message : ndarray of str, shape (K,)
    end_time : ndarray, shape (K,)
        Where each run ended [s].
    end_state : ndarray, shape (K, n)
    end_mode : ndarray of int, shape (K,)
        Row of ``modes``; -1 where there was none.
    counts : ndarray of int, shape (K, 3)
        Steps, expansions, evaluations of guards.
    run : ndarray of int, shape (R,)
        Which run each transition belongs to; they stand in order of runs, and of time in each.
    records : ndarray, shape (R,)
        See :func:`henon_ref.integrator.records.transition_dtype`.
    modes : sequence of tuple
        Modes by the numbers that the records hold: an entry a surface, those of sections last.
    refused : ndarray of bool, shape (K,)
        Runs that could not begin.
    first : int
        Number of the first one among all points of the sweep.
    """

    settings: Settings
    sections: Mapping[Any, Section]
    values: Mapping[str, Vector]
    parameters: Mapping[str, Vector]
    start: Vector
    start_state: Vector
    status: NDArray[Any]
    message: NDArray[Any]
    end_time: Vector
    end_state: Vector
    end_mode: NDArray[np.int64]
    counts: NDArray[np.int64]
    run: NDArray[np.int64]
    records: NDArray[Any]
    modes: tuple[Mode, ...]
    refused: NDArray[np.bool_]
    first: int = 0

    def __len__(self) -> int:
        return len(self.status)

    @property
    def system(self) -> System:
        """The system as it was given."""
        return self.settings.system

    @cached_property
    def entries(self) -> NDArray[np.int64]:
        """Modes as an array, shape (modes, surfaces)."""
        return np.array(self.modes or np.zeros((0, 1)), dtype=np.int64)

    def mode_names(self, rows: NDArray[np.int64]) -> NDArray[Any]:
        """Texts of modes by their numbers, without the sections; None for -1."""
        names = self.system.model.sign_names
        different, places = np.unique(rows, return_inverse=True)
        modes = [None if row < 0 else self._kinks.shown(self.modes[row][: len(names)]) for row in different.tolist()]
        return np.array([mode and mode_text(mode, names) for mode in modes], dtype=object)[places]

    def changes(self, surface: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Transitions of one surface: their places, and the surface's entry of the mode before and after each."""
        at = np.nonzero(self.records["surface"] == surface)[0]
        column = self.entries[:, surface] if len(self.entries) else np.zeros(0, dtype=np.int64)
        return at, column[self.records["from_mode"][at]], column[self.records["to_mode"][at]]

    @cached_property
    def visible(self) -> NDArray[np.bool_]:
        """Of each transition whether it is one: it is not on a kink that another branch hides."""
        return self._kinks.are_transitions(self.records, self.modes)

    @cached_property
    def _kinks(self) -> HiddenKinks:
        return HiddenKinks(self.system.model)

    def told(self, run: int) -> str:
        """Which point a run is of, in words: ``point 3 (F = 0.5)``."""
        return told(self.first + run, {name: values[run] for name, values in self.values.items()})

    def rows(self, at: NDArray[np.int64]) -> Columns:
        """Transitions as columns: ``point`` (number within the chunk), ``time_s``, then the states by name."""
        kept = self.records[at]
        states = dict(zip(self.system.state, kept["state"].T, strict=True))
        return {"point": self.run[at], "time_s": kept["time"], **states}

    def arguments(self) -> Iterator[dict[str, Any]]:
        """For each run, the arguments of ``simulate`` that repeat it."""
        given, names = self.settings, self.system.state
        start, until = (self._fixed(value) for value in (given.start, given.until))
        for k in range(len(self)):
            point = {name: float(values[k]) for name, values in self.values.items() if name not in names}
            yield {
                "initial": dict(zip(names, self.start_state[k].tolist(), strict=True)),
                "parameters": point,
                "start": start,
                "until": until,
                "rtol": given.rtol,
                "mode": given.mode,
                "max_steps": given.max_steps,
            }

    def _fixed(self, value: Any) -> Any:
        """A number; text that holds no parameter as one that needs no reading for each run."""
        if not isinstance(value, str):
            return value
        number = self.system.expression(value)
        return python_number(number) if number.is_Rational else value
