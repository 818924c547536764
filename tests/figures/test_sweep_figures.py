"""Figures of sweeps: what is drawn is what the table holds."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from henon_ref.errors import ArgumentError
from henon_ref.figures.sweeps import MOST_BASINS, basins, bifurcation, histogram, plane


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    """No figure is left to pyplot."""
    yield
    plt.close("all")


def on_a_grid() -> pd.DataFrame:
    """A grid of 3 x 2, the last name fastest."""
    a, b = np.repeat([0.0, 1.0, 2.0], 2), np.tile([5.0, 7.0], 3)
    return pd.DataFrame({"a": a, "b": b, "value": a * b, "mode": ["s=0", "s=1"] * 3})


def test_a_plane_has_each_value_at_its_place() -> None:
    axes = plane(on_a_grid(), "a", "b", "value")
    (cells,) = axes.collections
    assert np.asarray(cells.get_array()).tolist() == [[0, 5, 10], [0, 7, 14]]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("a", "b")


def test_points_that_are_no_grid_are_dots() -> None:
    axes = plane(on_a_grid().iloc[:-1], "a", "b", "value")
    (dots,) = axes.collections
    assert np.asarray(dots.get_offsets()).shape == (5, 2)


def test_basins_are_named_with_their_shares() -> None:
    axes = basins(on_a_grid(), "a", "b", "mode")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["s=0: 50.00%", "s=1: 50.00%"]
    many = pd.DataFrame({"a": np.arange(20.0), "b": np.arange(20.0), "value": np.arange(20.0)})
    with pytest.raises(ArgumentError, match=f"at most {MOST_BASINS}"):
        basins(many, "a", "b", "value")


def test_a_histogram_counts_every_value_and_tells_what_is_missing() -> None:
    table = pd.DataFrame({"value": [1.0, 1.0, 2.0, np.nan]})
    axes = histogram(table, "value")
    assert sum(bar.get_height() for bar in axes.patches) == 3
    assert "1 without a value left out" in axes.get_title(loc="left")
    with pytest.raises(ArgumentError, match="no numbers"):
        histogram(on_a_grid(), "mode")


def test_a_bifurcation_diagram_has_every_section_point() -> None:
    table = pd.DataFrame({"p": [0.1, 0.2]})
    table.__class__ = type("Table", (pd.DataFrame,), {"_metadata": ["frames"]})
    object.__setattr__(table, "frames", {"section": pd.DataFrame({"point": [0, 1, 1], "v": [5.0, 6.0, 7.0]})})
    (line,) = bifurcation(table, "p", "v").lines
    assert line.get_xydata().tolist() == [[0.1, 5], [0.2, 6], [0.2, 7]]
    for wrong in (("p", "v", "other"), ("q", "v", "section"), ("p", "w", "section")):
        with pytest.raises(ArgumentError):
            bifurcation(table, *wrong)


def test_points_without_a_value_are_told_in_a_plane_and_among_basins() -> None:
    table = on_a_grid()
    table.loc[0, "value"], table.loc[1, "mode"] = np.nan, None
    assert plane(table, "a", "b", "value").get_title(loc="left") == "value at 6 points, 1 without a value left out"
    legend = basins(table, "a", "b", "mode").get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["s=0: 50.00%", "s=1: 33.33%", "no value: 16.67%"]
