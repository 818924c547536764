"""Every SVG has the role of an image, a title and a description, and nothing in it that could end either."""

from __future__ import annotations

from xml.etree import ElementTree

from henon_ref.figures import style
from henon_ref.figures.description import describe, description_of

SVG = "{http://www.w3.org/2000/svg}"


def written(figure) -> ElementTree.Element:
    return ElementTree.fromstring(style.image(figure))


def test_an_svg_is_an_image_with_title_and_description():
    with style.figure(2.0) as figure:
        figure.add_subplot()
        describe(figure, "A < B & C", 'Of <A> and "B",\nin one line.')
    root = written(figure)
    title, description = list(root)[:2]
    assert (title.tag, title.text) == (f"{SVG}title", "A < B & C")
    assert (description.tag, description.text) == (f"{SVG}desc", 'Of <A> and "B", in one line.')
    assert root.get("role") == "img"
    assert root.get("aria-labelledby") == f"{title.get('id')} {description.get('id')}"


def test_figures_in_one_page_do_not_share_names():
    names = set()
    for words in ("one", "another"):
        with style.figure(2.0) as figure:
            describe(figure, "Title", words)
        names |= {element.get("id") for element in list(written(figure))[:2]}
    assert len(names) == 4


def test_a_figure_that_nobody_described_says_what_stands_on_its_axes():
    with style.figure(2.0) as figure:
        left, right = figure.subplots(1, 2)
        left.set_title("a   the fan")
        left.plot([0, 1], [0, 1], label="a curve")
        left.set(xlabel="time [s]", ylabel="h")
        right.set_title("b   near it", loc="center")
    title, description = description_of(figure)
    assert title == "a   the fan; b   near it"
    assert description == "a   the fan, across: time [s], upward: h; shown are a curve."
    with style.figure(2.0) as single:
        single.add_subplot().set(xlabel=r"$\mu_0$ [N]", ylabel=r"$A\,\sin t$ [m$^2$]")
    assert description_of(single) == ("A sin t [m^2] over mu_0 [N]", "Panel, across: mu_0 [N], upward: A sin t [m^2].")
    with style.figure(2.0) as empty:
        assert all(description_of(empty))
