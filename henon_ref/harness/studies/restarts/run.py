"""The study of how libraries are restarted: every case, every library in every restart, and their options."""

from __future__ import annotations

from henon_ref.harness import registry
from henon_ref.harness.report.text.restarts import read_suite, wrong_defaults
from henon_ref.harness.studies.restarts.options import option_rows, options_of
from henon_ref.harness.studies.restarts.page import write_page
from henon_ref.harness.studies.restarts.runs import Entry, run_all
from henon_ref.harness.studies.study import Asked, Made


def run_restarts(asked: Asked) -> Made:
    """Run the study on all readings that have a stored truth, and write its page; it tells defaults that are beaten."""
    names = registry.expanded(asked.options.solvers or registry.default_names())
    found = dict.fromkeys(
        registry.base_name(name) for name in names if isinstance(name, str) and registry.restart_of(name)
    )
    groups: list[tuple[Entry, ...]] = [
        tuple(registry.with_restart(library, way) for way in registry.RESTARTS) for library in found
    ]
    study = run_all(asked.cases, groups, asked.options, asked.observer)
    if not study.rows:
        return Made(None)
    options_tried = options_of(list(found))
    pairs: list[tuple[Entry, ...]] = [(option.without, option.with_it) for option in options_tried]
    runs = run_all(asked.cases, pairs, asked.options, asked.observer).rows if pairs else []
    page = write_page(study, option_rows(options_tried, runs), asked.origin, asked.out)
    return Made(page, wrong_defaults(read_suite(asked.out)))
