"""The price list: ladder and pairs in worker processes, then what needs an idle machine, then the page."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.case_files import load_cases
from henon_ref.harness.campaign.journal import FILE
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.files.folder_lock import locked
from henon_ref.harness.report.files.manifest import provenance
from henon_ref.harness.report.files.write import check_writable, remove_if_empty
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
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import Truth


def run(
    paths: Sequence[Path],
    out: Path,
    *,
    chosen: Sequence[str],
    jobs: int,
    resume: bool,
    observer: AbstractContextManager[Observer],
) -> int:
    """Measure everything and write the page; ``chosen``: see :func:`henon_ref.harness.studies.price.ladder.solvers`."""
    check_writable(out)
    cases, wanted = load_cases(paths), solvers(chosen)
    journals = [out / case.name for case in cases]
    names = " ".join([*map(str, paths), *(["--solvers", ",".join(chosen)] if chosen else [])])
    options = Options(solvers=wanted, processes=jobs, folder=out, resume=resume, keep_journals=True)
    with locked([out, *journals]):
        found = _measured(cases, options, observer)
        page = write_page(found, provenance(f"python -m henon_ref.price {names}"), out)
        for folder in journals:
            (folder / FILE).unlink(missing_ok=True)
    for folder in journals:
        remove_if_empty(folder)
    print(page)
    return 0


def _measured(cases: Sequence[Case], options: Options, observer: AbstractContextManager[Observer]) -> Prices:
    """Everything that the page is made of."""
    with observer as shown:
        ladder = run_ladder(cases, options, shown)
        timed, failed = time_ladder_pairs(cases, ladder.rows, options, shown)
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
