"""Files that summarise all reports of a folder: the matrix, the index in markdown, and the HTML page.

The page contains its data as JSON: the matrix, the recommended solvers, and the cases. The details of a case (its runs
and portraits) come from its folder. If the folder has been removed, or its comparison did not run a solver, the details
come from the existing page. The page thus keeps as much as the matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from henon_ref.atomic_write import replace_file
from henon_ref.baselines.causes import CAUSES
from henon_ref.errors import CaseError
from henon_ref.grouping import grouped
from henon_ref.harness.report import choice
from henon_ref.harness.report.folder import (
    CASE_FILE,
    INDEX,
    MATRIX,
    PAGE,
    REPORT,
    SCHEMA,
    check_index,
    mapping,
    read_json,
    without_dead_links,
)
from henon_ref.harness.report.matrix import (
    MatrixRow,
    commits_of,
    merged,
    read_report,
    solvers_of,
    wall_column,
)
from henon_ref.harness.report.rendering import environment, read_embedded, rendered, rounded, solver_lines
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.ranking import LEVELS, by_solver, floor, readings_of
from henon_ref.harness.score.reference import CLOSE
from henon_ref.harness.table import count
from henon_ref.text import one_line

MEAN_PARTS = round(1 / CLOSE)
"""Two roots are close if their distance is below their mean spacing divided by this number."""
PAGES = {
    "price": "[Price list](price/README.md): times for a number of digits, of preparation, of effects and of long runs",
    "rivals": "[Alternating runs](rivals/README.md): times of `henon`, heyoka and the cheapest other solver",
    "atlas": "[Atlas](atlas/README.md): tolerance against distance from a graze, or between two roots of one step",
    "restarts": "[Restarts](restarts/README.md) of the libraries after an event: each restart on all cases",
    "causes": "[Causes](causes/README.md) of failures of the libraries, each shown by a run of the library alone",
    "paper": "[The paper](paper/README.md): every number and equation of the paper, computed again",
}
"""Folder of a study -> its link in the index."""
FORMAT = 2
TEXT = 0
"""Marks a text field in ``FIELDS``, instead of a number of significant digits."""
FIELDS: Mapping[str, int] = {
    "setting": TEXT, "status": TEXT, "verdict": TEXT, "digits": 5, "max_time_error_s": 2, "wall_s": 4,
    "max_stick_error_s": 2, "max_state_error": 2, "steps": 12, "rhs_evaluations": 12, "wall_s_iqr": 2, "missed": 12,
    "spurious": 12, "missed_touches": 12, "status_reason": TEXT, "cause": TEXT, "verdict_basis": TEXT,
}  # fmt: skip
"""Fields of a run on the page -> significant digits."""
CELL = ("settings", "judged", "right", "status", "verdict", "digits", *map(wall_column, (None, *LEVELS)))
"""Columns of the matrix in a cell, after the index of the solver."""
PROJECTS = {
    "henon-ref": ("", "Taylor method with Hénon's landing, and the paper's own programs; this project"),
    "heyoka": ("https://bluescarni.github.io/heyoka.py/", "Taylor integrator, compiled by LLVM, with event detection"),
    "scikit-sundae": ("https://github.com/NREL/scikit-sundae", "CVODE and IDA of SUNDIALS, called from Python"),
    "scipy": ("https://docs.scipy.org/doc/scipy/tutorial/integrate.html", "solve_ivp, what most people begin with"),
    "sundials": ("https://computing.llnl.gov/projects/sundials", "CVODE from C, all callbacks compiled"),
    "octave": ("https://octave.org", "ode45 of GNU Octave, written as for MATLAB"),
    "siconos": (
        "https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/",
        "time stepping for nonsmooth systems",
    ),
    "diffrax": ("https://docs.kidger.site/diffrax/", "solvers for JAX, with events"),
    "pydiffsol": ("https://github.com/martinjrobins/diffsol", "diffsol, solvers in Rust with their own language"),
    "nosnoc": ("https://github.com/nosnoc/nosnoc_py", "time stepping with switch detection, by optimization"),
}
"""Package or program of solvers -> (address, description); no address for this project."""
Details = dict[str, Any]
"""Details of a case: title, tags, source, ``files`` of its report, and ``readings`` by name, each with its portrait and
its runs by solver."""


def write_folder_report(folder: Path) -> Path:
    """Write the matrix of all reports in a folder, the page and the index; return the path of the index.

    The matrix keeps its rows of solvers and cases without a report in the folder (:func:`.text.matrix.merged`). If this
    package has not written a file that it would replace, or the matrix or the page is damaged, raise CaseError and
    write nothing.
    """
    check_index(folder)
    rows = merged(folder)
    page = page_text(rows, folder)
    replace_file(folder / MATRIX, rows_text(MatrixRow, rows).encode())
    replace_file(folder / PAGE, page.encode())
    replace_file(folder / INDEX, index_text(rows, folder).encode())  # last, since it links to existing files only
    return folder / INDEX


def index_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """Format the index as markdown from the rows of a folder's matrix, with links to existing files only."""
    text = (
        environment()
        .get_template("index.md.j2")
        .render(
            choice=choice.choice_table(rows).markdown,
            often=choice.frequency_table(rows).markdown,
            cases=choice.case_table([row for row in rows if (folder / row.case / REPORT).exists()]).markdown,
            commits=choice.commits(rows),
            mean_parts=MEAN_PARTS,
            pages=[words for page, words in PAGES.items() if (folder / page / INDEX).exists()],
        )
    )
    return without_dead_links(text, folder)


