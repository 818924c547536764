"""Read case files, and check the solvers that they name.

A worker loads each third-party solver before this process does, because importing its module may hang or crash.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path

from henon_ref.casefile.case import Case, load_case
from henon_ref.casefile.files import case_files
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

LOADING_SECONDS = 60.0
"""Limit on the processor time to import a third-party solver [s]."""


def load_cases(paths: Sequence[Path], *, check_solvers: bool = True) -> list[Case]:
    """Read the case files, and check the solvers that they name; a folder means all of its files outside ``truth``.

    CaseError if a file is not a case, a folder contains no case, or two cases have the same name.
    """
    known = registry.names() if check_solvers else None
    cases: dict[str, Case] = {}
    # Several paths may lead to the same file; it is read once, under its first path.
    files: dict[str, Path] = {}
    for path in paths:
        for found in case_files(path):
            files.setdefault(os.path.realpath(found), found)
    for file in files.values():
        case = load_case(file, solvers=known, fixed_step=fixed_step if check_solvers else None)
        if case.name in cases:
            raise CaseError(f"the name '{case.name}' is also that of {cases[case.name].path}", file=str(file))
        cases[case.name] = case
    return list(cases.values())


def fixed_step(name: str) -> bool:
    """Check whether a solver takes a fixed step instead of tolerances; False if a third-party solver cannot load."""
    known = registry.fixed_step(name)
    return _probed(registry.entry_point(name)) if known is None else known


def _load(state: WorkerState, name: str, value: str, group: str) -> bool:
    """Job: import the solver of an entry point, and check whether it takes a fixed step."""
    return registry.loaded(EntryPoint(name, value, group)).fixed_step


@cache
def _probed(point: EntryPoint) -> bool:
    """Check in a worker whether a solver takes a fixed step; if loading fails, forbid this process to load it."""
    found: list[bool | Failure] = []

    def loading() -> Jobs:
        found.append((yield Job(_load, (point.name, point.value, point.group), LOADING_SECONDS)))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, loading())
    pool.run()
    (result,) = found
    if not isinstance(result, Failure):
        return result
    if result.status != "unavailable":  # an unavailable solver reports a better reason itself
        registry.refuse(point, result.reason)
    return False
