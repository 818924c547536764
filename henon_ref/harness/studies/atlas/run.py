"""The atlas's runs: every family among the cases by all solvers that have a tolerance, not timed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.plugin_probe import fixed_step
from henon_ref.harness.studies.atlas.family import TOLERANCES, Family, family_of
from henon_ref.harness.studies.atlas.page import FOLDER, write_atlas
from henon_ref.harness.studies.runs import rows_of
from henon_ref.harness.studies.study import Asked, Made


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