def page_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """Format the page as HTML from the rows of a folder's matrix."""
    data = content(folder, rows)
    cases, readings = len({row.case for row in rows}), len({row.problem for row in rows})
    files = {INDEX: "index (markdown)", MATRIX: "matrix (CSV)"}
    studies = {f"{page}/{INDEX}": words.split("]")[0].strip("[").lower() for page, words in PAGES.items()}
    return rendered(
        "reports.html",
        ("page.js", "matrix.js", "run.js"),
        data,
        summary=f"{count(readings, 'reading')} of {count(cases, 'case')}, "
        f"{count(len(data['solvers']), 'solver')}; {choice.commits(rows)}.",
        choice=next(level for level in data["choice"] if level["digits"] == 9),  # selected when the page is opened
        mean_parts=MEAN_PARTS,
        coverage=choice.coverage_sentence(rows),
        files=files | {address: title for address, title in studies.items() if (folder / address).is_file()},
    )


def content(folder: Path, rows: Sequence[MatrixRow]) -> dict[str, Any]:
    """Return the data of the page for a folder of reports and the rows of its matrix."""
    earlier, few = earlier_details(folder), few_readings(rows)
    solvers, kinds = sorted(solvers_of(rows), key=few.__contains__), list(choice.by_kind(rows))
    lines = solver_lines(solvers)
    made = []
    for case, own in grouped(rows, lambda row: row.case).items():
        details = updated(details_of(folder / case), earlier.get(case, {}))
        known = {key: value for key, value in details.items() if key != "readings"}
        readings = [_reading(cells, details, solvers, kinds) for cells in readings_of(own).values()]
        made.append({"name": case, "title": case, **known, "readings": readings})
    return {
        "format": FORMAT,
        "fields": list(FIELDS),
        "cell": list(CELL),
        "solvers": [_solver(solver, lines[solver], solver in few) for solver in solvers],
        "kinds": kinds,
        "choice": choice.choice_levels(rows, solvers),
        "causes": {cause: known.title for cause, known in CAUSES.items()},
        "cases": made,
    }


def few_readings(rows: Sequence[MatrixRow]) -> set[str]:
    """Return the solvers that were run on less than half of the readings; the page shows them separately."""
    every = len(readings_of(rows))
    return {solver for solver, own in by_solver(rows).items() if 2 * len(own) < every}


def _solver(name: str, line: Mapping[str, object], few: bool) -> Details:
    package = choice.package_of(name)
    link, about = PROJECTS.get(package, ("", ""))
    return {"name": name, "package": package, "link": link, "about": about, "few": few, **line}


def _reading(
    rows: Sequence[MatrixRow], details: Details, solvers: Sequence[str], kinds: Sequence[str]
) -> dict[str, Any]:
    """Return the data of a reading, with its cells and the runs of the solvers that have a cell."""
    own = details.get("readings", {}).get(rows[0].reading, {})
    runs, ran = own.get("runs", {}), {row.solver for row in rows}
    return {
        "name": rows[0].reading,
        "kind": kinds.index(rows[0].kind or choice.UNKNOWN),
        "commit": ", ".join(commits_of(rows)),
        **{key: value for key, value in own.items() if key != "runs"},
        "cells": [[solvers.index(row.solver), *(rounded(value, 6) for value in row.values(CELL))] for row in rows],
        "runs": {str(solvers.index(solver)): runs[solver] for solver in runs if solver in ran},
    }


