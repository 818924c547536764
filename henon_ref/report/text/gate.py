"""The gate of a case in its report, and what the terminal says of bounds that were not checked."""

from __future__ import annotations

from henon_ref.campaign.comparison import Comparison
from henon_ref.report.text.formats import listing, setting
from henon_ref.report.text.tables import Table
from henon_ref.score.gate import LeftOut, Tally, gate_tally
from henon_ref.text import code, markdown


def gate_table(comparison: Comparison) -> Table | None:
    """One row: whether the gate is met, how many of its bounds were checked, what is not met, what did not run."""
    tally = gate_tally(comparison.case.readings, comparison.run_rows)
    if not tally.total:
        return None
    failures = comparison.gate_failures()
    state = "not met" if failures else "met" if tally.checked else "not checked"
    not_met = "; ".join(markdown(failure) for failure in failures)
    left_out = ", ".join(
        code(entry.solver) + (f" at {setting(entry.rtol, None)}" if entry.rtol is not None else "")
        for entry in tally.left_out
    )
    row = (state, f"{tally.checked} of {tally.total}", not_met, left_out)
    return Table(("gate", "bounds checked", "not met", "bounds left out: did not run"), "lrll", [row])


def why_unchecked(tally: Tally) -> str:
    """Why no bound of a gate was checked."""
    if not tally.total:
        return "there is no bound"
    solvers_only = all(entry.rtol is None for entry in tally.left_out)
    what = "solver that ran" if solvers_only else "solver that ran, at a tolerance that did"
    if tally.total == 1:
        return f"the only bound of the gate is on no {what}"
    return f"none of the {tally.total} bounds of the gate is on a {what}"


def bounds_left_out(tally: Tally) -> str:
    """The bounds that were not checked, by what did not run."""
    return f"bounds on what did not run are left out: {listing([_name(entry) for entry in tally.left_out])}"


def _name(entry: LeftOut) -> str:
    return entry.solver if entry.rtol is None else f"{entry.solver} at {setting(entry.rtol, None)}"
