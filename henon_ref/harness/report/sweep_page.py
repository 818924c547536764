"""Write the page ``index.html`` of a sweep from the files of its folder: ``sweep.yaml`` and the Parquet files.

The page contains packed columns of the points and of the tables, portraits of the last part of some runs, and the text
of a case file for any point.
"""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from henon_ref.atomic_write import replace_file
from henon_ref.casefile.schema import CaseForm
from henon_ref.errors import HenonRefError
from henon_ref.figures.motion import Motion
from henon_ref.figures.sweeps import MOST_BASINS
from henon_ref.harness.report.rendering import packed, packed_numbers, rendered
from henon_ref.harness.table import count, setting
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.sweeps.chunk import POINTS
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.storage import MANIFEST, PAGE, SWEEP_FILE, chunk_files, owned
from henon_ref.sweeps.sweep_file import SweepForm, load_sweep
from henon_ref.text import one_line

_LOG = logging.getLogger(__name__)

CHAINED = "Each point of a continuation starts from the final state of its neighbour, so that it is not a separate run."

MAX_PORTRAITS = 25
"""Largest number of runs with a portrait."""
NAME, PLACE = "NAMEOFTHEPOINT", "VALUEOFTHEPOINT{}E"
"""Placeholders for the name and the values of a point in the text of a case file."""
POINT_BYTES, ROW_BYTES = 1_500_000, 1_100_000
"""Largest size of the points, and of the rows of all tables, before encoding as base64 text [bytes]."""
MOST_READ = 2_000_000
"""Largest number of points of a sweep with a page, and of rows read from a table."""


def write_sweep_page(folder: Path) -> Path | None:
    """Write the page of a finished sweep into its folder; None if it has more than two million points."""
    if rows_of(folder) > MOST_READ:
        _LOG.warning("%s has no page: it has more than %d points", folder, MOST_READ)
        return None
    plan, table = load_sweep(folder / SWEEP_FILE), read_table(folder)
    number = table.pop("point").to_numpy()
    swept = list(plan.points.names)
    kept = kept_points(plan, bytes_a_point(dict(table.dtypes), swept))
    order = np.argsort(number)[kept]
    own = owned(folder)
    names = sorted(set(own.tables) - {POINTS}) if own is not None else []
    frames = [
        frame_content(name, read_table(folder, name, most=MOST_READ), rows_of(folder, name), kept, len(names))
        for name in names
    ]
    case, chained = case_text(plan, folder), plan.points.chain > 1
    rtol = setting(plan.work.rtol, None)
    shown = table.iloc[order]
    data: dict[str, Any] = {
        "format": 1,
        "name": plan.name,
        "count": len(table),
        "points": packed_numbers(kept, "<i4"),
        "swept": [one_line(name) for name in swept],
        "coloured": coloured(shown, swept),
        "columns": point_columns(shown, swept),
        "frames": [frame for frame in frames if frame["point"]],
        "runs": kept_runs(plan),
        "no_runs": CHAINED if chained else "This page has no portraits: each run has too many steps.",
        "case": case,
        "no_case": CHAINED if chained else "The swept quantities cannot be written in a case file.",
        "place_of_name": NAME,
        "places": [PLACE.format(k) for k in range(len(swept))],
        "rtol": rtol,
    }
    commit = str(json.loads((folder / MANIFEST).read_text(encoding="utf-8")).get("commit") or "")[:12]
    part = f"{len(kept):,} of the {len(table):,} points, evenly spaced."
    drawn = part if len(kept) < len(table) else f"All {count(len(table), 'point')}."
    page = rendered(
        "sweep.html",
        ("page.js", "sweep.js"),
        data,
        title=one_line(plan.title),
        origin=one_line(plan.source or ""),
        summary=one_line(f"{len(table):,} points over {', '.join(swept)}; relative tolerance {rtol}."),
        drawn=drawn,
        has_case=case is not None,
        observed=observed_rows(table),
        rerun=one_line(f"Made by henon_ref{' from commit ' + commit if commit else ''}."),
    )
    replace_file(folder / PAGE, page.encode())
    return folder / PAGE


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
    sizes, count = grid_sizes(plan), len(plan.points)
    if not sizes:
        return sorted(set(np.linspace(0, count - 1, min(MAX_PORTRAITS, count)).astype(int).tolist()))
    each = max(int(MAX_PORTRAITS ** (1 / len(sizes)) + 1e-9), 1)
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
        # A portrait requires the polynomials of all steps.
        return simulate(settings.system, initial, **how) if first.counts.steps <= 20_000 else None
    except HenonRefError:  # the row of the sweep has the reason
        return None


def _last_part(run: Solution) -> Motion:
    """Motion over the last 40 transitions, which is the final motion rather than the transient."""
    assert run.sol is not None
    at = run.transitions["time_s"].to_numpy(dtype=float)
    begin = float(at[-40]) if len(at) >= 40 else run.sol.start
    begin = begin if begin < run.sol.end else run.sol.start
    return run.motion_at(np.union1d(np.linspace(begin, run.sol.end, 1500), run.t[run.t >= begin]))


def case_text(plan: Plan, folder: Path) -> str | None:
    """Return the text of a case file with placeholders for a point; None if no case file can express the points."""
    from ruamel.yaml import YAML

    content = YAML(typ="safe", pure=True).load((folder / SWEEP_FILE).read_text(encoding="utf-8"))
    shared = CaseForm.__annotations__.keys() & SweepForm.__annotations__.keys()
    made = {key: value for key, value in content.items() if key in shared} | {"name": NAME}
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


