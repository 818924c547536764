"""The gate of a case in its report, and what the terminal says of bounds that were not checked."""

from __future__ import annotations

from collections.abc import Mapping

from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.report.text.formats import listing, setting
from henon_ref.harness.score.gate import Demand, Gate
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown


def gate_table(comparison: Comparison) -> Table | None:
    """One row: whether the gate is met, how many of its bounds were checked, what is not met, what did not run."""
    gate = comparison.gate
    if not gate.total:
        return None
    state = "not met" if gate.unmet else "met" if gate.checked else "not checked"
    not_met = "; ".join(markdown(words) for _, words in gate.unmet)
    left_out = ", ".join(_name(code(solver), rtol) for solver, rtol in gate.left_out)
    row = (state, f"{gate.checked} of {gate.total}", not_met, left_out)
    return Table(("gate", "bounds checked", "not met", "bounds left out: did not run"), "lrll", [row])


def why_unchecked(gate: Gate) -> str:
    """Why no bound of a gate was checked."""
    if not gate.total:
        return "there is no bound"
    solvers_only = all(rtol is None for _, rtol in gate.left_out)
    what = "solver that ran" if solvers_only else "solver that ran, at a tolerance that did"
    if gate.total == 1:
        return f"the only bound of the gate is on no {what}"
    return f"none of the {gate.total} bounds of the gate is on a {what}"


def bounds_left_out(gate: Gate) -> str:
    """The bounds that were not checked, by what did not run."""
    return f"bounds on what did not run are left out: {listing([_name(*entry) for entry in gate.left_out])}"


def _name(solver: str, rtol: float | None) -> str:
    return solver if rtol is None else f"{solver} at {setting(rtol, None)}"


def gate_state(gate: Gate, failed: bool, *, wanted: bool) -> str:
    """What became of the gate, behind the report's name; ``wanted``: whether it decides the exit status."""
    if not gate.total and not wanted:
        return ""
    if failed and gate.checked:
        return "; gate not met"
    if not gate.checked:
        return f"; gate not checked: {why_unchecked(gate)}"
    part = "" if gate.checked == gate.total else f" ({gate.checked} of {gate.total} bounds checked)"
    return f"; gate met{part}"


def demands_state(demands: Mapping[str, Demand]) -> str:
    """In how many readings each required solver is right, behind the report's name."""
    return "".join(f"; {solver} right in {own.right} of {own.judged} judged" for solver, own in demands.items())
