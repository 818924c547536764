"""Labels of a figure: in order, apart, within the axes, their lines not across each other; lines told apart."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from henon_ref.figures import style
from henon_ref.figures.style import line_of, spread

SUNDIALS = ("cvode-adams", "cvode-bdf", "ida")
SCIPY = ("scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda")


def test_labels_keep_their_distance_and_their_place():
    placed = spread([0.5, 0.5, 0.5, 0.0, 1.0], 0.1, 0.0, 1.0)
    assert sorted(placed) == pytest.approx([0.0, 0.4, 0.5, 0.6, 1.0])
    crowded = spread([0.02] * 5, 0.1, 0.0, 1.0)
    assert sorted(crowded) == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("seed", range(20))
def test_labels_are_moved_no_more_than_they_must(seed):
    draw = np.random.default_rng(seed)
    count, gap, low, high = 8, 0.1, 0.05, 0.95
    wanted = np.sort(draw.uniform(0.0, draw.choice([0.2, 1.0]), count))
    placed = np.array(spread(list(wanted), gap, low, high))
    assert placed.min() >= low - 1e-12
    assert placed.max() <= high + 1e-12
    assert np.diff(placed).min() >= gap - 1e-12
    # any other way that keeps gap, order and ends: what is left over, shared out at random
    rest = draw.dirichlet(np.ones(count + 1), 2000)[:, :count] * (high - low - (count - 1) * gap)
    others = low + np.cumsum(rest, axis=1) + gap * np.arange(count)
    near = placed + draw.uniform(0.0, 0.2, (2000, 1)) * (others - placed)
    for rival in (others, near):
        assert ((placed - wanted) ** 2).sum() <= ((rival - wanted) ** 2).sum(axis=1).min() + 1e-12


@pytest.fixture
def labelled():
    """Axes with more labels than there is room for, most of them at the lower end; and their points."""
    draw = np.random.default_rng(1)
    solvers = ("henon", "heyoka", *SUNDIALS, *SCIPY, "scipy-sign", "scipy-smoothed") * 2
    points = [(s, draw.uniform(0.0, 1.0), 10.0 ** draw.uniform(-16.0, -14.0), line_of(s)) for s in solvers]
    with style.figure(4.0) as figure:
        axes = figure.add_axes((0.1, 0.1, 0.67, 0.8))
        axes.set_yscale("log")
        axes.set_ylim(1e-16, 1e-2)
        style.label_points(axes, points, x=1.045, gap=0.05)
        yield axes, points


def test_labels_stay_within_the_axes_in_the_order_of_their_points(labelled):
    axes, points = labelled
    box = axes.get_window_extent()
    middles = []
    for text in axes.texts:
        extent = text.get_window_extent()
        middles.append((extent.y0 + extent.y1) / 2)
        assert box.y0 < middles[-1] < box.y1
    by_point = sorted(range(len(points)), key=lambda k: points[k][2])
    gaps = np.array([middles[b] - middles[a] for a, b in pairwise(by_point)])
    assert gaps.min() > 0.9 * box.height / len(points)


def test_leaders_do_not_cross(labelled):
    axes, points = labelled
    leaders = [
        line.get_xydata() for line in axes.findobj(Line2D) if line.get_zorder() == 1 and len(line.get_xdata()) == 3
    ]
    assert len(leaders) == len(points)
    for one, other in combinations(leaders, 2):
        start, edge, end = (np.sign(one[k, 1] - other[k, 1]) for k in range(3))
        assert (one[1, 0], one[2, 0]) == (other[1, 0], other[2, 0])
        assert start == edge == end


def test_a_label_shows_its_line(labelled):
    axes, points = labelled
    samples = [line for line in axes.findobj(Line2D) if line.get_markevery() == [1]]
    heights = [text.get_position()[1] for text in axes.texts]
    for (_, _, _, line), sample, height in zip(points, samples, heights, strict=True):
        assert (sample.get_color(), sample.get_marker(), sample.get_linestyle()) == (
            line.colour,
            line.marker,
            line.dashes,
        )
        assert set(sample.get_ydata()) == {height}


@pytest.mark.parametrize("family", [SUNDIALS, SCIPY])
def test_solvers_of_a_family_differ_in_lightness(family):
    lines = [line_of(solver) for solver in family]
    lightness = sorted(_lightness(line.colour) for line in lines)
    assert min(b - a for a, b in pairwise(lightness)) > 10.0
    assert len({(line.marker, line.dashes) for line in lines}) == len(lines)


def _lightness(colour: str) -> float:
    """CIE L* of a colour, 0 to 100."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return 116.0 * float(np.dot([0.2126, 0.7152, 0.0722], linear)) ** (1 / 3) - 16.0
