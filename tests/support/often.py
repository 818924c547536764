"""Of a long list of parameters some every day, the others where slow tests are run."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def daily(values: Iterable[Any], *, some: Collection[Any]) -> list[Any]:
    """All values for ``parametrize``; those that are not among ``some`` are marked slow."""
    return [value if value in some else pytest.param(value, marks=pytest.mark.slow) for value in values]
