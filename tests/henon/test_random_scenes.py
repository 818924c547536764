"""Random scenes: the reference, the multiprecision route and a library find the same transitions.

What two of them disagree on is explained by the conditioning of the question, or is a fault.
``python tests/support/random_scenes.py --seed 1 --count 300`` makes the long comparison (half an hour).
"""

from __future__ import annotations

import pytest
from random_scenes import compared


@pytest.mark.parametrize("scene", range(1, 21))
def test_reference_multiprecision_and_a_library_agree_on_a_random_scene(scene: int) -> None:
    pytest.importorskip("heyoka")
    assert compared(34, [scene]) == []
