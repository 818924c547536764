"""The runs behind some points of a sweep: portraits of their last part, and any point as a case file of its own."""

from __future__ import annotations

import io
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.errors import HenonRefError
from henon_ref.figures.curves import curves_of
from henon_ref.figures.motion import Motion
from henon_ref.harness.report.html.portrait import packed
from henon_ref.harness.report.html.sweep_content import grid_sizes
from henon_ref.harness.table import setting
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.storage import SWEEP_FILE
from henon_ref.sweeps.sweep_file import CASE_KEYS

KEPT = 25
"""Runs that the page keeps a portrait of."""
SHOWN_TRANSITIONS = 40
"""A portrait shows a run from its so many last transition on: where it ends up, not how it gets there."""
MOST_STEPS = 20_000
"""Steps of a run whose polynomials are kept for a portrait."""
TIMES = 1500
"""Times at which a run is looked at."""
NAME, PLACE = "NAMEOFTHEPOINT", "VALUEOFTHEPOINT{}E"
"""What stands in the case file's text for the point's name and values."""


def kept_runs(plan: Plan) -> list[dict[str, Any]]:
    """Portraits of runs of points that are spread over all; of chains none, whose points start where others end."""
    if plan.points.chain > 1:
        return []
    found = []
    for number in _spread(plan):
        run = _run(plan, number)
        if run is not None and run.sol is not None and run.sol.end > run.sol.start:
            portrait = packed(curves_of(run.system.model, _last_part(run)))
            values = [float(value) for value in plan.points.values[number]]
            found.append({"point": number, "values": values, "status": run.status, "portrait": portrait})
    return found


def _spread(plan: Plan) -> list[int]:
    sizes, count = grid_sizes(plan), len(plan.points)
    if not sizes:
        return sorted(set(np.linspace(0, count - 1, min(KEPT, count)).astype(int).tolist()))
    each = max(int(KEPT ** (1 / len(sizes)) + 1e-9), 1)
    axes = [sorted(set(np.linspace(0, size - 1, min(each, size)).astype(int).tolist())) for size in sizes]
    return [int(np.ravel_multi_index(place, sizes)) for place in product(*axes)]


def _run(plan: Plan, number: int) -> Solution | None:
    """A point's run with its polynomials; None where it cannot be had, or has too many steps for a picture."""
    settings, values = plan.work, dict(zip(plan.points.names, plan.points.values[number], strict=True))
    states = {name: float(values.pop(name)) for name in settings.system.state if name in values}
    how: dict[str, Any] = {
        "until": settings.until, "start": settings.start, "rtol": settings.rtol, "mode": settings.mode,
        "max_steps": settings.max_steps,
        "parameters": {name: float(value) for name, value in values.items()},
    }  # fmt: skip
    try:
        first = simulate(settings.system, {**settings.initial, **states}, dense_output=False, **how)
        if first.counts.steps > MOST_STEPS:
            return None
        return simulate(settings.system, {**settings.initial, **states}, **how)
    except HenonRefError:  # the sweep's row says why
        return None


def _last_part(run: Solution) -> Motion:
    assert run.sol is not None
    at = run.transitions["time_s"].to_numpy(dtype=float)
    begin = float(at[-SHOWN_TRANSITIONS]) if len(at) >= SHOWN_TRANSITIONS else run.sol.start
    begin = begin if begin < run.sol.end else run.sol.start
    times = np.union1d(np.linspace(begin, run.sol.end, TIMES), run.t[run.t >= begin])
    modes = run.mode(times)
    assert isinstance(modes, list)
    return Motion(times, run.sol(times).T, tuple(tuple(mode.values()) for mode in modes))


def case_text(plan: Plan, folder: Path) -> str | None:
    """The text of a case file with places for a point's name and values; None where no such file says the same."""
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


def tolerance(plan: Plan) -> str:
    """The sweep's relative tolerance, as the command takes it."""
    return setting(plan.work.rtol, None)
