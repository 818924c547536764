"""Rows of the result files as dataclasses: columns, types and units, and their CSV.

The fields of a row are the columns of its file, in order. They are part of the contract, so new fields go to the end. A
missing value is None and an empty field in the file, never 0.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from henon_ref.harness.table import setting
from henon_ref.text import cell, from_cell, shortened

NOT_RUN = ("unsupported", "unavailable")
"""Statuses of rows whose run was not made."""
REPEATED = "a repeated run ended otherwise than the first one, "
"""Start of the reason of a run's row if a repeated run ended differently."""
STATE = "state"
"""Field of a transition's row that stands for several columns: one per state."""

Key = tuple[str, str, str, float | None, float | None]
"""Case, reading, solver, tolerance and step, which identify a run."""


@dataclass(frozen=True)
class Row:
    """A row of a result file; the fields are the columns, and columns of fields with a default may be missing."""

    @classmethod
    def columns(cls, states: Sequence[str] = ()) -> tuple[str, ...]:
        """Columns of a file; ``states``: names of the states if the row has them."""
        return tuple(name for own in fields(cls) for name in (states if own.name == STATE else (own.name,)))

    def values(self, columns: Iterable[str]) -> list[object]:
        """Values of some columns; None for columns that the row does not have."""
        known = vars(self)
        return list(map((known | known[STATE] if STATE in known else known).get, columns))


@dataclass(frozen=True)
class RunRow(Row):
    """One run: a reading, solver and setting (``runs.csv``)."""

    case: str
    reading: str
    solver: str
    library_version: str | None = None
    rtol: float | None = None
    """Relative tolerance; None for a fixed-step solver."""
    atol: float | None = None
    """Absolute tolerance, in units of the state."""
    step_s: float | None = None
    """Step [s]; None for a solver with tolerances."""
    status: str = ""
    """Status after scoring: ok, wrong, diverged, nonunique, invalid, timeout, failed, unsupported, unavailable."""
    landing: str | None = None
    """Method of the last step of event location."""
    reference_transitions: int | None = None
    """Number of the truth's transitions; like all counts without touches."""
    found_transitions: int | None = None
    matched: int | None = None
    missed: int | None = None
    spurious: int | None = None
    max_time_error_s: float | None = None
    """Largest error of a matched transition's time [s]."""
    rms_time_error_s: float | None = None
    max_state_error: float | None = None
    """Largest error of a state at a matched transition [unit of the state]."""
    max_surface_drift: float | None = None
    """Largest distance of a stick from its surface [unit of the surface]."""
    stick_count: int | None = None
    max_stick_error_s: float | None = None
    """Largest error of a stick's duration [s]."""
    wall_s: float | None = None
    """Median wall time [s]."""
    wall_s_iqr: float | None = None
    """Interquartile range of the wall times [s]; None for fewer than three."""
    compile_s: float | None = None
    """One-time work before the first run [s]."""
    steps: int | None = None
    rhs_evaluations: int | None = None
    event_evaluations: int | None = None
    status_reason: str | None = None
    expected_status: str | None = None
    """Status of the truth; None if nothing is known after the start."""
    verdict: str | None = None
    """Classification of a run (:mod:`henon_ref.harness.score.verdict`); None if it was not scored."""
    digits: float | None = None
    """Decimal digits of the worst transition time, counted from ``time_unit_s``."""
    time_unit_s: float | None = None
    end_time_s: float | None = None
    reference_radius_s: float | None = None
    """Radius of the truth's transition times [s]."""
    missed_touches: int | None = None
    """Touches change no mode and are not counted as missed or spurious."""
    spurious_touches: int | None = None
    cut_off: int | None = None
    """Number of transitions that the horizon cuts off."""
    wall_s_low: float | None = None
    """Lower end of the 95 % bootstrap interval of the median [s]."""
    wall_s_high: float | None = None
    timed_runs: int | None = None
    """Number of wall times of which the median is taken."""
    verdict_basis: str | None = None
    """Reason of the verdict on a run that is not right."""
    cause: str | None = None
    """Certain cause of a solver's defect, if one is known (:mod:`henon_ref.harness.campaign.causes`)."""
    undecided_after_s: float | None = None
    """Time from which on some surface is below the solver's rounding, so that its transitions are undecided [s]."""

    @property
    def key(self) -> Key:
        return self.case, self.reading, self.solver, self.rtol, self.step_s

    @property
    def problem(self) -> tuple[str, str]:
        return self.case, self.reading

    @property
    def size(self) -> float:
        """Tolerance or step (smaller is tighter); infinite if there is neither."""
        size = self.step_s if self.rtol is None else self.rtol
        return math.inf if size is None else size

    @property
    def setting(self) -> str:
        """Tolerance or step in the form used in tables."""
        return setting(self.rtol, self.step_s)

    @property
    def repeated(self) -> bool:
        """Whether a repeated run ended differently."""
        return REPEATED in (self.status_reason or "")

    @property
    def status_text(self) -> str:
        return f"{self.status} ({self.status_reason})" if self.status_reason else self.status

    @property
    def label(self) -> str:
        """Solver and setting in messages.

        Examples
        --------
        >>> RunRow("fig8", "default", "henon", rtol=1e-9).label, RunRow("fig8", "default", "rk4", step_s=0.01).label
        ('henon (rtol 1e-09)', 'rk4 (step 0.01 s)')
        """
        if self.rtol is not None:
            return f"{self.solver} (rtol {self.rtol:g})"
        return self.solver if self.step_s is None else f"{self.solver} (step {self.step_s:g} s)"

    @property
    def name(self) -> str:
        """Case, reading and label in messages."""
        return f"{self.case}: {self.reading}: {self.label}"


