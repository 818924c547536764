"""Stored truths: one JSON file a reading, the same bytes for the same truth, a line a fact."""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import platformdirs

from henon_ref.truth.reference import NearGraze, ReferenceTransition, Truth, TruthError

SCHEMA = 1


def folder_of(case_file: Path | None) -> Path:
    """Where the truths of a case file are kept.

    ``cases/truth`` for a case below a folder ``cases``; for any other case the user's cache, so that nothing
    appears beside somebody's own file.
    """
    if case_file is not None:
        for parent in case_file.resolve().parents:
            if parent.name == "cases":
                return parent / "truth"
    return Path(platformdirs.user_cache_dir("henon_ref")) / "truth"


def path_of(folder: Path, case: str, reading: str) -> Path:
    """File of one reading."""
    return folder / case / f"{reading}.json"


def load(folder: Path, case: str, reading: str) -> Truth | None:
    """The stored truth, whatever mathematics it belongs to; None where there is none.

    Raises
    ------
    TruthError
        For a file that is no truth, or cannot be read; it says how to make it anew.
    """
    path = path_of(folder, case, reading)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["schema"] != SCHEMA:
            return None
        return _truth(found)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        reason = error.strerror or "cannot be read"
    except (AttributeError, KeyError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        reason = f"{type(error).__name__}: {error}"
    raise TruthError(f"{path} is no stored truth ({reason}); delete it and run python -m henon_ref.truth")


def save(folder: Path, truth: Truth) -> Path:
    """Store a truth; the file is complete or not there.

    Raises
    ------
    OSError
        Where the folder cannot be written.
    """
    path = path_of(folder, truth.case, truth.reading)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(dumps(truth))
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise
    return path


def dumps(truth: Truth) -> str:
    """A truth as JSON: keys in a fixed order, a line an entry."""
    whole = {
        "schema": SCHEMA,
        "case": truth.case,
        "reading": truth.reading,
        "mathematics": truth.mathematics_hash,
        "status": truth.status,
        "reason": truth.reason,
        "end_time": truth.end_digits,
        "end_radius": truth.end_radius,
        "certified": truth.certified,
        "uncertified_because": truth.uncertified_because,
        "methods": [{"method": m, "bits": list(b), "seconds": round(s, 1)} for m, b, s in truth.methods],
        "near_grazes": [{"time": g.time, "surface": g.surface, "distance": g.distance} for g in truth.near_grazes],
        "transitions": [_entry(t) for t in truth.transitions],
    }
    return json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _entry(t: ReferenceTransition) -> dict[str, Any]:
    return {
        "kind": t.kind,
        "surface": t.surface,
        "modes": " -> ".join(",".join(f"{s:+d}" if s else "0" for s in m) for m in (t.from_mode, t.to_mode)),
        "time": t.time_digits,
        "radius": t.radius,
        "proven": t.proven,
        "closed_form": t.closed_form,
        "state": list(t.state),
        "state_radius": t.state_radius,
        "transversality": t.transversality,
        "conditioning": t.conditioning if math.isfinite(t.conditioning) else None,
    }


def _truth(found: dict[str, Any]) -> Truth:
    return Truth(
        case=found["case"],
        reading=found["reading"],
        mathematics_hash=found["mathematics"],
        status=found["status"],
        reason=found["reason"],
        end_digits=found["end_time"],
        end_radius=found["end_radius"],
        transitions=tuple(_transition(entry) for entry in found["transitions"]),
        near_grazes=tuple(NearGraze(g["time"], g["surface"], g["distance"]) for g in found["near_grazes"]),
        methods=tuple((m["method"], tuple(m["bits"]), m["seconds"]) for m in found["methods"]),
        certified=found["certified"],
        uncertified_because=found["uncertified_because"],
    )


def _transition(entry: dict[str, Any]) -> ReferenceTransition:
    before, after = (tuple(int(s) for s in mode.split(",")) for mode in entry["modes"].split(" -> "))
    conditioning = entry["conditioning"]
    return ReferenceTransition(
        kind=entry["kind"],
        surface=entry["surface"],
        from_mode=before,
        to_mode=after,
        time_digits=entry["time"],
        radius=entry["radius"],
        state=tuple(entry["state"]),
        state_radius=entry["state_radius"],
        transversality=entry["transversality"],
        conditioning=math.inf if conditioning is None else conditioning,
        proven=entry["proven"],
        closed_form=entry["closed_form"],
    )
