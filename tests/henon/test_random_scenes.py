"""Random scenes: the reference, the multiprecision route and a library find the same transitions.

What two of them disagree on is explained by the conditioning of the question, or is a fault.
``python tests/support/random_scenes.py --seed 1 --count 300`` makes the long comparison (half an hour).
"""

from __future__ import annotations

import pytest
from random_scenes import compared

SCENES = range(1, 21)
DAILY = SCENES[::4]
"""The others are slow."""


@pytest.mark.parametrize("scene", [pytest.param(n, marks=[] if n in DAILY else [pytest.mark.slow]) for n in SCENES])
def test_reference_multiprecision_and_a_library_agree_on_a_random_scene(scene: int) -> None:
    pytest.importorskip("heyoka")
    assert compared(34, [scene]) == []