def run_values(row: RunRow) -> list[Any]:
    """Return the :data:`FIELDS` of a run; error counts of 0 become None."""
    shown = dict(zip(FIELDS, row.values(FIELDS), strict=True)) | {"setting": row.setting}
    if row.digits is not None and row.digits > 0:
        shown["digits"] = int(row.digits * 1000) / 1000  # rounded down
    shown |= {name: shown[name] or None for name in ("missed", "spurious", "missed_touches")}
    return [rounded(shown[name], places) for name, places in FIELDS.items()]


def details_of(folder: Path) -> Details | None:
    """Read the details of a case from its folder; None if it has no readable report."""
    try:
        manifest, rows = read_report(folder)
    except CaseError:
        return None  # the writer of the matrix prints a message
    words, known = read_json(folder / CASE_FILE), mapping(manifest.get("readings"))
    words = words if words.get("schema") == SCHEMA else {}
    return {
        "title": one_line(manifest["title"] or folder.name),
        **{key: words[key] for key in ("tags", "source") if words.get(key)},
        "files": sorted(one_line(path.name) for path in folder.iterdir() if path.suffix in (".md", ".csv", ".svg")),
        "readings": {
            reading: _details_of(reading, mapping(known.get(reading)), words, own)
            for (_, reading), own in readings_of(rows).items()
        },
    }


def _details_of(reading: str, manifest: Mapping[str, Any], words: Mapping[str, Any], rows: Sequence[RunRow]) -> Details:
    """Collect the details of a reading from its manifest, ``page.json`` and its rows."""
    truth = mapping(manifest.get("truth"))
    details = {
        "title": one_line(str(manifest.get("title") or "")),
        "story": mapping(words.get("stories")).get(reading),
        "portrait": mapping(mapping(words.get("portraits")).get(reading)) or None,
        "unit": rounded(next((row.time_unit_s for row in rows if row.time_unit_s is not None), None), 6),
        "floor": rounded(max((floor(row) for row in rows), default=0.0), 2),
        "transitions": truth.get("transitions"),
        "ends": truth.get("status"),
        "proven": truth.get("certified"),
    }
    return {
        **{key: value for key, value in details.items() if value not in (None, "")},
        "runs": {solver: list(map(run_values, own)) for solver, own in by_solver(rows).items()},
    }


def updated(fresh: Details | None, earlier: Details) -> Details:
    """Add portraits and runs of other solvers from an earlier page to the details from the folder of a case, if any."""
    if fresh is None:
        return earlier
    known = earlier.get("readings", {})
    readings = {reading: _both(own, known.get(reading, {})) for reading, own in fresh["readings"].items()}
    return {**fresh, "readings": {**known, **readings}}


def _both(fresh: Details, earlier: Details) -> Details:
    floors = [own["floor"] for own in (fresh, earlier) if own.get("floor")]
    return {**earlier, **fresh, "floor": max(floors, default=0.0), "runs": {**earlier.get("runs", {}), **fresh["runs"]}}


def earlier_details(folder: Path) -> dict[str, Details]:
    """Read the details of each case from the existing page of a folder; empty if it is of another version.

    CaseError if the page is damaged.
    """
    file = folder / PAGE
    if not file.exists():
        return {}
    try:
        data = read_embedded(file.read_text(encoding="utf-8"))
        if data["format"] != FORMAT or data["fields"] != list(FIELDS):
            return {}
        names = [solver["name"] for solver in data["solvers"]]
        return {case["name"]: _known(case, names) for case in data["cases"]}
    except (IndexError, KeyError, TypeError, UnicodeDecodeError) as error:
        words = "its data, which cases without a folder need, cannot be read; restore the file, or remove it"
        raise CaseError(words, file=str(file)) from error


def _known(case: Mapping[str, Any], solvers: Sequence[str]) -> Details:
    """Convert a case in the data of a page back to details."""
    known: Details = {key: case[key] for key in ("title", "tags", "source") if key in case}
    left_out, readings = ("name", "kind", "commit", "cells"), {}
    for reading in case["readings"]:
        own = readings[reading["name"]] = {key: value for key, value in reading.items() if key not in left_out}
        own["runs"] = {solvers[int(solver)]: runs for solver, runs in own["runs"].items()}
    return {**known, "readings": readings}
