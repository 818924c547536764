"""The figure of the price list: worst error against a cost."""

from __future__ import annotations

import pytest

from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.price.ladder import draw_ladder


def test_a_ladder_of_runs_without_an_error_is_drawn_without_a_warning() -> None:
    run = RunRow("c", "r", "henon", verdict="right", digits=16.0, max_time_error_s=0.0, wall_s=1e-5, wall_s_low=1e-5,
                 wall_s_high=1e-5)  # fmt: skip
    (axes,) = draw_ladder([run], "wall_s").axes
    assert axes.get_ylim() == pytest.approx((1e-17, 1e-15))
