"""The price list: ladder and pairs in worker processes, then what needs an idle machine, then the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text.paired_times import PairRow, own_words
from henon_ref.harness.report.text.ranking import readings_of
from henon_ref.harness.rows import RunRow, csv_text, rows_text
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.paired_times.timing import TimedPair
from henon_ref.harness.studies.price import tables
from henon_ref.harness.studies.price.compiling import Ready, readiness
from henon_ref.harness.studies.price.effects import Step, effect_costs
from henon_ref.harness.studies.price.figures import COUNTS, draw_growth, draw_ladder, draw_sizes
from henon_ref.harness.studies.price.fresh import caches_in, in_fresh_process
from henon_ref.harness.studies.price.growth import Horizon, horizons
from henon_ref.harness.studies.price.ladder import TIMEOUT, run_ladder, solvers
from henon_ref.harness.studies.price.ladder_pairs import FEWEST, SampleRow, samples_of, time_ladder_pairs
from henon_ref.harness.studies.price.landings import Landed, crest_crossings, landings
from henon_ref.harness.studies.price.operations import Work, work
from henon_ref.harness.studies.price.orbit import orbit_problem
from henon_ref.harness.studies.price.states import Size, sizes
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import duration
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import Truth
from henon_ref.text import markdown

FOLDER = "price"
GROWTH, SIZES = "growth.svg", "states.svg"


@dataclass(frozen=True)
class Prices:
    """Everything that was measured."""

    rows: Sequence[RunRow]
    pairs: Sequence[TimedPair]
    failed: Sequence[str]
    """Pairs that could not be timed, and why."""
    ready: Sequence[Ready]
    landings: Sequence[Landed]
    work: Work
    effects: Sequence[Step]
    growth: Sequence[Horizon]
    sizes: Sequence[Size]


def run_price(asked: Asked) -> Made:
    """Measure everything and write the page; with ``all`` among the solvers of the ladder the peers, too."""
    folder, named = asked.out / FOLDER, asked.options.solvers or ()
    options = replace(asked.options, solvers=solvers([str(name) for name in named]), folder=folder)
    return Made(write_page(_measured(asked.cases, options, asked.observer), asked.origin, folder))


def _measured(cases: Sequence[Case], options: Options, observer: Observer) -> Prices:
    """Everything that the page is made of."""
    rows = run_ladder(cases, options, observer)
    timed, failed = time_ladder_pairs(cases, rows, options, observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    orbit = orbit_problem()
    with TemporaryDirectory() as folder, caches_in(Path(folder)):
        chains = in_fresh_process(sizes)
    return Prices(
        rows=rows,
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


def write_page(found: Prices, origin: Provenance, folder: Path) -> Path:
    """Write rows, figures and page.

    Raises
    ------
    OSError
        Where the folder cannot be written.
    """
    sections, figures = [], {GROWTH: draw_growth(found.growth), SIZES: draw_sizes(found.sizes)}
    for (case, reading), rows in readings_of(found.rows).items():
        own = {f"{case}_{reading}_{count}.svg": count for count in COUNTS}
        figures |= {file: draw_ladder(rows, count) for file, count in own.items()}
        sections.append(
            {
                "title": tables.title(case, reading),
                "figures": [(COUNTS[count], file) for file, count in own.items()],
                "scatter": tables.scatter(rows),
            }
        )
    work = found.work
    context = {
        "whole": tables.whole_table(found.rows, found.pairs).markdown,
        "own_times": tables.own_times(found.pairs),
        "deadline": f"{TIMEOUT:g}",
        "fewest": FEWEST,
        "rivals": tables.rival_table(found.pairs).markdown,
        "own": own_words(found.pairs),
        "failed": [markdown(words) for words in found.failed],
        "ready": tables.ready_table(found.ready).markdown,
        "sections": sections,
        "landings": tables.landing_table(found.landings).markdown,
        "effects": tables.effect_table(found.effects).markdown,
        "growth": tables.growth_table(found.growth).markdown,
        "growth_figure": GROWTH,
        "sizes": tables.size_table(found.sizes).markdown,
        "sizes_figure": SIZES,
        "work": work,
        "work_time": duration(work.wall_s),
        "of_peak": f"{100 * work.rate / work.peak:.0f} %",
        "gigaflops": f"{work.rate / 1e9:.2g}",
        "peak": f"{work.peak / 1e9:.2g}",
        "origin": origin,
    }
    return write(folder, "price", context, _files(found), figures)


def _files(found: Prices) -> dict[str, str]:
    """CSV text of what the tables are made of, by file name."""
    return {
        "price.csv": rows_text(RunRow, found.rows),
        "pairs.csv": rows_text(PairRow, found.pairs),
        "samples.csv": rows_text(SampleRow, samples_of(found.pairs)),
        "compiling.csv": _records(Ready, found.ready),
        "landings.csv": _records(Landed, found.landings),
        "effects.csv": _records(Step, found.effects),
        "horizons.csv": _records(Horizon, found.growth),
        "states.csv": _records(Size, found.sizes),
        "operations.csv": _records(Work, [found.work]),
    }


def _records(kind: Any, found: Sequence[Any]) -> str:
    return csv_text([field.name for field in fields(kind)], map(astuple, found))
