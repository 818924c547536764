"""The text that identifies an initial-value problem: the key of its stored truth."""

from __future__ import annotations

from typing import Any

from henon_ref.modes.overrides import SlidingOverride
from henon_ref.modes.problem import Problem


def mathematics(problem: Problem) -> dict[str, Any]:
    """Everything that decides the solution, and nothing else, as text fit for JSON.

    Parameters that nothing uses are left out; so are titles, tolerances and the order of the file.
    """
    system = problem.system
    expressions = [*system.surfaces, *system.field, *system.valid]
    for override in system.overrides.values():
        expressions += [*override.field, *(release.when for release in override.release)]
    for reset in system.resets.values():
        expressions += reset.map.values()
    used = set().union(*(e.free_symbols for e in expressions))
    found = {
        "states": list(system.state_names),
        "surfaces": [[name, str(h)] for name, h in zip(system.sign_names, system.surfaces, strict=True)],
        "field": [str(f) for f in system.field],
        "valid": [str(v) for v in system.valid],
        "parameters": {p.name: str(v) for p, v in sorted(system.parameters.items(), key=str) if p in used},
        "sliding": {system.sign_names[i]: _override_text(o) for i, o in sorted(system.overrides.items())},
        "start": str(problem.start),
        "initial": [str(x) for x in problem.initial],
        "until": str(problem.until),
        "mode": {system.sign_names[i]: s for i, s in sorted(problem.initial_mode.items())},
    }
    if system.resets:  # what is stored without them stays valid
        found["resets"] = {
            system.sign_names[i]: {x.name: str(value) for x, value in reset.map.items()}
            for i, reset in sorted(system.resets.items())
        }
        priorities = {system.sign_names[i]: r.priority for i, r in sorted(system.resets.items()) if r.priority}
        if priorities:
            found["priorities"] = priorities
    return found


def _override_text(override: SlidingOverride) -> dict[str, Any]:
    text: dict[str, Any] = {
        "field": [str(f) for f in override.field],
        "release": [[str(r.when), r.direction, r.to] for r in override.release],
    }
    if override.entry != "attracting":  # the default is not written out: what is stored without it stays valid
        text["entry"] = override.entry
    return text
