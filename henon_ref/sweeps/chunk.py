"""One chunk of points: a pure function of the sweep's content and the points, so that a task may be done again."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from itertools import product
from time import thread_time
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.casefile.expressions import parse_expression
from henon_ref.errors import HenonRefError
from henon_ref.integrator.constant_program import constant_program
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.pairs import decimal_pairs
from henon_ref.integrator.points import Keep
from henon_ref.integrator.prepared_run import local_error
from henon_ref.modes.bounds import double_double
from henon_ref.simulation.dependent_parameters import following, pairs_at, without_others
from henon_ref.simulation.launch import integrator_of
from henon_ref.simulation.system import System
from henon_ref.simulation.written import as_given
from henon_ref.sweeps.kernel import Ended, joined, refused_runs, run_points, together
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.refusals import NO_KINKS, refusals
from henon_ref.sweeps.runs import Columns, Runs, Section, Settings, Vector, with_sections


class PointNumbers:
    """The numbers of points: what is written of them is read once, and evaluated wherever parameters are swept.

    Parameters
    ----------
    system : System
    swept : frozenset of str
        Parameters whose values the points have.
    numbers : mapping
        Further numbers by name; one that is text follows swept parameters.
    """

    def __init__(self, system: System, swept: frozenset[str], numbers: Mapping[str, object]) -> None:
        exact = {symbol.name: value for symbol, value in system.model.parameters.items()}
        names = {name: sp.Symbol(name, real=True) for name in system.parameters}
        read = following(system, swept)
        self.moved = swept | read.keys()
        """Parameters that differ from point to point."""
        own = without_others(read, swept, exact)
        known = {names[name]: value for name, value in {**exact, **own}.items() if name not in swept}
        self._parameters = {name: _Number(own.get(name, exact[name])) for name in exact if name not in swept}
        self._numbers = {
            name: _Number(parse_expression(as_given(value, "a number"), names).xreplace(known))
            for name, value in numbers.items()
        }

    def parameters(self, swept: Mapping[str, Vector], count: int) -> dict[str, Vector]:
        """Every parameter -> its values as pairs of doubles (:mod:`henon_ref.integrator.pairs`), shape (count, 2).

        Parameters
        ----------
        swept : mapping
            Parameter -> values, shape (count,).
        count : int
        """
        found = {name: number.pairs(swept, count) for name, number in self._parameters.items()}
        return found | {name: decimal_pairs(values) for name, values in swept.items()}

    def number(self, name: str, swept: Mapping[str, Vector], count: int) -> Vector:
        """Another number likewise, shape (count, 2)."""
        return self._numbers[name].pairs(swept, count)


class _Number:
    """An expression in swept parameters, at the decimal numbers that these are printed as, to the last bit."""

    def __init__(self, expression: sp.Expr) -> None:
        symbols = sorted(expression.free_symbols, key=lambda s: s.name)
        self._names = [symbol.name for symbol in symbols]
        self._constant = np.zeros(2) if symbols else np.array(double_double(expression))
        self._program = constant_program(tuple(symbols), (expression,)) if symbols else None

    def pairs(self, swept: Mapping[str, Vector], count: int) -> Vector:
        if self._program is None:
            return np.broadcast_to(self._constant, (count, 2))
        points, places = np.unique(np.column_stack([swept[n] for n in self._names]), axis=0, return_inverse=True)
        pairs = [pairs_at(self._program, point) for point in points.tolist()]
        return np.array(pairs).reshape(-1, 2)[places.ravel()]


POINTS = "points"
"""The table with a row a point."""
START, UNTIL = "initial time", "horizon"
"""What these two numbers go by beside states, whose names have no blank."""
KEPT_SYSTEMS = 64
"""Systems of one sweep that are kept: another one for each set of exponents."""
KEPT_SWEEPS = 8
"""Sweeps of which a worker keeps what it has read."""


@dataclass(frozen=True)
class Tables:
    """What is observed of a chunk."""

    points: Columns
    """``status``, then the observations, an entry a point."""
    ragged: Mapping[str, Columns]
    """Tables of their own, by name; their first column is ``point``, counted from the sweep's first one."""
    refused: tuple[str, ...] = ()
    """What is said of each point that has no run."""


@dataclass(frozen=True)
class Work:
    """What every task of a sweep needs to know."""

    settings: Settings
    observations: tuple[Observation, ...]
    names: tuple[str, ...]
    """Of the points' values."""
    chain: int

    @cached_property
    def numbers(self) -> PointNumbers:
        """What gives the points' numbers: initial values by their states, then ``start`` and ``until``."""
        settings = self.settings
        swept = frozenset(self.names) - frozenset(settings.system.state)
        return PointNumbers(settings.system, swept, {**settings.initial, START: settings.start, UNTIL: settings.until})

    @cached_property
    def keep(self) -> Keep:
        """Transitions that some observation is computed from."""
        return together([o.kept(self.settings.system) for o in self.observations])

    @cached_property
    def prepared(self) -> Callable[..., tuple[Integrator, dict[sp.Expr, Section]]]:
        """See :meth:`_prepared`; what it returns is kept."""
        return lru_cache(maxsize=KEPT_SYSTEMS)(self._prepared)

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def pickled(self) -> bytes:
        """As bytes; functions of one's own go along by value, wherever they are defined."""
        import cloudpickle

        return bytes(cloudpickle.dumps(self))

    def _prepared(
        self, *exponents: tuple[str, float], open_kinks: frozenset[int] = NO_KINKS
    ) -> tuple[Integrator, dict[sp.Expr, Section]]:
        """The compiled system, sections included, and where each section stands.

        Parameters
        ----------
        *exponents : tuple of str and float
            Parameters that stand in exponents, and their values: with others it is another system.
        open_kinks : frozenset of int
            See :class:`henon_ref.modes.system.FilippovSystem`.
        """
        system = self.settings.system
        wanted = [e for o in self.observations for e in o.sections(system)]
        whole, sections = with_sections(system.with_parameters(dict(exponents)) if exponents else system, wanted)
        return integrator_of(whole, local_error(self.settings.rtol), open_kinks), sections


