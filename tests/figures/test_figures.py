"""What a figure shows is what was computed: every transition is a corner of its curve."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy as sp

from henon_ref.casefile.case import Reading, load_case
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, axes_of_portrait, draw_portrait, mark_transitions, motion_of
from henon_ref.figures.plots import draw_modes
from henon_ref.figures.style import description_of, image
from henon_ref.harness import registry
from henon_ref.harness.campaign.comparison import expected_of
from henon_ref.harness.campaign.jobs import sample_times
from henon_ref.harness.figures import draw_cost, draw_errors, running_maximum
from henon_ref.harness.rows import RunRow, TransitionRow
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.truth.compute import truth_for
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Samples

FIG8 = Path(__file__).parents[2] / "cases" / "fig8.yaml"
TOLERANCE = 1e-3
"""How far a vertex may be from its transition, in seconds and in the unit of the state."""


def moved(name: str) -> tuple[Reading, Expected, Motion]:
    """A reading, its truth, and its motion as the reports draw it."""
    case = load_case(FIG8)
    reading = case.reading(name)
    expected = expected_of(reading, truth_for(case, reading))
    wanted = sample_times(
        expected.start, reading.measure_after, expected.until, [event.time for event in expected.transitions]
    )
    run = registry.solver("henon").prepare(reading.problem, rtol=1e-12, sample_times=np.array(wanted))()
    samples = Samples(np.array(wanted), run.samples, run.sample_modes)
    return reading, expected, motion_of(samples, expected.transitions)


def drawn_vertices(figure, axes) -> np.ndarray:
    """Vertices of the curves of some axes, read from the SVG as it is before it is shortened, in the axes' data."""
    for line in axes.lines:
        line.set_gid("curve" if line.get_linestyle() == "-" else None)
    root = ElementTree.fromstring(image(figure))
    paths = [
        path.get("d", "")
        for group in root.iter("{http://www.w3.org/2000/svg}g")
        if group.get("id") == "curve"
        for path in group.iter("{http://www.w3.org/2000/svg}path")
    ]
    points = [[float(x), float(y)] for d in paths for x, y in re.findall(r"[ML] ([-\d.e]+) ([-\d.e]+)", d)]
    figure.dpi = 72.0  # a point is the unit of an SVG, and its y axis points down
    height = figure.get_size_inches()[1] * 72.0
    return axes.transData.inverted().transform([(x, height - y) for x, y in points])


def farthest(wanted: np.ndarray, vertices: np.ndarray) -> float:
    """How far the transition that is worst off is from the nearest vertex, in its worst coordinate."""
    return max(float(np.abs(vertices - point).max(axis=1).min()) for point in wanted)


@pytest.mark.parametrize("name", ["equations", "listing_limit"])
def test_every_transition_is_a_vertex_of_the_curves(name):
    reading, expected, motion = moved(name)
    system = reading.problem.system
    inside = [event for event in expected.transitions if motion.times[0] <= event.time <= motion.times[-1]]
    states = np.array([[float(value) for value in event.state] for event in inside])
    assert len(inside) > 10

    h = sp.lambdify([TIME, *system.states], system.numeric(system.surfaces[0]))
    times = np.array([event.time for event in inside])
    figure = draw_modes(reading.problem.system, motion)
    heights = np.broadcast_to(h(times, *states.T), times.shape)
    assert farthest(np.column_stack([times, heights]), drawn_vertices(figure, figure.axes[0])) < TOLERANCE

    portrait = draw_portrait(system, motion)
    plane = states[:, list(axes_of_portrait(system))]
    assert farthest(plane, drawn_vertices(portrait, portrait.axes[0])) < TOLERANCE


def test_an_arc_is_as_smooth_as_its_samples():
    """No sample in between is left out, near a transition or away from one."""
    reading, _, motion = moved("equations")
    figure = draw_modes(reading.problem.system, motion)
    drawn = drawn_vertices(figure, figure.axes[0])
    gaps = [b[0] - a[0] for a, b in pairwise(drawn.tolist())]
    assert max(gaps) <= 1.01 * np.diff(motion.times).max()


