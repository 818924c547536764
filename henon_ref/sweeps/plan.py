"""Plan of a sweep: its arguments checked, its points, and their division into chunks."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import CodeType
from typing import Any

import numpy as np

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.integrator.integrator import MOST_STEPS, NO_LIMIT
from henon_ref.simulation.arguments import check_system, problem_of, start_of, tolerance_of, whole_number
from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import POINTS, problem_at
from henon_ref.sweeps.points import OWN_COLUMNS, Points, check_names, points_of
from henon_ref.sweeps.run_by_run import with_columns
from henon_ref.sweeps.table_files import Columns
from henon_ref.sweeps.work import Observation, Runs, Work
from henon_ref.workers.executors import Task

MOST_CHUNK = 2000
"""Largest default number of points of a chunk."""
MOST_CHUNKS = 1_000_000
"""Largest number of chunks of a sweep: their files are in one folder, sorted by name."""
FIGURES = "figures"
"""Folder of a sweep's figures, and therefore no name of a table."""
RTOL = 1e-10


@dataclass(frozen=True)
class Plan:
    """Work, points and chunks of a sweep."""

    work: Work
    points: Points
    chunk: int
    """Number of points of a chunk; a multiple of the length of a chain."""
    tables: dict[str, tuple[str, ...]]
    """Name of each table -> its columns; the table of points first."""
    name: str = "sweep"
    """Name, title and source of the sweep file."""
    title: str = "A sweep from Python"
    source: str | None = None

    @cached_property
    def chunks(self) -> tuple[range, ...]:
        count = len(self.points)
        return tuple(range(k, min(k + self.chunk, count)) for k in range(0, count, self.chunk))

    def task(self, numbers: Sequence[int], pickled: bytes) -> Task:
        """Return the task of a worker for consecutive chunks."""
        start, stop = self.chunks[numbers[0]].start, self.chunks[numbers[-1]].stop
        return numbers[0], (pickled, start, self.points.values[start:stop], self.chunk)

    def own_columns(self, number: int) -> Columns:
        """Return the columns of a chunk that come from its points: their numbers, values and labels."""
        chunk = self.chunks[number]
        numbers = np.arange(chunk.start, chunk.stop, dtype=np.int64)
        return {"point": numbers, **self.points.columns(slice(chunk.start, chunk.stop))}

    @cached_property
    def content(self) -> str:
        """SHA-256, in hexadecimal, of everything that determines the results and their files."""
        work, system = self.work, self.work.system
        identity = {
            "system": repr(system.content),
            "initial": [str(system.number(work.initial[name])) for name in system.state],
            "time": [str(system.number(value)) for value in (work.start, work.until)],
            "rtol": work.rtol,
            "mode": repr(work.mode),
            "max_steps": work.max_steps,
            "observations": [_named(o) for o in work.observations],
            "names": self.points.names,
            "chain": self.points.chain,
            "labels": {name: _digest("\0".join(column).encode()) for name, column in self.points.labels.items()},
            "chunk": self.chunk,
            "points": _digest(np.ascontiguousarray(self.points.values).data),
        }
        return _digest(json.dumps(identity, sort_keys=True).encode())


class RepeatedNameError(ArgumentError):
    """Two results with one name."""

    def __init__(self, what: str, name: str, observation: int | None) -> None:
        super().__init__(f"two results have the {what} '{name[:60]}'; rename one of them, or leave it out")
        self.observation = observation
        """Index of the observation that repeats the name; None if only the points have it."""


def planned(
    system: System,
    initial: Mapping[str, Any] | Sequence[Any] | None = None,
    *,
    until: Any = None,
    grid: Any,
    observe: Sequence[Observation],
    rtol: float = RTOL,
    chunk: int | None = None,
    start: Any = None,
    mode: Mapping[str, int] | None = None,
    max_steps: int = MOST_STEPS,
) -> Plan:
    """Check the arguments of a sweep (see :func:`henon_ref.sweeps.sweep.sweep`); HenonRefError if they are invalid."""
    tolerance = tolerance_of(rtol)
    points = points_of(grid)
    check_system(system)
    check_names(points.names, system)
    _check_chains(points, system)
    given, until, start, mode = start_of(system, initial, until, start, mode)
    is_whole = isinstance(given, Mapping) and {*map(str, given)} >= {*system.state}
    if not is_whole or (mode is not None and not isinstance(mode, Mapping)):
        problem_of(system, given, until=until, start=start, mode=mode)  # raises the error for it
    named = {str(name): value for name, value in given.items()}
    most = min(whole_number(max_steps, "max_steps"), NO_LIMIT)
    work = Work(
        system, named, start, until, tolerance, dict(mode) if mode else None, most, (), points.names, points.chain
    )
    work = replace(work, observations=_checked(observe, system, _horizon(work, points)))
    size = _chunk_size(chunk, points)
    _tables(work, points)  # check all names before a function of the user is called
    work = replace(work, observations=with_columns(work, points))
    return Plan(work, points, size, _tables(work, points))


