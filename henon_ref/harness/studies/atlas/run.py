"""The atlas's runs: every family among the cases by all solvers that have a tolerance, not timed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.campaign.plugin_probe import fixed_step
from henon_ref.harness.report.files.manifest import Provenance
from henon_ref.harness.studies.atlas.family import TOLERANCES, Family, family_of
from henon_ref.harness.studies.atlas.page import FOLDER, write_atlas
from henon_ref.harness.studies.runs import rows_of


def families(cases: Sequence[Case]) -> list[Family]:
    """The families among the cases."""
    return [family for case in cases if (family := family_of(case)) is not None]


def run_atlas(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> Path | None:
    """Run the families at the atlas's tolerances and write its page.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        As for the cases themselves: solvers, limits and resuming are taken from it.
    origin : Provenance
    out : Path
        Folder of the reports.
    observer : Observer

    Returns
    -------
    Path or None
        The page; None where no case is a family, or no solver with a tolerance was asked for.
    """
    found = families(cases)
    names = registry.expanded(options.solvers or registry.default_names())
    # A solver that is driven by a step has no place on an axis of tolerances.
    solvers = tuple(s for s in names if not (fixed_step(s) if isinstance(s, str) else s.fixed_step))
    if not found or not solvers:
        return None
    folder = out / FOLDER
    changed = replace(options, solvers=solvers, tolerances=TOLERANCES, timed=False, folder=folder)
    rows = rows_of([family.case for family in found], changed, observer)
    return write_atlas([(family, rows[family.case.name]) for family in found], origin, folder)
