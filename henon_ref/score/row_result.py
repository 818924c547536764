"""What a row is to a test runner: passed, a failure, an error or skipped, and why."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from henon_ref.rows import NOT_RUN, RunRow

Kind = Literal["passed", "failure", "error", "skipped", "known"]
KINDS: tuple[Kind, ...] = ("passed", "failure", "error", "known", "skipped")
UNDECIDED = ("ill-conditioned", "not unique", "not judged", None)
"""Verdicts on rows that are not right by no fault of the solver."""


@dataclass(frozen=True)
class RowResult:
    """What a row is to a test runner."""

    kind: Kind
    """``known``: it fails as expected."""
    reason: str = ""
    """Why it has not passed."""


def row_result(row: RunRow, complaints: Collection[str] = (), *, known: bool = False) -> RowResult:
    """What a row is to a test runner.

    A failure: it is not right and its solver is to blame, it ran out of time, or there are complaints. An error:
    there is no result (a crash, an exception, too much memory), or the run did not end so when it was repeated.
    Skipped: it did not run, or double precision does not decide what is right.

    Parameters
    ----------
    row : RunRow
    complaints : collection of str
        What else is wrong with it: a bound that is not met, digits lost since earlier.
    known : bool
        Whether a failure of it is expected.
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
    elif row.status in NOT_RUN or (verdict in UNDECIDED and row.status != "timeout"):
        kind = "skipped"
    else:
        kind = "failure"
    if known and kind != "passed":
        return RowResult("known", "fails as expected: " + "; ".join(reasons))
    return RowResult(kind, "; ".join(reasons))
