"""Random Filippov systems: the reference and independent libraries find the same transitions.

What two of them disagree on is judged by 256 bits: the reference has to be right to within its conditioning.
``python tests/support/random_systems.py 500 20130216`` makes the long comparison (some forty minutes).
"""

from __future__ import annotations

import pytest
from random_systems import compared


def test_reference_agrees_with_scipy_on_a_random_system() -> None:
    assert compared(1, 20130216, "scipy-dop853", close=1e-7) == []


def test_reference_agrees_with_heyoka_on_another_one() -> None:
    pytest.importorskip("heyoka")
    assert compared(1, 3) == []


@pytest.mark.slow  # eight minutes; daily: the first of other seeds, above
def test_reference_agrees_with_heyoka_on_random_systems() -> None:
    pytest.importorskip("heyoka")
    assert compared(100, 20130216) == []
