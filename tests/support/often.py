"""How often tests run: slow ones are marked, and only some depend on the version of Python."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

EVERY_PYTHON = (
    "casefile/test_files.py", "expressions/test_expressions.py", "figures/test_figures.py",
    "harness/campaign/test_from_python.py", "harness/cli/test_main.py", "harness/report/test_report.py",
    "harness/test_registry.py", "jit/", "packaging/test_metadata.py", "simulation/test_system_from_python.py",
    "sweeps/test_storage.py", "test_package.py", "workers/test_executors.py",
)  # fmt: skip
"""Tests whose results may depend on the version of Python: syntax trees, processes and pickles, entry points, warnings
(errors here). All others are marked ``long``: .ci/pythons collects, and thereby imports them, but does not run them."""


def daily(values: Iterable[Any], *, some: Collection[Any]) -> list[Any]:
    """Values for ``parametrize``; those that are not in ``some`` are marked slow. A tuple has several arguments."""
    rows = [(value in some, value if isinstance(value, tuple) else (value,)) for value in values]
    return [pytest.param(*row, marks=[] if often else [pytest.mark.slow]) for often, row in rows]
