"""Price study: ladder and pairs in worker processes, followed by measurements on an idle machine, and the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.score.ranking import readings_of
from henon_ref.harness.studies.page import in_fresh_process, shipped_problem, title, write
from henon_ref.harness.studies.pairs import PairRow, TimedPair, own_words
from henon_ref.harness.studies.price import accuracy, chains, ladder, operations
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, duration
from henon_ref.text import markdown

PARTS: Mapping[str, tuple[str, type[Row], Callable[[Any], Table]]] = {
    "ready": ("compiling.csv", ladder.Ready, ladder.ready_table),
    "landings": ("landings.csv", accuracy.Landed, accuracy.landing_table),
    "effects": ("effects.csv", operations.Step, operations.effect_table),
    "growth": ("horizons.csv", accuracy.Horizon, accuracy.growth_table),
    "sizes": ("states.csv", chains.Size, chains.size_table),
    "contacts": ("contacts.csv", chains.ManyContacts, chains.contact_table),
}
"""File, type of the rows, and table of each measurement."""


def run_price(request: StudyRequest) -> StudyResult:
    """Measure everything and write the page; the ladder includes the peers if ``all`` is among the solvers."""
    named = request.options.solvers or ()
    options = replace(request.options, solvers=ladder.solvers([str(name) for name in named]), folder=request.folder)
    rows = ladder.run_ladder(request.cases, options, request.observer)
    timed, failed = ladder.time_ladder_pairs(request.cases, rows, options, request.observer)
    # The measurements below run one at a time, in this process or a new one, with no worker busy.
    with TemporaryDirectory() as empty:
        sizes = in_fresh_process(chains.sizes, cache=empty)
    problem = shipped_problem("fig8", "listing_limit")
    done = operations.work(problem)
    parts: dict[str, Sequence[Row]] = {
        "ready": ladder.readiness(request.cases, timed),
        "landings": [*accuracy.landings(request.cases), *accuracy.crest_crossings()],
        "effects": operations.effect_costs(),
        "growth": accuracy.horizons(problem),
        "sizes": sizes,
        "contacts": [chains.many_contacts(blocks) for blocks in (4, 8, 16, 64)],
    }
    return StudyResult(write_page(request.folder, request.origin, rows, timed, failed, done, parts))


def write_page(
    folder: Path,
    origin: Provenance,
    rows: Sequence[RunRow],
    pairs: Sequence[TimedPair],
    failed: Sequence[str],
    work: operations.Work,
    parts: Mapping[str, Sequence[Any]],
) -> Path:
    """Write rows, figures and page; OSError if the folder cannot be written.

    ``rows`` are the runs of the ladder, ``failed`` says which pairs could not be timed and why, and ``parts`` has the
    rows of each measurement in :data:`PARTS`.
    """
    sections = []
    figures = {"growth.svg": accuracy.draw_growth(parts["growth"]), "states.svg": chains.draw_sizes(parts["sizes"])}
    for (case, reading), own in readings_of(rows).items():
        shown = [(words, f"{case}_{reading}_{count}.svg") for count, words in ladder.COUNTS.items()]
        figures |= {file: ladder.draw_ladder(own, count) for count, (_, file) in zip(ladder.COUNTS, shown, strict=True)}
        sections.append({"title": title(case, reading), "figures": shown, "scatter": ladder.scatter(own)})
    context = {name: table(parts[name]).markdown for name, (_, _, table) in PARTS.items()} | {
        "whole": ladder.whole_table(rows, pairs).markdown,
        "rivals": ladder.rival_table(pairs).markdown,
        "own_times": ladder.own_times(pairs),
        "deadline": f"{ladder.TIMEOUT:g}",
        "fewest": ladder.FEWEST,
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
        "samples.csv": ladder.samples_text(pairs),
        "operations.csv": rows_text(operations.Work, [work]),
    }
    return write(folder, "price", context, files, figures)
