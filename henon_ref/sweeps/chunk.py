"""One chunk of points: a pure function of the sweep's content and the points, so that a task may be done again."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from henon_ref.henon.integrator import Integrator
from henon_ref.henon.pairs import decimal_pairs
from henon_ref.simulation.compiled import integrator_of, local_error
from henon_ref.sweeps.kernel import Ended, joined, run_points, together
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.parameter_values import following, number_values, parameter_values
from henon_ref.sweeps.points import Vector
from henon_ref.sweeps.runs import Columns, Runs, Settings
from henon_ref.sweeps.sections import Section, with_sections

KEPT_SWEEPS = 8
"""Sweeps of which a worker keeps what it has read."""


@dataclass(frozen=True)
class Tables:
    """What is observed of a chunk."""

    points: Columns
    """``status``, then the observations, an entry a point."""
    ragged: Mapping[str, Columns]
    """Tables of their own, by name; their first column is ``point``, counted from the sweep's first one."""


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
    runs = run_chunk(made, columns, len(values))
    points: Columns = {"status": runs.status}
    ragged: dict[str, Columns] = {}
    for observation in made.observations:
        points |= observation.columns(runs)
        for name, table in observation.tables(runs).items():
            ragged[name] = {**table, "point": table["point"] + first}
    return Tables(points, ragged)


def run_chunk(work: Work, columns: Mapping[str, Vector], count: int) -> Runs:
    """Run a chunk's points; those of a chain one after another, all chains at once."""
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
    parts: list[tuple[Any, Ended]] = []
    for step in range(work.chain):
        own = np.arange(step, count, work.chain)
        if step:
            _, ended = parts[-1]
            carried = ended.status == "ok"
            initial[own[carried]] = decimal_pairs(ended.end_state[carried])
        at_step = {name: v[own] for name, v in parameters.items()}
        times = np.stack([start[own], until[own]], axis=1)
        parts.append((own, _run_step(work, moved, at_step, initial[own], times)))
    return Runs(
        settings=settings,
        sections=work.prepared()[1],
        values=columns,
        parameters={name: pairs[:, 0] for name, pairs in parameters.items()},
        start=start[:, 0],
        start_state=initial[:, :, 0],
        **vars(joined(parts)),
    )


def _run_step(
    work: Work, moved: frozenset[str], parameters: Mapping[str, Vector], initial: Vector, times: Vector
) -> Ended:
    """Runs that do not wait for each other; one compiled system for each set of exponents."""
    settings = work.settings
    keep = together([o.kept(settings.system) for o in work.observations])
    names = sorted(settings.system.exponent_parameters & moved)
    if not names:
        return run_points(work.prepared()[0], settings, parameters, initial, times, keep)
    values, which = np.unique(np.column_stack([parameters[name][:, 0] for name in names]), axis=0, return_inverse=True)
    parts: list[tuple[Any, Ended]] = []
    for k, exponents in enumerate(values.tolist()):
        own = np.nonzero(which.ravel() == k)[0]
        integrator, _ = work.prepared(dict(zip(names, exponents, strict=True)))
        at_own = {name: v[own] for name, v in parameters.items()}
        parts.append((own, run_points(integrator, settings, at_own, initial[own], times[own], keep)))
    return joined(parts)
