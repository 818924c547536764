"""Write the page ``index.html`` of a sweep from the files of its folder.

In addition to the points, the page shows portraits of the last part of some runs, and any point as a case file.
"""

from __future__ import annotations

import io
import json
import logging
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.atomic_write import replace_file
from henon_ref.errors import HenonRefError
from henon_ref.figures.motion import Motion
from henon_ref.harness.report.html import sweep_content
from henon_ref.harness.report.html.portrait import packed
from henon_ref.harness.report.html.rendering import rendered
from henon_ref.harness.table import count, setting
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.storage import MANIFEST, PAGE, SWEEP_FILE
from henon_ref.sweeps.sweep_file import CASE_KEYS, load_sweep
from henon_ref.text import one_line

_LOG = logging.getLogger(__name__)

SCRIPTS = ("page.js", "sweep.js")
OBSERVED = (
    ("quantity", "l"), ("points with a value", "r"), ("minimum", "r"), ("median", "r"), ("maximum", "r"),
    ("shares of the points with a value", "l"),
)  # fmt: skip
"""Headings of the table of observations."""
CHAINED = "Each point of a continuation starts from the final state of its neighbour, so that it is not a separate run."

KEPT = 25
"""Largest number of runs with a portrait."""
SHOWN_TRANSITIONS = 40
"""Number of last transitions in a portrait, which shows the final motion rather than the transient."""
MOST_STEPS = 20_000
"""Largest number of steps of a run with a portrait, which requires the polynomials of all steps."""
TIMES = 1500
"""Number of sample times of a portrait."""
NAME, PLACE = "NAMEOFTHEPOINT", "VALUEOFTHEPOINT{}E"
"""Placeholders for the name and the values of a point in the text of a case file."""


def write_sweep_page(folder: Path) -> Path | None:
    """Write the page of a finished sweep into its folder; None if it has more than two million points."""
    if sweep_content.rows_of(folder) > sweep_content.MOST_READ:
        _LOG.warning("%s has no page: it has more than %d points", folder, sweep_content.MOST_READ)
        return None
    plan, table = load_sweep(folder / SWEEP_FILE), sweep_content.read_table(folder)
    number = table.pop("point").to_numpy()
    swept = list(plan.points.names)
    kept = sweep_content.kept_points(plan, sweep_content.bytes_a_point(dict(table.dtypes), swept))
    order = np.argsort(number)[kept]
    names = sweep_content.tables_of(folder)
    frames = [
        sweep_content.frame_content(
            name,
            sweep_content.read_table(folder, name, most=sweep_content.MOST_READ),
            sweep_content.rows_of(folder, name),
            kept,
            len(names),
        )
        for name in names
    ]
    case, chained = case_text(plan, folder), plan.points.chain > 1
    rtol = setting(plan.work.rtol, None)
    shown = table.iloc[order]
    data: dict[str, Any] = {
        "format": 1,
        "name": plan.name,
        "count": len(table),
        "points": sweep_content.packed_numbers(kept, "<i4"),
        "swept": [one_line(name) for name in swept],
        "coloured": sweep_content.coloured(shown, swept),
        "columns": sweep_content.point_columns(shown, swept),
        "frames": [frame for frame in frames if frame["point"]],
        "runs": kept_runs(plan),
        "no_runs": CHAINED if chained else "This page has no portraits: each run has too many steps.",
        "case": case,
        "no_case": CHAINED if chained else "The swept quantities cannot be written in a case file.",
        "place_of_name": NAME,
        "places": [PLACE.format(k) for k in range(len(swept))],
        "rtol": rtol,
    }
    page = rendered(
        "sweep.html",
        SCRIPTS,
        data,
        title=one_line(plan.title),
        origin=one_line(plan.source or ""),
        summary=one_line(f"{len(table):,} points over {', '.join(swept)}; relative tolerance {rtol}."),
        drawn=_drawn(len(table), len(kept)),
        has_case=case is not None,
        headings=OBSERVED,
        observed=sweep_content.observed_rows(table),
        rerun=_rerun(folder),
    )
    replace_file(folder / PAGE, page.encode())
    return folder / PAGE


def _drawn(points: int, kept: int) -> str:
    return f"All {count(points, 'point')}." if kept == points else f"{kept:,} of the {points:,} points, evenly spaced."


def _rerun(folder: Path) -> str:
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    commit = str(manifest.get("commit") or "")[:12]
    return one_line(f"Made by henon_ref{' from commit ' + commit if commit else ''}.")


def kept_runs(plan: Plan) -> list[dict[str, Any]]:
    """Return portraits of the runs of evenly spread points; none for a continuation, whose points depend on others."""
    if plan.points.chain > 1:
        return []
    found = []
    for number in _spread(plan):
        run = _run(plan, number)
        if run is not None and run.sol is not None and run.sol.end > run.sol.start:
            portrait = packed(run.system.model, _last_part(run))
            values = [float(value) for value in plan.points.values[number]]
            found.append({"point": number, "values": values, "status": run.status, "portrait": portrait})
    return found


def _spread(plan: Plan) -> list[int]:
    sizes, count = sweep_content.grid_sizes(plan), len(plan.points)
    if not sizes:
        return sorted(set(np.linspace(0, count - 1, min(KEPT, count)).astype(int).tolist()))
    each = max(int(KEPT ** (1 / len(sizes)) + 1e-9), 1)
    axes = [sorted(set(np.linspace(0, size - 1, min(each, size)).astype(int).tolist())) for size in sizes]
    return [int(np.ravel_multi_index(place, sizes)) for place in product(*axes)]


def _run(plan: Plan, number: int) -> Solution | None:
    """Repeat the run of a point with dense output; None if it fails, or has too many steps."""
    settings = plan.work
    values = dict(zip(plan.points.names, plan.points.values[number].tolist(), strict=True))
    moved = {name: values.pop(name) for name in settings.system.state if name in values}
    initial = {**settings.initial, **moved}
    how: dict[str, Any] = {
        "until": settings.until, "start": settings.start, "rtol": settings.rtol, "mode": settings.mode,
        "max_steps": settings.max_steps, "parameters": values,
    }  # fmt: skip
    try:
        first = simulate(settings.system, initial, dense_output=False, **how)
        return simulate(settings.system, initial, **how) if first.counts.steps <= MOST_STEPS else None
    except HenonRefError:  # the row of the sweep has the reason
        return None


def _last_part(run: Solution) -> Motion:
    assert run.sol is not None
    at = run.transitions["time_s"].to_numpy(dtype=float)
    begin = float(at[-SHOWN_TRANSITIONS]) if len(at) >= SHOWN_TRANSITIONS else run.sol.start
    begin = begin if begin < run.sol.end else run.sol.start
    return run.motion_at(np.union1d(np.linspace(begin, run.sol.end, TIMES), run.t[run.t >= begin]))


def case_text(plan: Plan, folder: Path) -> str | None:
    """Return the text of a case file with placeholders for a point; None if no case file can express the points."""
    from ruamel.yaml import YAML

    content = YAML(typ="safe", pure=True).load((folder / SWEEP_FILE).read_text(encoding="utf-8"))
    made = {key: content[key] for key in CASE_KEYS if key in content} | {"name": NAME}
    parameters = (made.get("system") or made.get("scene") or {}).get("parameters") or {}
    if plan.points.chain > 1:
        return None
    for k, name in enumerate(plan.points.names):
        place = made["initial"] if name in plan.work.system.state else parameters
        if name not in place:
            return None
        place[name] = PLACE.format(k)
    buffer = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 120
    yaml.dump(made, buffer)
    return buffer.getvalue()