@dataclass(frozen=True)
class PartRow(Row):
    """A part of a run, identified by its index."""

    case: str
    reading: str
    solver: str
    rtol: float | None
    step_s: float | None
    index: int


@dataclass(frozen=True)
class TransitionRow(PartRow):
    """A transition of the truth, of the run, or of both if matched (``transitions.csv``)."""

    kind: str
    surface: str
    """Name of the surface's sign."""
    from_mode: str
    to_mode: str
    reference_time_s: float | None = None
    reference_radius_s: float | None = None
    time_s: float | None = None
    time_error_s: float | None = None
    """Signed [s]."""
    conditioning: float | None = None
    """Sensitivity of the time to an error of the state [s / unit of the state]."""
    state: Mapping[str, float | None] = field(default_factory=dict)
    """State of the run by name: one column each."""
    transversality: float | None = None
    """Rate at which the guard falls through zero [unit of the guard / s]."""
    graze_distance: float | None = None
    """Depth of the surface function between the transition and its neighbour, on the parabola through both
    [unit of the surface]."""
    outcome: str | None = None
    """matched, missed, spurious, cut off (beyond the horizon within the run's error), touch (no mode changes)."""
    verdict: str | None = None
    """Verdict on a missed or spurious transition (:mod:`henon_ref.harness.score.verdict`)."""


@dataclass(frozen=True)
class StickRow(PartRow):
    """A stick of the truth, of the run, or of both that ends within the measured window (``sticks.csv``)."""

    start_s: float | None = None
    duration_s: float | None = None
    reference_s: float | None = None
    """Duration in the truth [s]."""
    error_s: float | None = None
    published_s: float | None = None
    published_error_s: float | None = None
    length: float | None = None
    """Displacement of the first state [its unit]."""


AnyRow = TypeVar("AnyRow", bound=Row)


def number(value: float | None) -> float:
    """Return the number, NaN if it is missing."""
    return math.nan if value is None else value


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write rows of values as CSV (RFC 4180, with plain line feeds)."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(map(csv_field, columns))
    writer.writerows(map(csv_field, row) for row in rows)
    return buffer.getvalue()


