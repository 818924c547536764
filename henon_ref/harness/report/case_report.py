"""Write the report of a case; all files are prepared before the first one is replaced."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from henon_ref.atomic_write import write_through
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.report import folder as names
from henon_ref.harness.report.folder import locked, own_files
from henon_ref.harness.report.manifest import Provenance, manifest_text
from henon_ref.harness.report.text.markdown import report_text
from henon_ref.harness.result_files import csv_text, rows_text
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.text import one_line

SAMPLE_COLUMNS = ("reading", "solver", "rtol", "step_s", "samples_ns")
"""Columns of ``samples.csv``, with one row per timed run; samples [ns] are separated by spaces."""


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
    rows = [
        (*record.run.key[1:], " ".join(f"{round(sample * 1e9)}" for sample in record.samples))
        for record in comparison.records
        if record.samples
    ]
    return csv_text(SAMPLE_COLUMNS, rows)


def case_content(comparison: Comparison) -> dict[str, Any]:
    """Collect the data of a case for the HTML page, except its rows: tags, source, stories and portraits."""
    from henon_ref.figures.motion import motion_of
    from henon_ref.harness.report.html.portrait import packed

    stories, portraits = {}, {}
    for result in comparison.readings:
        reading, samples, expected = result.reading, result.samples, result.expected
        if story := one_line(reading.story or ""):
            stories[reading.name] = story
        motion = motion_of(samples, expected.transitions) if samples is not None and expected is not None else None
        if motion is not None:
            portraits[reading.name] = packed(reading.problem.system, motion)
    tags = dict.fromkeys(tag for result in comparison.readings for tag in result.reading.tags)
    return {
        "schema": names.SCHEMA,
        "tags": list(map(one_line, tags)),
        "source": one_line(comparison.case.source or ""),
        "stories": stories,
        "portraits": portraits,
    }


def write_report(comparison: Comparison, origin: Provenance, folder: Path) -> Path:
    """Write the report of one case into ``folder/<name>``; return the path of its ``report.md``.

    All files are first written into a temporary folder, and then moved to their places. Files of an earlier report that
    the new one does not have are removed. If writing fails (OSError), the earlier report is unchanged.
    """
    place = folder / comparison.case.name
    files = report_files(comparison, origin)
    folder.mkdir(parents=True, exist_ok=True)
    waiting = Path(tempfile.mkdtemp(prefix=f".{comparison.case.name}.", dir=folder))
    try:
        for name, content in files.items():
            write_through(waiting / name, content)
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
