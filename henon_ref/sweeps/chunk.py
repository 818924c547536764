"""One chunk of points: a pure function of the sweep's content and the points, so that a task may be done again."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import HenonRefError
from henon_ref.henon.integrator import Integrator
from henon_ref.henon.pairs import decimal_pairs
from henon_ref.simulation.compiled import integrator_of, local_error
from henon_ref.simulation.dependent_parameters import following
from henon_ref.sweeps.kernel import Ended, joined, refused_runs, run_points, together
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.parameter_values import number_values, parameter_values
from henon_ref.sweeps.points import Vector
from henon_ref.sweeps.refusals import refusals
from henon_ref.sweeps.runs import Columns, Runs, Settings
from henon_ref.sweeps.sections import Section, with_sections

POINTS = "points"
"""The table with a row a point."""
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

    def pickled(self) -> bytes:
        """As bytes; functions of one's own go along by value, wherever they are defined."""
        import cloudpickle

        return bytes(cloudpickle.dumps(self))

    def prepared(self, exponents: Mapping[str, float] | None = None) -> tuple[Integrator, dict[sp.Expr, Section]]:
        """The compiled system, sections included, and where each section stands; compiled at the first call.

        Parameters
        ----------
        exponents : mapping, optional
            Values of parameters that stand in exponents: with others it is another system.
        """
        system = self.settings.system
        wanted = [e for o in self.observations for e in o.sections(system)]
        whole, sections = with_sections(system.with_parameters(exponents) if exponents else system, wanted)
        return integrator_of(whole, local_error(self.settings.rtol)), sections


@lru_cache(maxsize=KEPT_SWEEPS)
def _unpickled(work: bytes) -> Work:
    made: Work = pickle.loads(work)
    return made


def execute(work: bytes, first: int, values: Vector) -> Tables:
    """Do a chunk.

    Parameters
    ----------
    work : bytes
        :meth:`Work.pickled`.
    first : int
        Number of the chunk's first point in the sweep.
    values : ndarray, shape (K, k)
        The chunk's points.
    """
    made = _unpickled(work)
    columns = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(made.names)}
    runs = run_chunk(made, columns, len(values), first)
    points: Columns = {"status": runs.status}
    ragged: dict[str, Columns] = {}
    for observation in made.observations:
        points |= observation.columns(runs)
        for name, table in observation.tables(runs).items():
            ragged[name] = {**table, "point": table["point"] + first}
    refused = tuple(f"{runs.told(k)}: {runs.message[k]}" for k in np.flatnonzero(runs.refused).tolist())
    return Tables(points, ragged, refused)


def run_chunk(work: Work, columns: Mapping[str, Vector], count: int, first: int = 0) -> Runs:
    """Run a chunk's points; those of a chain one after another, all chains at once.

    A point at which there is no problem to solve (a parameter that is not finite, a horizon before the start) is a run
    that ends ``failed`` where it starts.
    """
    settings = work.settings
    names, system = settings.system.state, settings.system
    swept = {name: values for name, values in columns.items() if name not in names}
    parameters = parameter_values(system, swept, count)
    moved = frozenset(swept) | set(following(system, frozenset(swept)))

    def numbers(value: Any) -> Vector:
        return np.broadcast_to(number_values(system, value, swept), (count, 2))

    initial = np.stack(
        [decimal_pairs(columns[n]) if n in columns else numbers(settings.initial[n]) for n in names], axis=1
    )
    start, until = numbers(settings.start), numbers(settings.until)
    highs = {name: pairs[:, 0] for name, pairs in parameters.items()}
    wrong = refusals(settings, columns, highs, initial[:, :, 0], np.column_stack([start[:, 0], until[:, 0]]))
    parts: list[tuple[Any, Ended]] = []
    for step in range(work.chain):
        own = np.arange(step, count, work.chain)
        if step:
            _, ended = parts[-1]
            carried = ended.status == "ok"
            initial[own[carried]] = decimal_pairs(ended.end_state[carried])
        at_step = {name: v[own] for name, v in parameters.items()}
        times = np.stack([start[own], until[own]], axis=1)
        parts.append((own, _run_step(work, moved, at_step, initial[own], times, wrong[own])))
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
    moved: frozenset[str],
    parameters: Mapping[str, Vector],
    initial: Vector,
    times: Vector,
    wrong: NDArray[Any],
) -> Ended:
    """Runs that do not wait for each other; one compiled system for each set of exponents."""
    settings = work.settings
    keep = together([o.kept(settings.system) for o in work.observations])
    names = sorted(settings.system.exponent_parameters & moved)
    refused = wrong != None  # noqa: E711 - entry by entry
    parts = [(np.flatnonzero(refused), refused_runs(wrong[refused], initial[refused], times[refused]))]

    def run(integrator: Integrator, own: NDArray[np.int64]) -> None:
        at_own = {name: v[own] for name, v in parameters.items()}
        try:
            parts.append((own, run_points(integrator, settings, at_own, initial[own], times[own], keep)))
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
    for k, exponents in enumerate(values.tolist()):
        own = there[which.ravel() == k]
        try:
            integrator, _ = work.prepared(dict(zip(names, exponents, strict=False)))
        except HenonRefError as error:
            parts.append((own, refused_runs([str(error)] * len(own), initial[own], times[own])))
        else:
            run(integrator, own)
    return joined(parts)