@lru_cache(maxsize=KEPT_SWEEPS)
def _unpickled(work: bytes) -> Work:
    made: Work = pickle.loads(work)
    return made


def execute(work: bytes, first: int, values: Vector, size: int) -> tuple[list[Tables], float]:
    """Do some chunks that follow each other, their points in one go: their tables, and how long it took [s].

    Parameters
    ----------
    work : bytes
        :meth:`Work.pickled`.
    first : int
        Number of their first point in the sweep.
    values : ndarray, shape (K, k)
        Their points.
    size : int
        Points a chunk; the last one may have fewer.

    Returns
    -------
    list of Tables
    float
        Processor time [s].
    """
    began, made = thread_time(), _unpickled(work)
    columns = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(made.names)}
    runs = run_chunk(made, columns, len(values), first)
    points: Columns = {"status": runs.status}
    ragged: dict[str, Columns] = {}
    for observation in made.observations:
        points |= observation.columns(runs)
        for name, table in observation.tables(runs).items():
            ragged[name] = {**table, "point": table["point"] + first}
    refused = {k: f"{runs.told(k)}: {runs.message[k]}" for k in np.flatnonzero(runs.refused).tolist()}
    found = [
        Tables(
            {name: column[k : k + size] for name, column in points.items()},
            {name: _rows(table, first + k, first + k + size) for name, table in ragged.items()},
            tuple(words for point, words in refused.items() if k <= point < k + size),
        )
        for k in range(0, len(values), size)
    ]
    return found, thread_time() - began


def _rows(table: Columns, first: int, end: int) -> Columns:
    """Those of some points."""
    rows = np.flatnonzero((table["point"] >= first) & (table["point"] < end))
    return {name: column[rows] for name, column in table.items()}


def run_chunk(work: Work, columns: Mapping[str, Vector], count: int, first: int = 0) -> Runs:
    """Run a chunk's points; those of a chain one after another, all chains at once.

    A point at which there is no problem to solve (a parameter that is not finite, a horizon before the start) is a run
    that ends ``failed`` where it starts.
    """
    settings = work.settings
    names = settings.system.state
    swept = {name: values for name, values in columns.items() if name not in names}
    numbers = work.numbers
    parameters = numbers.parameters(swept, count)
    initial = np.stack(
        [decimal_pairs(columns[n]) if n in columns else numbers.number(n, swept, count) for n in names], axis=1
    )
    start, until = (numbers.number(name, swept, count) for name in (START, UNTIL))
    highs = {name: pairs[:, 0] for name, pairs in parameters.items()}
    wrong, open_kinks = refusals(
        settings, columns, highs, initial[:, :, 0], np.column_stack([start[:, 0], until[:, 0]])
    )
    parts: list[tuple[Any, Ended]] = []
    for step in range(work.chain):
        own = np.arange(step, count, work.chain)
        if step:
            _, ended = parts[-1]
            carried = ended.status == "ok"
            initial[own[carried]] = decimal_pairs(ended.end_state[carried])
        at_step = {name: v[own] for name, v in parameters.items()}
        times = np.stack([start[own], until[own]], axis=1)
        parts.append((own, _run_step(work, at_step, initial[own], times, wrong[own], open_kinks[own])))
    return Runs(
        settings=settings,
        sections=work.prepared()[1],
        values=columns,
        parameters=highs,
        start=start[:, 0],
        start_state=initial[:, :, 0],
        first=first,
        **vars(joined(parts)),
    )


def _run_step(
    work: Work,
    parameters: Mapping[str, Vector],
    initial: Vector,
    times: Vector,
    wrong: NDArray[Any],
    open_kinks: NDArray[Any],
) -> Ended:
    """Runs that do not wait for each other; one compiled system for each set of exponents, and of open kinks."""
    settings = work.settings
    names = sorted(settings.system.exponent_parameters & work.numbers.moved)
    refused = wrong != None  # noqa: E711 - entry by entry
    parts = [(np.flatnonzero(refused), refused_runs(wrong[refused], initial[refused], times[refused]))]

    def run(integrator: Integrator, own: NDArray[np.int64]) -> None:
        at_own = {name: v[own] for name, v in parameters.items()}
        try:
            parts.append((own, run_points(integrator, settings, at_own, initial[own], times[own], work.keep)))
        except HenonRefError as error:
            if len(own) == 1:
                parts.append((own, refused_runs([str(error)], initial[own], times[own])))
            else:  # one of them is in the way of all
                for one in own:
                    run(integrator, np.array([one]))

    there = np.flatnonzero(~refused)
    values, which = np.unique(
        np.column_stack([parameters[name][there, 0] for name in names] or [np.zeros(len(there))]),
        axis=0,
        return_inverse=True,
    )
    for k, kinks in product(range(len(values)), set(open_kinks[there].tolist())):
        own = there[(which.ravel() == k) & (open_kinks[there] == kinks)]
        exponents = values[k].tolist()
        try:
            integrator, _ = work.prepared(*zip(names, exponents, strict=False), open_kinks=kinks)
        except HenonRefError as error:
            parts.append((own, refused_runs([str(error)] * len(own), initial[own], times[own])))
        else:
            run(integrator, own)
    return joined(parts)
