"""Everything that the page of a folder of reports shows, as JSON: the matrix, the choice, what is known of each case.

The details of a case (its runs, its portrait) come from its folder; of a case whose folder is gone, and of solvers that
the comparison there did not run, from the page that stands there already: it forgets no more than the matrix does.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from henon_ref.baselines.causes import CAUSES
from henon_ref.errors import CaseError
from henon_ref.figures.style import Line, lines_of
from henon_ref.harness.report.folder import CASE_FILE, PAGE, SCHEMA
from henon_ref.harness.report.html.rendering import read_embedded, rounded
from henon_ref.harness.report.text.choice import UNKNOWN, by_kind, choice_levels, package_of
from henon_ref.harness.report.text.matrix import MatrixRow, commits_of, mapping, read_report, solvers_of, wall_column
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, floor, grouped, readings_of
from henon_ref.harness.rows import RunRow
from henon_ref.text import one_line

FORMAT = 2
TEXT = 0
"""In place of a number's significant places: the field is text."""
FIELDS: Mapping[str, int] = {
    "setting": TEXT, "status": TEXT, "verdict": TEXT, "digits": 5, "max_time_error_s": 2, "wall_s": 4,
    "max_stick_error_s": 2, "max_state_error": 2, "steps": 12, "rhs_evaluations": 12, "wall_s_iqr": 2, "missed": 12,
    "spurious": 12, "missed_touches": 12, "status_reason": TEXT, "cause": TEXT, "verdict_basis": TEXT,
}  # fmt: skip
"""What a run on the page is a list of, and the places of each number."""
CELL = ("settings", "judged", "right", "status", "verdict", "digits", *map(wall_column, (None, *LEVELS)))
"""Columns of the matrix that a cell is a list of, behind its solver."""
SHOWN_FILES = (".md", ".csv", ".svg")
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
"""Package, or program, that solvers come from -> (address, line); no address for this one."""
Details = dict[str, Any]
"""What is known of a case: title, words of its file, ``files`` beside its report, and ``readings`` by name, each with
its portrait and, by solver, its runs."""


def content(folder: Path, rows: Sequence[MatrixRow]) -> dict[str, Any]:
    """The page's data, of a folder of reports and the rows of its matrix."""
    earlier, few = earlier_details(folder), few_readings(rows)
    solvers, kinds = sorted(solvers_of(rows), key=few.__contains__), list(by_kind(rows))
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
        "choice": choice_levels(rows, solvers),
        "causes": {cause: known.title for cause, known in CAUSES.items()},
        "cases": made,
    }


def few_readings(rows: Sequence[MatrixRow]) -> set[str]:
    """The solvers that were run on less than half of the readings: they stand apart."""
    every = len(readings_of(rows))
    return {solver for solver, own in by_solver(rows).items() if 2 * len(own) < every}


def _solver(name: str, line: Mapping[str, object], few: bool) -> Details:
    package = package_of(name)
    link, about = PROJECTS.get(package, ("", ""))
    return {"name": name, "package": package, "link": link, "about": about, "few": few, **line}


def _reading(
    rows: Sequence[MatrixRow], details: Details, solvers: Sequence[str], kinds: Sequence[str]
) -> dict[str, Any]:
    """A reading with its cells, and the runs of the solvers that have one."""
    own = details.get("readings", {}).get(rows[0].reading, {})
    runs, ran = own.get("runs", {}), {row.solver for row in rows}
    return {
        "name": rows[0].reading,
        "kind": kinds.index(rows[0].kind or UNKNOWN),
        "commit": ", ".join(commits_of(rows)),
        **{key: value for key, value in own.items() if key != "runs"},
        "cells": [[solvers.index(row.solver), *(rounded(value, 6) for value in row.values(CELL))] for row in rows],
        "runs": {str(solvers.index(solver)): runs[solver] for solver in runs if solver in ran},
    }


def run_values(row: RunRow) -> list[Any]:
    """A run as the page has it: :data:`FIELDS`; counts of what went wrong are left out where they are 0."""
    shown = dict(zip(FIELDS, row.values(FIELDS), strict=True)) | {"setting": row.setting}
    if row.digits is not None and row.digits > 0:
        shown["digits"] = int(row.digits * 1000) / 1000  # never more than there are
    shown |= {name: shown[name] or None for name in ("missed", "spurious", "missed_touches")}
    return [rounded(shown[name], places) for name, places in FIELDS.items()]


def details_of(folder: Path) -> Details | None:
    """What a case's folder says of it; None where there is no report in it that can be read."""
    try:
        manifest, rows = read_report(folder)
    except CaseError:
        return None  # the index names it, and leaves it out
    words, known = _words_of(folder), mapping(manifest.get("readings"))
    return {
        "title": one_line(manifest["title"] or folder.name),
        **{key: words[key] for key in ("tags", "source") if words.get(key)},
        "files": sorted(one_line(path.name) for path in folder.iterdir() if path.suffix in SHOWN_FILES),
        "readings": {
            reading: _details_of(reading, mapping(known.get(reading)), words, own)
            for (_, reading), own in readings_of(rows).items()
        },
    }


