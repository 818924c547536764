"""Report of a case: text, tables and figures; all files are prepared before the first one is replaced."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from henon_ref.atomic_write import write_through
from henon_ref.casefile.case import DEFAULT_READING
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.report import folder as names
from henon_ref.harness.report import tables, truth
from henon_ref.harness.report.folder import locked, own_files, without_dead_links
from henon_ref.harness.report.gate import gate_table
from henon_ref.harness.report.manifest import Provenance, manifest_text
from henon_ref.harness.report.model import model_text, parameters
from henon_ref.harness.report.rendering import environment, packed
from henon_ref.harness.report.svg import KINDS, file_name, motion_in
from henon_ref.harness.result_files import csv_text, rows_text
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.harness.score.ranking import over_all
from henon_ref.harness.table import Table, listing
from henon_ref.text import link, markdown, one_line, paragraphs

MANY_READINGS = 4
"""Number of readings from which a report begins with tables over all readings."""


def write_report(comparison: Comparison, origin: Provenance, folder: Path) -> Path:
    """Write the report of one case into ``folder/<name>``; return the path of its ``report.md``.

    All files are first written into a temporary folder, and then moved to their places. Links of the report to missing
    files become text, as in the index. Files of an earlier report that the new one does not have are removed. If
    writing fails (OSError), the earlier report is unchanged.
    """
    place = folder / comparison.case.name
    files = report_files(comparison, origin)
    folder.mkdir(parents=True, exist_ok=True)
    waiting = Path(tempfile.mkdtemp(prefix=f".{comparison.case.name}.", dir=folder))
    try:
        for name, content in files.items():
            write_through(waiting / name, content)
        page = without_dead_links(files[names.REPORT].decode(), waiting)
        write_through(waiting / names.REPORT, page.encode())
        with locked([folder], wait=True):  # a writer of the index reads the old or the new report
            place.mkdir(exist_ok=True)
            stale = own_files(place) - set(files)
            for name in sorted(files, key=lambda name: name != names.MANIFEST):  # it marks the files as a report's
                os.replace(waiting / name, place / name)
            for name in stale:
                (place / name).unlink(missing_ok=True)
    finally:
        shutil.rmtree(waiting, ignore_errors=True)
    return place / names.REPORT


def report_files(comparison: Comparison, origin: Provenance) -> dict[str, bytes]:
    files: dict[str, bytes] = {
        names.REPORT: report_text(comparison, origin).encode(),
        names.RUNS: rows_text(RunRow, comparison.run_rows).encode(),
        names.TRANSITIONS: rows_text(TransitionRow, comparison.transition_rows, comparison.states).encode(),
        names.STICKS: rows_text(StickRow, comparison.stick_rows).encode(),
        names.SAMPLES: samples_text(comparison).encode(),
        names.CASE_FILE: json.dumps(case_content(comparison), indent=1).encode() + b"\n",
    }
    for result in comparison.readings:
        files.update(result.figures)
    files[names.MANIFEST] = manifest_text(comparison, origin, [*files, names.MANIFEST]).encode()
    return files


def samples_text(comparison: Comparison) -> str:
    """Write ``samples.csv``, with one row per timed run; samples [ns] are separated by spaces."""
    rows = [
        (*record.run.key[1:], " ".join(f"{round(sample * 1e9)}" for sample in record.samples))
        for record in comparison.records
        if record.samples
    ]
    return csv_text(("reading", "solver", "rtol", "step_s", "samples_ns"), rows)


def case_content(comparison: Comparison) -> dict[str, Any]:
    """Collect the data of a case for the HTML page, except its rows: tags, source, stories and portraits."""
    stories = {result.reading.name: one_line(result.reading.story or "") for result in comparison.readings}
    motions = [(result.reading, motion_in(result.samples, result.expected)) for result in comparison.readings]
    tags = dict.fromkeys(tag for result in comparison.readings for tag in result.reading.tags)
    return {
        "schema": names.SCHEMA,
        "tags": list(map(one_line, tags)),
        "source": one_line(comparison.case.source or ""),
        "stories": {name: story for name, story in stories.items() if story},
        "portraits": {own.name: packed(own.problem.system, motion) for own, motion in motions if motion is not None},
    }


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
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _text(table: Table | None) -> str:
    return "" if table is None else table.markdown


def _whole(comparison: Comparison) -> Mapping[str, Any] | None:
    """Make the tables over all readings, if there are many: solvers, prices, and digits by reading."""
    readings = {
        result.reading.name: [record.run for record in comparison.of_reading(result.reading.name)]
        for result in comparison.readings
        if result.expected is not None
    }
    if len(comparison.readings) < MANY_READINGS or not readings:
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
