"""Random scenes and systems: the reference, the multiprecision route and a library find the same transitions.

What two of them disagree on is explained by the conditioning of the question, or is a fault.
``python tests/support/random_scenes.py --seed 1 --count 300`` makes the long comparison (half an hour), with
``--systems`` that of Filippov systems.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

import pytest
from random_scenes import compared
from scene_draws import scene
from system_draws import system

NUMBERS = range(1, 21)
SPIRAL = (system, 16)
"""Its crossings of two surfaces accumulate, and every route ends there."""
DRAWS = [(draw, number) for draw in (scene, system) for number in NUMBERS if (draw, number) != SPIRAL]


@pytest.mark.parametrize("draw", [scene, system])
def test_reference_multiprecision_and_a_library_agree_on_the_draw_of_the_day(draw: Callable[[int, int], str]) -> None:
    """Another one of the list every day; a test's name may not change at midnight, between two workers."""
    pytest.importorskip("heyoka")
    numbers = [number for own, number in DRAWS if own is draw]
    assert compared(34, [numbers[date.today().toordinal() % len(numbers)]], draw) == []


@pytest.mark.slow  # daily: one of each kind
@pytest.mark.parametrize(("draw", "number"), DRAWS)
def test_they_agree_on_every_draw_of_the_list(draw: Callable[[int, int], str], number: int) -> None:
    pytest.importorskip("heyoka")
    assert compared(34, [number], draw) == []
