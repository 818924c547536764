"""The page of a sweep's folder, ``index.html``, made from what is in it."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.atomic_write import replace_file
from henon_ref.harness.report.html.rendering import rendered, source
from henon_ref.harness.report.html.sweep_content import (
    MOST_READ,
    bytes_a_point,
    coloured,
    frame_content,
    kept_points,
    observed_rows,
    packed_numbers,
    point_columns,
    read_table,
    rows_of,
    tables_of,
)
from henon_ref.harness.report.html.sweep_runs import NAME, PLACE, case_text, kept_runs, tolerance
from henon_ref.harness.table import count
from henon_ref.sweeps.storage import MANIFEST, PAGE, SWEEP_FILE
from henon_ref.sweeps.sweep_file import load_sweep
from henon_ref.text import one_line

_LOG = logging.getLogger(__name__)

SCRIPTS = ("dom.js", "numbers.js", "axes.js", "portrait.js", "sweep.js")
OBSERVED = (
    ("quantity", "l"), ("points with a value", "r"), ("least", "r"), ("median", "r"), ("greatest", "r"),
    ("values, of the points with one", "l"),
)  # fmt: skip
"""Headings of the table of observations."""
CHAINED = "Each point of a continuation starts where its neighbour ended, so that none is a run by itself."


def write_sweep_page(folder: Path) -> Path | None:
    """Write the page of a finished sweep; one of more than two million points has none.

    Parameters
    ----------
    folder : Path
        Of the sweep, with all its chunks.

    Returns
    -------
    Path or None
        The page.

    Raises
    ------
    OSError
        Where the folder cannot be read or written.
    """
    if rows_of(folder) > MOST_READ:
        _LOG.warning("%s has no page: it has more than %d points", folder, MOST_READ)
        return None
    sweep = load_sweep(folder / SWEEP_FILE)
    plan, table = sweep.plan, read_table(folder)
    number = table.pop("point").to_numpy()
    swept = list(plan.points.names)
    kept = kept_points(plan, bytes_a_point(dict(table.dtypes), swept))
    order = np.argsort(number)[kept]
    names = tables_of(folder)
    frames = [
        frame_content(name, read_table(folder, name, most=MOST_READ), rows_of(folder, name), kept, len(names))
        for name in names
    ]
    case, chained = case_text(plan, folder), plan.points.chain > 1
    shown = table.iloc[order]
    data: dict[str, Any] = {
        "format": 1,
        "name": sweep.name,
        "count": len(table),
        "points": packed_numbers(kept, "<i4"),
        "swept": [one_line(name) for name in swept],
        "coloured": coloured(shown, swept),
        "columns": point_columns(shown, swept),
        "frames": [frame for frame in frames if frame["point"]],
        "runs": kept_runs(plan),
        "no_runs": CHAINED if chained else "No run of this sweep is kept here: each has too many steps for a picture.",
        "case": case,
        "no_case": CHAINED if chained else "What is swept here stands in no case file.",
        "place_of_name": NAME,
        "places": [PLACE.format(k) for k in range(len(swept))],
        "rtol": tolerance(plan),
    }
    page = rendered(
        "sweep.html",
        source("sweep.css"),
        SCRIPTS,
        data,
        title=one_line(sweep.title),
        origin=one_line(sweep.source or ""),
        summary=_summary(len(table), swept, tolerance(plan)),
        drawn=_drawn(len(table), len(kept)),
        has_case=case is not None,
        headings=OBSERVED,
        observed=observed_rows(table),
        rerun=_rerun(folder),
    )
    replace_file(folder / PAGE, page.encode())
    return folder / PAGE


def _summary(points: int, swept: list[str], rtol: str) -> str:
    return one_line(f"{points:,} points over {', '.join(swept)}; relative tolerance {rtol}.")


def _drawn(points: int, kept: int) -> str:
    return f"All {count(points, 'point')}." if kept == points else f"{kept:,} of the {points:,} points, evenly chosen."


def _rerun(folder: Path) -> str:
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    commit = str(manifest.get("commit") or "")[:12]
    return one_line(f"Made by henon_ref{' from commit ' + commit if commit else ''}.")
