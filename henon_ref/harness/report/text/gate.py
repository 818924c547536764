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
    bounds = "its only bound belongs" if gate.total == 1 else f"its {gate.total} bounds belong"
    return f"{bounds} to {_not_run(gate)}"


def _not_run(gate: Gate) -> str:
    """What the bounds belong to that were not checked."""
    solvers_only = all(rtol is None for _, rtol in gate.left_out)
    return f"{'solvers' if solvers_only else 'solvers or tolerances'} that were not run"


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
    if gate.checked == gate.total:
        return "; gate met"
    others = gate.total - gate.checked
    belong = f"{others} {'belongs' if others == 1 else 'belong'} to {_not_run(gate)}"
    return f"; gate met: {gate.checked} of {gate.total} bounds checked, {belong}"


def demands_state(demands: Mapping[str, Demand]) -> str:
    """In how many readings each required solver is right, behind the report's name."""
    return "".join(f"; {solver} right in {own.right} of {own.judged} judged" for solver, own in demands.items())
