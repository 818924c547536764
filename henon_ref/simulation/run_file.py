"""Write and read runs as NumPy archives; ``Solution.save`` documents the format."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from henon_ref.atomic_write import replace_file
from henon_ref.errors import ArgumentError
from henon_ref.integrator.records import LANDINGS, TRANSITION, TRANSITION_PLACES, transition_dtype
from henon_ref.integrator.run_result import KINDS, TransitionArray
from henon_ref.simulation.system import System
from henon_ref.system.problem import MODEL_KEYS
from henon_ref.system.python_arguments import mapping_of, source_of
from henon_ref.system.tree import as_written, mapping
from henon_ref.trajectory import Counts, Decisions, Trajectory

FORMAT = 1
WORDS = {"kind": KINDS, "landing": LANDINGS}
"""Fields of a transition that are text in the file and numbers in the records."""
NAMES = {"from_mode": "from", "to_mode": "to"}
"""Names in the file of fields whose names differ there."""
STEP_FIELDS = ("time", "time_low", "unit", "coefficients")


Saved = tuple[System, float, Sequence[tuple[float, float]], Trajectory, NDArray[Any] | None]
"""A run: system with the run's parameters, initial time [s], initial states as pairs of doubles, trajectory, and the
steps' polynomials if there is dense output."""


def write_run(path: Path, run: Saved) -> None:
    """Write a run, replacing an existing file; ArgumentError if the file cannot be written."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **_arrays(run))  # given a path, NumPy would append .npz
    try:
        replace_file(path, buffer.getvalue())
    except OSError as error:
        raise ArgumentError(f"cannot write {path}: {error.strerror or error}") from None


def read_run(path: str | Path) -> Saved:
    """Read a run that :func:`write_run` has written; ArgumentError if the file is unreadable or not a run."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        about = json.loads(str(arrays["about"]))
        if about["format"] != FORMAT:
            raise ArgumentError(f"{path} has the format {about['format']}; this version reads format {FORMAT}")
        return _run(about, arrays)
    except OSError as error:
        raise ArgumentError(f"cannot read {path}: {error.strerror or error}") from None
    except (zipfile.BadZipFile, AttributeError, EOFError, KeyError, IndexError, TypeError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{path} is not a run written by Solution.save") from error


def _arrays(run: Saved) -> dict[str, NDArray[Any]]:
    """Return the file's arrays by name."""
    system, start, initial, end, steps = run
    about = {
        "format": FORMAT,
        "system": as_written(system.tree),
        "start": start,
        "end": end.end_time,
        "status": end.status,
        "reason": end.reason,
        "counts": end.counts._asdict() | {"decisions": end.counts.decisions._asdict()},
        "max_surface_drift": end.max_surface_drift,
        "undecided_after": [list(entry) for entry in end.undecided_after],
    }
    changes = cast(TransitionArray, end.transitions)
    records, modes = changes.records, np.array(list(changes.modes), dtype=np.int8)
    found: dict[str, NDArray[Any]] = {
        "about": np.array(json.dumps(about, ensure_ascii=False, indent=1)),
        "states": np.array(system.state, dtype=str),
        "signs": np.array(system.model.sign_names, dtype=str),
        "initial": np.array(initial, dtype=np.float64).T,
        "end_state": np.array(end.end_state, dtype=np.float64),
        "end_mode": np.array(end.end_mode, dtype=np.int8),
        "modes": modes.reshape(len(modes), len(system.model.sign_names)),
    }
    for field in (*(TRANSITION.names or ()), "state"):
        words = WORDS.get(field)
        values = np.array(words)[records[field]] if words else records[field]
        found[f"transition_{NAMES.get(field, field)}"] = np.ascontiguousarray(values)
    if steps is not None:
        found |= {f"step_{field}": np.ascontiguousarray(steps[field]) for field in STEP_FIELDS}
    return found


def _run(about: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Saved:
    """Return the run in the file's arrays."""
    counts = dict(about["counts"])
    decisions = Decisions(**counts.pop("decisions"))
    made = Counts(**counts)
    made.decisions = decisions
    trajectory = Trajectory(
        status=about["status"],
        transitions=_transitions(arrays),
        end_time=about["end"],
        end_state=tuple(arrays["end_state"].tolist()),
        end_mode=tuple(arrays["end_mode"].tolist()),
        reason=about["reason"],
        counts=made,
        max_surface_drift=about["max_surface_drift"],
        undecided_after=tuple((index, time) for index, time in about["undecided_after"]),
    )
    steps = None
    if "step_time" in arrays:
        fields = {field: arrays[f"step_{field}"] for field in STEP_FIELDS}
        shapes = [(name, values.dtype, values.shape[1:]) for name, values in fields.items()]
        steps = np.zeros(len(fields["time"]), dtype=np.dtype(shapes))
        for field, values in fields.items():
            steps[field] = values
    initial = [(high, low) for high, low in arrays["initial"].T.tolist()]
    model = {key: node for key, node in mapping_of(about["system"], "'system'").entries.items() if key in MODEL_KEYS}
    system = System.from_source(source_of(mapping(model)))
    return system, about["start"], initial, trajectory, steps


def _transitions(arrays: dict[str, NDArray[Any]]) -> TransitionArray:
    """Return the transitions as records of the integrator."""
    states = arrays["transition_state"]
    rows = np.zeros((len(states), TRANSITION_PLACES + states.shape[1]))
    records = rows.view(transition_dtype(states.shape[1]))[:, 0] if len(rows) else rows
    for field in (*(TRANSITION.names or ()), "state") if len(rows) else ():
        values = arrays[f"transition_{NAMES.get(field, field)}"]
        if field in WORDS:
            values = np.array([WORDS[field].index(word) for word in values.tolist()])
        records[field] = values
    return TransitionArray(rows, tuple(tuple(mode) for mode in arrays["modes"].tolist()))