def kept_points(plan: Plan, bytes_a_point: int) -> NDArray[np.int64]:
    """Return the numbers of the points on the page: all points, or an even selection that fits into the page.

    The selection of a grid is again a grid.
    """
    most = max(POINT_BYTES // bytes_a_point, 1)
    count, sizes = len(plan.points), grid_sizes(plan)
    if count <= most:
        return np.arange(count)
    if not sizes:
        return np.arange(0, count, -(-count // most))
    stride = 1
    while np.prod([-(-size // stride) for size in sizes]) > most:
        stride += 1
    kept = np.meshgrid(*(np.arange(0, size, stride) for size in sizes), indexing="ij")
    return np.ravel_multi_index([own.ravel() for own in kept], sizes).astype(np.int64)


def grid_sizes(plan: Plan) -> tuple[int, ...]:
    """Return the number of values on each axis of a grid; empty if the points are not a grid."""
    values = plan.points.values
    sizes = tuple(len(np.unique(values[:, k])) for k in range(values.shape[1]))
    whole = plan.points.chain == 1 and "grid" in plan.points.written and np.prod(sizes) == len(values)
    return sizes if whole else ()


def bytes_a_point(columns: Mapping[str, Any], swept: Sequence[str]) -> int:
    """Return the size of the row of a point: its number and its columns [bytes]."""
    return 4 + sum(8 if name in swept else 4 if _is_number(dtype) else 1 for name, dtype in columns.items())


def point_columns(table: pd.DataFrame, swept: Sequence[str]) -> list[dict[str, Any]]:
    """Pack the columns of the selected points: swept values in double precision, other numbers in single, texts."""
    made: list[dict[str, Any]] = []
    for name, own in table.items():
        if name in swept:
            packed: dict[str, Any] = {"kind": "double", "data": packed_numbers(own, "<f8")}
        elif _is_number(own.dtype):
            packed = {"kind": "single", "data": packed_numbers(own, "<f4")}
        elif own.nunique() < 255:  # a text is given by one byte
            codes, words = pd.factorize(own.fillna(""), sort=True)
            texts = [one_line(str(word)) for word in words]
            packed = {"kind": "word", "words": texts, "data": packed_numbers(codes, "u1")}
        else:
            continue
        made.append({"name": one_line(str(name)), **packed})
    return made


def coloured(table: pd.DataFrame, swept: Sequence[str]) -> str:
    """Choose the column that a map shows first: one of few different texts, else one of numbers."""
    others = {name: own for name, own in table.items() if name not in swept and own.nunique() > 1}
    few = [name for name, own in others.items() if not _is_number(own.dtype) and own.nunique() <= MOST_BASINS]
    numbers = [name for name, own in others.items() if _is_number(own.dtype)]
    return one_line(str((few + numbers + [""])[0]))


def frame_content(name: str, frame: pd.DataFrame, rows: int, kept: NDArray[np.int64], tables: int) -> dict[str, Any]:
    """Pack a table with several rows per point (column ``point``): the rows of selected points, thinned if too many.

    ``rows`` is the number of rows of the whole table, of which ``frame`` may be a part. ``tables`` is the number of
    tables that share the space of the page.
    """
    own = frame[frame["point"].isin(kept)]
    place = np.searchsorted(kept, own["point"].to_numpy())
    numbers = [column for column in own.columns if column != "point" and _is_number(own[column].dtype)]
    most = max(ROW_BYTES // (tables * (4 + 4 * len(numbers))), 1)
    stride = max(-(-len(own) // most), 1)
    own, place = own.iloc[::stride], place[::stride]
    return {
        "name": one_line(name),
        "rows": rows,
        "point": packed_numbers(place, "<u4"),
        "columns": [{"name": one_line(name), "data": packed_numbers(own[name], "<f4")} for name in numbers],
    }


def observed_rows(table: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return one row per column: number of values, minimum, median and maximum, or the shares of texts."""
    made = []
    for name, column in table.items():
        own = column.dropna()
        cells = ["", "", "", ""]
        if not _is_number(own.dtype):
            shares = own.value_counts(normalize=True)
            cells[3] = ", ".join(f"{one_line(str(word))} {share:.2%}" for word, share in shares.head(6).items())
            cells[3] += f" and {len(shares) - 6} more" if len(shares) > 6 else ""
        elif len(own):
            cells[:3] = (f"{value:.6g}" for value in (own.min(), own.median(), own.max()))
        made.append((one_line(str(name)), f"{len(own):,}", *cells))
    return made


def read_table(folder: Path, name: str = POINTS, *, most: int | None = None) -> pd.DataFrame:
    """Read a table of a sweep from its chunks in order; use a stride if it has more than ``most`` rows."""
    stride = max(-(-rows_of(folder, name) // most), 1) if most else 1
    parts, before = [], 0
    for file in chunk_files(folder, name):
        part = pd.read_parquet(file)
        parts.append(part.iloc[-before % stride :: stride])
        before += len(part)
    return pd.concat(parts, ignore_index=True)


def rows_of(folder: Path, name: str = POINTS) -> int:
    import pyarrow.parquet as pq

    return sum(int(pq.read_metadata(file).num_rows) for file in chunk_files(folder, name))


def _is_number(dtype: Any) -> bool:
    return getattr(dtype, "kind", "O") in "iuf"