def scored(solver: str, errors: dict[float, float | None], **run: object) -> tuple[RunRow, list[TransitionRow]]:
    """A run with an error [s] at each of some transition times [s]; None: it is missed."""
    names = ("made_up", "default", solver, 1e-12, None)
    rows = [TransitionRow(*names, 0, "stick", "s", "", "", t, None, None, e) for t, e in errors.items()]
    usual = {"verdict": "right", "status": "ok", "matched": 1}
    timed = {"wall_s": 1e-4, "wall_s_low": 1e-4, "wall_s_high": 1e-4, "max_time_error_s": 1e-9}
    return RunRow("made_up", "default", solver, rtol=1e-12, **usual | timed | run), rows


ERRORS = {1.0: -3e-12, 2.0: 1e-12, 3.0: None, 4.0: 5e-10, 5.0: 0.0}


def test_errors_are_drawn_as_a_running_maximum():
    curve = running_maximum(*scored("henon", ERRORS))
    assert curve.times.tolist() == [1.0, 2.0, 4.0, 5.0]
    assert curve.errors.tolist() == [3e-12, 3e-12, 5e-10, 5e-10]
    empty = running_maximum(*scored("henon", {}))
    assert empty.times.size == empty.errors.size == 0


def test_a_curve_ends_where_nothing_later_is_matched():
    _, expected, _ = moved("equations")
    at = [event.time for event in expected.transitions if event.kind != "graze"]
    whole, cut = dict.fromkeys(at, 1e-12), dict.fromkeys(at[:3], 1e-11)
    figure = draw_errors([scored("henon", whole), scored("ida", cut, status="failed", verdict="wrong")], expected)
    (axes,) = figure.axes
    steps = [line for line in axes.lines if line.get_drawstyle() == "steps-post"]
    assert [line.get_xdata()[-1] for line in steps] == [expected.end_time, at[2]]
    assert [line.get_xdata().tolist() for line in axes.lines if line.get_marker() == "+"] == [[at[2]]]
    assert "+: no later transition is matched" in figure.texts[0].get_text()
    assert [text.get_text() for text in axes.texts] == ["ida 1e-12 (failed)", "henon 1e-12"]
    assert "henon 1e-12 1.0e-12 s; ida 1e-12 (failed) 1.0e-11 s" in description_of(figure)[1]


def test_markers_of_cost_mean_one_thing_each_and_times_have_units():
    _, expected, _ = moved("equations")
    rows = [scored(solver, {}, wall_s=wall, **more)[0] for solver, wall, more in (
        ("henon", 1e-4, {}), ("mine", 2e-2, {}), ("yours", 3e-2, {"verdict": "solver defect", "wall_s_high": 1.0}),
    )]  # fmt: skip
    figure = draw_cost(rows[:2], expected)
    assert figure.axes[0].get_legend() is None
    figure = draw_cost(rows, expected)
    (axes,) = figure.axes
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words[0] == "right"
    assert words[1].startswith("not right")
    assert words[2:] == ["95 % interval of the median"]
    hollow = [line for line in axes.lines if len(line.get_xdata()) and line.get_markerfacecolor() == "white"]
    assert [line.get_xdata().tolist() for line in hollow] == [[3e-2]]
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert {"0.1 ms", "1 ms", "10 ms", "0.1 s"} <= set(labels)
    assert draw_cost(rows[:1], expected) is None


def test_transitions_share_a_label_where_two_would_overlap():
    with style.figure(3.0) as figure:
        axes = figure.add_subplot()
        axes.set(xlim=(0, 10), ylim=(0, 1))
        points = np.array([[2.0, 0.5], [2.3, 0.5], [2.3, 0.5], [3.0, 0.5]])
        mark_transitions(axes, points, ["stick", "stick", "release", "stick"], np.array([1.0, 2.0, 3.0, 4.0]))
    assert [text.get_text() for text in axes.texts] == ["stick 1, 2 s", "release 3 s", "stick 4 s"]
