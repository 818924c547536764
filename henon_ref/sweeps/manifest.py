"""What stands beside a sweep's results: the sweep as a file that runs it again, its points' table, and a manifest."""

from __future__ import annotations

import io
import re
import shlex
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from henon_ref.casefile.tree import as_written
from henon_ref.simulation.system import MODEL_KEYS
from henon_ref.simulation.written import written
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.point_files import CSV, PARQUET, csv_rows
from henon_ref.sweeps.storage import parquet
from henon_ref.workers.machine import commit, library_versions, machine

SWEEP_FILE = "sweep.yaml"


def files_of(
    plan: Plan, *, name: str = "sweep", title: str = "A sweep from Python", source: str | None = None
) -> dict[str, bytes]:
    """Name -> content of the files that run the sweep again; a function of one's own cannot stand in them."""
    from ruamel.yaml import YAML

    buffer = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 120
    yaml.dump(_written(plan, name, title, source), buffer)
    found, points = {SWEEP_FILE: buffer.getvalue().encode()}, plan.points
    if points.written.get("table") == CSV:
        found[CSV] = "".join(f"{row}\n" for row in csv_rows(points.names, points.values)).encode()
    if points.written.get("table") == PARQUET:
        found[PARQUET] = parquet({name: points.values[:, k] for k, name in enumerate(points.names)})
    return found


def manifest_of(plan: Plan) -> dict[str, Any]:
    """What the results were made with, and how to make them again."""
    own = [o.kind for o in plan.work.observations if o.kind == "function"]
    return {
        "rerun": shlex.join(["henon-ref", "sweep", SWEEP_FILE, "--out", "again"]),
        "left_out": "functions of one's own, which no file can hold" if own else "",
        "points": len(plan.points),
        "chunk": plan.chunk,
        "commit": commit(),
        "versions": library_versions(),
        "machine": machine(),
    }


def _written(plan: Plan, name: str, title: str, source: str | None) -> dict[str, Any]:
    settings = plan.work.settings
    model = {
        key: as_written(settings.system.tree.entries[key]) for key in MODEL_KEYS if key in settings.system.tree.entries
    }
    initial = {state: written(settings.initial[state], state) for state in settings.system.state}
    mode = {"mode": {str(sign): int(side) for sign, side in settings.mode.items()}} if settings.mode else {}
    told = {
        "schema": 1,
        "name": re.sub("[^a-z0-9_]", "_", name.lower())[:64] or "sweep",
        "title": title,
        "source": source,
        **model,
        "initial": {"t": written(settings.start, "start"), **initial, **mode},
        "until": written(settings.until, "until"),
        "points": dict(plan.points.written),
        "observe": [_observation(o) for o in plan.work.observations if o.kind != "function"] or [{"status": {}}],
        "rtol": settings.rtol,
        "chunk": plan.chunk,
        "max_steps": settings.max_steps,
    }
    return {key: value for key, value in told.items() if value is not None}


def _observation(observation: Observation) -> Mapping[str, Any]:
    given = {f.name: getattr(observation, f.name) for f in fields(observation)}
    return {observation.kind: {name: value for name, value in given.items() if value is not None}}
