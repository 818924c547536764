"""Result of a row for a test runner (passed, failure, error, skipped), and expected failures."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Literal, get_args

from henon_ref.harness.rows import NOT_RUN, UNDECIDED, Row, RunRow
from henon_ref.text import did_you_mean, listed, shortened
from henon_ref.trajectory import Status

Kind = Literal["passed", "failure", "error", "skipped", "known"]
STATUSES: tuple[str, ...] = get_args(Status)


@dataclass(frozen=True)
class KnownFailure(Row):
    """Rows that are expected to fail; a field that is None matches any value.

    Raises
    ------
    ValueError
        If it would match every row, or if its status is not one with which a row fails.
    """

    case: str | None = None
    reading: str | None = None
    solver: str | None = None
    rtol: float | None = None
    step_s: float | None = None
    """Step [s]."""
    status: str | None = None
    reason: str | None = None
    """Why the failure is expected."""

    def __post_init__(self) -> None:
        if not (self.case or self.reading or self.solver):
            raise ValueError("the line would match every row: name a case, a reading or a solver")
        if self.status == "ok":
            raise ValueError("'ok' is no failure: leave the status empty, or give that of the failing rows")
        if self.status:
            check_status(self.status)

    @property
    def name(self) -> str:
        """Description in messages.

        Examples
        --------
        >>> KnownFailure("two_roots", solver="ida", rtol=1e-3).name
        'case two_roots, solver ida, rtol 0.001'
        """
        given = [(own.name, getattr(self, own.name)) for own in fields(self) if own.name != "reason"]
        return ", ".join(f"{what} {value}" for what, value in given if value is not None)

    def names(self, row: RunRow) -> bool:
        """Whether the row matches, regardless of its status."""
        own = (self.case, self.reading, self.solver, self.rtol, self.step_s)
        return all(wanted in (None, value) for wanted, value in zip(own, row.key, strict=True))

    def covers(self, row: RunRow) -> bool:
        """Whether a failure of the row is the expected one."""
        return self.names(row) and self.status in (None, row.status)


def check_status(status: str) -> None:
    """Check that a text is a status of a row.

    Raises
    ------
    ValueError
        If it is not; the message lists the statuses.
    """
    if status not in STATUSES:
        hint = did_you_mean(status, STATUSES)
        raise ValueError(f"{shortened(status)} is no status; there are {listed(STATUSES)}{hint}")


@dataclass(frozen=True)
class RowResult:
    """Result of a row for a test runner."""

    kind: Kind
    """``known``: the row fails as expected."""
    reason: str = ""
    """Why the row has not passed."""


def row_result(row: RunRow, complaints: Collection[str] = (), *, known: bool = False) -> RowResult:
    """Classify a row for a test runner.

    Failure: it is wrong by its solver's fault, it ran out of time, or there are complaints. Error: it has no result (a
    crash, an exception, too much memory), or a repeated run ended differently. Skipped: it did not run, or double
    precision does not decide the right result. ``complaints``: further faults, such as unmet bounds or digits lost
    since an earlier run; ``known``: whether a failure of the row is expected.
    """
    kind: Kind
    verdict = row.verdict
    judged = f"; verdict: {verdict}" if verdict is not None and row.status not in NOT_RUN else ""
    reasons = [*([] if verdict == "right" else [row.status_text + judged]), *complaints]
    if row.repeated:
        kind, reasons = "error", [row.status_text, *complaints]
    elif row.status == "failed" and row.found_transitions is None:
        kind = "error"
    elif complaints:
        kind = "failure"
    elif verdict == "right":
        kind = "passed"
    elif row.status in NOT_RUN or ((verdict in UNDECIDED or not row.judged) and row.status != "timeout"):
        kind = "skipped"
    else:
        kind = "failure"
    if known and kind != "passed":
        return RowResult("known", "fails as expected: " + "; ".join(reasons))
    return RowResult(kind, "; ".join(reasons))
