"""The atlas: every family among the cases by all solvers that have a tolerance, not timed; a figure a family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from henon_ref.harness import registry
from henon_ref.harness.campaign.case_files import fixed_step
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.rows import RunRow, rows_text
from henon_ref.harness.studies.atlas.family import OUTCOMES, TOLERANCES, family_of, outcome_of
from henon_ref.harness.studies.atlas.figure import draw_atlas
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.runs import rows_of
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import Table, exponential
from henon_ref.text import code, markdown, paragraphs

FOLDER = "atlas"
BLAME = ("ill-conditioned", "solver defect")


def run_atlas(asked: Asked) -> Made:
    """Run the families at the atlas's tolerances and write its page; none where nothing asked for has a place on it."""
    found = [family for case in asked.cases if (family := family_of(case)) is not None]
    names = registry.expanded(asked.options.solvers or registry.default_names())
    # A solver that is driven by a step has no place on an axis of tolerances.
    solvers = tuple(s for s in names if not (fixed_step(s) if isinstance(s, str) else s.fixed_step))
    if not found or not solvers:
        return Made(None)
    folder = asked.out / FOLDER
    changed = replace(asked.options, solvers=solvers, tolerances=TOLERANCES, timed=False, folder=folder)
    rows = rows_of([family.case for family in found], changed, asked.observer)
    sections, figures = [], {}
    for family in found:
        case, own = family.case, rows[family.case.name]
        figures[f"{case.name}.svg"] = draw_atlas(family, own, solvers_of(own))
        sections.append(
            {
                "title": markdown(case.title),
                "case": case.name,
                "figure": f"{case.name}.svg",
                "story": paragraphs(case.readings[0].story or ""),
                "counts": count_table(own).markdown,
            }
        )
    every = [row for own in rows.values() for row in own]
    context = {
        "sections": sections,
        "runs": len(every),
        "tightest": exponential(min(TOLERANCES), 1),
        "loosest": exponential(max(TOLERANCES), 1),
        "origin": asked.origin,
    }
    return Made(write(folder, "atlas", context, {RUNS: rows_text(RunRow, every)}, figures))


def solvers_of(rows: Sequence[RunRow]) -> list[str]:
    """Solvers that ran, in the registry's order."""
    present = {row.solver for row in rows if outcome_of(row) is not None}
    order = [name for name in registry.names() if name in present]
    return order + sorted(present - set(order))


def count_table(rows: Sequence[RunRow]) -> Table:
    """How often each solver is right, wrong in each way, and wrong by its own fault."""
    lines = []
    for solver in solvers_of(rows):
        own = [row for row in rows if row.solver == solver and outcome_of(row) is not None]
        tally = Counter(outcome_of(row) for row in own)
        blamed = Counter(row.verdict for row in own)
        shown = [f"{tally[outcome] or ''}" for outcome in OUTCOMES]
        lines.append((code(solver), f"{len(own)}", *shown, *(f"{blamed[word] or ''}" for word in BLAME)))
    headings = ("solver", "runs", *OUTCOMES.values(), *BLAME)
    return Table(headings, "l" + "r" * (len(headings) - 1), lines)