def _check_chains(points: Points, system: System) -> None:
    """Raise ArgumentError for a chain along a state: its later points start in the final state of their neighbour."""
    chains = points.values.reshape(-1, points.chain, len(points.names))
    changing = (chains != chains[:, :1]).any(axis=(0, 1)).tolist()
    changing[-1] |= "direction" in points.labels  # a continuation, perhaps of one value
    for name, changes in zip(points.names, changing, strict=True):
        if changes and name in system.state:
            raise ArgumentError(f"a chain of points is along '{name[:60]}', a state; wanted a parameter")


def _horizon(work: Work, points: Points) -> float:
    """Return the horizon for the system's own values, or, if these are invalid, for the first valid point.

    If the first 100 points are also invalid, the arguments are at fault.
    """
    refused: list[HenonRefError] = []
    for values in ({}, *(dict(zip(points.names, row, strict=True)) for row in points.values[:100].tolist())):
        try:
            return float(problem_at(work, values).until)
        except HenonRefError as error:
            refused.append(error)
    raise refused[0]


def _checked(observe: Sequence[Observation], system: System, until: float) -> tuple[Observation, ...]:
    if isinstance(observe, Observation):
        observe = [observe]
    if not isinstance(observe, list | tuple):
        raise ArgumentError("observe must be a list of observations, as in [henon_ref.observe.sticks(after=400)]")
    for observation in observe:
        if not isinstance(observation, Observation):
            raise ArgumentError(f"observe holds {str(observation)[:60]}; wanted observations of henon_ref.observe")
        observation.check(system)
        check_after(observation, until)
    return tuple(observe)


def check_after(observation: Observation, until: float) -> None:
    """Raise ArgumentError if an observation begins at the horizon or later."""
    after = getattr(observation, "after", None)
    if after is not None and after >= until:
        raise ArgumentError(f"'after' of '{observation.kind}' is {after:g}; it must be earlier than the horizon")


def _tables(work: Work, points: Points) -> dict[str, tuple[str, ...]]:
    """Return the columns of each table, the table of points first; RepeatedNameError if two names are equal."""
    runs, own = Runs(work, points.values[:0]), [*points.names, *points.labels, "status"]
    columns, ragged = ["point", *own], list[tuple[str, Columns]]()
    further = [name for name in OWN_COLUMNS if name not in columns]
    _check_once("column", columns, None)
    for k, observation in enumerate(work.observations):
        columns += observation.columns(runs)
        ragged += observation.tables(runs).items()
        _check_once("table", [POINTS, FIGURES, *(name for name, _ in ragged)], k)
        _check_once("column", [*columns, *further], k)
    return {POINTS: tuple(columns), **{name: tuple(table) for name, table in ragged}}


def _check_once(what: str, names: Sequence[str], last: int | None) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise RepeatedNameError(what, name, last)


def _chunk_size(chunk: int | None, points: Points) -> int:
    """Return the number of points of a chunk; by default that of 64 chunks, within bounds, whatever the workers."""
    default = min(max(-(-len(points) // 64), 16), MOST_CHUNK)
    wanted = default if chunk is None else whole_number(chunk, "chunk")
    least = -(-len(points) // MOST_CHUNKS)
    if wanted < least:
        if chunk is not None:
            raise ArgumentError(
                f"chunk is {wanted}, which makes more than {MOST_CHUNKS} chunks of {len(points)} points; wanted "
                f"{least} points or more"
            )
        wanted = least
    return max(wanted // points.chain, 1) * points.chain


def _digest(content: bytes | memoryview) -> str:
    return hashlib.sha256(content).hexdigest()


def _named(observation: Observation) -> str:
    """Return an observation as text; for a function its name and code, since its behaviour cannot be compared."""
    function = getattr(observation, "of", None)
    if callable(function):
        name = f"{getattr(function, '__qualname__', '?')} {getattr(observation, 'name', '')}"
        return f"function {name} {_code(getattr(function, '__code__', None))}"
    return repr(observation)


def _code(code: Any) -> Any:
    """Return the content of a function's code, without its location; other constants as text."""
    if isinstance(code, frozenset):  # its order differs between processes
        return sorted(map(repr, code))
    if not isinstance(code, CodeType):
        return repr(code)
    return code.co_code.hex(), code.co_names, code.co_varnames, [_code(value) for value in code.co_consts]
