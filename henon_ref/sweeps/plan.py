"""A sweep, read and checked: what is run at which points, and in which chunks."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from henon_ref.errors import ArgumentError
from henon_ref.simulation.arguments import problem_of, start_of, tolerance_of
from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import Work
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.points import OWN_COLUMNS, Points, check_names, points_of
from henon_ref.sweeps.runs import Settings
from henon_ref.sweeps.workers import Task

MOST_CHUNK, CHUNKS = 2000, 64
"""Without a size of one's own a chunk has so many points at most; a sweep is cut into so many chunks where its size
allows it. (Neither depends on the number of workers, so that the files do not.)"""
RTOL = 1e-10


@dataclass(frozen=True)
class Plan:
    """What is to be done."""

    work: Work
    points: Points
    chunk: int
    """Points a chunk; a multiple of a chain."""

    @cached_property
    def chunks(self) -> tuple[range, ...]:
        """Points of each chunk."""
        count = len(self.points)
        return tuple(range(k, min(k + self.chunk, count)) for k in range(0, count, self.chunk))

    def tasks(self, but: set[int]) -> list[int]:
        """Numbers of the chunks that are still to be done."""
        return [number for number in range(len(self.chunks)) if number not in but]

    def task(self, number: int, pickled: bytes) -> Task:
        """What a worker is given for a chunk."""
        chunk = self.chunks[number]
        return Task(number, (pickled, chunk.start, self.points.values[chunk.start : chunk.stop]))

    @cached_property
    def content(self) -> str:
        """SHA-256 of everything that decides the results and their files, in hexadecimal."""
        settings = self.work.settings
        told = {
            "system": repr(settings.system.content),
            "initial": [str(settings.system.number(settings.initial[name])) for name in settings.system.state],
            "time": [str(settings.system.number(value)) for value in (settings.start, settings.until)],
            "rtol": settings.rtol,
            "mode": repr(settings.mode),
            "observations": [_named(o) for o in self.work.observations],
            "names": self.points.names,
            "chain": self.points.chain,
            "chunk": self.chunk,
            "points": hashlib.sha256(np.ascontiguousarray(self.points.values).tobytes()).hexdigest(),
        }
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


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
) -> Plan:
    """Check the arguments of a sweep (see :func:`henon_ref.sweeps.sweep.sweep`).

    Raises
    ------
    HenonRefError
        For what cannot be meant.
    """
    tolerance = tolerance_of(rtol)
    points = points_of(grid)
    if not isinstance(system, System):
        raise ArgumentError(f"system is {str(system)[:60]!r}; wanted a System")
    check_names(points, list(system.parameters), system.state)
    first = {name: float(value) for name, value in zip(points.names, points.values[0], strict=True)}
    states = {name: value for name, value in first.items() if name in system.state}
    swept = {name: value for name, value in first.items() if name not in states}
    initial, until, start, mode = start_of(system, initial, until, start, mode)
    given: Any = dict(initial) if isinstance(initial, Mapping) else initial
    _, problem = problem_of(system, given, until=until, start=start)
    if states or swept:
        problem_of(system, {**given, **states}, until=until, start=start, parameters=swept)
    if mode:
        problem_of(system, {**given, **states}, until=until, start=start, parameters=swept, mode=mode)
    observations = _checked(observe, system, float(problem.until))
    named = {str(name): value for name, value in given.items()}
    settings = Settings(system, named, start, until, tolerance, dict(mode) if mode else None)
    work = Work(settings, observations, points.names, points.chain)
    _check_columns(work, points)
    return Plan(work, points, _chunk_size(chunk, points))


def whole_number(value: Any, what: str) -> int:
    """A number of things, from 1 on.

    Raises
    ------
    ArgumentError
        For anything else.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted a whole number from 1 on")
    return int(value)


def _checked(observe: Sequence[Observation], system: System, until: float) -> tuple[Observation, ...]:
    if isinstance(observe, Observation):
        observe = [observe]
    if not isinstance(observe, list | tuple):
        raise ArgumentError("observe must be a list of observations, as in [henon_ref.observe.sticks(after=400)]")
    for observation in observe:
        if not isinstance(observation, Observation):
            raise ArgumentError(f"observe holds {str(observation)[:60]}; wanted those of henon_ref.observe")
        observation.check(system)
        after = getattr(observation, "after", None)
        if after is not None and after >= until:
            raise ArgumentError(f"'after' of '{observation.kind}' is {after:g}; it must be earlier than the horizon")
    return tuple(observe)


def _check_columns(work: Work, points: Points) -> None:
    """Check that no two columns, and no two tables, have one name."""
    columns = [*points.names, *OWN_COLUMNS]
    tables = ["points"]
    for observation in work.observations:
        own, ragged = observation.names(work.settings.system)
        columns += own
        tables += ragged
    for what, names in (("column", columns), ("table", tables)):
        for name, count in Counter(names).items():
            if count > 1:
                raise ArgumentError(
                    f"two results have the {what} '{name[:60]}'; call one of them otherwise, or leave it out"
                )


def _chunk_size(chunk: int | None, points: Points) -> int:
    wanted = min(MOST_CHUNK, -(-len(points) // CHUNKS)) if chunk is None else whole_number(chunk, "chunk")
    return max(wanted // points.chain, 1) * points.chain


def _named(observation: Observation) -> str:
    """An observation as text; a function by its name, for what it does cannot be told."""
    function = getattr(observation, "of", None)
    if callable(function):
        return f"function {getattr(function, '__qualname__', '?')} {getattr(observation, 'name', '')}"
    return repr(observation)
