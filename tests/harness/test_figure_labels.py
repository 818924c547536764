"""Labels of a figure: in order, apart, within the axes, with connecting lines that cross nothing."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.lines import Line2D

from henon_ref.figures import style
from henon_ref.figures.style import line_of
from henon_ref.harness.figures import label_column

SOLVERS = ("henon", "heyoka", "cvode-adams", "cvode-bdf", "ida", "scipy-rk45", "scipy-dop853", "scipy-radau")


@pytest.fixture
def labelled():
    """Axes with more labels than there is room for, most of them at the lower end; and where their curves end."""
    draw = np.random.default_rng(1)
    ends = [(s, 10.0 ** draw.uniform(-16.0, -14.0), line_of(s)) for s in SOLVERS * 3]
    with style.figure(4.0) as figure:
        axes = figure.add_axes((0.1, 0.1, 0.67, 0.8))
        axes.set_yscale("log")
        axes.set_ylim(1e-16, 1e-2)
        heights = [height for _, height, _ in ends]
        label_column(axes, [(s, line) for s, _, line in ends], gap=0.05, ends=heights)
        yield axes, sorted(ends, key=lambda own: -own[1])


def middles(axes) -> list[float]:
    """Heights of all labels; they are within the axes."""
    box = axes.get_window_extent()
    extents = [text.get_window_extent() for text in axes.texts]
    found = [(extent.y0 + extent.y1) / 2 for extent in extents]
    assert all(box.y0 < middle < box.y1 for middle in found)
    return found


def leaders(axes) -> list[np.ndarray]:
    return [line.get_xydata() for line in axes.findobj(Line2D) if line.get_zorder() == 1 and len(line.get_xdata()) == 2]


def test_labels_stay_within_the_axes_in_the_order_of_their_curves(labelled):
    axes, ends = labelled
    gaps = -np.diff(middles(axes))
    assert gaps.min() > 0.9 * axes.get_window_extent().height / len(ends)
    assert [text.get_text() for text in axes.texts] == [solver for solver, _, _ in ends]


def test_leaders_lie_in_the_margin_and_do_not_cross(labelled):
    axes, ends = labelled
    found = leaders(axes)
    assert len(found) == len(ends)
    assert all(leader[:, 0].min() >= 1.0 for leader in found)
    for one, other in combinations(found, 2):
        start, end = (np.sign(one[k, 1] - other[k, 1]) for k in range(2))
        assert (one[0, 0], one[1, 0]) == (other[0, 0], other[1, 0])
        assert start == end


def test_a_label_shows_its_line(labelled):
    axes, ends = labelled
    samples = [line for line in axes.findobj(Line2D) if line.get_markevery() == [1]]
    heights = [text.get_position()[1] for text in axes.texts]
    for (_, _, line), sample, height in zip(ends, samples, heights, strict=True):
        assert (sample.get_color(), sample.get_marker(), sample.get_linestyle()) == (
            line.colour,
            line.marker,
            line.dashes,
        )
        assert set(sample.get_ydata()) == {height}


def test_a_column_of_labels_has_no_leaders_and_keeps_its_order():
    labels = [(f"solver-{k}", line_of("henon")) for k in range(40)]
    with style.figure(4.0) as figure:
        axes = figure.add_axes((0.1, 0.1, 0.67, 0.8))
        label_column(axes, labels, gap=0.05)
        found = middles(axes)
    assert found == sorted(found, reverse=True)
    assert [text.get_text() for text in axes.texts] == [label for label, _ in labels]
    assert leaders(axes) == []


@pytest.mark.parametrize("length", [3, 18, 25, 400])
def test_a_long_label_ends_within_the_figure(length):
    with style.figure(4.0) as figure:
        axes = figure.add_axes((0.1, 0.1, 0.645, 0.8))
        label_column(axes, [("mil" * (length // 3), line_of("henon"))], gap=0.05)
        (text,) = axes.texts
        assert text.get_window_extent().x1 <= figure.bbox.x1
        assert text.get_fontsize() >= 6.0
