"""Observations that simulate each run by itself: Lyapunov exponents, and functions of the user."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from henon_ref.analysis.lyapunov import lyapunov_exponents
from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.sweeps.chunk import run_chunk
from henon_ref.sweeps.points import Points
from henon_ref.sweeps.table_files import Columns
from henon_ref.sweeps.work import Observation, Runs, Work

VALUE = "value"
"""Default column of a function."""
Cell = float | str | None


@dataclass(frozen=True)
class Lyapunov(Observation):
    """See :func:`henon_ref.sweeps.observe.lyapunov`."""

    span: float
    discard: float = 0.0
    kind: ClassVar[str] = "lyapunov"

    def columns(self, runs: Runs) -> Columns:
        found = np.full(len(runs), np.nan)
        for k, point in enumerate(runs.arguments()):
            del point["until"], point["max_steps"]
            try:
                spectrum = lyapunov_exponents(runs.system, span=self.span, discard=self.discard, **point)
            except HenonRefError:  # no exponent, for example if two surfaces change at one instant
                continue
            if spectrum.status == "ok":
                found[k] = spectrum.exponents[0]
        return {"lyapunov": found}


@dataclass(frozen=True)
class Function(Observation):
    """See :func:`henon_ref.sweeps.observe.function`."""

    of: Callable[[Solution], Any]
    name: str = VALUE
    dense_output: bool = False
    kinds: Mapping[str, type[float | str]] | None = None
    """Column -> type of its values, determined from the first values (see :func:`with_columns`)."""
    kind: ClassVar[str] = "function"

    def columns(self, runs: Runs) -> Columns:
        named = {} if self.name == VALUE else {self.name: float}
        kinds: Mapping[str, type] = named if self.kinds is None else self.kinds
        rows = []
        for k, row in enumerate(self.rows(runs)):
            for name, cell in row.items():
                if name not in kinds:
                    raise self._refused(
                        f"a column '{name[:60]}'", runs.point_words(k), f"its columns are {list(kinds)}"
                    )
                if cell is not None and type(cell) is not kinds[name] and cell == cell:
                    wanted = f"'{name[:60]}' is a column of {'numbers' if kinds[name] is float else 'text'}"
                    raise self._refused(f"{cell!r:.60}", runs.point_words(k), f"{wanted}, as its first value was")
            rows.append(row)
        return {name: _column([row.get(name) for row in rows], kind) for name, kind in kinds.items()}

    def rows(self, runs: Runs) -> Iterator[dict[str, Cell]]:
        """Yield what the function returns for each run, by column; an empty mapping if a point has no run."""
        for k, point in enumerate(runs.arguments()):
            try:
                run = simulate(runs.system, dense_output=self.dense_output, **point)
            except HenonRefError:  # the row of the point has the reason
                yield {}
                continue
            try:
                value = self.of(run)
            except Exception as error:
                error.add_note(f"in the function '{self.name}' of a sweep, at {runs.point_words(k)}")
                raise
            yield self._cells(value, runs.point_words(k))

    def _cells(self, value: Any, point: str) -> dict[str, Cell]:
        given = value if isinstance(value, Mapping) else {} if value is None else {self.name: value}
        found: dict[str, Cell] = {}
        for key, entry in given.items():
            cell, name = _cell(entry), str(key)
            if name in found or not _is_written(name):
                raise self._refused(f"the key {key!r:.60}", point, "wanted keys that differ as text")
            if cell is NotImplemented:
                raise self._refused(f"{entry!r:.60}", point, "wanted a number, text, None, or a mapping of these")
            found[name] = cell
        return found

    def _refused(self, what: str, point: str, wanted: str) -> ArgumentError:
        return ArgumentError(f"the function '{self.name}' returned {what} at {point}; {wanted}")


def with_columns(work: Work, points: Points) -> tuple[Observation, ...]:
    """Return a sweep's observations, with the columns of functions of the user determined at the first points.

    The table is then independent of the division into chunks. A column without a value at the first 100 points has
    numbers. Exceptions of the functions propagate.
    """
    return tuple(replace(o, kinds=_kinds(o, work, points)) if isinstance(o, Function) else o for o in work.observations)


def _kinds(function: Function, work: Work, points: Points) -> dict[str, type]:
    kinds: dict[str, Any] = {}
    for first in range(0, min(len(points), 100), points.chain):
        for row in function.rows(run_chunk(work, points.values[first : first + points.chain], first)):
            for name in list(kinds or row):
                cell = row.get(name)
                kinds[name] = kinds.get(name) or (None if cell is None or cell != cell else type(cell))
        if kinds and all(kinds.values()):
            break
    return {name: kind or float for name, kind in (kinds or {function.name: None}).items()}


def _cell(value: Any) -> Any:
    """Return a value as stored in a column; NotImplemented if it cannot be stored."""
    if value is None:
        return None
    if isinstance(value, str):
        return str(value) if _is_written(value) else NotImplemented
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, Real) or (isinstance(value, np.generic) and value.dtype.kind in "biuf"):
        try:
            return float(value)
        except OverflowError:
            pass
    return NotImplemented


def _is_written(text: str) -> bool:
    """Check whether a text can be written to a file (a lone surrogate cannot)."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _column(cells: list[Cell], kind: type) -> Any:
    if kind is float:
        return np.array([np.nan if cell is None else cell for cell in cells], dtype=np.float64)
    return np.array([cell if isinstance(cell, str) else None for cell in cells], dtype=object)