def _words_of(folder: Path) -> Mapping[str, Any]:
    """The content of the file that a report keeps for the page; empty where it has none, or one of another version."""
    try:
        words = mapping(json.loads((folder / CASE_FILE).read_text(encoding="utf-8")))
    except (FileNotFoundError, RecursionError, ValueError):
        return {}
    return words if words.get("schema") == SCHEMA else {}


def _details_of(reading: str, manifest: Mapping[str, Any], words: Mapping[str, Any], rows: Sequence[RunRow]) -> Details:
    """What its manifest, the words of the case's file and its rows say of a reading."""
    truth = mapping(manifest.get("truth"))
    told = {
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
        **{key: value for key, value in told.items() if value not in (None, "")},
        "runs": {solver: list(map(run_values, own)) for solver, own in by_solver(rows).items()},
    }


def updated(fresh: Details | None, earlier: Details) -> Details:
    """What a case's folder says (None: it is gone), and what an earlier page knows: portraits, other solvers' runs."""
    if fresh is None:
        return earlier
    known = earlier.get("readings", {})
    readings = {reading: _both(own, known.get(reading, {})) for reading, own in fresh["readings"].items()}
    return {**fresh, "readings": {**known, **readings}}


def _both(fresh: Details, earlier: Details) -> Details:
    floors = [own["floor"] for own in (fresh, earlier) if own.get("floor")]
    return {**earlier, **fresh, "floor": max(floors, default=0.0), "runs": {**earlier.get("runs", {}), **fresh["runs"]}}


def earlier_details(folder: Path) -> dict[str, Details]:
    """What the page that stands in a folder knows of each case; nothing where it is of another version."""
    try:
        data = read_embedded((folder / PAGE).read_text(encoding="utf-8"))
    except (FileNotFoundError, UnicodeDecodeError):
        return {}
    if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("fields") != list(FIELDS):
        return {}
    try:
        names = [solver["name"] for solver in data["solvers"]]
        return {case["name"]: _known(case, names) for case in data["cases"]}
    except (IndexError, KeyError, TypeError):
        return {}  # somebody has changed it


def _known(case: Mapping[str, Any], solvers: Sequence[str]) -> Details:
    """What a page knows of a case whose folder may be gone."""
    known: Details = {key: case[key] for key in ("title", "tags", "source") if key in case}
    left_out, readings = ("name", "kind", "commit", "cells"), {}
    for reading in case["readings"]:
        own = readings[reading["name"]] = {key: value for key, value in reading.items() if key not in left_out}
        own["runs"] = {solvers[int(solver)]: runs for solver, runs in own["runs"].items()}
    return {**known, "readings": readings}


PAPER, NIGHT = "#ffffff", "#15181c"
"""Backgrounds of a light and of a dark page."""
SEEN = 3.0
"""Contrast with the background that a line has at least (WCAG 2.2, 1.4.11)."""
_DASHES = {"-": (), "--": (5, 3), ":": (1.5, 2.5), "-.": (5, 2, 1.5, 2)}


def solver_lines(solvers: Iterable[str]) -> dict[str, dict[str, object]]:
    """Colours (light, dark), dashes [line widths], marker and width of each solver's line."""
    return {name: _drawn(line) for name, line in lines_of(solvers).items()}


def _drawn(line: Line) -> dict[str, object]:
    dashes = _DASHES[line.dashes] if isinstance(line.dashes, str) else line.dashes[1]
    return {
        "light": towards(line.colour, 0.0, PAPER),
        "dark": towards(line.colour, 1.0, NIGHT),
        "dashes": " ".join(f"{length:g}" for length in dashes),
        "marker": line.marker,
        "width": line.width,
    }


def towards(colour: str, end: float, background: str) -> str:
    """A colour, mixed with black (0) or white (1) until it is seen on a background.

    Examples
    --------
    >>> towards("#000000", 1.0, "#15181c"), towards("#0072b2", 0.0, "#ffffff")
    ('#666666', '#0072b2')
    """
    for share in range(0, 101, 2):
        parts = ((1 - share / 100) * channel + share / 100 * end for channel in _channels(colour))
        mixed = "#" + "".join(f"{round(255 * part):02x}" for part in parts)
        if contrast(mixed, background) >= SEEN:
            break
    return mixed


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours (WCAG 2.2).

    Examples
    --------
    >>> round(contrast("#000000", "#ffffff"), 6)
    21.0
    """
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in _channels(colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _channels(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
