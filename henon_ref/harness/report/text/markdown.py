"""The report of a case as markdown: blocks of text, figures and tables, all of it taken from the comparison."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from henon_ref.casefile.case import DEFAULT_READING
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.report.figure_jobs import COST, ERRORS, MODES, PORTRAIT, SCENE, file_name
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text.gate import gate_table
from henon_ref.harness.report.text.model import model_blocks, parameters
from henon_ref.harness.report.text.ranking import over_all
from henon_ref.harness.report.text.tables import (
    KEY,
    MARK,
    digits_table,
    price_table,
    reason_table,
    run_table,
    samples_of,
    solver_table,
    stick_table,
    whole_table,
)
from henon_ref.harness.report.text.truth import (
    no_truth,
    orbit_table,
    printed_times_table,
    published_table,
    truth_table,
)
from henon_ref.harness.rows import RunRow
from henon_ref.harness.table import Table, listing
from henon_ref.text import link, markdown, paragraphs

if TYPE_CHECKING:
    from jinja2 import Environment

MANY = 4
"""Readings from which on a report begins with tables over all of them, and each one's tables stand in its section."""
NOTES = {
    "matched, missed, spurious": "Transitions are matched with the truth by order and mode (kind, surface, modes "
    "before and after) before any error is taken, so that one missed transition counts once; touches that change no "
    "mode count apart.",
    "digits": "−log₁₀ of the worst error of a transition time in seconds{unit}, never more than the truth's radius and "
    "double precision allow.",
    "time": "Median of repeated runs in one process after one run as a warm-up, with the interquartile range, or the "
    "number of runs where they are fewer than three: a slow run is not repeated, nor is one that is not right.",
    "times as long": "The time over the shortest one in the table.",
    "compile": "Compilation, code generation and other one-time work. What is kept on disk (machine code of `henon`, C "
    "programs) comes from there once it has been made.",
    "right, verdict": "Of the library with its default way of being restarted on the surface after an event; "
    "`--solvers heyoka@offset` tries another one.",
    "steps, right-hand sides, event functions": "Steps, and evaluations of right-hand sides and of event functions, as "
    "each solver's docstring counts them.",
}
"""What the columns of the tables mean."""
EXPLAINED = "The most accurate right run of each solver, and at how many of its settings it is right."
"""Below a table of solvers that has several."""
WHOLE = (
    "Right: in how many of {judged} readings{without}, at one and the same setting. Digits: the fewest in any reading "
    "that is right; time: of all readings, where all are right."
)
LEGEND = f"{MARK}: the samples scatter by more than a tenth of their median."
WHOLE_LEGEND = f"{MARK}: the ranges of all readings' samples add up to more than a tenth of it."
"""Below a table with a time that is marked so."""
CAPTIONS = {
    COST: "Worst error of a transition time against the wall time of a run",
    ERRORS: "Largest error of a transition time so far, each solver at its tightest setting",
    PORTRAIT: "Phase portrait in the measured window; sticks lie on the surface",
    MODES: "Distance from the surface over time, the modes shaded",
    SCENE: "Bodies and what connects them",
}
Blocks = list[str]
"""Paragraphs, tables and figures; an empty one is left out."""


