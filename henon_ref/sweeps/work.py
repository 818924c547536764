"""Work of a sweep that its points share, base class of observations, and results of runs as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError
from henon_ref.expressions.algebra import signed_form
from henon_ref.expressions.evaluation import parse_expression
from henon_ref.integrator.integrator import MOST_STEPS, Integrator, local_error
from henon_ref.integrator.pairs import decimal_pairs
from henon_ref.integrator.points import NOTHING, Keep
from henon_ref.integrator.records import transition_dtype
from henon_ref.modes.kinks import are_visible, shown_mode
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.simulation.launch import integrator_of
from henon_ref.simulation.quick_start import Number, following
from henon_ref.simulation.system import System
from henon_ref.sweeps.table_files import Columns, Vector
from henon_ref.system.python_arguments import as_given, python_number
from henon_ref.text import listed

NO_KINKS = frozenset[int]()
START, UNTIL = "initial time", "horizon"
"""Names of these two numbers among those of states; names of states have no space."""


@dataclass(frozen=True)
class Observation:
    """Base class of observations.

    An observation adds columns to the table of points, or is an additional table whose column ``point`` refers to
    points. It is computed over all runs of a chunk at once. For no runs it returns the same columns, empty.
    """

    kind: ClassVar[str]
    """Name in a sweep file."""

    def check(self, system: System) -> None:
        """Raise ArgumentError, before anything runs, if the observation is impossible for a system."""

    def sections(self, system: System) -> Sequence[sp.Expr]:
        """Return expressions whose zeros must be located."""
        return ()

    def kept(self) -> Keep:
        """Return which transitions, of any surface, the observation needs."""
        return NOTHING

    def columns(self, runs: Runs) -> Columns:
        """Return columns of the table of points, one entry for each run; NaN (text: None) if there is no value."""
        return {}

    def tables(self, runs: Runs) -> dict[str, Columns]:
        """Return additional tables by name; their column ``point`` is the index of a run within the chunk."""
        return {}


@dataclass(frozen=True)
class Work:
    """Everything that the runs of a sweep have in common; numbers as in :func:`henon_ref.simulate`."""

    system: System
    initial: Mapping[str, Any]
    start: Any
    until: Any
    rtol: float
    mode: Mapping[str, int] | None = None
    max_steps: int = MOST_STEPS
    observations: tuple[Observation, ...] = ()
    names: tuple[str, ...] = ()
    """Names of the points' values."""
    chain: int = 1
    """Number of consecutive points in a chain, where each run starts in the final state of the previous one."""

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def pickled(self) -> bytes:
        """Return the work as bytes; functions of the user are included by value, wherever they are defined."""
        import cloudpickle

        return bytes(cloudpickle.dumps(self))

    @cached_property
    def numbers(self) -> dict[str, Number]:
        """Parameters that are not swept, initial values, initial time and horizon, in terms of the swept parameters."""
        system = self.system
        swept = frozenset(self.names) - frozenset(system.state)
        exact = system.model.parameter_values | following(system, swept)
        own = {name: value for name, value in exact.items() if name not in swept}
        symbols = {name: sp.Symbol(name, real=True) for name in system.parameters}
        known = {symbols[name]: value for name, value in own.items()}
        given = {name: self.initial[name] for name in system.state} | {START: self.start, UNTIL: self.until}
        for name, value in given.items():
            own[name] = parse_expression(as_given(value, "a number"), symbols).xreplace(known)
        return {name: Number(expression) for name, expression in own.items()}

    def pairs(self, columns: Mapping[str, Vector], count: int) -> dict[str, Vector]:
        """Return all numbers of some points, by name, as pairs of doubles; a swept value is read as it prints."""
        found = {name: number.pairs(columns, count) for name, number in self.numbers.items() if name not in columns}
        return found | {name: decimal_pairs(values) for name, values in columns.items()}

    @cached_property
    def moving_exponents(self) -> list[str]:
        """Parameters in exponents that vary between points; each of their values requires its own compiled system."""
        numbers = self.numbers
        return sorted(p for p in self.system.exponent_parameters if p not in numbers or numbers[p].names)

    @cached_property
    def keep(self) -> Keep:
        """Transitions that at least one observation needs."""
        some = [keep for keep in (o.kept() for o in self.observations) if keep != NOTHING]
        if not some:
            return NOTHING
        return Keep(after=min(keep.after for keep in some), open_sticks=any(keep.open_sticks for keep in some))

    @cached_property
    def sections(self) -> dict[sp.Expr, tuple[int, int]]:
        """Expression of an observation -> surface of the integrated system, and ratio of their signs, +1 or -1."""
        return self._with_sections(self.system)[1]

    def _with_sections(self, system: System) -> tuple[System, dict[sp.Expr, tuple[int, int]]]:
        """Return a system with additional surfaces for the observations' expressions, and :attr:`sections`.

        An expression that equals a surface up to a factor of constant sign uses that surface. The field does not depend
        on the sign of an added surface: its normal velocity is equal on both sides, so it is always crossed.
        """
        model = system.model
        added: dict[sp.Symbol, sp.Expr] = {}
        known: dict[object, tuple[int, int]] = {}
        for index, surface in enumerate(model.surfaces):
            form, way = signed_form(surface, model.parameters)
            known.setdefault(form, (index, way))
        found: dict[sp.Expr, tuple[int, int]] = {}
        for expression in (e for o in self.observations for e in o.sections(self.system)):
            form, way = signed_form(expression, model.parameters)
            if form not in known:
                known[form] = len(model.surfaces) + len(added), way
                added[sp.Symbol(f"section {len(added) + 1}", real=True)] = expression  # other names have no space
            index, own = known[form]
            found[expression] = index, way * own
        return (system.with_surfaces(added) if added else system), found

    @cached_property
    def integrator(self) -> Callable[..., Integrator]:
        """Cached :meth:`_integrator`, for up to 64 sets of exponents."""
        return lru_cache(maxsize=64)(self._integrator)

    def _integrator(self, *exponents: float, open_kinks: frozenset[int] = NO_KINKS) -> Integrator:
        """Compile the system with its sections, at some values of :attr:`moving_exponents` (default: the system's)."""
        named = dict(zip(self.moving_exponents, exponents, strict=True)) if exponents else {}
        return self.integrator_at(named, open_kinks)

    def integrator_at(self, values: Mapping[str, float], open_kinks: frozenset[int]) -> Integrator:
        """Compile the system with its sections, at some values of parameters (states among them are left out).

        ArgumentError if its surfaces are not those of the system.
        """
        changed = {name: value for name, value in values.items() if name not in self.system.state}
        own = self.system.with_parameters(changed) if changed else self.system
        if own.model.signs != self.system.model.signs or own.model.kinks != self.system.model.kinks:
            raise ArgumentError("the system has other kinks at these parameters; simulate it there by itself")
        return integrator_of(self._with_sections(own)[0], local_error(self.rtol), open_kinks)


