"""The price list: ladder and pairs in worker processes, then what needs an idle machine, then the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text.ranking import readings_of
from henon_ref.harness.rows import Row, RunRow, rows_text
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.paired_times.rows import PairRow, own_words
from henon_ref.harness.studies.paired_times.timing import TimedPair
from henon_ref.harness.studies.price.compiling import Ready, readiness, ready_table
from henon_ref.harness.studies.price.effects import Step, effect_costs, effect_table
from henon_ref.harness.studies.price.figures import COUNTS, draw_growth, draw_ladder, draw_sizes
from henon_ref.harness.studies.price.growth import Horizon, growth_table, horizons
from henon_ref.harness.studies.price.ladder import (
    FEWEST,
    TIMEOUT,
    SampleRow,
    own_times,
    rival_table,
    run_ladder,
    samples_of,
    scatter,
    solvers,
    time_ladder_pairs,
    whole_table,
)
from henon_ref.harness.studies.price.landings import Landed, crest_crossings, landing_table, landings
from henon_ref.harness.studies.price.measure import caches_in, in_fresh_process, orbit_problem, title
from henon_ref.harness.studies.price.operations import Work, work
from henon_ref.harness.studies.price.states import Size, size_table, sizes
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import duration
from henon_ref.text import markdown

FOLDER = "price"


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
    rows = run_ladder(asked.cases, options, asked.observer)
    timed, failed = time_ladder_pairs(asked.cases, rows, options, asked.observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    orbit = orbit_problem()
    with TemporaryDirectory() as empty, caches_in(Path(empty)):
        chains = in_fresh_process(sizes)
    found = Prices(
        rows=rows,
        pairs=timed,
        failed=failed,
        ready=readiness(asked.cases, timed),
        landings=[*landings(asked.cases), *crest_crossings()],
        work=work(orbit),
        effects=effect_costs(),
        growth=horizons(orbit),
        sizes=chains,
    )
    return Made(write_page(found, asked.origin, folder))


def write_page(found: Prices, origin: Provenance, folder: Path) -> Path:
    """Write rows, figures and page.

    Raises
    ------
    OSError
        Where the folder cannot be written.
    """
    sections, figures = [], {"growth.svg": draw_growth(found.growth), "states.svg": draw_sizes(found.sizes)}
    for (case, reading), rows in readings_of(found.rows).items():
        own = {f"{case}_{reading}_{count}.svg": count for count in COUNTS}
        figures |= {file: draw_ladder(rows, count) for file, count in own.items()}
        shown = [(COUNTS[count], file) for file, count in own.items()]
        sections.append({"title": title(case, reading), "figures": shown, "scatter": scatter(rows)})
    work = found.work
    tables = {
        "whole": whole_table(found.rows, found.pairs),
        "rivals": rival_table(found.pairs),
        "ready": ready_table(found.ready),
        "landings": landing_table(found.landings),
        "effects": effect_table(found.effects),
        "growth": growth_table(found.growth),
        "sizes": size_table(found.sizes),
    }
    context = {name: table.markdown for name, table in tables.items()} | {
        "own_times": own_times(found.pairs),
        "deadline": f"{TIMEOUT:g}",
        "fewest": FEWEST,
        "own": own_words(found.pairs),
        "failed": [markdown(words) for words in found.failed],
        "sections": sections,
        "work": work,
        "work_time": duration(work.wall_s),
        "of_peak": f"{100 * work.rate / work.peak:.0f} %",
        "gigaflops": f"{work.rate / 1e9:.2g}",
        "peak": f"{work.peak / 1e9:.2g}",
        "origin": origin,
    }
    files: dict[str, tuple[type[Row], Sequence[Row]]] = {
        "price.csv": (RunRow, found.rows),
        "pairs.csv": (PairRow, found.pairs),
        "samples.csv": (SampleRow, samples_of(found.pairs)),
        "compiling.csv": (Ready, found.ready),
        "landings.csv": (Landed, found.landings),
        "effects.csv": (Step, found.effects),
        "horizons.csv": (Horizon, found.growth),
        "states.csv": (Size, found.sizes),
        "operations.csv": (Work, [work]),
    }
    return write(
        folder, "price", context, {name: rows_text(kind, rows) for name, (kind, rows) in files.items()}, figures
    )
