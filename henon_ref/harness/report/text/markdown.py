"""Report of a case as markdown, made from a template and a comparison."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from henon_ref.casefile.case import DEFAULT_READING
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.report.figure_jobs import KINDS, file_name
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text import tables, truth
from henon_ref.harness.report.text.gate import gate_table
from henon_ref.harness.report.text.model import model_text, parameters
from henon_ref.harness.report.text.ranking import over_all
from henon_ref.harness.table import Table, listing
from henon_ref.text import link, markdown, paragraphs

if TYPE_CHECKING:
    from jinja2 import Environment

MANY = 4
"""Number of readings from which a report begins with tables over all readings."""
_EMPTY = re.compile(r"\n{3,}")
"""Repeated blank lines, which a template leaves around omitted parts."""


@cache
def environment() -> Environment:
    """Make the environment of the templates of reports, of the index, and of the pages of studies."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("henon_ref.harness.report.text"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
    )


def report_text(comparison: Comparison, origin: Provenance) -> str:
    case, results = comparison.case, comparison.readings
    models: dict[str, str] = {}
    stories = {""}
    text = (
        environment()
        .get_template("report.md.j2")
        .render(
            title=markdown(case.title),
            single=[result.reading.name for result in results] == [DEFAULT_READING],
            compared=len({row.solver for row in comparison.run_rows}) > 1,
            whole=_whole(comparison),
            readings=[_reading(comparison, result, models, stories) for result in results],
            gate=_text(gate_table(comparison.gate)),
            mark=tables.MARK,
            origin=origin,
            **_origin(comparison, origin),
        )
    )
    return _EMPTY.sub("\n\n", text).strip() + "\n"


def _text(table: Table | None) -> str:
    return "" if table is None else table.markdown


def _whole(comparison: Comparison) -> Mapping[str, Any] | None:
    """Make the tables over all readings, if there are many: solvers, prices, and digits by reading."""
    readings = {
        result.reading.name: [record.run for record in comparison.of_reading(result.reading.name)]
        for result in comparison.readings
        if result.expected is not None
    }
    if len(comparison.readings) < MANY or not readings:
        return None
    whole = over_all(list(readings.values()))
    return {
        "judged": len(readings),
        "others": len(comparison.readings) - len(readings),
        "solvers": tables.whole_table(whole, len(readings)).markdown,
        "prices": _text(tables.price_table(whole, {})),
        "digits": tables.digits_table(readings).markdown,
    }


def _reading(
    comparison: Comparison, result: ReadingResult, models: dict[str, str], stories: set[str]
) -> Mapping[str, Any]:
    """Collect the variables of the template for a reading; repeated models and stories are left out."""
    reading, records = result.reading, comparison.of_reading(result.reading.name)
    rows = [record.run for record in records]
    story, model = paragraphs(reading.story or ""), model_text(result)
    same, repeated = models.setdefault(model, reading.name), story in stories
    stories.add(story)
    names = {kind: file_name(reading.name, kind) for kind in KINDS}
    return {
        "name": reading.name,
        "title": "" if reading.title == comparison.case.title else markdown(reading.title),
        "solvers": tables.solver_table(records).markdown,
        "no_truth": truth.no_truth(result),
        "figures": {kind: name for kind, name in names.items() if name in result.figures},
        "figures_note": _figures_note(comparison, result),
        "published": _text(truth.published_table(records, result)),
        "printed_times": _text(truth.printed_times_table(result)),
        "prices": _text(tables.price_table(rows, tables.samples_of(records))),
        "sticks": _text(tables.stick_table(records, result)),
        "orbit": _text(truth.orbit_table(result)),
        "runs": tables.run_table(records).markdown,
        "reasons": _text(tables.reason_table(rows)),
        "truth": truth.truth_table(result, rows).markdown,
        "story": "" if repeated else story,
        "model": model,
        "same_model": "" if same == reading.name else same,
        "parameters": ", ".join(parameters(result)),
    }


def _figures_note(comparison: Comparison, result: ReadingResult) -> str:
    if result.figures_reason:
        return f"Figures could not be drawn: {markdown(result.figures_reason)}."
    drawn = any(other.figures for other in comparison.readings)
    if drawn and comparison.readings.index(result) == MOST_DRAWN:
        return f"(Figures are drawn for the first {MOST_DRAWN} readings.)"
    return ""


def _origin(comparison: Comparison, origin: Provenance) -> Mapping[str, str]:
    """Return the units of time for the count of digits if other than seconds, the source, and the versions."""
    units = {result.expected.time_unit for result in comparison.readings if result.expected is not None} - {1.0}
    links = dict.fromkeys(link(own) for result in comparison.readings for own in result.reading.links)
    source = markdown(comparison.case.source or "").rstrip(".")
    ran = {row.solver: row.library_version or "" for row in comparison.run_rows}
    return {
        "unit": f" (here in units of {listing([f'{unit:g} s' for unit in sorted(units)])})" if units else "",
        "source": source + (f" ({', '.join(links)})" if source and links else ""),
        "versions": listing([markdown(f"{name} {version}") for name, version in origin.packages(ran).items()]),
    }
