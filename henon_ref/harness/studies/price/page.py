"""Price study: ladder and pairs in worker processes, followed by measurements on an idle machine, and the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.score.ranking import readings_of
from henon_ref.harness.studies.page import shipped_problem, title, write
from henon_ref.harness.studies.pairs import PairRow, TimedPair, own_words
from henon_ref.harness.studies.price.compiling import Ready, readiness, ready_table
from henon_ref.harness.studies.price.contacts import ManyContacts, contact_table, many_contacts
from henon_ref.harness.studies.price.effects import Step, effect_costs, effect_table
from henon_ref.harness.studies.price.growth import Horizon, draw_growth, growth_table, horizons
from henon_ref.harness.studies.price.ladder import (
    COUNTS,
    FEWEST,
    TIMEOUT,
    SampleRow,
    draw_ladder,
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
from henon_ref.harness.studies.price.measure import caches_in, in_fresh_process
from henon_ref.harness.studies.price.operations import Work, work
from henon_ref.harness.studies.price.states import Size, draw_sizes, size_table, sizes
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, duration
from henon_ref.text import markdown

PARTS: Mapping[str, tuple[str, type[Row], Callable[[Any], Table]]] = {
    "ready": ("compiling.csv", Ready, ready_table),
    "landings": ("landings.csv", Landed, landing_table),
    "effects": ("effects.csv", Step, effect_table),
    "growth": ("horizons.csv", Horizon, growth_table),
    "sizes": ("states.csv", Size, size_table),
    "contacts": ("contacts.csv", ManyContacts, contact_table),
}
"""File, type of the rows, and table of each measurement."""


@dataclass(frozen=True)
class Prices:
    """Results of all measurements."""

    rows: Sequence[RunRow]
    pairs: Sequence[TimedPair]
    failed: Sequence[str]
    """Pairs that could not be timed, and why."""
    work: Work
    ready: Sequence[Ready]
    landings: Sequence[Landed]
    effects: Sequence[Step]
    growth: Sequence[Horizon]
    sizes: Sequence[Size]
    contacts: Sequence[ManyContacts]


def run_price(request: StudyRequest) -> StudyResult:
    """Measure everything and write the page; the ladder includes the peers if ``all`` is among the solvers."""
    named = request.options.solvers or ()
    options = replace(request.options, solvers=solvers([str(name) for name in named]), folder=request.folder)
    rows = run_ladder(request.cases, options, request.observer)
    timed, failed = time_ladder_pairs(request.cases, rows, options, request.observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    with TemporaryDirectory() as empty, caches_in(empty):
        chains = in_fresh_process(sizes)
    found = Prices(
        rows=rows,
        pairs=timed,
        failed=failed,
        work=work(shipped_problem("fig8", "listing_limit")),
        ready=readiness(request.cases, timed),
        landings=[*landings(request.cases), *crest_crossings()],
        effects=effect_costs(),
        growth=horizons(shipped_problem("fig8", "listing_limit")),
        sizes=chains,
        contacts=many_contacts(),
    )
    return StudyResult(write_page(found, request.origin, request.folder))


def write_page(found: Prices, origin: Provenance, folder: Path) -> Path:
    """Write rows, figures and page.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    sections, figures = [], {"growth.svg": draw_growth(found.growth), "states.svg": draw_sizes(found.sizes)}
    for (case, reading), rows in readings_of(found.rows).items():
        own = {f"{case}_{reading}_{count}.svg": count for count in COUNTS}
        figures |= {file: draw_ladder(rows, count) for file, count in own.items()}
        shown = [(COUNTS[count], file) for file, count in own.items()]
        sections.append({"title": title(case, reading), "figures": shown, "scatter": scatter(rows)})
    work = found.work
    context = {name: table(getattr(found, name)).markdown for name, (_, _, table) in PARTS.items()} | {
        "whole": whole_table(found.rows, found.pairs).markdown,
        "rivals": rival_table(found.pairs).markdown,
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
    files = {file: rows_text(kind, getattr(found, name)) for name, (file, kind, _) in PARTS.items()} | {
        "price.csv": rows_text(RunRow, found.rows),
        "pairs.csv": rows_text(PairRow, found.pairs),
        "samples.csv": rows_text(SampleRow, samples_of(found.pairs)),
        "operations.csv": rows_text(Work, [work]),
    }
    return write(folder, "price", context, files, figures)
