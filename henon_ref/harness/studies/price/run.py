"""The price list: ladder and pairs in worker processes, then what needs an idle machine, then the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.studies.price.compiling import readiness
from henon_ref.harness.studies.price.effects import effect_costs
from henon_ref.harness.studies.price.fresh import caches_in, in_fresh_process
from henon_ref.harness.studies.price.growth import horizons
from henon_ref.harness.studies.price.ladder import run_ladder, solvers
from henon_ref.harness.studies.price.ladder_pairs import time_ladder_pairs
from henon_ref.harness.studies.price.landings import crest_crossings, landings
from henon_ref.harness.studies.price.operations import work
from henon_ref.harness.studies.price.orbit import orbit_problem
from henon_ref.harness.studies.price.page import Prices, write_page
from henon_ref.harness.studies.price.states import sizes
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import Truth

FOLDER = "price"


def run_price(asked: Asked) -> Made:
    """Measure everything and write the page; with ``all`` among the solvers of the ladder the peers, too."""
    folder, named = asked.out / FOLDER, asked.options.solvers or ()
    options = replace(asked.options, solvers=solvers([str(name) for name in named]), folder=folder)
    return Made(write_page(_measured(asked.cases, options, asked.observer), asked.origin, folder))


def _measured(cases: Sequence[Case], options: Options, observer: Observer) -> Prices:
    """Everything that the page is made of."""
    ladder = run_ladder(cases, options, observer)
    timed, failed = time_ladder_pairs(cases, ladder.rows, options, observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    orbit = orbit_problem()
    with TemporaryDirectory() as folder, caches_in(Path(folder)):
        chains = in_fresh_process(sizes)
    return Prices(
        rows=ladder.rows,
        samples=ladder.samples,
        pairs=timed,
        failed=failed,
        ready=readiness(cases, timed),
        landings=[*landings(cases, truths_of(cases)), *crest_crossings()],
        work=work(orbit),
        effects=effect_costs(),
        growth=horizons(orbit),
        sizes=chains,
    )


def truths_of(cases: Sequence[Case]) -> dict[tuple[str, str], Truth]:
    """The stored truths of the cases' readings."""
    found = {}
    for case in cases:
        for reading in case.readings:
            truth = stored_truth(case, reading)
            if truth is not None:
                found[case.name, reading.name] = truth
    return found