class Runs:
    """K runs of one system with n states, and R transitions of them.

    ``values`` are those of the points, shape (K, names), and ``first`` is the index of the first run among all points.
    """

    def __init__(self, work: Work, values: Vector, first: int = 0) -> None:
        count, system = len(values), work.system
        self.work, self.system, self.first = work, system, first
        # Parameter or state -> its value in each run, shape (K,); other values are those of the work.
        self.values = {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(work.names)}
        pairs = work.pairs(self.values, count)
        # Pairs of doubles: every parameter (K, 2), initial states (K, n, 2), initial times and horizons [s] (K, 2, 2).
        self.numbers = {name: pairs[name] for name in system.parameters}
        self.initial = np.stack([pairs[name] for name in system.state], axis=1)
        self.times = np.stack([pairs[START], pairs[UNTIL]], axis=1)
        self.status, self.message = np.full(count, "failed", dtype=object), np.full(count, "", dtype=object)
        self.end_time, self.end_state = self.times[:, 0, 0].copy(), self.initial[:, :, 0].copy()
        self.end_mode = np.full(count, -1)
        """Index in ``modes``; -1 if there was no mode."""
        self.counts = np.zeros((count, 3), dtype=np.int64)
        """Numbers of steps, expansions, evaluations of guards."""
        self.refused = np.ones(count, dtype=np.bool_)
        """Whether a point has no run; initially True for all points."""
        self.held_entries: dict[int, dict[str, int]] = {}
        """Entries of the mode in which a run of a chain began, on surfaces that held at the end of the run before."""
        self._records: list[NDArray[Any]] = []
        self._rows: dict[Mode, int] = {}

    def __len__(self) -> int:
        return len(self.status)

    def keep(self, records: NDArray[Any], own: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Store transitions of some runs; ``own`` has the indices of the runs, ``rows`` those of the records' modes."""
        kept = records.copy()
        kept["point"] = own[records["point"]]
        kept["from_mode"], kept["to_mode"] = rows[records["from_mode"]], rows[records["to_mode"]]
        self._records.append(kept)

    def rows_of_modes(self, modes: Sequence[Mode]) -> NDArray[np.int64]:
        """Return the indices of some modes in ``modes``, followed by -1."""
        return np.array([*(self._rows.setdefault(mode, len(self._rows)) for mode in modes), -1])

    def holding(self, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which surfaces hold at the end of some runs, shape (K, surfaces)."""
        found: NDArray[np.bool_] = np.array([*self._rows])[self.end_mode[own]] == 0
        return found

    @cached_property
    def records(self) -> NDArray[Any]:
        """Transitions sorted by run and time: :func:`henon_ref.integrator.records.transition_dtype`."""
        if not self._records:
            return np.zeros(0, dtype=transition_dtype(len(self.system.state)))
        found = np.concatenate(self._records)
        return found[np.argsort(found["point"], kind="stable")]

    @cached_property
    def run(self) -> NDArray[np.int64]:
        """Run of each transition, shape (R,)."""
        return self.records["point"].astype(np.int64) if self._records else np.zeros(0, dtype=np.int64)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes in the order of their indices in the records; one entry for each surface, sections last."""
        return tuple(self._rows)

    @cached_property
    def entries(self) -> NDArray[np.int64]:
        """Modes as an array, shape (modes, surfaces)."""
        return np.array(self.modes or np.zeros((0, 1)), dtype=np.int64)

    def mode_names(self, rows: NDArray[np.int64]) -> NDArray[Any]:
        """Return the texts of modes by index, without the sections; None for -1."""
        model, names = self.system.model, self.system.model.sign_names
        different, places = np.unique(rows, return_inverse=True)
        modes = [self.modes[row][: len(names)] if row >= 0 else None for row in different.tolist()]
        texts = [None if mode is None else mode_text(shown_mode(model, mode), names) for mode in modes]
        return np.array(texts, dtype=object)[places]

    def changes(self, surface: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return the indices of a surface's transitions, and its entry in the mode before and after each."""
        at = np.nonzero(self.records["surface"] == surface)[0]
        column = self.entries[:, surface] if len(self.entries) else np.zeros(0, dtype=np.int64)
        return at, column[self.records["from_mode"][at]], column[self.records["to_mode"][at]]

    @cached_property
    def visible(self) -> NDArray[np.bool_]:
        """For each transition, whether it is not on a kink that is hidden by another branch."""
        return are_visible(self.system.model, self.records, self.modes)

    def point_words(self, run: int) -> str:
        """Return a text that identifies the point of a run: ``point 3 (F = 0.5)``."""
        words = [f"{name} = {repr(float(own[run])).removesuffix('.0')}" for name, own in self.values.items()]
        return f"point {self.first + run} ({listed(words, 4)})"

    def rows(self, at: NDArray[np.int64]) -> Columns:
        """Return transitions as columns: ``point`` (index within the chunk), ``time_s``, then the states by name."""
        kept = self.records[at]
        states = dict(zip(self.system.state, kept["state"].T, strict=True))
        return {"point": self.run[at], "time_s": kept["time"], **states}

    def arguments(self) -> Iterator[dict[str, Any]]:
        """Yield, for each run, the arguments of ``simulate`` that repeat it."""
        work, names = self.work, self.system.state
        start, until = (self._fixed(value) for value in (work.start, work.until))
        for k in range(len(self)):
            yield {
                "initial": dict(zip(names, self.initial[k, :, 0].tolist(), strict=True)),
                "parameters": {name: float(own[k]) for name, own in self.values.items() if name not in names},
                "start": start,
                "until": until,
                "rtol": work.rtol,
                "mode": {**(work.mode or {}), **self.held_entries.get(k, {})} or None,
                "max_steps": work.max_steps,
            }

    def _fixed(self, value: Any) -> Any:
        """A number; text that holds no parameter as one that needs no reading for each run."""
        if not isinstance(value, str):
            return value
        number = self.system.expression(value)
        return python_number(number) if number.is_Rational else value
