"""Rows of the result files as dataclasses: columns, types and units.

The fields of a row are the columns of its file, in order. They are part of the contract, so new fields go to the end. A
missing value is None and an empty field in the file, never 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields

from henon_ref.harness.table import setting

NOT_RUN = ("unsupported", "unavailable")
"""Statuses of rows whose run was not made."""
UNJUDGED = ("not run", "not judged")
"""Verdicts on runs that are neither right nor wrong."""
UNDECIDED = ("ill-conditioned", "not unique")
"""Verdicts on runs that differ from the truth where double precision cannot decide the right sequence."""
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
class ReadingRow(Row):
    """A row on a reading of a case."""

    case: str
    reading: str

    @property
    def problem(self) -> tuple[str, str]:
        """Key of the reading."""
        return self.case, self.reading


@dataclass(frozen=True)
class RunRow(ReadingRow):
    """One run: a reading, solver and setting (``runs.csv``)."""

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
    """Classification of a run (:mod:`henon_ref.harness.score.scoring`); None if it was not scored."""
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
    """First time at which some surface was below the solver's rounding; its later transitions are not scored [s]."""

    @property
    def key(self) -> Key:
        return self.case, self.reading, self.solver, self.rtol, self.step_s

    @property
    def judged(self) -> bool:
        return self.verdict is not None and self.verdict not in UNJUDGED

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
class PartRow(ReadingRow):
    """A part of a run, identified by its index."""

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
    """Verdict on a missed or spurious transition (:mod:`henon_ref.harness.score.scoring`)."""


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


def number(value: float | None) -> float:
    """Return the number, NaN if it is missing."""
    return math.nan if value is None else value
