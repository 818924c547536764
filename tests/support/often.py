"""Which tests run how often: slow ones by the clock, what a version of Python may change with each of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

EVERY_PYTHON = (
    "casefile/test_yaml_file.py", "expressions/test_expressions.py", "figures/test_figures.py",
    "harness/campaign/test_from_python.py", "harness/cli/test_main.py", "harness/report/test_report.py",
    "harness/test_registry.py", "jit/", "packaging/test_metadata.py", "simulation/test_system_from_python.py",
    "sweeps/test_storage.py", "test_package.py", "workers/test_executors.py",
)  # fmt: skip
"""What a version of Python may change: syntax trees, processes and pickles, entry points, warnings (errors here).
All others are ``long``: .ci/pythons collects them, so that each is imported, and leaves them out."""


def daily(values: Iterable[Any], *, some: Collection[Any]) -> list[Any]:
    """All values for ``parametrize``; those that are not among ``some`` are marked slow. A tuple is of several."""
    rows = [(value in some, value if isinstance(value, tuple) else (value,)) for value in values]
    return [pytest.param(*row, marks=[] if often else [pytest.mark.slow]) for often, row in rows]
