"""The report as markdown: everything in it is taken from the comparison, then set by the template."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from henon_ref.casefile.case import DEFAULT_READING
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.report.files.figure_jobs import COST, ERRORS, MODES, PORTRAIT, SCENE, file_name
from henon_ref.harness.report.files.manifest import Provenance
from henon_ref.harness.report.text.formats import listing
from henon_ref.harness.report.text.gate import gate_table
from henon_ref.harness.report.text.model import (
    as_written,
    effect_table,
    general_form,
    kink_notes,
    mode_equations,
    modes_of,
    parameters,
    reset_notes,
)
from henon_ref.harness.report.text.overview import overview
from henon_ref.harness.report.text.published import orbit_table, printed_times_table, published_table
from henon_ref.harness.report.text.summary import EXPLAINED, solver_table
from henon_ref.harness.report.text.tables import MARK, price_table, reason_table, run_table, samples_of, stick_table
from henon_ref.harness.report.text.truth import no_truth, truth_table
from henon_ref.harness.table import Table
from henon_ref.text import link, markdown, paragraphs

if TYPE_CHECKING:
    from jinja2 import Environment

NOTES = (
    (
        "matched, missed, spurious",
        "Transitions are matched with the truth by order and mode (kind, surface, modes before and after) before any "
        "error is taken, so that one missed transition counts once; touches that change no mode count apart.",
    ),
    (
        "digits",
        "−log₁₀ of the worst error of a transition time in seconds{unit}, never more than the truth's radius and "
        "double precision allow.",
    ),
    (
        "time",
        "Median of repeated runs in one process after one run as a warm-up, with the interquartile range, or the "
        "number of runs where they are fewer than three: a slow run is not repeated, nor is one that is not right.",
    ),
    (
        "compile",
        "Compilation, code generation and other one-time work. What is kept on disk (machine code of `henon`, C "
        "programs) comes from there once it has been made.",
    ),
    (
        "right, verdict",
        "Of the library with its default way of being restarted on the surface after an event; `--solvers "
        "heyoka@offset` tries another one.",
    ),
    (
        "steps, right-hand sides, event functions",
        "Steps, and evaluations of right-hand sides and of event functions, as each solver's docstring counts them.",
    ),
)
"""What the columns of the tables mean."""

LEGEND = f"{MARK}: the samples scatter by more than a tenth of their median."
"""Below a table that is marked so, away from the notes."""


@cache
def environment() -> Environment:
    """The templates' environment."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("henon_ref.harness.report.text"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
    )


def report_text(comparison: Comparison, provenance: Provenance) -> str:
    """The report of one case."""
    case = comparison.case
    single = [result.reading.name for result in comparison.readings] == [DEFAULT_READING]
    text = (
        environment()
        .get_template("report.md.j2")
        .render(
            title=markdown(case.title),
            single=single,
            sub="##" if single else "###",
            overview=overview(comparison),
            explained=EXPLAINED if len({record.run.solver for record in comparison.records}) > 1 else "",
            readings=_without_repeats([_reading(comparison, result) for result in comparison.readings]),
            gate=_markdown(gate_table(comparison)),
            notes=Table(
                ("column", "meaning"), "ll", [(c, w.format(unit=_unit(comparison))) for c, w in NOTES]
            ).markdown,
            source=markdown(case.source or "").rstrip("."),
            links=list(dict.fromkeys(link(own) for result in comparison.readings for own in result.reading.links)),
            rerun=provenance.rerun,
            versions=_versions(comparison, provenance),
            machine=provenance.machine_text,
            commit=provenance.commit[:12],
        )
    )
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _reading(comparison: Comparison, result: ReadingResult) -> dict[str, Any]:
    reading = result.reading
    system = reading.problem.system
    records = comparison.of_reading(reading.name)
    rows = [record.run for record in records]
    solvers = solver_table(comparison, result).markdown
    prices = _markdown(price_table(rows, samples_of(records)))
    figures = _figures(result)
    return {
        "name": reading.name,
        "title": "" if reading.title == comparison.case.title else markdown(reading.title),
        "solvers": solvers,
        "solvers_legend": LEGEND if MARK in solvers else "",
        "no_truth": no_truth(result),
        "figures": figures[:FIRST_FIGURES],
        "scene": [file for file in (file_name(reading.name, SCENE),) if file in result.figures],
        "more_figures": figures[FIRST_FIGURES:],
        "figures_note": _figures_note(comparison, result),
        "published": _markdown(published_table(comparison, result)),
        "printed_times": _markdown(printed_times_table(result)),
        "prices": prices,
        "legend": LEGEND if MARK in prices else "",
        "sticks": _markdown(stick_table(comparison, result)),
        "orbit": _markdown(orbit_table(result)),
        "runs": run_table(records).markdown,
        "reasons": _markdown(reason_table(rows)),
        "truth": truth_table(result, rows).markdown,
        "model": {
            "story": paragraphs(reading.story or ""),
            "effects": [part if isinstance(part, str) else part.markdown for part in effect_table(result) or ()],
            "kinks": [*kink_notes(system), *reset_notes(system)],
            "equations": general_form(system),
            "written": as_written(system),
            "modes": [mode_equations(system, mode) for mode in modes_of(result)],
        },
        "parameters": parameters(result),
    }


def _without_repeats(readings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Readings with the name of an earlier one of the same model, and with no story that an earlier one has told."""
    stories: set[str] = set()
    models: list[tuple[str, dict[str, Any]]] = []
    for reading in readings:
        model = reading["model"]
        if (story := model.pop("story")) in stories:
            story = ""
        stories.add(story)
        same = next((name for name, earlier in models if earlier == model), "")
        if not same:
            models.append((reading["name"], model))
        reading |= {"story": story, "same_model": same}
    return readings


def _markdown(table: Table | None) -> str:
    return "" if table is None else table.markdown


CAPTIONS = {
    PORTRAIT: "Phase portrait in the measured window; sticks lie on the surface",
    MODES: "Distance from the surface over time, the modes shaded",
    ERRORS: "Largest error of a transition time so far, each solver at its tightest setting",
    COST: "Worst error of a transition time against the wall time of a run",
}
FIRST_FIGURES = 3
"""Figures that stand above all headings; the others belong to the model."""


def _figures(result: ReadingResult) -> list[dict[str, str]]:
    """The figures that were drawn, what matters most first."""
    found = []
    for kind in (COST, ERRORS, PORTRAIT, MODES):
        file = file_name(result.reading.name, kind)
        if file in result.figures:
            found.append({"file": file, "caption": CAPTIONS[kind]})
    return found


def _figures_note(comparison: Comparison, result: ReadingResult) -> str:
    """Why a reading has no figures."""
    if result.figures_reason:
        return f"Figures could not be drawn: {markdown(result.figures_reason)}."
    drawn = any(other.figures for other in comparison.readings)
    if drawn and comparison.readings.index(result) == MOST_DRAWN:
        return f"(Figures are drawn for the first {MOST_DRAWN} readings.)"
    return ""


def _unit(comparison: Comparison) -> str:
    units = {result.expected.time_unit for result in comparison.readings if result.expected is not None}
    other = sorted(units - {1.0})
    return f" (here in units of {listing([f'{unit:g} s' for unit in other])})" if other else ""


def _versions(comparison: Comparison, provenance: Provenance) -> str:
    """The versions of the packages whose solvers ran."""
    ran = {record.run.solver: record.run.library_version or "" for record in comparison.records}
    return listing([markdown(f"{package} {version}") for package, version in provenance.packages(ran).items()])