def rows_text(kind: type[AnyRow], rows: Iterable[AnyRow], states: Sequence[str] = ()) -> str:
    """Write rows of one kind as CSV; ``states``: names of the states if the rows have them."""
    columns = kind.columns(states)
    return csv_text(columns, (row.values(columns) for row in rows))


def csv_field(value: object) -> str:
    """Write one value: floats with the fewest digits that read back the same, missing values empty.

    Examples
    --------
    >>> csv_field(1e-12), csv_field(3), csv_field(None), csv_field(float("nan")), csv_field("ok")
    ('1e-12', '3', '', '', 'ok')
    >>> csv_field(-1), csv_field("-1"), csv_field("=A1")
    ('-1', '-1', "'=A1")
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float):
        return repr(float(value))
    return cell(str(value))


class TableError(ValueError):
    """A fault of a result file, with line and column (of a character), counted from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1) -> None:
        super().__init__(message)
        self.line, self.column = line, column


def read_rows(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """Read the rows of a result file; columns that are not fields are states, or ignored.

    Raises
    ------
    OSError, UnicodeDecodeError
        If the file cannot be read.
    TableError
        If the file is not a valid result file of this kind.
    """
    with path.open(encoding="utf-8-sig", newline="") as file:
        lines = list(file)
    reader, rows = csv.reader(lines, strict=True), []
    try:
        present = [name.strip() for name in next(reader, [])]
        readers = _readers(kind, present)
        for cells in filter(None, reader):
            if len(cells) != len(present):
                raise TableError(f"{len(cells)} fields; there are {len(present)} columns", reader.line_num)
            line = dict(zip(present, map(str.strip, cells), strict=True))
            where = reader.line_num, lines[reader.line_num - 1]
            values = {name: _read(read, line[name], *where) for name, read in readers.items()}
            if kind is TransitionRow:
                values[STATE] = {name: values.pop(name) for name in readers if name not in kind.columns()}
            try:
                rows.append(kind(**values))
            except ValueError as error:
                raise TableError(str(error), reader.line_num) from None
    except csv.Error as error:
        raise TableError(str(error), reader.line_num) from error
    return rows


def earlier_rows(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """Read the rows of a result file; empty if the file is missing or invalid."""
    try:
        return read_rows(kind, path)
    except (OSError, ValueError):
        return []


Reader = Callable[[str], Any]


def _readers(kind: type[Row], present: Sequence[str]) -> dict[str, Reader]:
    """Reader of each column, by the field's type; additional columns of a transition's row are states."""
    types = get_type_hints(kind)
    needed = [own.name for own in fields(kind) if own.default is MISSING and own.default_factory is MISSING]
    for column in needed:
        if column not in present:
            raise TableError(f"there is no column '{column}'; needed are {', '.join(needed)}")
    if len(set(present)) < len(present):
        raise TableError("a column name occurs twice")
    known = {column: _READERS[types[column]] for column in kind.columns() if column in present}
    states = [name for name in present if name not in known] if kind is TransitionRow else []
    return known | dict.fromkeys(states, _READERS[float | None])


def _number(text: str) -> float:
    value = float(text)
    if math.isnan(value):
        raise ValueError(text)
    return value


def _count(text: str) -> int:
    value = float(text)
    if not value.is_integer():
        raise ValueError(text)
    return int(value)


def _optional(read: Reader) -> Reader:
    return lambda text: read(text) if text else None


_READERS: Mapping[object, Reader] = {
    str: from_cell,
    int: _count,
    float: _number,
    str | None: _optional(from_cell),
    int | None: _optional(_count),
    float | None: _optional(_number),
}
"""Reader of a field, by its type."""


def _read(reader: Reader, text: str, line: int, written: str) -> Any:
    try:
        return reader(text)
    except (OverflowError, ValueError):
        words = f"{shortened(text)} is no number: the field takes a number or nothing"
        raise TableError(words, line, written.find(text) + 1) from None
