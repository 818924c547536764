"""Random Filippov systems: the reference and an independent library find the same transitions.

``pytest -m slow tests/test_random_systems.py`` makes the long comparison with heyoka.
"""

from __future__ import annotations

import pytest
from random_systems import compared


def test_reference_agrees_with_scipy_on_random_systems() -> None:
    assert compared(4, 20130216, "scipy-dop853", close=1e-7) == []


@pytest.mark.slow
def test_reference_agrees_with_heyoka_on_random_systems() -> None:
    pytest.importorskip("heyoka")
    assert compared(100, 20130216) == []