@cache
def environment() -> Environment:
    """The environment of the templates: of the index, and of the studies' pages."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("henon_ref.harness.report.text"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
    )


def report_text(comparison: Comparison, origin: Provenance) -> str:
    """The report of one case."""
    case, results = comparison.case, comparison.readings
    single = [result.reading.name for result in results] == [DEFAULT_READING]
    many, written = len(results) >= MANY and bool(judged(comparison)), _Written()
    blocks = [f"# {markdown(case.title)}"]
    if many:
        blocks += _whole(comparison)
    for result in () if many else results:
        blocks += [] if single else [_title(comparison, result, f"[{result.reading.name}](#{result.reading.name})")]
        blocks += _head(comparison, result)
    if not many and len({record.run.solver for record in comparison.records}) > 1:
        blocks.append(EXPLAINED)
    for result in results:
        blocks += [] if single else [f"## {result.reading.name}"]
        blocks += [_title(comparison, result), *_head(comparison, result)] if many else []
        blocks += _reading_section(comparison, result, written, "##" if single else "###")
    blocks += _section("## Gate", [_text(gate_table(comparison.gate))])
    blocks += _section("## How to read this", _notes(comparison, origin))
    return "\n\n".join(filter(None, blocks)) + "\n"


def judged(comparison: Comparison) -> list[tuple[str, list[RunRow]]]:
    """The readings that have a truth, by name, and their rows."""
    return [
        (result.reading.name, [record.run for record in comparison.of_reading(result.reading.name)])
        for result in comparison.readings
        if result.expected is not None
    ]


def _whole(comparison: Comparison) -> Blocks:
    """In how many readings each solver is right at one setting, what the cheapest that is right in all costs; who is
    right where."""
    readings = judged(comparison)
    whole, others = over_all([rows for _, rows in readings]), len(comparison.readings) - len(readings)
    prices = price_table(whole)
    without = f", {others} more without a truth" if others else ""
    blocks = [whole_table(whole, len(readings)).markdown, WHOLE.format(judged=len(readings), without=without)]
    if prices is not None:
        words = "The cheapest setting that reaches so many digits in every reading, and its time for all of them:"
        blocks += [words, prices.markdown]
    blocks.append(WHOLE_LEGEND if any(MARK in block for block in blocks) else "")
    return [*blocks, *_section("## All readings", [KEY, digits_table(readings).markdown])]


def _title(comparison: Comparison, result: ReadingResult, place: str = "") -> str:
    title = "" if result.reading.title == comparison.case.title else markdown(result.reading.title)
    return ": ".join(filter(None, (place, title)))


def _head(comparison: Comparison, result: ReadingResult) -> Blocks:
    """The table that a reading is summed up in."""
    return [*_marked(solver_table(comparison.of_reading(result.reading.name)), LEGEND), no_truth(result)]


class _Written:
    """Models and stories that the report has already: none is written twice."""

    def __init__(self) -> None:
        self.models: dict[str, str] = {}
        self.stories: set[str] = {""}


def _reading_section(comparison: Comparison, result: ReadingResult, written: _Written, level: str) -> Blocks:
    """The section of one reading: its figures and tables."""
    records = comparison.of_reading(result.reading.name)
    rows = [record.run for record in records]
    figures, prices = _figures(result), _marked(price_table(rows, samples_of(records)), LEGEND)
    return [
        *(figures.get(kind, "") for kind in (COST, ERRORS, PORTRAIT)),
        _figures_note(comparison, result),
        _text(published_table(records, result)),
        _text(printed_times_table(result)),
        *_section(f"{level} Cheapest solver for so many digits", prices),
        *_section(f"{level} Sticks", [_text(stick_table(records, result))]),
        *_section(f"{level} Periodic orbit", [_text(orbit_table(result))]),
        *_section(f"{level} Every run", [run_table(records).markdown, _text(reason_table(rows))]),
        *_section(f"{level} Truth", [truth_table(result, rows).markdown]),
        *_section(f"{level} Model", _model_section(result, written, figures)),
        figures.get(MODES, ""),
    ]


def _model_section(result: ReadingResult, written: _Written, figures: dict[str, str]) -> Blocks:
    reading = result.reading
    story, model = paragraphs(reading.story or ""), "\n\n".join(model_blocks(result))
    same = written.models.setdefault(model, reading.name)
    blocks = ["" if story in written.stories else story]
    written.stories.add(story)
    if same == reading.name:
        blocks += [figures.get(SCENE, ""), model]
    else:
        blocks.append(f"The equations are those of [{same}](#{same}).")
    return [*blocks, f"Values: {', '.join(parameters(result))}."]


def _section(heading: str, blocks: Sequence[str]) -> Blocks:
    """A heading with what stands below it; nothing where that is nothing."""
    kept = list(filter(None, blocks))
    return [heading, *kept] if kept else []


def _text(table: Table | None) -> str:
    return "" if table is None else table.markdown


def _marked(table: Table | None, legend: str) -> Blocks:
    """A table, with its legend where one of its times is marked."""
    return [] if table is None else [table.markdown, legend if MARK in table.markdown else ""]


def _figures(result: ReadingResult) -> dict[str, str]:
    """The figures that were drawn, by kind."""
    names = {kind: file_name(result.reading.name, kind) for kind in CAPTIONS}
    return {kind: f"![{CAPTIONS[kind]}]({name})" for kind, name in names.items() if name in result.figures}


def _figures_note(comparison: Comparison, result: ReadingResult) -> str:
    """Why a reading has no figures."""
    if result.figures_reason:
        return f"Figures could not be drawn: {markdown(result.figures_reason)}."
    drawn = any(other.figures for other in comparison.readings)
    if drawn and comparison.readings.index(result) == MOST_DRAWN:
        return f"(Figures are drawn for the first {MOST_DRAWN} readings.)"
    return ""


def _notes(comparison: Comparison, origin: Provenance) -> Blocks:
    """What the columns mean, and where all of it comes from."""
    units = {result.expected.time_unit for result in comparison.readings if result.expected is not None} - {1.0}
    unit = f" (here in units of {listing([f'{unit:g} s' for unit in sorted(units)])})" if units else ""
    rows = [(column, meaning.format(unit=unit)) for column, meaning in NOTES.items()]
    links = dict.fromkeys(link(own) for result in comparison.readings for own in result.reading.links)
    source, where = markdown(comparison.case.source or "").rstrip("."), f" ({', '.join(links)})" if links else ""
    ran = {record.run.solver: record.run.library_version or "" for record in comparison.records}
    versions = listing([markdown(f"{package} {version}") for package, version in origin.packages(ran).items()])
    commit = f", from commit {origin.commit[:12]}" if origin.commit else ""
    return [
        Table(("column", "meaning"), "ll", rows).markdown,
        f"Source: {source}{where}." if source else "",
        "Made by",
        f"    {origin.rerun}",
        f"with {versions}, on {origin.machine_text}{commit}. Exact parameter values and all versions are in "
        "[manifest.json](manifest.json); every number is in [runs.csv](runs.csv), and in `transitions.csv`, "
        "`sticks.csv` and (timing samples) `samples.csv`, which are written beside it.",
    ]
