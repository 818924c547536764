"""Manifest of a report, with the data needed to make the report again."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.result_files import refuse_pipe
from henon_ref.harness.score.gate import Bounds, bounds_of
from henon_ref.harness.score.reference import kind_of
from henon_ref.text import one_line
from henon_ref.workers.machine import commit, machine
from henon_ref.workers.worker import Failure


@dataclass(frozen=True)
class Provenance:
    """Origin of results: command, commit, machine and versions."""

    rerun: str
    """Command that makes the results again."""
    commit: str
    machine: Mapping[str, object]
    versions: Mapping[str, str]

    @property
    def machine_text(self) -> str:
        memory = self.machine["memory_bytes"]
        size = f", {memory / 2**30:.0f} GiB" if isinstance(memory, int) else ""
        return (
            f"{self.machine['processor']} ({self.machine['cores']} cores{size}), {self.machine['system']}, "
            f"{self.machine['python']}, {self.machine['linear_algebra']}"
        )

    def packages(self, solvers: Mapping[str, str]) -> dict[str, str]:
        """Return the versions by package for the solvers that ran (name of a solver -> version that it reported)."""
        found: dict[str, str] = {}
        for solver, version in solvers.items():
            package = registry.distribution(solver) or solver
            found.setdefault(package, self.versions.get(package, version))
        return found


def provenance(rerun: str) -> Provenance:
    """Return the provenance of results made by this process."""
    return Provenance(one_line(rerun), commit(), machine(), registry.all_versions())


def manifest_text(comparison: Comparison, origin: Provenance, files: Iterable[str]) -> str:
    options = comparison.options
    content = {
        "schema": 1,
        "case": comparison.case.name,
        "title": comparison.case.title,
        "rerun": origin.rerun,
        "commit": origin.commit,
        "machine": dict(origin.machine),
        "versions": dict(origin.versions),
        "timeout_s": options.timeout,
        "processes": options.processes,
        "readings": {result.reading.name: _reading(result) for result in comparison.readings},
        "gate": [vars(bounds) for bounds in bounds_of(comparison.case)],
        "case_readings": [reading.name for reading in comparison.case.readings],
        "files": sorted(files),
    }
    return json_text(content) + "\n"


def json_text(value: object, indent: str = "") -> str:
    """Format a value as readable JSON: a list or object is on one line if it fits into 120 characters.

    >>> print(json_text({"a": {"exact": "1/10", "value": 0.1}, "b": ["x" * 70, "y" * 70]}))
    {
     "a": {"exact": "1/10", "value": 0.1},
     "b": [
      "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx",
      "yyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyy"
     ]
    }
    """
    line = json.dumps(value)
    if len(indent) + len(line) <= 120 or not isinstance(value, dict | list):
        return line
    deeper = indent + " "
    if isinstance(value, dict):
        parts = [f"{deeper}{json.dumps(key)}: {json_text(own, deeper)}" for key, own in value.items()]
        return "{\n" + ",\n".join(parts) + f"\n{indent}}}"
    return "[\n" + ",\n".join(deeper + json_text(own, deeper) for own in value) + f"\n{indent}]"


def read_bounds(manifest: Path) -> list[Bounds]:
    """Read the bounds of a report's gate; empty if the manifest is missing or of an earlier version."""
    try:
        refuse_pipe(manifest)
        content = json.loads(manifest.read_text(encoding="utf-8"))
        return [Bounds(**own) for own in content.get("gate", ())]
    except FileNotFoundError:
        return []
    except (AttributeError, OSError, RecursionError, TypeError, ValueError) as error:
        raise CaseError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=str(manifest)) from error


def _reading(result: ReadingResult) -> dict[str, Any]:
    """Return the exact problem of a reading, and the properties of its truth."""
    problem, expected = result.reading.problem, result.expected
    system, truth = problem.system, None if isinstance(result.truth, Failure) else result.truth

    def exact(value: Any) -> dict[str, Any]:
        return {"exact": str(value), "value": float(value)}

    return {
        "title": result.reading.title,
        "kind": kind_of(expected, len(system.surfaces)),
        "mathematics_hash": result.reading.mathematics_hash,
        "parameters": {symbol.name: exact(value) for symbol, value in system.parameters.items()},
        "initial": {x: exact(value) for x, value in zip(system.state_names, problem.initial, strict=True)},
        "start": exact(problem.start),
        "until": exact(problem.until),
        "measure_after_s": result.reading.measure_after,
        "truth": {
            "methods": [
                {"method": method, "bits": list(bits), "seconds": seconds}
                for method, bits, seconds in (truth.methods if truth else ())
            ],
            "certified": truth is not None and truth.certified,
            "uncertified_because": truth.uncertified_because if truth else "",
            "radius_s": expected.radius if expected is not None else None,
            "status": expected.status if expected is not None else None,
            "transitions": len(expected.transitions) if expected is not None else None,
            "reason": result.truth.reason,
        },
        "sampled_by": result.sampled_by,
    }
