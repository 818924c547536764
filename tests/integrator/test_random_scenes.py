"""Random scenes: the reference, the multiprecision route and a library find the same transitions.

What two of them disagree on is explained by the conditioning of the question, or is a fault.
``python tests/support/random_scenes.py --seed 1 --count 300`` makes the long comparison (half an hour).
"""

from __future__ import annotations

from datetime import date

import pytest
from random_scenes import compared

SCENES = range(1, 21)


def test_reference_multiprecision_and_a_library_agree_on_the_scene_of_the_day() -> None:
    """Another one of the list every day; a test's name may not change at midnight, between two workers."""
    pytest.importorskip("heyoka")
    assert compared(34, [SCENES[date.today().toordinal() % len(SCENES)]]) == []


@pytest.mark.slow  # daily: one of them
@pytest.mark.parametrize("scene", SCENES)
def test_they_agree_on_every_scene_of_the_list(scene: int) -> None:
    pytest.importorskip("heyoka")
    assert compared(34, [scene]) == []
