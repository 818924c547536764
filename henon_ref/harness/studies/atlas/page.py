"""The atlas's page: a figure and a count a family, and every run in one file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from henon_ref.harness import registry
from henon_ref.harness.report.files.manifest import Provenance
from henon_ref.harness.report.files.write import RUNS
from henon_ref.harness.report.text.formats import exponential
from henon_ref.harness.rows import RunRow, rows_text
from henon_ref.harness.studies.atlas.family import OUTCOMES, TOLERANCES, Family, outcome_of
from henon_ref.harness.studies.atlas.figure import draw_atlas
from henon_ref.harness.studies.page import write
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown, paragraphs

FOLDER = "atlas"


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
