"""Short SVG: fewer bytes, the same picture."""

from __future__ import annotations

import re

import numpy as np
import pytest

from henon_ref.figures import style
from henon_ref.harness.report.svg import BEND, UNIT, shortened, svg


def path_of(points: np.ndarray) -> bytes:
    """A path as matplotlib writes it."""
    text = "L".join(f" {x:.6f} {y:.6f} " for x, y in points)
    return f'<path d="M{text}"/>'.encode()


def points_of(content: bytes) -> np.ndarray:
    """The corners of a path of relative lines."""
    found, here = [], np.zeros(2)
    (path,) = re.findall(rb'd="([^"]*)"', content)
    for command, text in re.findall(r"([Mlhv])([^Mlhv]*)", path.decode()):
        numbers = [float(own) for own in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", text)]
        for step in np.reshape(numbers, (-1, 1 if command in "hv" else 2)):
            move = {"h": (step[0], 0.0), "v": (0.0, step[0])}.get(command, step)
            here = np.array(move) if command == "M" else here + move
            found.append(here)
    return np.array(found)


def distance(point: np.ndarray, corners: np.ndarray) -> float:
    """From a point to a line through corners."""
    a, b = corners[:-1], corners[1:]
    along = np.clip(((point - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(a + along[:, None] * (b - a) - point).T).min())


def test_a_dense_curve_has_fewer_points_and_no_point_beside_it() -> None:
    at = np.linspace(0.0, 6 * np.pi, 3000)
    curve = np.column_stack([50 + 15 * at, 100 + 60 * np.sin(at)])
    short = points_of(shortened(path_of(curve)))
    assert len(short) < len(curve) / 7
    assert max(distance(point, short) for point in curve[::7]) < BEND + UNIT
    assert np.abs(short[[0, -1]] - curve[[0, -1]]).max() <= UNIT


def test_corners_and_steps_stay() -> None:
    steps = np.array([[10, 10], [20, 10], [20, 10.5], [30, 10.5], [30, 80], [30, 40], [31.004, 40]])
    assert points_of(shortened(path_of(steps))) == pytest.approx(np.round(steps, 2))


def test_what_has_been_shortened_stays() -> None:
    for content in (
        path_of(np.random.default_rng(1).uniform(-1000, 1000, (50, 2))),
        b'<use xlink:href="#m0123456789"/>',
    ):
        once = shortened(content)
        assert len(once) < len(content)
        assert shortened(once) == once


def drawn() -> str:
    """A figure with a label, a formula, ticks, and two curves of hollow and of full markers."""
    with style.figure(2.0) as figure:
        axes = figure.add_subplot()
        axes.plot([0, 1], [0, 1], "o", color="red", mfc="white")
        axes.plot([0, 1, 2], [1, 0, 1], "o", color="red")
        axes.set(title=r"$x_1$", xlabel='two   spaces, x="1.23456"')
    return svg(figure).decode()


def test_text_is_text_in_fonts_with_a_substitute() -> None:
    content = drawn()
    assert '>two   spaces, x="1.23456"</text>' in content
    assert "text{white-space: pre}" in content
    assert set(re.findall("'DejaVu[^;}\"]*", content)) == {"'DejaVu Sans', 'Verdana', sans-serif"}


def test_the_style_of_a_marker_is_written_with_its_path() -> None:
    content = drawn()
    rings = re.findall('<path id="(n\\d+)" d="M0 2.25[^"]*" style="([^"]*)"/>', content)
    assert [own for _, own in rings] == ["stroke: #ff0000; fill: #ffffff", "stroke: #ff0000; fill: #ff0000"]
    for marker, count in zip([name for name, _ in rings], (2, 3), strict=True):
        assert len(re.findall(f'<use href="#{marker}" x="[\\d.]+" y="[\\d.]+"/>', content)) == count


def test_groups_are_closed_and_have_a_purpose() -> None:
    content = drawn()
    assert "<g>" not in content
    assert content.count("<g ") == content.count("</g>") > 0
    assert shortened(content.encode()).decode() == content


def test_places_are_rounded_and_scales_are_not() -> None:
    group = b'<g transform="translate(1.23456 7) scale(0.015625 -0.095)">\n<path d="M 0 0 \nL 1.234567 2"/>\n</g>'
    short = b'<g transform="translate(1.23 7) scale(0.015625 -0.095)">\n<path d="M0 0l1.23 2"/>\n</g>'
    assert shortened(group) == short


def test_symbols_of_formulas_that_few_fonts_have_are_outlines() -> None:
    with style.figure(2.0) as figure:
        axes = figure.add_subplot()
        axes.set(xlabel=r"$x_1 = \mu/2$ [m]", ylabel=r"$h = \sqrt{3}$")
    content = svg(figure).decode()
    texts = re.findall("<(?:tspan|text) [^>]*>([^<\n]*)<", content)
    assert {"μ", "x"} <= set(texts)
    assert not {"h", "3"} & set(texts)
    assert "STIX" not in content
    assert re.search('<path d="[^"]*q', content)  # letters have curves of order two
