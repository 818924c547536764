"""Which tests run how often: slow ones by the clock, what a version of Python may change with each of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

EVERY_PYTHON = (
    "analysis/test_tangent.py", "baselines/protocol/test_reader.py", "baselines/test_base.py", "casefile/test_case.py",
    "casefile/test_expressions.py", "casefile/test_yaml_file.py", "enclosure/test_enclosed_events.py",
    "figures/test_figures.py", "modes/test_system.py", "harness/campaign/test_from_python.py",
    "harness/campaign/test_timing.py", "harness/cli/test_main.py", "harness/figures/", "harness/report/test_report.py",
    "harness/score/test_sticks.py", "harness/studies/test_page.py", "harness/test_registry.py",
    "harness/truth/test_truth_store.py", "integrator/test_henon.py", "jit/", "kernel/", "packaging/test_metadata.py",
    "roots/", "simulation/test_simulate.py", "simulation/test_system_from_python.py",
    "sweeps/test_storage.py", "taylor/test_rules.py", "test_package.py",
    "workers/test_executors.py",
)  # fmt: skip
"""What a version of Python may change, a file or two a room: processes, pickles, syntax trees, warnings (errors here).
All others are ``long``: .ci/pythons collects them, so that each is imported, and leaves them out."""


def daily(values: Iterable[Any], *, some: Collection[Any]) -> list[Any]:
    """All values for ``parametrize``; those that are not among ``some`` are marked slow. A tuple is of several."""
    rows = [(value in some, value if isinstance(value, tuple) else (value,)) for value in values]
    return [pytest.param(*row, marks=[] if often else [pytest.mark.slow]) for often, row in rows]
