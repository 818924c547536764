"""The study of how libraries are restarted: every case, every library in every restart, and their options."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.files.manifest import Provenance
from henon_ref.harness.studies.restarts.options import option_rows, options_of
from henon_ref.harness.studies.restarts.page import write_page
from henon_ref.harness.studies.restarts.runs import Entry, run_all


def run_restarts(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> Path | None:
    """Run the study on all readings that have a stored truth, and write its page.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        As for the cases themselves: solvers, tolerances, processes and memory are taken from it.
    origin : Provenance
    out : Path
        Folder of the reports.
    observer : Observer

    Returns
    -------
    Path or None
        The page; None where no reading has such a truth, or no solver that restarts a library was asked for.
    """
    names = registry.expanded(options.solvers or registry.default_names())
    found = dict.fromkeys(
        registry.base_name(name) for name in names if isinstance(name, str) and registry.restart_of(name)
    )
    groups: list[tuple[Entry, ...]] = [
        tuple(registry.with_restart(library, way) for way in registry.RESTARTS) for library in found
    ]
    study = run_all(cases, groups, options, observer)
    if not study.rows:
        return None
    options_tried = options_of(list(found))
    pairs: list[tuple[Entry, ...]] = [(option.without, option.with_it) for option in options_tried]
    runs = run_all(cases, pairs, options, observer).rows if pairs else []
    return write_page(study, option_rows(options_tried, runs), origin, out)
