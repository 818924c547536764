"""The atlas: every family among the cases by all solvers that have a tolerance, not timed; a figure a family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.plugin_probe import fixed_step
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.rows import RunRow, rows_text
from henon_ref.harness.studies.atlas.family import OUTCOMES, TOLERANCES, Family, family_of, outcome_of
from henon_ref.harness.studies.atlas.figure import draw_atlas
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.runs import rows_of
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import Table, exponential
from henon_ref.text import code, markdown, paragraphs

FOLDER = "atlas"


def families(cases: Sequence[Case]) -> list[Family]:
    """The families among the cases."""
    return [family for case in cases if (family := family_of(case)) is not None]


def run_atlas(asked: Asked) -> Made:
    """Run the families at the atlas's tolerances and write its page; none where nothing asked for has a place on it."""
    found = families(asked.cases)
    names = registry.expanded(asked.options.solvers or registry.default_names())
    # A solver that is driven by a step has no place on an axis of tolerances.
    solvers = tuple(s for s in names if not (fixed_step(s) if isinstance(s, str) else s.fixed_step))
    if not found or not solvers:
        return Made(None)
    folder = asked.out / FOLDER
    changed = replace(asked.options, solvers=solvers, tolerances=TOLERANCES, timed=False, folder=folder)
    rows = rows_of([family.case for family in found], changed, asked.observer)
    return Made(write_atlas([(family, rows[family.case.name]) for family in found], asked.origin, folder))


def write_atlas(found: Sequence[tuple[Family, list[RunRow]]], origin: Provenance, folder: Path) -> Path:
    """Write figures, runs and page.

    Parameters
    ----------
    found : sequence of (Family, list of RunRow)
        The families and their runs.
    origin : Provenance
    folder : Path
        The atlas's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    sections, figures = [], {}
    for family, rows in found:
        name = figure_name(family.case.name)
        figures[name] = draw_atlas(family, rows, solvers_of(rows))
        sections.append(
            {
                "title": markdown(family.case.title),
                "case": family.case.name,
                "figure": name,
                "story": paragraphs(family.case.readings[0].story or ""),
                "counts": count_table(rows).markdown,
            }
        )
    every = [row for _, rows in found for row in rows]
    context = {
        "sections": sections,
        "runs": len(every),
        "tightest": exponential(min(TOLERANCES), 1),
        "loosest": exponential(max(TOLERANCES), 1),
        "origin": origin,
    }
    return write(folder, "atlas", context, {RUNS: rows_text(RunRow, every)}, figures)


def figure_name(case: str) -> str:
    """File name of a family's figure."""
    return f"{case}.svg"


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


BLAME = ("ill-conditioned", "solver defect")
