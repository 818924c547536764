"""Price study: ladder and pairs in worker processes, followed by measurements on an idle machine, and the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text.ranking import readings_of
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.studies.page import shipped_problem, title, write
from henon_ref.harness.studies.pairs import PairRow, TimedPair, own_words
from henon_ref.harness.studies.price.chains import (
    ManyContacts,
    Size,
    contact_table,
    draw_sizes,
    many_contacts,
    size_table,
    sizes,
)
from henon_ref.harness.studies.price.growth import Horizon, draw_growth, growth_table, horizons
from henon_ref.harness.studies.price.ladder import (
    COUNTS,
    FEWEST,
    TIMEOUT,
    Ready,
    draw_ladder,
    own_times,
    readiness,
    ready_table,
    rival_table,
    run_ladder,
    samples_text,
    scatter,
    solvers,
    time_ladder_pairs,
    whole_table,
)
from henon_ref.harness.studies.price.landings import Landed, crest_crossings, landing_table, landings
from henon_ref.harness.studies.price.measure import in_fresh_process
from henon_ref.harness.studies.price.operations import Step, Work, effect_costs, effect_table, work
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


def run_price(request: StudyRequest) -> StudyResult:
    """Measure everything and write the page; the ladder includes the peers if ``all`` is among the solvers."""
    named = request.options.solvers or ()
    options = replace(request.options, solvers=solvers([str(name) for name in named]), folder=request.folder)
    rows = run_ladder(request.cases, options, request.observer)
    timed, failed = time_ladder_pairs(request.cases, rows, options, request.observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    with TemporaryDirectory() as empty:
        chains = in_fresh_process(sizes, cache=empty)
    problem = shipped_problem("fig8", "listing_limit")
    done = work(problem)
    parts: dict[str, Sequence[Row]] = {
        "ready": readiness(request.cases, timed),
        "landings": [*landings(request.cases), *crest_crossings()],
        "effects": effect_costs(),
        "growth": horizons(problem),
        "sizes": chains,
        "contacts": [many_contacts(blocks) for blocks in (4, 8, 16, 64)],
    }
    return StudyResult(write_page(request.folder, request.origin, rows, timed, failed, done, parts))


def write_page(
    folder: Path,
    origin: Provenance,
    rows: Sequence[RunRow],
    pairs: Sequence[TimedPair],
    failed: Sequence[str],
    work: Work,
    parts: Mapping[str, Sequence[Any]],
) -> Path:
    """Write rows, figures and page.

    ``rows`` are the runs of the ladder, ``failed`` says which pairs could not be timed and why, and ``parts`` has the
    rows of each measurement in :data:`PARTS`.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    sections, figures = [], {"growth.svg": draw_growth(parts["growth"]), "states.svg": draw_sizes(parts["sizes"])}
    for (case, reading), own in readings_of(rows).items():
        shown = [(words, f"{case}_{reading}_{count}.svg") for count, words in COUNTS.items()]
        figures |= {file: draw_ladder(own, count) for count, (_, file) in zip(COUNTS, shown, strict=True)}
        sections.append({"title": title(case, reading), "figures": shown, "scatter": scatter(own)})
    context = {name: table(parts[name]).markdown for name, (_, _, table) in PARTS.items()} | {
        "whole": whole_table(rows, pairs).markdown,
        "rivals": rival_table(pairs).markdown,
        "own_times": own_times(pairs),
        "deadline": f"{TIMEOUT:g}",
        "fewest": FEWEST,
        "own": own_words(pairs),
        "failed": [markdown(words) for words in failed],
        "sections": sections,
        "work": work,
        "work_time": duration(work.wall_s),
        "of_peak": f"{100 * work.rate / work.peak:.0f} %",
        "gigaflops": f"{work.rate / 1e9:.2g}",
        "peak": f"{work.peak / 1e9:.2g}",
        "origin": origin,
    }
    files = {file: rows_text(kind, parts[name]) for name, (file, kind, _) in PARTS.items()} | {
        "price.csv": rows_text(RunRow, rows),
        "pairs.csv": rows_text(PairRow, pairs),
        "samples.csv": samples_text(pairs),
        "operations.csv": rows_text(Work, [work]),
    }
    return write(folder, "price", context, files, figures)
